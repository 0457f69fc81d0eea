// Snapshots of a planner's graph, as OMPL's PlannerData has them: nodes, parents, links.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <ompl/base/PlannerData.h>

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

inline std::size_t index(int i) { return static_cast<std::size_t>(i); }

/// A node of a planner's graph, in all snapshots that it is in.
struct GraphNode {
    const ob::State *state;
    std::uint64_t hash;            // of its configuration
    int tree;                      // 0, or 1 for a tree from the goal
    int snapshot = 0;              // the last one that it is in
    int target = -1;               // its parent there
    bool is_root = false;          // whether it may be: it is the start, or in the goal's tree
    int number = -1, parent = -1;  // as they are recorded
};

/// Reads snapshots of a planner's graph.
///
/// An edge that leads one way to a node without another parent is its parent's edge; all others are
/// links. Planners with two trees tag them 1 and 2.
class SnapshotReader {
  public:
    using Pairs = std::vector<std::pair<int, int>>;

    SnapshotReader(std::size_t dof, std::vector<double> start)
        : dof_(dof), start_(std::move(start)) {}

    /// Read a snapshot.
    ///
    /// @param reals Returns the numbers of a state.
    template <class Reals>
    void read(const ob::PlannerData &data, Reals &&reals) {
        ++snapshot_;
        const unsigned count = data.numVertices();
        const bool two = has_two_trees(data);
        std::vector<int> node_of(count);
        present_.clear();
        for (unsigned i = 0; i < count; ++i) {
            const ob::PlannerDataVertex &vertex = data.getVertex(i);
            node_of[i] = known(vertex.getState(), reals(vertex.getState()),
                               two && vertex.getTag() == 2 ? 1 : 0);
            if (nodes_[index(node_of[i])].snapshot != snapshot_) present_.push_back(node_of[i]);
            GraphNode &node = nodes_[index(node_of[i])];
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

    GraphNode &node(int v) { return nodes_[index(v)]; }
    const GraphNode &node(int v) const { return nodes_[index(v)]; }
    const double *place(int v) const { return &q_[index(v) * dof_]; }
    bool is_present(int v) const { return node(v).snapshot == snapshot_; }

    // Of the last snapshot: its nodes, links, and edges between the trees.
    const std::vector<int> &present() const { return present_; }
    const Pairs &links() const { return links_; }
    const Pairs &connections() const { return connections_; }
    /// The way from the start to a goal; empty if there is none.
    const std::vector<int> &way_to_goal() const { return way_; }

    /// Return the node of a state whose configuration has a hash; null if there is none.
    const GraphNode *find(const ob::State *state, std::uint64_t hash) const {
        const auto it = by_state_.find(state);
        return it != by_state_.end() && node(it->second).hash == hash ? &node(it->second) : nullptr;
    }

    /// Forget the state of a node: it is freed, and another one may come to its place.
    void forget(int v) {
        const auto it = by_state_.find(node(v).state);
        if (it != by_state_.end() && it->second == v) by_state_.erase(it);
    }

  private:
    /// Tell parents' edges from links and from motions between the trees.
    void sort_edges(bool two) {
        links_.clear();
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
            GraphNode &child = nodes_[index(v)];
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
            GraphNode &child = nodes_[index(down)];
            const bool is_undirected = directed.count(key(v, u)) > 0;
            if (is_undirected ? u < v : child.target >= 0 || leads_to(up, down))
                links_.emplace_back(u, v);
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
            const GraphNode &node = nodes_[index(it->second)];
            if (node.hash == hash && node.tree == tree) return it->second;
            it->second = static_cast<int>(nodes_.size());
        }
        nodes_.push_back({state, hash, tree});
        q_.insert(q_.end(), q, q + dof_);
        GraphNode &node = nodes_.back();
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
            const GraphNode &root = nodes_[index(way_.back())];
            const bool is_whole =
                way_.size() > 1 && root.tree == 0 && (root.is_root || root.number == 0);
            if (!is_whole) way_.clear();
        }
        std::reverse(way_.begin(), way_.end());
    }

    const std::size_t dof_;
    const std::vector<double> start_;
    std::vector<GraphNode> nodes_;
    std::vector<double> q_;
    std::unordered_map<const ob::State *, int> by_state_;
    int snapshot_ = 0;
    std::vector<int> present_, way_;
    Pairs edges_, links_, connections_;
};

}  // namespace brrt::detail
