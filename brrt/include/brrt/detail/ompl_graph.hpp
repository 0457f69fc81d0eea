// From snapshots of a planner's graph to events: what is new, what changed, and when it was
// checked.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <ompl/base/PlannerData.h>

#include "../brrt.hpp"
#include "ompl_snapshot.hpp"

namespace brrt::detail {

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
class GraphFollower {
  public:
    GraphFollower(Recorder &rec, std::size_t dof, std::vector<double> start)
        : rec_(rec), dof_(dof), graph_(dof, std::move(start)) {}

    /// Record what differs between a snapshot and the one before.
    ///
    /// @param reals Returns the numbers of a state.
    /// @param at Set to the moment of each event; then the moment of the snapshot.
    template <class Reals>
    void follow(const ob::PlannerData &data, const Observations &seen, Reals &&reals, Moment &at) {
        const Moment now = at;
        graph_.read(data, reals);
        changes_.clear();
        for (int v : graph_.present()) {
            const GraphNode &node = graph_.node(v);
            if (node.number < 0 || node.parent != node.target) change(v, node.target);
        }
        for (const auto &[a, b] : graph_.links())
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

    const SnapshotReader &graph() const { return graph_; }

  private:
    struct Change {
        int node, other;
        bool is_link;
        std::size_t check;
    };
    static constexpr std::size_t kNoCheck = std::numeric_limits<std::size_t>::max();

    static std::uint64_t pair(int a, int b) {
        return static_cast<std::uint64_t>(std::min(a, b)) << 32 |
               static_cast<std::uint32_t>(std::max(a, b));
    }
    Configuration view(const double *q) const { return {q, dof_}; }
    void begin(const Moment &at) { rec_.iteration(at.iteration); }

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
                wanted[motion_key(graph_.node(each.node).hash, graph_.node(each.other).hash)] = i;
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
        const GraphNode &a = graph_.node(change.node), &b = graph_.node(change.other);
        rec_.link(a.number, b.number, {}, a.tree);
    }

    /// Give a node its parent: after its new ancestors, and after all if it would make a circle.
    void settle(int v) {
        chain_.assign(1, v);
        bool all = false;
        for (int u = graph_.node(v).target; u >= 0; u = graph_.node(u).target) {
            if (!all && graph_.node(v).number >= 0) all = descends(u, v);
            if (!all && graph_.node(u).number >= 0) break;
            chain_.push_back(u);
        }
        for (; !chain_.empty(); chain_.pop_back()) apply(chain_.back());
    }

    bool descends(int node, int ancestor) const {
        while (node >= 0 && node != ancestor) node = graph_.node(node).parent;
        return node == ancestor;
    }

    void apply(int v) {
        GraphNode &node = graph_.node(v);
        const bool is_new = node.number < 0;
        if (!is_new && node.parent == node.target) return;
        if (node.target >= 0) {
            const int up = graph_.node(node.target).number;
            const Recorder::Cost cost = cost_below(node.target, v);
            if (is_new) node.number = rec_.edge(view(graph_.place(v)), up, cost, node.tree);
            else rec_.rewire(node.number, up, cost, node.tree);
        } else if (!is_new) {
            rec_.cut(node.number, -1, node.tree);
        } else if (node.is_root && !has_root_[node.tree]) {
            node.number = rec_.edge(view(graph_.place(v)), -1, {}, node.tree);
            has_root_[node.tree] = true;
        } else {
            node.number = rec_.vertex(view(graph_.place(v)), node.tree);
        }
        node.parent = node.target;
    }

    /// Return the cost of a node from the node without a parent above it, if that is no root, as
    /// where there are several goals; none for the recorder's default.
    Recorder::Cost cost_below(int up, int v) const {
        const GraphNode &parent = graph_.node(up);
        if (rec_.cost(parent.number, parent.tree)) return {};
        double cost = rec_.distance(view(graph_.place(up)), view(graph_.place(v)));
        for (int at = up; graph_.node(at).parent >= 0; at = graph_.node(at).parent)
            cost +=
                rec_.distance(view(graph_.place(graph_.node(at).parent)), view(graph_.place(at)));
        return cost;
    }

    /// Record a blocked motion as rejected, from the end of it that is a node.
    void reject(const Observation &event, const Observations &seen) {
        const double *const from = &seen.reals[event.place], *const to = from + dof_;
        if (const GraphNode *node = numbered(event.from, event.from_hash))
            rec_.reject(view(to), node->number, Reason::collision, node->tree);
        else if (const GraphNode *end = numbered(event.to, event.to_hash))
            rec_.reject(view(from), end->number, Reason::collision, end->tree);
    }

    const GraphNode *numbered(const ob::State *state, std::uint64_t hash) const {
        const GraphNode *node = graph_.find(state, hash);
        return node && node->number >= 0 ? node : nullptr;
    }

    /// Record the motions that join the trees.
    void connect() {
        for (auto [u, v] : graph_.connections()) {
            if (!connected_.insert(pair(u, v)).second) continue;
            const bool swapped = graph_.node(u).tree == 1;
            const GraphNode &a = graph_.node(swapped ? v : u), &b = graph_.node(swapped ? u : v);
            const double far = rec_.distance(view(graph_.place(swapped ? v : u)),
                                             view(graph_.place(swapped ? u : v)));
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
        for (auto [a, b] : graph_.links()) now.insert(pair(a, b));
        for (auto it = links_.begin(); it != links_.end();) {
            if (now.count(*it)) {
                ++it;
                continue;
            }
            const int a = static_cast<int>(*it >> 32), b = static_cast<int>(*it & 0xFFFFFFFF);
            if (graph_.is_present(a) && graph_.is_present(b))
                rec_.cut(graph_.node(a).number, graph_.node(b).number, graph_.node(a).tree);
            it = links_.erase(it);
        }
    }

    /// Record that nodes of the last snapshot are gone.
    void remove_missing() {
        for (int v : alive_) {
            GraphNode &node = graph_.node(v);
            if (graph_.is_present(v) || node.number < 0) continue;
            rec_.remove(node.number, node.tree);
            node.number = -1;
            graph_.forget(v);
        }
        alive_ = graph_.present();
    }

    Recorder &rec_;
    const std::size_t dof_;
    SnapshotReader graph_;
    std::unordered_set<std::uint64_t> links_, connected_;  // as they are recorded
    bool has_root_[2]{false, false};
    std::vector<int> alive_, chain_;
    std::vector<Change> changes_;
};

}  // namespace brrt::detail
