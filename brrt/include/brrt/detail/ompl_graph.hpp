// From snapshots of a planner's graph to events: what is new, what changed, and when it was
// checked.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <ompl/base/PlannerData.h>

#include "../brrt.hpp"

namespace brrt::detail {

namespace ob = ompl::base;

/// Return a hash of a configuration.
inline std::uint64_t hash_of(const double *q, std::size_t dof) {
    std::uint64_t hash = 1469598103934665603u;
    for (std::size_t k = 0; k < dof; ++k) {
        std::uint64_t word;
        std::memcpy(&word, q + k, sizeof word);
        hash = (hash ^ word) * 0x9E3779B97F4A7C15u;
        hash ^= hash >> 29;
    }
    return hash;
}

/// Return a key of a motion between two configurations, the same in both directions.
inline std::uint64_t motion_key(std::uint64_t a, std::uint64_t b) {
    return (a + b) * 0x9E3779B97F4A7C15u ^ (a ^ b);
}

/// What a planner did between two snapshots, in order. Configurations of blocked motions (both
/// ends) and of samples are in `reals`, those of free motions are told apart by hashes.
struct Observation {
    enum What : std::uint8_t { blocked, is_free, sample } what;
    std::int64_t t, iteration;
    const ob::State *from, *to;
    std::uint64_t from_hash, to_hash;
    std::size_t place;
};
struct Observations {
    std::vector<Observation> list;
    std::vector<double> reals;
};

/// The moment that events are recorded at, while a snapshot is worked off.
struct Moment {
    std::int64_t t = -1, iteration = 0;
};

/// Follows a planner's graph by its snapshots.
///
/// An edge that leads one way to a node without another parent is its parent's edge; all others are
/// links. Planners with two trees tag them 1 and 2.
class GraphFollower {
  public:
    GraphFollower(Recorder &rec, std::size_t dof, std::vector<double> start)
        : rec_(rec), dof_(dof), start_(std::move(start)) {}

    /// Record what differs between a snapshot and the one before.
    ///
    /// @param reals Returns the numbers of a state.
    /// @param at Set to the moment of each event; then the moment of the snapshot.
    template <class Reals>
    void follow(const ob::PlannerData &data, const Observations &seen, Reals &&reals, Moment &at) {
        const Moment now = at;
        ++snapshot_;
        take(data, reals);
        changes_.clear();
        for (int v : present_) {
            const Node &node = nodes_[index(v)];
            if (node.number < 0 || node.parent != node.target) change(v, node.target);
        }
        for (const auto &[a, b] : links_now_)
            if (!links_.count(pair(a, b))) change(a, b, true);
        find_checks(seen);
        if (!seen.list.empty()) at = {seen.list[0].t, seen.list[0].iteration};
        begin(at);
        cut_links();
        std::size_t next = 0;
        for (std::size_t i = 0; i < seen.list.size(); ++i) {
            const Observation &event = seen.list[i];
            at = {event.t, event.iteration};
            if (event.what == Observation::sample)
                begin(at), rec_.sample(view(&seen.reals[event.place]));
            if (event.what == Observation::blocked) begin(at), reject(event, seen);
            for (; next < changes_.size() && changes_[next].check == i; ++next)
                begin(at), make(changes_[next]);
        }
        at = now;
        begin(at);
        for (; next < changes_.size(); ++next) make(changes_[next]);
        connect();
        remove_missing();
    }

    int nodes() const { return static_cast<int>(present_.size()); }

    /// Return the node of the best goal in the last snapshot with the way to it from the start;
    /// empty if there is none.
    const std::vector<int> &way_to_goal() const { return way_; }
    const double *place(int node) const { return &q_[index(node) * dof_]; }
    const ob::State *state_of(int node) const { return nodes_[index(node)].state; }

  private:
    struct Node {
        const ob::State *state;
        std::uint64_t hash;
        int tree, snapshot;
        int number = -1, parent = -1, target = -1;
        bool is_root = false;
    };
    struct Change {
        int node, other;
        bool is_link;
        std::size_t check;
    };
    static constexpr std::size_t kNoCheck = std::numeric_limits<std::size_t>::max();

