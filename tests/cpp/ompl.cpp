// Plans with a planner of OMPL, recorded or not, and prints its graph at the end:
// ompl PLANNER WORLD ITERATIONS SEED [FILE]. With EXACT in the environment its graph is compared at
// each iteration, with THROWS the motion check fails in the end, with TWICE it plans once more.
#include <brrt/brrt_ompl.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/spaces/SE2StateSpace.h>
#include <ompl/geometric/SimpleSetup.h>
#include <ompl/geometric/planners/est/EST.h>
#include <ompl/geometric/planners/fmt/BFMT.h>
#include <ompl/geometric/planners/fmt/FMT.h>
#include <ompl/geometric/planners/informedtrees/BITstar.h>
#include <ompl/geometric/planners/kpiece/BKPIECE1.h>
#include <ompl/geometric/planners/kpiece/KPIECE1.h>
#include <ompl/geometric/planners/kpiece/LBKPIECE1.h>
#include <ompl/geometric/planners/prm/LazyPRM.h>
#include <ompl/geometric/planners/prm/PRMstar.h>
#include <ompl/geometric/planners/rrt/InformedRRTstar.h>
#include <ompl/geometric/planners/rrt/RRT.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/geometric/planners/rrt/SORRTstar.h>
#include <ompl/util/RandomNumbers.h>

namespace ob = ompl::base;
namespace og = ompl::geometric;

