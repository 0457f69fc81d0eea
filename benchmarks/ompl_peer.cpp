// ompl_peer: runs OMPL's geometric planners on a world of balls and axis-aligned boxes and prints one
// JSON object per seed. It is the C++ peer that brrt's timings are compared with.
//
// Build (Debian 12: libompl-dev 1.5.2, libeigen3-dev, libboost-dev, pkg-config; g++ 12). OMPL's pkg-config --libs
// names Boost files that libompl-dev does not install, and its --cflags say -std=c++14, so only the -I are taken:
//   g++ -O3 -march=native -std=c++17 ompl_peer.cpp -o ompl_peer $(pkg-config --cflags-only-I ompl eigen3) -lompl
//
// World file, one item a line, '#' comments:
//   dim 2|3 / bounds lo... hi... / ball c... r / box lo... hi... / start ... / goal ...
//
// Timing covers planner->solve() only; reading the world, building the grid and setting up OMPL do not count.
// --iterations N > 0 replaces the time limit. --optimal only insists that the planner is an optimising one.
// Seeds: OMPL's seed source is reset to seed + 1 (it refuses 0) before each run, and everything that draws
// from it is built afresh, so a seed gives the same run alone or in a sequence.
// "iterations" is OMPL's own count for the RRT* family; RRT and RRT-Connect expose none, so it is the number of
// times they asked whether to stop, which they do once per loop. Unsolved: "cost" null, "exact_valid" false.

#define EIGEN_MAX_ALIGN_BYTES 16  // -march=native must not change Eigen's layout against Debian's libompl

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <limits>
#include <memory>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <ompl/base/PlannerData.h>
#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/datastructures/NearestNeighborsGNATNoThreadSafety.h>
#include <ompl/geometric/SimpleSetup.h>
#include <ompl/geometric/planners/rrt/InformedRRTstar.h>
#include <ompl/geometric/planners/rrt/RRT.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>

namespace ob = ompl::base;
namespace og = ompl::geometric;
using Error = std::runtime_error;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// ---------------------------------------------------------------- world

template <int Dim> using Point = std::array<double, Dim>;
template <int Dim> struct Box { Point<Dim> side[2]; };  // [0] the low corner, [1] the high one
template <int Dim> struct Ball { Point<Dim> centre; double radius; };
template <int Dim> struct World {
    Box<Dim> bounds;
    Point<Dim> start, goal;
    std::vector<Box<Dim>> boxes;
    std::vector<Ball<Dim>> balls;
};

struct WorldLine { std::string keyword; std::vector<double> numbers; };

std::vector<WorldLine> readLines(const std::string &path) {
    std::ifstream file(path);
    if (!file) throw Error("cannot read " + path);
    std::vector<WorldLine> lines;
    for (std::string text; std::getline(file, text);) {
        std::istringstream words(text.substr(0, text.find('#')));
        WorldLine line;
        if (!(words >> line.keyword)) continue;
        for (double number; words >> number;) line.numbers.push_back(number);
        if (!words.eof()) throw Error("not a number in '" + text + "'");
        lines.push_back(std::move(line));
    }
    return lines;
}

template <int Dim> World<Dim> buildWorld(const std::vector<WorldLine> &lines) {
    World<Dim> world;
    std::set<std::string> seen;
    for (const auto &[keyword, numbers] : lines) {
        const bool isBox = keyword == "box" || keyword == "bounds", isBall = keyword == "ball";
        if (keyword == "dim") continue;
        if (numbers.size() != (isBox ? 2 * Dim : isBall ? Dim + 1 : Dim)) throw Error("wrong count of numbers: " + keyword);
        Box<Dim> box{};
        std::copy_n(numbers.begin(), Dim, box.side[0].begin());
        if (isBox) std::copy_n(numbers.begin() + Dim, Dim, box.side[1].begin());
        for (int i = 0; isBox && i < Dim; ++i)
            if (box.side[0][i] > box.side[1][i] || (keyword == "bounds" && box.side[0][i] == box.side[1][i]))
                throw Error("low not below high: " + keyword);
        if (keyword == "box") world.boxes.push_back(box);
        else if (isBall) world.balls.push_back({box.side[0], numbers.back()});
        else if (keyword == "bounds") world.bounds = box;
        else if (keyword == "start") world.start = box.side[0];
        else if (keyword == "goal") world.goal = box.side[0];
        else throw Error("unknown keyword " + keyword);
        if (isBall && numbers.back() < 0) throw Error("negative radius");
        seen.insert(keyword);
    }
    if (!seen.count("bounds") || !seen.count("start") || !seen.count("goal")) throw Error("no bounds, start or goal");
    return world;
}

