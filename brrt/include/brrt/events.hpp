// The kinds of events. Made from brrt/events.py by docs/make_events.py: do not edit.
#pragma once

#include <cstddef>
#include <cstdint>

namespace brrt {

/// What happened.
enum class Kind : std::uint8_t {
    phase = 0,
    sample = 1,
    reject = 2,
    edge = 3,
    path = 4,
    shortcut = 5,
    rewire = 6,
    connect = 7,
    expand = 8,
    heuristic = 9,
    move = 10,
    vertex = 11,
    link = 12,
    cut = 13,
    remove = 14,
    check = 15,
};

/// A part of a run.
enum class Phase : std::uint8_t {
    plan = 0,
    smooth = 1,
    execute = 2,
};

/// The state of a phase: it begins, or how it ended.
enum class Status : std::uint8_t {
    begin = 0,
    solved = 1,
    iteration_limit = 2,
    time_limit = 3,
    interrupted = 4,
    done = 5,
    no_path = 6,
};

/// Origin of a sample.
enum class Source : std::uint8_t {
    uniform = 0,
    goal = 1,
    other_tree = 2,
    informed = 3,
};

/// Why an extension failed.
enum class Reason : std::uint8_t {
    collision = 0,
    no_progress = 1,
    goal_blocked = 2,
    link_blocked = 3,
    near_blocked = 4,
    no_gain = 5,
    limits = 6,
};

/// Which path of the run this is.
enum class Stage : std::uint8_t {
    raw = 0,
    smoothed = 1,
    improved = 2,
};

namespace detail {

/// A kind of event: its name, the key of its count in the metrics (or null), and its ROS 2
/// message definition, in which `@` stands for the numbers in a configuration.
struct KindInfo {
    const char *name, *count, *definition;
};

inline constexpr KindInfo kKinds[] = {
    {"phase", nullptr,
     "uint64 iteration  # the planner's count\n"
     "uint8 NAME_PLAN=0\n"
     "uint8 NAME_SMOOTH=1\n"
     "uint8 NAME_EXECUTE=2\n"
     "uint8 name  # part of the run\n"
     "uint8 STATUS_BEGIN=0\n"
     "uint8 STATUS_SOLVED=1\n"
     "uint8 STATUS_ITERATION_LIMIT=2\n"
     "uint8 STATUS_TIME_LIMIT=3\n"
     "uint8 STATUS_INTERRUPTED=4\n"
     "uint8 STATUS_DONE=5\n"
     "uint8 STATUS_NO_PATH=6\n"
     "uint8 status  # begins, or how it ended\n"},
    {"sample", "samples",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "uint8 SOURCE_UNIFORM=0\n"
     "uint8 SOURCE_GOAL=1\n"
     "uint8 SOURCE_OTHER_TREE=2\n"
     "uint8 SOURCE_INFORMED=3\n"
     "uint8 source  # origin of the sample\n"
     "float64[@] q  # configuration\n"},
    {"reject", "rejects",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "int32 node  # node that the extension started from\n"
     "uint8 REASON_COLLISION=0\n"
     "uint8 REASON_NO_PROGRESS=1\n"
     "uint8 REASON_GOAL_BLOCKED=2\n"
     "uint8 REASON_LINK_BLOCKED=3\n"
     "uint8 REASON_NEAR_BLOCKED=4\n"
     "uint8 REASON_NO_GAIN=5\n"
     "uint8 REASON_LIMITS=6\n"
     "uint8 reason  # why it failed\n"
     "float64[@] q  # configuration that the extension headed for\n"},
    {"edge", "edges",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "int32 node  # node that joined the tree, numbered from 0 in each tree\n"
     "int32 parent  # its parent; -1 for a root\n"
     "float64 cost  # cost-to-come in the robot's metric\n"
     "float64[@] q  # configuration\n"},
    {"path", nullptr,
     "uint64 iteration  # the planner's count\n"
     "uint8 STAGE_RAW=0\n"
     "uint8 STAGE_SMOOTHED=1\n"
     "uint8 STAGE_IMPROVED=2\n"
     "uint8 stage  # which path of the run\n"
     "float64 cost  # its length in the robot's metric\n"
     "float64[] waypoints  # configurations from start to goal, @ numbers each, one after another\n"},
    {"shortcut", "shortcuts",
     "uint64 iteration  # the planner's count\n"
     "int32 i  # first waypoint of the pair, numbered on the path before the attempt\n"
     "int32 j  # second waypoint\n"
     "bool accepted  # whether the direct motion was free and replaced the detour\n"
     "float64 cost  # cost of the path after the attempt\n"},
    {"rewire", "rewires",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "int32 node  # node that got another parent; its descendants' costs follow\n"
     "int32 parent  # the new parent\n"
     "float64 cost  # its new cost-to-come\n"},
    {"connect", "links",
     "uint64 iteration  # the planner's count\n"
     "int32 node  # node of tree 0\n"
     "int32 other  # node of tree 1; the motion between the two is free\n"
     "float64 cost  # cost of the path from start to goal over this link\n"},
    {"expand", "expanded",
     "uint64 iteration  # the planner's count\n"
     "int32 cell  # cell of the lattice, numbered from 0 (the start) as first seen\n"
     "int32 parent  # cell that it was reached from in this search; -1 for its first\n"
     "float64 cost  # cost from this search's first cell\n"
     "float64[@] q  # configuration\n"},
    {"heuristic", "learned",
     "uint64 iteration  # the planner's count\n"
     "int32 cell  # cell whose estimate of the cost-to-go was raised\n"
     "float64 h  # the new estimate; the first one is the distance to the goal\n"
     "float64[@] q  # configuration\n"},
    {"move", nullptr,
     "uint64 iteration  # the planner's count\n"
     "int32 trial  # 0, 1 ...: each trial begins at the start\n"
     "int32 step  # moves of this trial so far, this one included\n"
     "int32 cell  # cell of the lattice that it ends in; -1 if there is none\n"
     "float64 cost  # length of this trial's moves so far, this one included\n"
     "float64[@] q  # configuration that the robot moves to, in a straight line\n"},
    {"vertex", "vertices",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "int32 node  # node that joined without an edge; numbered with those of edges\n"
     "float64[@] q  # configuration\n"},
    {"link", "graph_edges",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "int32 node  # one end of an edge of a graph, which leads both ways\n"
     "int32 other  # the other end, a node of the same tree\n"
     "float64 cost  # cost of the edge; that of a later link of the two replaces it\n"},
    {"cut", "cuts",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "int32 node  # one of two nodes whose edges, link and that to a parent, are removed\n"
     "int32 other  # the other one\n"},
    {"remove", "removals",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "int32 node  # node that is removed with all its edges; its number stays unused\n"},
    {"check", "checks",
     "uint64 iteration  # the planner's count\n"
     "uint8 tree  # 0 grows from the start, 1 from the goal\n"
     "int32 node  # node at which the motion begins; -1 if it is at none\n"
     "int32 other  # node at which it ends; -1 if it is at none\n"
     "float64 part  # how much of the motion is free: from 0 to 1, 1 for all of it\n"
     "float64[@] q  # configuration at which it ends\n"},
};

inline constexpr std::size_t kKindCount = sizeof(kKinds) / sizeof(KindInfo);

inline constexpr const char *kStatusLabels[] = {
    "begin", "solved", "iteration limit", "time limit", "interrupted", "done", "no path"};

}  // namespace detail
}  // namespace brrt