    static std::size_t index(int i) { return static_cast<std::size_t>(i); }
    static std::uint64_t pair(int a, int b) {
        return static_cast<std::uint64_t>(std::min(a, b)) << 32 |
               static_cast<std::uint32_t>(std::max(a, b));
    }
    Configuration view(const double *q) const { return {q, dof_}; }
    void begin(const Moment &at) { rec_.iteration(at.iteration); }

    /// Read vertices and edges of a snapshot.
    template <class Reals>
    void take(const ob::PlannerData &data, Reals &&reals) {
        const unsigned count = data.numVertices();
        const bool two = has_two_trees(data);
        std::vector<int> node_of(count);
        present_.clear();
        for (unsigned i = 0; i < count; ++i) {
            const ob::PlannerDataVertex &vertex = data.getVertex(i);
            node_of[i] = known(vertex.getState(), reals(vertex.getState()),
                               two && vertex.getTag() == 2 ? 1 : 0);
            if (nodes_[index(node_of[i])].snapshot != snapshot_) present_.push_back(node_of[i]);
            Node &node = nodes_[index(node_of[i])];
            node.snapshot = snapshot_;
            node.target = -1;
        }
        edges_.clear();
        std::vector<unsigned> out;
        for (unsigned i = 0; i < count; ++i) {
            data.getEdges(i, out);
            for (unsigned j : out) edges_.emplace_back(node_of[i], node_of[j]);
        }
        sort_edges(two);
        find_way(data, node_of);
    }

    /// Tell parents' edges from links and from motions between the trees.
    void sort_edges(bool two) {
        links_now_.clear();
        connections_.clear();
        std::vector<std::pair<int, int>> both_ways;
        bool is_graph = false;
        for (auto [u, v] : edges_) {
            if (nodes_[index(u)].tree != nodes_[index(v)].tree) {
                connections_.emplace_back(u, v);
                continue;
            }
            if (two && nodes_[index(u)].tree == 1)
                std::swap(u, v);  // OMPL has it from leaf to root
            Node &child = nodes_[index(v)];
            is_graph = is_graph || u == v || child.target >= 0 || nodes_[index(u)].target == v;
            child.target = u;
        }
        if (!is_graph) return;
        std::unordered_set<std::uint64_t> directed;
        const auto key = [](int u, int v) {
            return static_cast<std::uint64_t>(u) << 32 | static_cast<std::uint32_t>(v);
        };
        for (auto [u, v] : edges_) directed.insert(key(u, v));
        for (int v : present_) nodes_[index(v)].target = -1;
        for (auto [u, v] : edges_) {
            if (nodes_[index(u)].tree != nodes_[index(v)].tree || u == v) continue;
            const bool reversed = two && nodes_[index(u)].tree == 1;
            const int up = reversed ? v : u, down = reversed ? u : v;
            Node &child = nodes_[index(down)];
            const bool is_undirected = directed.count(key(v, u)) > 0;
            if (is_undirected ? u < v : child.target >= 0 || leads_to(up, down))
                links_now_.emplace_back(u, v);
            else if (!is_undirected) child.target = up;
        }
    }

    /// Whether a node is below another one by the edges so far.
    bool leads_to(int node, int ancestor) const {
        while (node >= 0 && node != ancestor) node = nodes_[index(node)].target;
        return node == ancestor;
    }

    /// Whether vertices are tagged as two trees, as planners with trees from start and goal do.
    static bool has_two_trees(const ob::PlannerData &data) {
        const unsigned starts = data.numStartVertices(), goals = data.numGoalVertices();
        bool first = false, second = false;
        for (unsigned i = 0; i < data.numVertices(); ++i) {
            const int tag = data.getVertex(i).getTag();
            if (tag != 1 && tag != 2) return false;
            (tag == 1 ? first : second) = true;
        }
        for (unsigned i = 0; i < starts; ++i)
            if (data.getStartVertex(i).getTag() != 1) return false;
        for (unsigned i = 0; i < goals; ++i)
            if (data.getGoalVertex(i).getTag() != 2) return false;
        return first && second && (starts == 0) == (goals == 0);  // BFMT marks neither
    }