// The referee: no grid, written apart from the fast tests and in extended precision, so that it can find their mistakes.
template <int Dim> bool bruteForceFree(const World<Dim> &world, const double *a, const double *b) {
    using Real = long double;
    for (const Box<Dim> &box : world.boxes) {
        Real enter = 0, leave = 1;
        for (int i = 0; i < Dim; ++i) {
            const Real step = Real(b[i]) - a[i], toLow = box.side[0][i] - Real(a[i]), toHigh = box.side[1][i] - Real(a[i]);
            if (step == 0 && (toLow > 0 || toHigh < 0)) leave = -1;
            if (step == 0) continue;
            enter = std::max(enter, std::min(toLow / step, toHigh / step));
            leave = std::min(leave, std::max(toLow / step, toHigh / step));
        }
        if (enter <= leave) return false;
    }
    for (const Ball<Dim> &ball : world.balls) {
        Real along = 0, length2 = 0, gap2 = 0;
        for (int i = 0; i < Dim; ++i) {
            along += (ball.centre[i] - Real(a[i])) * (Real(b[i]) - a[i]);
            length2 += (Real(b[i]) - a[i]) * (Real(b[i]) - a[i]);
        }
        const Real t = length2 > 0 ? std::clamp<Real>(along / length2, 0, 1) : 0;
        for (int i = 0; i < Dim; ++i) gap2 += std::pow(a[i] + t * (Real(b[i]) - a[i]) - ball.centre[i], 2);
        if (gap2 <= Real(ball.radius) * ball.radius) return false;
    }
    return true;
}

// ---------------------------------------------------------------- grid

