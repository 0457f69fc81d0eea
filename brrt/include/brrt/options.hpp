// What a recording states about the run: world, robot, start, goal, planner, claims.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <type_traits>

#include "detail/json.hpp"
#include "world.hpp"

namespace brrt {

/// How a log is made, so that `brrt verify` does not accuse what is right: see docs/promises.md.
struct Claims {
    std::string motions = "straight";  ///< "own": arcs, dynamics and the like.
    std::string costs = "length";      ///< "own": anything but the lengths of motions.
    std::string edges = "checked";  ///< "assumed": they are not checked before they are recorded.
    std::string times = "exact";    ///< "snapshot": inferred from states of the planner.
    std::string samples = "all";    ///< "none": not all of them are recorded.
    double goal_tolerance = 0;      ///< Distance from the goal within which paths may end.
};

/// The value of a planner's parameter, for readers.
struct Param {
    std::string json;

    template <class T, class = std::enable_if_t<std::is_arithmetic_v<T>>>
    Param(T value) {
        if constexpr (std::is_same_v<T, bool>) json = value ? "true" : "false";
        else if constexpr (std::is_integral_v<T>) json = std::to_string(value);
        else json = std::isfinite(value) ? detail::json(static_cast<double>(value)) : "null";
    }
    Param(const std::string &text) : json(detail::json_text(text)) {}
    Param(const char *text) : json(detail::json_text(text)) {}
};

/// What a recording states about the run. Start and goal are needed; all else has a default.
struct Options {
    std::optional<World> world;  ///< None if it is not known: then neither is the robot's shape.
    Point start, goal;           ///< First and last configuration.
    std::optional<Robot> robot;  ///< A point where a configuration is a position, and else opaque.
    std::string planner = "external";
    std::map<std::string, Param> params;     ///< The planner's parameters, for readers.
    std::uint64_t seed = 0;                  ///< Of its random draws, for readers.
    std::optional<std::int64_t> iterations;  ///< Its limit of iterations, for readers.
    std::optional<double> time_limit;        ///< Its limit of time in s, for readers.
    std::string contract;  ///< What it promises, JSON as docs/python.md lists it; or "".
    Claims claims;
    /// Returns the time of the next event in ns since the run began; none to measure it.
    std::function<std::int64_t()> clock;
    /// Called once, maybe on another thread, if the file cannot be written; none to print a line.
    std::function<void(const std::string &)> on_error;
};

namespace detail {

/// Throw unless a claim is one of two; return it for the manifest if it is not the usual one.
inline std::string claim(const char *name, const std::string &value, const char *usual,
                         const char *other) {
    if (value == usual) return "";
    if (value != other)
        throw Error(std::string(name) + " must be " + usual + " or " + other + ", not " + value);
    return ", " + json_text(name) + ": " + json_text(value);
}

/// Return the claims that are not the usual ones, as JSON; empty if there are none.
inline std::string stated(const Claims &claims) {
    std::string text = claim("motions", claims.motions, "straight", "own") +
                       claim("costs", claims.costs, "length", "own") +
                       claim("edges", claims.edges, "checked", "assumed");
    if (!(claims.goal_tolerance >= 0 && claims.goal_tolerance < kGreatest))
        throw Error("goal_tolerance must be a number from 0 on");
    if (claims.goal_tolerance > 0) text += ", \"goal_tolerance\": " + json(claims.goal_tolerance);
    text += claim("times", claims.times, "exact", "snapshot") +
            claim("samples", claims.samples, "all", "none");
    return text.empty() ? text : "{" + text.substr(2) + "}";
}

/// Fill in what options leave out, and check them.
inline void resolve(Options &options) {
    const std::size_t dof = options.start.size();
    for (const Point *end : {&options.start, &options.goal})
        if (dof < 1 || end->size() != dof || !possible(*end))
            throw Error("start and goal must be configurations, as many finite numbers each");
    if (!options.world) {
        if (options.robot && options.robot->kind != "opaque")
            throw Error("robot " + options.robot->kind +
                        " needs a world; without one it is opaque");
        std::vector<Point> places{options.start, options.goal};
        for (Point &place : places) place.resize(dof < 3 ? 2 : 3);
        options.world = World::unknown(places);
        options.robot = Robot::opaque(dof);
    }
    const std::size_t dim = options.world->dim();
    if (!options.robot) options.robot = dof == dim ? Robot::point() : Robot::opaque(dof);
    Robot &robot = *options.robot;
    if (robot.kind == "opaque") robot = Robot::opaque(robot.dof ? robot.dof : dof, dim);
    const std::size_t wanted = robot.kind == "point" ? dim : robot.dof ? robot.dof : dof;
    if (dof != wanted)
        throw Error("start must be " + std::to_string(wanted) + " numbers for robot " + robot.kind +
                    ", not " + std::to_string(dof));
    const bool timed = options.time_limit.has_value(), counted = options.iterations.has_value();
    if (timed && !(*options.time_limit > 0 && *options.time_limit <= 1e9))
        throw Error("time_limit must be above 0 and at most 1e9 seconds");
    if (counted && (*options.iterations < 1 || *options.iterations > 1000000000000000))
        throw Error("iterations must be at least 1 and at most 1e15");
    stated(options.claims);
}

/// Return resolved options as brrt reads them.
inline std::map<std::string, std::string> manifest(const Options &options, std::uint64_t epoch_ns) {
    const Robot &robot = *options.robot;
    const std::string start = json(options.start.data(), options.start.size());
    const std::string goal = json(options.goal.data(), options.goal.size());
    std::string params;
    for (const auto &[name, value] : options.params)
        params += (params.empty() ? "" : ", ") + json_text(name) + ": " + value.json;
    std::string scenario = "{\"world\": " + json_text(options.world->name()) +
                           ", \"robot\": " + json_text(robot.spec) +
                           ", \"planner\": " + json_text(options.planner) + ", \"params\": {" +
                           params + "}, \"start\": " + start + ", \"goal\": " + goal +
                           ", \"seed\": " + std::to_string(options.seed) + ", \"smooth\": false";
    if (options.iterations) scenario += ", \"iterations\": " + std::to_string(*options.iterations);
    if (options.time_limit) scenario += ", \"time\": " + json(*options.time_limit);
    std::map<std::string, std::string> texts{{"format", "3"},  // events of graphs may follow
                                             {"scenario", scenario + "}"},
                                             {"start", start},
                                             {"goal", goal},
                                             {"dim", std::to_string(options.world->dim())},
                                             {"dof", std::to_string(options.start.size())},
                                             {"epoch_ns", std::to_string(epoch_ns)},
                                             {"made_by", "{\"brrt.hpp\": \"1\"}"},
                                             {"robot", robot.definition}};
    if (!options.contract.empty()) texts["contract"] = options.contract;
    if (const std::string claims = stated(options.claims); !claims.empty())
        texts["claims"] = claims;
    return texts;
}

}  // namespace detail
}  // namespace brrt