    /// Return the node of a state; states are freed and come back as others.
    int known(const ob::State *state, const double *q, int tree) {
        const std::uint64_t hash = hash_of(q, dof_);
        const auto [it, is_new] = by_state_.try_emplace(state, static_cast<int>(nodes_.size()));
        if (!is_new) {
            const Node &node = nodes_[index(it->second)];
            if (node.hash == hash && node.tree == tree) return it->second;
            it->second = static_cast<int>(nodes_.size());
        }
        nodes_.push_back({state, hash, tree, 0});
        q_.insert(q_.end(), q, q + dof_);
        Node &node = nodes_.back();
        // What FMT* marks as a start is any node without a parent.
        node.is_root = tree == 1 || std::equal(start_.begin(), start_.end(), q);
        return it->second;
    }

    /// Follow the parents from a goal to the start.
    void find_way(const ob::PlannerData &data, const std::vector<int> &node_of) {
        way_.clear();
        for (unsigned g = 0; g < data.numGoalVertices() && way_.empty(); ++g) {
            const int goal = node_of[data.getGoalIndex(g)];
            for (int v = goal; v >= 0; v = nodes_[index(v)].target) way_.push_back(v);
            const Node &root = nodes_[index(way_.back())];
            const bool is_whole =
                way_.size() > 1 && root.tree == 0 && (root.is_root || root.number == 0);
            if (!is_whole) way_.clear();
        }
        std::reverse(way_.begin(), way_.end());
    }

    void change(int node, int other, bool is_link = false) {
        changes_.push_back({node, other, is_link, kNoCheck});
    }

    /// Find the last check of each motion that is new, and sort the changes by that.
    void find_checks(const Observations &seen) {
        std::unordered_map<std::uint64_t, std::size_t> wanted;
        wanted.reserve(changes_.size());
        for (std::size_t i = 0; i < changes_.size(); ++i) {
            const Change &each = changes_[i];
            if (each.other >= 0)
                wanted[motion_key(nodes_[index(each.node)].hash, nodes_[index(each.other)].hash)] =
                    i;
        }
        for (std::size_t i = 0; i < seen.list.size() && !wanted.empty(); ++i) {
            const Observation &event = seen.list[i];
            if (event.what != Observation::is_free) continue;
            const auto it = wanted.find(motion_key(event.from_hash, event.to_hash));
            if (it != wanted.end()) changes_[it->second].check = i;
        }
        std::stable_sort(changes_.begin(), changes_.end(),
                         [](const Change &a, const Change &b) { return a.check < b.check; });
    }

    void make(const Change &change) {
        settle(change.node);
        if (!change.is_link) return;
        settle(change.other);
        if (!links_.insert(pair(change.node, change.other)).second) return;
        const Node &a = nodes_[index(change.node)], &b = nodes_[index(change.other)];
        rec_.link(a.number, b.number, {}, a.tree);
    }

    /// Give a node its parent: after its new ancestors, and after all if it would make a circle.
    void settle(int v) {
        chain_.assign(1, v);
        bool all = false;
        for (int u = nodes_[index(v)].target; u >= 0; u = nodes_[index(u)].target) {
            if (!all && nodes_[index(v)].number >= 0) all = descends(u, v);
            if (!all && nodes_[index(u)].number >= 0) break;
            chain_.push_back(u);
        }
        for (; !chain_.empty(); chain_.pop_back()) apply(chain_.back());
    }

    bool descends(int node, int ancestor) const {
        while (node >= 0 && node != ancestor) node = nodes_[index(node)].parent;
        return node == ancestor;
    }

    void apply(int v) {
        Node &node = nodes_[index(v)];
        const bool is_new = node.number < 0;
        if (!is_new && node.parent == node.target) return;
        if (node.target >= 0) {
            const int up = nodes_[index(node.target)].number;
            const Recorder::Cost cost = cost_below(node.target, v);
            if (is_new) node.number = rec_.edge(view(place(v)), up, cost, node.tree);
            else rec_.rewire(node.number, up, cost, node.tree);
        } else if (!is_new) {
            rec_.cut(node.number, -1, node.tree);
        } else if (node.is_root && !has_root_[node.tree]) {
            node.number = rec_.edge(view(place(v)), -1, {}, node.tree);
            has_root_[node.tree] = true;
        } else {
            node.number = rec_.vertex(view(place(v)), node.tree);
        }
        node.parent = node.target;
    }