// Uniform grid over the bounds. Queries must lie inside the bounds, as all states of the planners do.
template <int Dim> class ObstacleGrid {
public:
    explicit ObstacleGrid(const World<Dim> &world) : boxes_(world.boxes), balls_(world.balls), low_(world.bounds.side[0]) {
        // Near-cubic cells; measured query time is flat from 1 to 64 cells per obstacle.
        const double cells = std::min(4e6, 4.0 * (boxes_.size() + balls_.size() + 1));
        Point<Dim> extent;
        double volume = 1;
        for (int i = 0; i < Dim; ++i) volume *= extent[i] = world.bounds.side[1][i] - low_[i];
        int total = 1;
        for (int i = 0; i < Dim; ++i) {
            count_[i] = int(std::clamp(std::round(extent[i] / std::pow(volume / cells, 1.0 / Dim)), 1.0, 2048.0));
            cellSize_[i] = extent[i] / count_[i];
            cellsPerUnit_[i] = count_[i] / extent[i];
            stride_[i] = total;
            total *= count_[i];
        }
        // CSR in two passes: count, then fill.
        cellStart_.assign(total + 1, 0);
        forEachEntry([&](int cell, uint32_t) { ++cellStart_[cell + 1]; });
        for (int cell = 0; cell < total; ++cell) cellStart_[cell + 1] += cellStart_[cell];
        entries_.resize(cellStart_.back());
        std::vector<uint32_t> next(cellStart_.begin(), cellStart_.end() - 1);
        forEachEntry([&](int cell, uint32_t obstacle) { entries_[next[cell]++] = obstacle; });
    }

    // Is the closed segment a-b clear of every obstacle?
    bool segmentFree(const double *a, const double *b) const {
        Segment s;
        double length2 = 0, nextCrossing[Dim], crossingStep[Dim];
        int stepsLeft[Dim], indexStep[Dim], cell = 0, steps = 0;
        for (int i = 0; i < Dim; ++i) {
            s.from[i] = a[i];
            s.step[i] = b[i] - a[i] + 0.0;  // + 0.0 turns -0 into +0, so that its reciprocal is +infinity
            s.reciprocal[i] = 1.0 / s.step[i];
            s.backward[i] = s.step[i] < 0;
            length2 += s.step[i] * s.step[i];

            const int first = cellAt(a[i], i), last = cellAt(b[i], i);
            cell += first * stride_[i];
            stepsLeft[i] = std::abs(last - first);
            steps += stepsLeft[i];
            indexStep[i] = last < first ? -stride_[i] : stride_[i];
            crossingStep[i] = std::abs(cellSize_[i] * s.reciprocal[i]);
            const double plane = low_[i] + (last < first ? first : first + 1) * cellSize_[i];
            nextCrossing[i] = stepsLeft[i] ? (plane - a[i]) * s.reciprocal[i] : kInfinity;
        }
        s.reciprocalLength2 = length2 > 0 ? 1.0 / length2 : 0.0;

        // Counting the steps of each axis makes the walk end in b's cell whatever the rounding.
        for (;; --steps) {
            for (uint32_t k = cellStart_[cell]; k < cellStart_[cell + 1]; ++k) {
                const uint32_t obstacle = entries_[k];
                if (obstacle < boxes_.size() ? hits(boxes_[obstacle], s) : hits(balls_[obstacle - boxes_.size()], s))
                    return false;
            }
            if (steps == 0) return true;
            int axis = 0;
            for (int i = 1; i < Dim; ++i)
                if (nextCrossing[i] < nextCrossing[axis]) axis = i;
            cell += indexStep[axis];
            nextCrossing[axis] = --stepsLeft[axis] ? nextCrossing[axis] + crossingStep[axis] : kInfinity;
        }
    }

private:
    struct Segment {
        double from[Dim], step[Dim], reciprocal[Dim], reciprocalLength2;
        bool backward[Dim];
    };

    int cellAt(double x, int axis) const {
        return int(std::clamp((x - low_[axis]) * cellsPerUnit_[axis], 0.0, count_[axis] - 0.5));
    }

    // Calls visit(cell, obstacle) for every cell an obstacle's bounding box touches; balls are numbered after boxes.
    template <class Visit> void forEachEntry(Visit visit) const {
        for (uint32_t obstacle = 0; obstacle < boxes_.size() + balls_.size(); ++obstacle) {
            int first[Dim], last[Dim], at[Dim];
            for (int i = 0; i < Dim; ++i) {
                const bool isBox = obstacle < boxes_.size();
                const Ball<Dim> ball = isBox ? Ball<Dim>{} : balls_[obstacle - boxes_.size()];
                // The margin covers rounding where a segment or an obstacle runs along a cell's face.
                const double margin = 1e-6 * cellSize_[i];
                at[i] = first[i] = cellAt((isBox ? boxes_[obstacle].side[0][i] : ball.centre[i] - ball.radius) - margin, i);
                last[i] = cellAt((isBox ? boxes_[obstacle].side[1][i] : ball.centre[i] + ball.radius) + margin, i);
            }
            for (int axis = 0; axis < Dim;) {  // count through the cells like an odometer
                int cell = 0;
                for (int i = 0; i < Dim; ++i) cell += at[i] * stride_[i];
                visit(cell, obstacle);
                for (axis = 0; axis < Dim && at[axis]++ == last[axis]; ++axis) at[axis] = first[axis];
            }
        }
    }

    // Slab test. On an axis along which the segment does not move the reciprocal is infinite: outside the slab that
    // gives an empty interval, and on a face 0 * infinity is NaN, which these comparisons pass over: touching is a hit.
    static bool hits(const Box<Dim> &box, const Segment &s) {
        double enter = 0, leave = 1;
        for (int i = 0; i < Dim; ++i) {
            const double near = (box.side[s.backward[i]][i] - s.from[i]) * s.reciprocal[i];
            const double far = (box.side[!s.backward[i]][i] - s.from[i]) * s.reciprocal[i];
            enter = enter < near ? near : enter;
            leave = far < leave ? far : leave;
        }
        return enter <= leave;
    }

    static bool hits(const Ball<Dim> &ball, const Segment &s) {
        double along = 0, gap2 = 0;
        for (int i = 0; i < Dim; ++i) along += (ball.centre[i] - s.from[i]) * s.step[i];
        const double t = std::clamp(along * s.reciprocalLength2, 0.0, 1.0);
        for (int i = 0; i < Dim; ++i) {
            const double gap = ball.centre[i] - s.from[i] - t * s.step[i];
            gap2 += gap * gap;
        }
        return gap2 <= ball.radius * ball.radius;
    }

    std::vector<Box<Dim>> boxes_;
    std::vector<Ball<Dim>> balls_;
    Point<Dim> low_, cellSize_, cellsPerUnit_;
    std::array<int, Dim> count_, stride_;
    std::vector<uint32_t> cellStart_, entries_;
};

