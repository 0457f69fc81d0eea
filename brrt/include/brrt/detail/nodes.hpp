// The nodes of a recorded tree or graph, for numbers and costs that the caller leaves out.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <unordered_set>
#include <vector>

namespace brrt::detail {

/// The nodes of a tree, or of a graph: each has a parent or none, and may have links.
class Nodes {
  public:
    explicit Nodes(std::size_t dof) : dof_(dof) {}

    int count() const { return static_cast<int>(parent_.size()); }
    int parent(int node) const { return parent_[index(node)]; }
    const double *place(int node) const { return &q_[index(node) * dof_]; }
    bool has(int node) const {
        return node >= 0 && node < count() && state_[index(node)] != State::removed;
    }

    /// Return a node's cost-to-come; infinite if no root is above it.
    double cost(int node) const {
        if (loose_ == 0) return cost_[index(node)];
        int root = node;
        while (parent(root) >= 0) root = parent(root);
        const bool reached = state_[index(root)] == State::joined;
        return reached ? cost_[index(node)] : std::numeric_limits<double>::infinity();
    }

    /// Add a node; with a parent of -1 it is a root.
    void join(const double *q, int parent, double cost) { append(q, parent, cost, State::joined); }

    /// Add a node that is no root and has no parent.
    void join_vertex(const double *q) {
        append(q, -1, 0, State::loose);
        ++loose_;
    }

    /// Give a node another parent; its descendants' costs follow.
    void move(int node, int parent, double cost) {
        know_children();
        leave(node);
        parent_[index(node)] = parent;
        enter(node);
        set(node, State::joined);
        const double change = cost - cost_[index(node)];
        below_.assign(1, node);
        while (!below_.empty()) {
            const int at = below_.back();
            below_.pop_back();
            cost_[index(at)] += change;
            for (int child = first_[index(at)]; child >= 0; child = next_[index(child)])
                below_.push_back(child);
        }
    }

    void link(int node, int other) { links_.insert(pair(node, other)); }

    bool has_edge(int node, int other) const {
        return parent(node) == other || parent(other) == node ||
               links_.count(pair(node, other)) > 0;
    }

    /// Remove the link between two nodes, and the edge if one is the other's parent.
    void cut(int node, int other) {
        links_.erase(pair(node, other));
        if (parent(node) == other) detach(node);
        if (parent(other) == node) detach(other);
    }

    /// Remove a node; its children have no parent then.
    void remove(int node) {
        know_children();
        while (first_[index(node)] >= 0) detach(first_[index(node)]);
        detach(node);
        set(node, State::removed);
    }

    /// Whether a node is another one, or descends from it.
    bool descends(int node, int ancestor) const {
        while (node >= 0 && node != ancestor) node = parent(node);
        return node == ancestor;
    }

  private:
    enum class State : std::uint8_t { joined, loose, removed };

    static std::size_t index(int node) { return static_cast<std::size_t>(node); }

    static std::uint64_t pair(int a, int b) {
        return static_cast<std::uint64_t>(std::min(a, b)) << 32 |
               static_cast<std::uint32_t>(std::max(a, b));
    }

    void append(const double *q, int parent, double cost, State state) {
        q_.insert(q_.end(), q, q + dof_);
        parent_.push_back(parent);
        cost_.push_back(cost);
        state_.push_back(state);
        if (knows_children_) {
            for (auto *list : {&first_, &next_, &before_}) list->push_back(-1);
            enter(count() - 1);
        }
    }

    void set(int node, State state) {
        State &now = state_[index(node)];
        loose_ += static_cast<int>(state == State::loose) - static_cast<int>(now == State::loose);
        now = state;
    }

    void detach(int node) {
        know_children();
        leave(node);
        parent_[index(node)] = -1;
        set(node, State::loose);
    }

    /// List the children of each node, once they are needed.
    void know_children() {
        if (knows_children_) return;
        knows_children_ = true;
        for (auto *list : {&first_, &next_, &before_}) list->assign(parent_.size(), -1);
        for (int node = 0; node < count(); ++node) enter(node);
    }

    void enter(int node) {
        const int up = parent(node);
        if (up < 0) return;
        const int other = first_[index(up)];
        next_[index(node)] = other;
        before_[index(node)] = -1;
        if (other >= 0) before_[index(other)] = node;
        first_[index(up)] = node;
    }

    void leave(int node) {
        const int up = parent(node), next = next_[index(node)], before = before_[index(node)];
        if (up < 0) return;
        (before >= 0 ? next_[index(before)] : first_[index(up)]) = next;
        if (next >= 0) before_[index(next)] = before;
    }

    std::size_t dof_;
    std::vector<double> q_, cost_;
    std::vector<int> parent_, first_, next_, before_, below_;
    std::vector<State> state_;
    std::unordered_set<std::uint64_t> links_;
    int loose_ = 0;
    bool knows_children_ = false;
};

}  // namespace brrt::detail