    /// Return the cost of a node from the node without a parent above it, if that is no root, as
    /// where there are several goals; none for the recorder's default.
    Recorder::Cost cost_below(int up, int v) const {
        const Node &parent = nodes_[index(up)];
        if (rec_.cost(parent.number, parent.tree)) return {};
        double cost = rec_.distance(view(place(up)), view(place(v)));
        for (int at = up; nodes_[index(at)].parent >= 0; at = nodes_[index(at)].parent)
            cost += rec_.distance(view(place(nodes_[index(at)].parent)), view(place(at)));
        return cost;
    }

    /// Record a blocked motion as rejected, from the end of it that is a node.
    void reject(const Observation &event, const Observations &seen) {
        const double *const from = &seen.reals[event.place], *const to = from + dof_;
        if (const Node *node = numbered(event.from, event.from_hash))
            rec_.reject(view(to), node->number, Reason::collision, node->tree);
        else if (const Node *end = numbered(event.to, event.to_hash))
            rec_.reject(view(from), end->number, Reason::collision, end->tree);
    }

    const Node *numbered(const ob::State *state, std::uint64_t hash) const {
        const auto it = by_state_.find(state);
        if (it == by_state_.end()) return nullptr;
        const Node &node = nodes_[index(it->second)];
        return node.hash == hash && node.number >= 0 ? &node : nullptr;
    }

    /// Record the motions that join the trees.
    void connect() {
        for (auto [u, v] : connections_) {
            if (!connected_.insert(pair(u, v)).second) continue;
            const bool swapped = nodes_[index(u)].tree == 1;
            const Node &a = nodes_[index(swapped ? v : u)], &b = nodes_[index(swapped ? u : v)];
            const double far =
                rec_.distance(view(place(swapped ? v : u)), view(place(swapped ? u : v)));
            // BFMT's nodes may be in both trees, so that others below them have no root in their
            // own.
            const double ends =
                rec_.cost(a.number, 0).value_or(0) + rec_.cost(b.number, 1).value_or(0);
            rec_.connect(a.number, b.number, ends + far);
        }
    }

    void cut_links() {
        if (links_.empty()) return;
        std::unordered_set<std::uint64_t> now;
        for (auto [a, b] : links_now_) now.insert(pair(a, b));
        for (auto it = links_.begin(); it != links_.end();) {
            if (now.count(*it)) {
                ++it;
                continue;
            }
            const Node &a = nodes_[*it >> 32], &b = nodes_[*it & 0xFFFFFFFF];
            if (a.snapshot == snapshot_ && b.snapshot == snapshot_)
                rec_.cut(a.number, b.number, a.tree);
            it = links_.erase(it);
        }
    }

    /// Record that nodes of the last snapshot are gone.
    void remove_missing() {
        for (int v : alive_) {
            Node &node = nodes_[index(v)];
            if (node.snapshot == snapshot_ || node.number < 0) continue;
            rec_.remove(node.number, node.tree);
            node.number = -1;
            const auto it = by_state_.find(node.state);
            if (it != by_state_.end() && it->second == v) by_state_.erase(it);
        }
        alive_ = present_;
    }

    Recorder &rec_;
    const std::size_t dof_;
    const std::vector<double> start_;
    std::vector<Node> nodes_;
    std::vector<double> q_;
    std::unordered_map<const ob::State *, int> by_state_;
    std::unordered_set<std::uint64_t> links_, connected_;
    bool has_root_[2]{false, false};
    int snapshot_ = 0;
    // Of the last snapshot.
    std::vector<int> present_, alive_, way_, chain_;
    std::vector<std::pair<int, int>> edges_, links_now_, connections_;
    std::vector<Change> changes_;
};

}  // namespace brrt::detail