// ---------------------------------------------------------------- OMPL glue

inline double *xyz(const ob::State *state) { return state->as<ob::RealVectorStateSpace::StateType>()->values; }

// The same space with its three hottest functions at a fixed dimension, as a careful user would do.
template <int Dim> struct FixedSpace final : ob::RealVectorStateSpace {
    FixedSpace() : ob::RealVectorStateSpace(Dim) {}
    double distance(const ob::State *a, const ob::State *b) const override {
        double sum = 0;
        for (int i = 0; i < Dim; ++i) sum += (xyz(a)[i] - xyz(b)[i]) * (xyz(a)[i] - xyz(b)[i]);
        return std::sqrt(sum);
    }
    void interpolate(const ob::State *a, const ob::State *b, double t, ob::State *result) const override {
        for (int i = 0; i < Dim; ++i) xyz(result)[i] = xyz(a)[i] + (xyz(b)[i] - xyz(a)[i]) * t;
    }
    void copyState(ob::State *to, const ob::State *from) const override { std::copy_n(xyz(from), Dim, xyz(to)); }
};

template <int Dim> struct ExactMotionValidator final : ob::MotionValidator {
    ExactMotionValidator(const ob::SpaceInformationPtr &si, const ObstacleGrid<Dim> &g) : MotionValidator(si), grid(g) {}
    bool checkMotion(const ob::State *a, const ob::State *b) const override { return grid.segmentFree(xyz(a), xyz(b)); }
    // None of the four planners asks for the last valid state; the start of the motion is always a correct answer.
    bool checkMotion(const ob::State *a, const ob::State *b, std::pair<ob::State *, double> &lastValid) const override {
        if (checkMotion(a, b)) return true;
        lastValid.second = 0;
        if (lastValid.first) si_->copyState(lastValid.first, a);
        return false;
    }
    const ObstacleGrid<Dim> &grid;
};

struct Options {
    std::string worldPath, planner;
    double range = 0, goalBias = 0.05, timeLimit = 10;
    long seeds = 30, firstSeed = 0, iterations = 0;
    bool exactCheck = true, optimising = false;
};

ob::PlannerPtr makePlanner(const Options &options, const ob::SpaceInformationPtr &si) {
    const auto configured = [&](auto planner) -> ob::PlannerPtr {
        // OMPL's default choice too, but instantiated here it is compiled with our flags and inlines better.
        planner->template setNearestNeighbors<ompl::NearestNeighborsGNATNoThreadSafety>();
        planner->setRange(options.range);
        if constexpr (!std::is_same_v<decltype(planner), std::shared_ptr<og::RRTConnect>>)
            planner->setGoalBias(options.goalBias);
        return planner;
    };
    if (options.planner == "rrt") return configured(std::make_shared<og::RRT>(si));
    if (options.planner == "rrt-connect") return configured(std::make_shared<og::RRTConnect>(si));
    if (options.planner == "rrt-star") return configured(std::make_shared<og::RRTstar>(si));
    return configured(std::make_shared<og::InformedRRTstar>(si));
}

