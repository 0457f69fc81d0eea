// One solve of a planner of OMPL, as it is recorded.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <ompl/base/Planner.h>
#include <ompl/base/PlannerData.h>
#include <ompl/base/goals/GoalState.h>
#include <ompl/base/goals/GoalStates.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>

#include "../brrt.hpp"
#include "ompl_graph.hpp"
#include "ompl_watch.hpp"

namespace brrt::detail {

/// One call of a planner's `solve`, as it is recorded.
class OmplSession : public Listener {
  public:
    OmplSession(ob::Planner &planner, const std::string &path, Options options, bool exact)
        : planner_(planner),
          space_(*planner.getSpaceInformation()->getStateSpace()),
          exact_(exact),
          looks_(!planner.getSpecs().multithreaded),
          rec_(path, complete(std::move(options))),
          graph_(rec_, q_.size(), reals(planner.getProblemDefinition()->getStartState(0))) {}

    /// Return a condition that looks at the planner's graph when it is asked.
    ob::PlannerTerminationCondition condition(const ob::PlannerTerminationCondition &inner) {
        return ob::PlannerTerminationCondition([this, inner] {
            attempt([this] {
                if (std::this_thread::get_id() != owner_)
                    return;  // PRM asks on a second thread, too
                ++iteration_;
                if (looks_ && is_due()) look();
            });
            return inner();
        });
    }

    /// Record the rest. The planner may have stopped for any reason.
    void finish() {
        attempt([this] {
            look();
            const auto &pdef = planner_.getProblemDefinition();
            if (pdef->hasExactSolution())
                if (auto *path = dynamic_cast<ompl::geometric::PathGeometric *>(
                        pdef->getSolutionPath().get()))
                    record_path(path->getStates());
        });
        rec_.close();
    }

    void checked(const ob::State *from, const ob::State *to, bool is_free) noexcept override {
        attempt([&] {
            const std::vector<double> &a = reals(from);
            Observation seen{};
            seen.what = is_free ? Observation::is_free : Observation::blocked;
            seen.from = from;
            seen.to = to;
            seen.from_hash = hash_of(a.data(), a.size());
            if (!is_free) seen.place = keep(a);
            const std::vector<double> &b = reals(to);
            seen.to_hash = hash_of(b.data(), b.size());
            if (!is_free) keep(b);
            add(seen);
        });
    }
    void sampled(const ob::State *state) noexcept override {
        attempt([&] {
            Observation seen{};
            seen.what = Observation::sample;
            seen.place = keep(reals(state));
            add(seen);
        });
    }

  private:
    using Clock = std::chrono::steady_clock;

    /// Fill in what the planner knows.
    Options complete(Options options) {
        const auto &pdef = planner_.getProblemDefinition();
        if (pdef->getStartStateCount() == 0) throw Error("the problem has no start state");
        options.start = reals(pdef->getStartState(0));
        double tolerance = 0;
        const ob::Goal &goal = *pdef->getGoal();
        const auto *state = dynamic_cast<const ob::GoalState *>(&goal);
        const auto *states = dynamic_cast<const ob::GoalStates *>(&goal);
        bool is_known = false;  // where paths may end
        if (state && state->getState()) {
            options.goal = reals(state->getState());
            is_known = true;
        } else if (states && states->getStateCount() > 0) {
            options.goal = reals(states->getState(0));
            is_known = !goal.hasType(ob::GOAL_LAZY_SAMPLES);  // others may be drawn while it plans
            for (unsigned i = 1; is_known && i < states->getStateCount(); ++i)
                tolerance =
                    std::max(tolerance, space_.distance(states->getState(0), states->getState(i)));
        } else if (options.goal.empty()) {
            options.goal = options.start;  // the goal is a region
        }
        if (!is_known) tolerance = space_.getMaximumExtent();
        if (const auto *region = dynamic_cast<const ob::GoalRegion *>(&goal))
            if (region->getThreshold() > 1e-9) tolerance += region->getThreshold();
        Claims &claims = options.claims;
        claims.goal_tolerance = std::max(claims.goal_tolerance, tolerance);
        claims.times = "snapshot";
        claims.samples = "none";
        const std::string &name = planner_.getName();
        if (name.rfind("Lazy", 0) == 0 || name.rfind("LBK", 0) == 0 || name == "SBL")
            claims.edges = "assumed";
        if (options.seed == 0) options.seed = ompl::RNG::getSeed();
        if (options.planner == "external") options.planner = "ompl:" + name;
        std::map<std::string, std::string> params;
        planner_.params().getParams(params);
        for (const auto &[key, value] : params) options.params.emplace(key, value);
        options.clock = [this] { return moment_.t >= 0 ? moment_.t : now(); };
        return options;
    }