namespace {

struct Ball {
    double x, y, radius;
};

struct Place {
    std::vector<Ball> balls;
    double resolution;  // of the motion check, as a part of the space; 0 for an exact one
};

std::map<std::string, Place> places() {
    Place circles{{}, 0};
    for (int i = 0; i < 60; ++i)  // none at the ends
        circles.balls.push_back(
            {10 + std::fmod(i * 61.8, 80), 10 + std::fmod(i * 38.3, 80), 2.0 + i % 3});
    Place many{{}, 0};
    for (int i = 0; i < 120; ++i)
        many.balls.push_back(
            {6 + std::fmod(i * 61.8, 88), 6 + std::fmod(i * 38.3, 88), 1.5 + i % 2});
    Place wall{{}, 0};
    for (int i = 0; i <= 40; ++i)
        if (i != 30) wall.balls.push_back({50, i * 2.5, 1.3});
    Place closed = many;
    for (int i = 0; i <= 40; ++i) closed.balls.push_back({50, i * 2.5, 1.3});
    return {{"open", {{}, 0}},  {"circles", circles}, {"many", many},
            {"closed", closed}, {"wall", wall},       {"sparse", {circles.balls, 0.01}}};
}

/// Whether a motion of a point touches no ball, exactly.
bool is_free(const std::vector<Ball> &balls, const double *a, const double *b) {
    return std::none_of(balls.begin(), balls.end(), [&](const Ball &ball) {
        const double dx = b[0] - a[0], dy = b[1] - a[1], squared = dx * dx + dy * dy;
        const double along = (ball.x - a[0]) * dx + (ball.y - a[1]) * dy;
        const double part = squared > 0 ? std::clamp(along / squared, 0.0, 1.0) : 0;
        return std::hypot(a[0] + part * dx - ball.x, a[1] + part * dy - ball.y) <= ball.radius;
    });
}

const double *position(const ob::State *state) {
    return state->as<ob::RealVectorStateSpace::StateType>()->values;
}

struct Exact : ob::MotionValidator {
    Exact(const ob::SpaceInformationPtr &si, std::vector<Ball> all)
        : MotionValidator(si), balls(std::move(all)) {}
    bool checkMotion(const ob::State *a, const ob::State *b) const override {
        if (std::getenv("THROWS") && ++count > 200) throw std::runtime_error("the check failed");
        return is_free(balls, position(a), position(b));
    }
    bool checkMotion(const ob::State *a, const ob::State *b,
                     std::pair<ob::State *, double> &last) const override {
        if (checkMotion(a, b)) return true;
        last.second = 0;
        if (last.first) si_->copyState(last.first, a);
        return false;
    }
    std::vector<Ball> balls;
    mutable int count = 0;
};

/// The first two numbers: Debian's OMPL aborts with the default projection.
struct Plane : ob::ProjectionEvaluator {
    explicit Plane(const ob::StateSpacePtr &space) : ProjectionEvaluator(space) {}
    unsigned int getDimension() const override { return 2; }
    void defaultCellSizes() override { cellSizes_ = {5, 5}; }
    void project(const ob::State *state, Eigen::Ref<Eigen::VectorXd> to) const override {
        std::vector<double> q;
        space_->copyToReals(q, state);
        to(0) = q[0], to(1) = q[1];
    }
};

using Make = std::function<ob::PlannerPtr(const ob::SpaceInformationPtr &)>;

template <class Planner>
Make make() {
    return [](const ob::SpaceInformationPtr &si) {
        auto planner = std::make_shared<Planner>(si);
        if (planner->params().hasParam("range")) planner->params().setParam("range", "4");
        if constexpr (std::is_same_v<og::KPIECE1, Planner> ||
                      std::is_same_v<og::BKPIECE1, Planner> ||
                      std::is_same_v<og::LBKPIECE1, Planner>)
            planner->setProjectionEvaluator(std::make_shared<Plane>(si->getStateSpace()));
        return planner;
    };
}

const std::map<std::string, Make> planners{
    {"RRT", make<og::RRT>()},
    {"RRTConnect", make<og::RRTConnect>()},
    {"RRTstar", make<og::RRTstar>()},
    {"InformedRRTstar", make<og::InformedRRTstar>()},
    {"SORRTstar", make<og::SORRTstar>()},
    {"BITstar", make<og::BITstar>()},
    {"FMT", make<og::FMT>()},
    {"BFMT", make<og::BFMT>()},
    {"PRM", make<og::PRM>()},
    {"PRMstar", make<og::PRMstar>()},
    {"LazyPRM", make<og::LazyPRM>()},
    {"EST", make<og::EST>()},
    {"KPIECE1", make<og::KPIECE1>()},
    {"BKPIECE1", make<og::BKPIECE1>()},
    {"LBKPIECE1", make<og::LBKPIECE1>()},
};

ob::StateSpacePtr space_of(const std::string &world) {
    if (world == "se2") {
        auto space = std::make_shared<ob::SE2StateSpace>();
        ob::RealVectorBounds bounds(2);
        bounds.setLow(0), bounds.setHigh(100);
        space->setBounds(bounds);
        return space;
    }
    if (world == "arm") {  // a slider and a turning joint
        auto line = std::make_shared<ob::RealVectorStateSpace>(1);
        line->setBounds(0, 100);
        return line + std::make_shared<ob::SO2StateSpace>();
    }
    auto space = std::make_shared<ob::RealVectorStateSpace>(2);
    space->setBounds(0, 100);
    return space;
}

void print_graph(const ob::Planner &planner) {
    ob::PlannerData data(planner.getSpaceInformation());
    planner.getPlannerData(data);
    const auto &space = planner.getSpaceInformation()->getStateSpace();
    std::printf("{\"nodes\": [");
    std::vector<double> q;
    for (unsigned i = 0; i < data.numVertices(); ++i) {
        space->copyToReals(q, data.getVertex(i).getState());
        std::printf("%s%s", i ? ", " : "", brrt::detail::json(q.data(), q.size()).c_str());
    }
    std::printf("], \"edges\": [");
    bool first = true;
    for (unsigned i = 0; i < data.numVertices(); ++i) {
        std::vector<unsigned> out;
        data.getEdges(i, out);
        for (unsigned j : out)
            std::printf("%s[%u, %u]", std::exchange(first, false) ? "" : ", ", i, j);
    }
    std::printf("], \"solved\": %s",
                planner.getProblemDefinition()->hasExactSolution() ? "true" : "false");
}

double processor_time() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

void plan(const std::string &name, const std::string &world, long most, const std::string &file) {
    const auto space = space_of(world);
    const bool is_plane = space->getType() == ob::STATE_SPACE_REAL_VECTOR;
    const Place place = places()[is_plane ? world : "circles"];

    og::SimpleSetup setup(space);
    const auto &si = setup.getSpaceInformation();
    setup.setStateValidityChecker([&](const ob::State *state) {
        std::vector<double> q;
        space->copyToReals(q, state);
        return is_free(place.balls, q.data(), q.data());
    });
    if (is_plane && place.resolution == 0)
        si->setMotionValidator(std::make_shared<Exact>(si, place.balls));
    if (place.resolution > 0) si->setStateValidityCheckingResolution(place.resolution);
    ob::ScopedState<> start(space), goal(space);
    for (unsigned k = 0; k < start.reals().size(); ++k)
        start[k] = k < 2 ? 3 : 1, goal[k] = k < 2 ? 97 : -3;
    if (world == "arm") start[1] = 2.5, goal[1] = -2.5;
    setup.setStartAndGoalStates(start, goal, world == "sparse" ? 1.0 : 0.001);
    const auto objective = std::make_shared<ob::PathLengthOptimizationObjective>(si);
    objective->setCostThreshold(ob::Cost(0));
    if (name.find("PRM") == std::string::npos) setup.setOptimizationObjective(objective);

    const ob::PlannerPtr inner = planners.at(name)(si);
    ob::PlannerPtr planner = inner;
    if (!file.empty()) {
        brrt::OmplOptions options;
        if (is_plane) {
            options.world = brrt::World({0, 0}, {100, 100}, world);
            for (const Ball &ball : place.balls) options.world->ball({ball.x, ball.y}, ball.radius);
        }
        options.exact = std::getenv("EXACT") != nullptr;
        planner = brrt::recorded(inner, file, options);
    }
    setup.setPlanner(planner);
    setup.setup();
    std::atomic<long> asked{0};
    const double began = processor_time();
    setup.solve(ob::PlannerTerminationCondition([&] { return ++asked > most; }));
    if (std::getenv("TWICE")) {
        asked = 0;
        setup.solve(ob::PlannerTerminationCondition([&] { return ++asked > most; }));
    }
    const double took = processor_time() - began;
    print_graph(*inner);
    std::printf(", \"seconds\": %.6f, \"asked\": %ld}\n", took, asked.load());
}

}  // namespace

int main(int argc, char **argv) {
    if (argc < 5) return 2;
    ompl::msg::setLogLevel(ompl::msg::LOG_WARN);
    ompl::RNG::setSeed(static_cast<std::uint_fast32_t>(std::atoi(argv[4])));
    try {
        plan(argv[1], argv[2], std::atol(argv[3]), argc > 5 ? argv[5] : "");
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