template <int Dim> bool exactlyValid(const World<Dim> &world, const og::PathGeometric &path) {
    const size_t count = path.getStateCount();
    bool valid = count > 0 && std::equal(world.start.begin(), world.start.end(), xyz(path.getState(0))) &&
                 std::equal(world.goal.begin(), world.goal.end(), xyz(path.getState(count - 1)));
    for (size_t k = 0; k < count && valid; ++k) {
        const double *p = xyz(path.getState(k));
        for (int i = 0; i < Dim; ++i) valid &= world.bounds.side[0][i] <= p[i] && p[i] <= world.bounds.side[1][i];
        valid &= bruteForceFree(world, xyz(path.getState(k ? k - 1 : 0)), p);
    }
    return valid;
}

template <int Dim> void runSeed(const Options &options, const World<Dim> &world, const ObstacleGrid<Dim> &grid, long seed) {
    ompl::RNG::setSeed(std::uint_fast32_t(seed + 1));
    auto space = std::make_shared<FixedSpace<Dim>>();
    ob::RealVectorBounds bounds(Dim);
    bounds.low.assign(world.bounds.side[0].begin(), world.bounds.side[0].end());
    bounds.high.assign(world.bounds.side[1].begin(), world.bounds.side[1].end());
    space->setBounds(bounds);

    og::SimpleSetup setup(space);
    const ob::SpaceInformationPtr &si = setup.getSpaceInformation();
    setup.setStateValidityChecker([&grid](const ob::State *state) { return grid.segmentFree(xyz(state), xyz(state)); });
    if (options.exactCheck) si->setMotionValidator(std::make_shared<ExactMotionValidator<Dim>>(si, grid));
    ob::ScopedState<> start(space), goal(space);
    std::copy(world.start.begin(), world.start.end(), xyz(start.get()));
    std::copy(world.goal.begin(), world.goal.end(), xyz(goal.get()));
    setup.setStartAndGoalStates(start, goal);
    const ob::PlannerPtr planner = makePlanner(options, si);
    const auto *star = options.optimising ? planner->as<og::RRTstar>() : nullptr;
    if (star) {  // no cost beats the threshold 0, so the search does not stop at a solution
        auto objective = std::make_shared<ob::PathLengthOptimizationObjective>(si);
        objective->setCostThreshold(ob::Cost(0.0));
        setup.setOptimizationObjective(objective);
    }
    setup.setPlanner(planner);
    setup.setup();

    using Clock = std::chrono::steady_clock;
    Clock::time_point began;
    const auto elapsedMs = [&] { return std::chrono::duration<double, std::milli>(Clock::now() - began).count(); };
    long asked = 0;
    double bestCost = kInfinity;
    std::vector<std::pair<double, double>> progress;
    // The planners evaluate this once per iteration, which also makes it the cheapest place to watch the cost.
    const ob::PlannerTerminationCondition stop([&] {
        ++asked;
        if (star && star->bestCost().value() < bestCost) {
            bestCost = star->bestCost().value();
            progress.emplace_back(elapsedMs(), bestCost);
        }
        if (options.iterations > 0) return asked > options.iterations;
        return asked % 16 == 0 && elapsedMs() >= options.timeLimit * 1000;  // a clock read is not free
    });
    began = Clock::now();
    const ob::PlannerStatus status = planner->solve(stop);
    const double ms = elapsedMs();

    const bool solved = status == ob::PlannerStatus::EXACT_SOLUTION;
    const auto *path = solved ? setup.getProblemDefinition()->getSolutionPath()->as<og::PathGeometric>() : nullptr;
    ob::PlannerData tree(si);
    planner->getPlannerData(tree);
    const long iterations = star ? long(star->numIterations()) : solved ? asked : std::max(0L, asked - 1);
    std::printf("{\"seed\":%ld,\"solved\":%s,\"ms\":%.6f,\"cost\":", seed, solved ? "true" : "false", ms);
    std::printf(solved ? "%.17g" : "null", solved ? path->length() : 0.0);
    std::printf(",\"nodes\":%u,\"iterations\":%ld,\"exact_valid\":%s", tree.numVertices(), iterations,
                solved && exactlyValid(world, *path) ? "true" : "false");
    if (star) std::printf(",\"progress\":[");
    for (const auto &entry : progress)
        std::printf("%s[%.6f,%.17g]", &entry == &progress[0] ? "" : ",", entry.first, entry.second);
    std::printf(star ? "]}\n" : "}\n");
    std::fflush(stdout);
}

