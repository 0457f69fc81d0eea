// OMPL's RRT*, recorded by brrt: ompl_rrt_star run.mcap, then `brrt view run.mcap`.
#include <brrt/brrt_ompl.hpp>

#include <cmath>
#include <memory>

#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/SimpleSetup.h>
#include <ompl/geometric/planners/rrt/RRTstar.h>

namespace ob = ompl::base;
namespace og = ompl::geometric;

int main(int argc, char **argv) {
    const auto space = std::make_shared<ob::RealVectorStateSpace>(2);
    space->setBounds(0, 100);
    og::SimpleSetup setup(space);
    setup.setStateValidityChecker([](const ob::State *state) {
        const double *q = state->as<ob::RealVectorStateSpace::StateType>()->values;
        return std::hypot(q[0] - 50, q[1] - 50) > 25;
    });
    ob::ScopedState<> start(space), goal(space);
    start[0] = start[1] = 5;
    goal[0] = goal[1] = 95;
    setup.setStartAndGoalStates(start, goal);

    // Three lines record it; the world lets brrt draw the obstacles and judge the motions.
    brrt::OmplOptions options;
    options.world = brrt::World({0, 0}, {100, 100}).ball({50, 50}, 25);
    const auto planner = std::make_shared<og::RRTstar>(setup.getSpaceInformation());
    setup.setPlanner(brrt::recorded(planner, argc > 1 ? argv[1] : "run.mcap", options));

    return setup.solve(0.5) == ob::PlannerStatus::EXACT_SOLUTION ? 0 : 1;
}