    /// Time since the beginning in ns, without the time that the recorder took to look at graphs.
    std::int64_t now() const {
        return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - began_ - paused_)
            .count();
    }

    /// Return the numbers of a state; they are there until the next call.
    const std::vector<double> &reals(const ob::State *state) {
        space_.copyToReals(q_, state);
        return q_;
    }

    std::size_t keep(const std::vector<double> &q) {
        const std::size_t place = seen_.reals.size();
        seen_.reals.insert(seen_.reals.end(), q.begin(), q.end());
        return place;
    }

    void add(Observation seen) {
        seen.t = now();
        seen.iteration = iteration_;
        seen_.list.push_back(seen);
    }

    /// Whether to look: once the planner did as much as it has nodes, or after a while. So looking
    /// takes a part of the time that does not grow with the graph.
    bool is_due() const {
        if (exact_ || seen_.list.size() > 4 * graph_.graph().present().size() + 64) return true;
        return Clock::now() - last_look_ >
               std::max<Clock::duration>(std::chrono::milliseconds(250), 10 * look_took_);
    }

    void look() {
        const auto begin = Clock::now();
        ob::PlannerData data(planner_.getSpaceInformation());
        planner_.getPlannerData(data);
        moment_ = {now(), iteration_};
        graph_.follow(
            data, seen_, [this](const ob::State *state) { return reals(state).data(); }, moment_);
        record_way();
        moment_.t = -1;
        seen_.list.clear();
        seen_.reals.clear();
        last_look_ = Clock::now();
        look_took_ = last_look_ - begin;
        paused_ += look_took_;
    }

    /// Record the way to the best goal so far, if it is better than the last path.
    void record_way() {
        const std::vector<int> &way = graph_.graph().way_to_goal();
        if (way.empty()) return;
        if (!planner_.getProblemDefinition()->getGoal()->isSatisfied(
                graph_.graph().node(way.back()).state))
            return;
        std::vector<Point> path;
        for (int node : way)
            path.emplace_back(graph_.graph().place(node), graph_.graph().place(node) + q_.size());
        record_better(path);
    }

    void record_path(const std::vector<ob::State *> &states) {
        std::vector<Point> path;
        for (const ob::State *state : states) path.push_back(reals(state));
        record_better(path);
    }

    void record_better(const std::vector<Point> &path) {
        double length = 0;
        for (std::size_t i = 1; i < path.size(); ++i) length += rec_.distance(path[i - 1], path[i]);
        if (length < best_ * (1 - 1e-12)) {
            rec_.path(path);
            best_ = length;
        }
    }

    /// Do something for the record, alone, and give up the record rather than disturb the planner.
    template <class Work>
    void attempt(Work &&work) noexcept {
        try {
            const std::lock_guard<std::recursive_mutex> lock(mutex_);
            if (!failed_) work();
        } catch (const std::exception &error) {
            failed_ = true;
            OMPL_ERROR("brrt: the rest is not recorded: %s", error.what());
        }
    }

    ob::Planner &planner_;
    const ob::StateSpace &space_;
    const bool exact_, looks_;
    const std::thread::id owner_ = std::this_thread::get_id();
    const Clock::time_point began_ = Clock::now();
    Clock::time_point last_look_ = began_;
    Clock::duration paused_{}, look_took_{};
    std::vector<double> q_;
    Moment moment_;
    std::int64_t iteration_ = 0;
    double best_ = std::numeric_limits<double>::infinity();
    Observations seen_;
    Recorder rec_;
    GraphFollower graph_;
    std::recursive_mutex mutex_;  // a goal may check motions when it is asked
    std::atomic<bool> failed_{false};
};

}  // namespace brrt::detail