template <int Dim> void runAll(const Options &options, const std::vector<WorldLine> &lines) {
    const World<Dim> world = buildWorld<Dim>(lines);
    const ObstacleGrid<Dim> grid(world);
    for (long k = 0; k < options.seeds; ++k) runSeed(options, world, grid, options.firstSeed + k);
}

// ---------------------------------------------------------------- command line

Options parseOptions(const std::vector<std::string> &arguments) {
    Options options;
    std::vector<std::string> positional;
    bool mustOptimise = false;
    for (size_t k = 0; k < arguments.size(); ++k) {
        const std::string name = arguments[k];
        if (name.rfind("--", 0) != 0) { positional.push_back(name); continue; }
        if (name == "--optimal") { mustOptimise = true; continue; }
        const std::string value = ++k < arguments.size() ? arguments[k] : "";
        std::istringstream text(value);
        double number = 0;
        const bool isNumber = (text >> number) && text.eof();
        const bool isCount = isNumber && number >= 0 && number <= 4e9 && number == std::floor(number);
        if (name == "--range" && isNumber && number > 0) options.range = number;
        else if (name == "--goal-bias" && isNumber && number >= 0 && number <= 1) options.goalBias = number;
        else if (name == "--time" && isNumber && number > 0) options.timeLimit = number;
        else if (name == "--seeds" && isCount && number > 0) options.seeds = long(number);
        else if (name == "--first-seed" && isCount) options.firstSeed = long(number);
        else if (name == "--iterations" && isCount) options.iterations = long(number);
        else if (name == "--check" && (value == "exact" || value == "resolution")) options.exactCheck = value == "exact";
        else throw Error("bad option: " + name + " " + value);
    }
    if (positional.size() != 2 || options.range == 0)
        throw Error("usage: ompl_peer WORLD.txt PLANNER --range R [--goal-bias B] [--seeds N] [--first-seed S] [--time T] "
                    "[--iterations N] [--check exact|resolution] [--optimal]");
    options.worldPath = positional[0];
    options.planner = positional[1];
    options.optimising = options.planner == "rrt-star" || options.planner == "informed-rrt-star";
    if (!options.optimising && options.planner != "rrt" && options.planner != "rrt-connect")
        throw Error("unknown planner " + options.planner);
    if (mustOptimise && !options.optimising) throw Error("--optimal needs rrt-star or informed-rrt-star");
    return options;
}

int main(int argc, char **argv) {
    ompl::msg::noOutputHandler();
    try {
        const Options options = parseOptions({argv + 1, argv + argc});
        const std::vector<WorldLine> lines = readLines(options.worldPath);
        const auto isDim = [](const WorldLine &line) { return line.keyword == "dim"; };
        const auto dim = std::find_if(lines.begin(), lines.end(), isDim);
        if (dim != lines.end() && dim->numbers == std::vector<double>{2}) runAll<2>(options, lines);
        else if (dim != lines.end() && dim->numbers == std::vector<double>{3}) runAll<3>(options, lines);
        else throw Error("the world needs a line 'dim 2' or 'dim 3'");
    } catch (const std::exception &error) {
        std::fprintf(stderr, "ompl_peer: %s\n", error.what());
        return 2;
    }
    return 0;
}
