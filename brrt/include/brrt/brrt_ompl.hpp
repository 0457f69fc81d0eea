// Record any planner of OMPL (1.5 or later): wrap it, and plan as before.
//
//     brrt::OmplOptions options;  // options.world, options.robot: what is known of them
//     setup.setPlanner(brrt::recorded(planner, "run.mcap", options));
//     setup.solve(1.0);
//
// The planner is not changed: the wrapper watches the motions that are checked and the
// configurations that are drawn, and now and then compares the planner's graph with what it was
// before. The graph at the end is that of `getPlannerData`. Times are inferred, and claimed to be:
// an edge is recorded at the time of the check that found it free.
#pragma once

#include <exception>
#include <memory>
#include <string>
#include <utility>

#include <ompl/base/Planner.h>
#include <ompl/util/Console.h>

#include "brrt.hpp"
#include "detail/ompl_session.hpp"
#include "detail/ompl_watch.hpp"

namespace brrt {

/// What to record of a planner of OMPL. Start, goal, the planner's name and its parameters are
/// those of the planner unless they are given.
struct OmplOptions : Options {
    bool exact = false;   ///< Look at the planner's graph at each iteration; slow.
    bool samples = true;  ///< Record samples, where the space has the usual sampler.
};

/// A planner whose calls of `solve` are recorded; everything else is the inner planner's.
///
/// Each solve has a file: run.mcap, run-2.mcap ... A file that cannot be opened is reported by
/// OMPL_ERROR, and the planner plans without it.
class Recorded : public ompl::base::Planner {
  public:
    Recorded(ompl::base::PlannerPtr inner, std::string path, OmplOptions options = {})
        : Planner(inner->getSpaceInformation(), inner->getName()),
          inner_(std::move(inner)),
          path_(std::move(path)),
          options_(std::move(options)) {
        specs_ = inner_->getSpecs();
        params_.include(inner_->params());
        plannerProgressProperties_ = inner_->getPlannerProgressProperties();
    }

    void setProblemDefinition(const ompl::base::ProblemDefinitionPtr &pdef) override {
        Planner::setProblemDefinition(pdef);
        inner_->setProblemDefinition(pdef);
    }
    void setup() override {
        Planner::setup();
        if (!inner_->isSetup()) inner_->setup();
    }
    void clear() override {
        Planner::clear();
        inner_->clear();
    }
    void clearQuery() override { inner_->clearQuery(); }
    void checkValidity() override { inner_->checkValidity(); }
    void getPlannerData(ompl::base::PlannerData &data) const override {
        inner_->getPlannerData(data);
    }

    using Planner::solve;
    ompl::base::PlannerStatus solve(const ompl::base::PlannerTerminationCondition &ptc) override {
        if (!si_->isSetup()) si_->setup();
        std::unique_ptr<detail::OmplSession> session;
        try {
            session = std::make_unique<detail::OmplSession>(*inner_, next_path(), options_,
                                                            options_.exact);
        } catch (const std::exception &error) {
            OMPL_ERROR("brrt: this solve is not recorded: %s", error.what());
            return inner_->solve(ptc);
        }
        const detail::Watch watch(si_, ear_, options_.samples);
        const Listening listening(*ear_, *session);
        const auto status = inner_->solve(session->condition(ptc));
        session->finish();
        return status;
    }

    const ompl::base::PlannerPtr &inner() const { return inner_; }

  private:
    struct Listening {
        Listening(detail::Ear &ear, detail::Listener &listener) : ear_(ear) {
            ear_.listener = &listener;
        }
        Listening(const Listening &) = delete;
        Listening &operator=(const Listening &) = delete;
        ~Listening() { ear_.listener = nullptr; }
        detail::Ear &ear_;
    };

    std::string next_path() {
        if (++solves_ == 1) return path_;
        const std::size_t dot = path_.rfind(".mcap");
        return path_.substr(0, dot) + "-" + std::to_string(solves_) + ".mcap";
    }

    const ompl::base::PlannerPtr inner_;
    const std::string path_;
    const OmplOptions options_;
    const detail::EarPtr ear_ = std::make_shared<detail::Ear>();
    int solves_ = 0;
};

/// Wrap a planner so that it is recorded.
inline ompl::base::PlannerPtr recorded(ompl::base::PlannerPtr planner, std::string path,
                                       OmplOptions options = {}) {
    return std::make_shared<Recorded>(std::move(planner), std::move(path), std::move(options));
}

}  // namespace brrt
