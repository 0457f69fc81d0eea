// Record a motion planner in C++17 into an MCAP file for brrt to replay, judge, explain and view.
//
//     brrt::Options options;
//     options.world = brrt::World({0, 0}, {100, 100}).ball({50, 50}, 10);
//     options.start = {5, 5}, options.goal = {95, 95}, options.planner = "mine";
//     brrt::Recorder rec("run.mcap", options);
//     const int root = rec.edge({5, 5});
//     rec.sample({9, 20});
//     const int node = rec.edge({9, 20}, root);
//     rec.reject({60, 60}, node, brrt::Reason::collision);
//     rec.path({{5, 5}, {9, 20}, {95, 95}});
//
// The names are those of `brrt.record` in Python. The header needs no library.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "detail/metrics.hpp"
#include "detail/nodes.hpp"
#include "detail/writer.hpp"
#include "events.hpp"
#include "options.hpp"

namespace brrt {

/// Takes the events of a planner, from any thread, and writes them on a thread of its own.
///
/// Nodes of a tree are numbered 0, 1, 2 ...; tree 0 grows from the start, tree 1 from the goal.
/// Costs are lengths in the robot's metric, unless they are given; an iteration is a sample, unless
/// it is set. A value that no event can have throws `Error`, and so does a file that cannot be
/// opened. A file that cannot be written later, as on a full disk, is reported once and never
/// disturbs the planner: see `error`. A process that is killed leaves all but its last half second.
class Recorder {
  public:
    using Cost = std::optional<double>;

    /// Open a recording; an existing file is overwritten.
    Recorder(const std::string &path, Options options) : options_(std::move(options)) {
        if (path.size() < 5 || path.compare(path.size() - 5, 5, ".mcap") != 0)
            throw Error(path + ": name a file that ends in .mcap");
        detail::resolve(options_);
        const auto now = std::chrono::system_clock::now().time_since_epoch();
        const auto epoch_ns = static_cast<std::uint64_t>(
            std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
        try {
            auto file = std::make_unique<detail::McapFile>(path, "brrt.hpp");
            file->metadata("brrt.run", detail::manifest(options_, epoch_ns));
            file->attach("world.json", options_.world->to_json(), epoch_ns);
            const detail::Bytes declarations = file->declare(dof_);
            file->flush();
            if (!options_.on_error)
                options_.on_error = [](const std::string &why) {
                    std::fprintf(stderr, "brrt: %s\n", why.c_str());
                };
            writer_ = std::make_unique<detail::Writer>(std::move(file), declarations, epoch_ns,
                                                       options_.on_error);
        } catch (const std::system_error &error) {
            throw Error(error.what());
        }
        began_ = std::chrono::steady_clock::now();
        const auto lock = open();
        phase(Status::begin);
    }
    Recorder(const Recorder &) = delete;
    Recorder &operator=(const Recorder &) = delete;

    /// Close the file; an exception that leaves the scope ends the run as interrupted.
    ~Recorder() {
        try {
            if (std::uncaught_exceptions() > exceptions_) close(Status::interrupted);
            else close();
        } catch (...) {  // no memory: what was written before can be read
        }
    }

    /// Set the planner's iteration, for the next events; it must not fall.
    void iteration(std::int64_t value) {
        const auto lock = open();
        if (value < iteration_ || value >= std::int64_t{1} << 60)
            throw Error("iteration must be a whole number from " + std::to_string(iteration_) +
                        " on");
        iteration_ = value;
        counts_samples_ = false;
    }

    /// Record that a configuration was drawn.
    void sample(Configuration q, Source source = Source::uniform, int tree = 0) {
        need(q);
        const auto lock = open();
        nodes(tree);
        if (counts_samples_) ++iteration_;
        put(Kind::sample, [&](Fields &f) { f.add(byte(tree)).add(source).array(q.data(), dof_); });
    }

    /// Record that a node joined a tree, and return its number.
    ///
    /// @param parent Number of its parent; -1 for a root.
    /// @param cost Its cost-to-come; by default its parent's plus the distance.
    int edge(Configuration q, int parent = -1, Cost cost = {}, int tree = 0) {
        need(q);
        const auto lock = open();
        auto &tree_nodes = nodes(tree);
        const int number = tree_nodes.count();
        if (parent != -1) need("parent", parent, tree);
        const double total = cost         ? possible(*cost)
                             : parent < 0 ? 0
                                          : via(tree_nodes, parent, q.data());
        put(Kind::edge, [&](Fields &f) {
            f.add(byte(tree)).add(number).add(parent).add(total).array(q.data(), dof_);
        });
        tree_nodes.join(q.data(), parent, total);
        return number;
    }

    /// Record that an extension from a node, or a cell, towards a configuration was rejected.
    void reject(Configuration q, int node = 0, Reason reason = Reason::collision, int tree = 0) {
        need(q);
        const auto lock = open();
        const auto &tree_nodes = nodes(tree);
        const bool is_node =
            node < tree_nodes.count() ? tree_nodes.has(node) : node == 0 || node < cells_;
        if (node < 0 || !is_node)
            throw Error("node must be a node of the tree or an expanded cell, not " +
                        std::to_string(node));
        put(Kind::reject,
            [&](Fields &f) { f.add(byte(tree)).add(node).add(reason).array(q.data(), dof_); });
    }

    /// Record that a node got another parent; the costs of its descendants follow.
    ///
    /// @param cost Its new cost-to-come; by default its parent's plus the distance.
    void rewire(int node, int parent, Cost cost = {}, int tree = 0) {
        const auto lock = open();
        auto &tree_nodes = nodes(tree);
        need("node", node, tree);
        need("parent", parent, tree);
        if (tree_nodes.descends(parent, node))
            throw Error("parent of node " + std::to_string(node) + " must not descend from it");
        const double total =
            cost ? possible(*cost) : via(tree_nodes, parent, tree_nodes.place(node));
        put(Kind::rewire, [&](Fields &f) { f.add(byte(tree)).add(node).add(parent).add(total); });
        tree_nodes.move(node, parent, total);
    }

    /// Record a free motion between a node of tree 0 and one of tree 1.
    ///
    /// @param cost Of the path over the link; by default by the costs of the nodes.
    void connect(int node, int other, Cost cost = {}) {
        const auto lock = open();
        need("node", node, 0);
        need("other", other, 1);
        const double total =
            cost ? possible(*cost)
                 : via(trees_[0], node, trees_[1].place(other)) + known_cost(trees_[1], other);
        put(Kind::connect, [&](Fields &f) { f.add(node).add(other).add(total); });
    }

    /// Record a path from start to goal: its waypoints one after another.
    ///
    /// @param cost Its cost; by default its length in the robot's metric.
    /// @param stage By default the first path is raw and those after it are improved.
    void path(const std::vector<Point> &waypoints, Cost cost = {},
              std::optional<Stage> stage = {}) {
        std::vector<double> flat;
        for (const Point &q : waypoints) {
            need(q, "waypoints");
            flat.insert(flat.end(), q.begin(), q.end());
        }
        if (flat.empty()) throw Error("waypoints must be one configuration at least");
        double total = 0;
        for (std::size_t i = dof_; i < flat.size(); i += dof_)
            total += distance(&flat[i - dof_], &flat[i]);
        if (cost) total = possible(*cost);
        const auto lock = open();
        const Stage kept = stage.value_or(metrics_.solved() ? Stage::improved : Stage::raw);
        put(
            Kind::path,
            [&](Fields &f) {
                f.add(kept)
                    .add(total)
                    .add(static_cast<std::uint32_t>(flat.size()))
                    .array(flat.data(), flat.size());
            },
            flat.size());
        metrics_.path(kept, total, std::move(flat), last_t_, iteration_);
    }

    /// Record that a search expanded a cell.
    ///
    /// @param parent Number of the cell that it was reached from; -1 for the first of a search.
    /// @param cost Its cost from the first cell of the search.
    void expand(int cell, int parent, Configuration q, double cost) {
        need(q);
        const auto lock = open();
        if (cell < 0 || parent < -1) throw Error("cell and parent must be numbers of cells");
        const double total = possible(cost);
        put(Kind::expand,
            [&](Fields &f) { f.add(cell).add(parent).add(total).array(q.data(), dof_); });
        cells_ = std::max(cells_, cell + 1);
    }

    /// Record that a node joined without an edge, and return its number; it has no cost until
    /// `rewire` gives it a parent.
    int vertex(Configuration q, int tree = 0) {
        need(q);
        const auto lock = open();
        auto &tree_nodes = nodes(tree);
        const int number = tree_nodes.count();
        put(Kind::vertex, [&](Fields &f) { f.add(byte(tree)).add(number).array(q.data(), dof_); });
        tree_nodes.join_vertex(q.data());
        return number;
    }

    /// Record an edge of a graph, which leads both ways and changes no parent.
    ///
    /// @param cost Its cost, which replaces that of an earlier link; by default the distance.
    void link(int node, int other, Cost cost = {}, int tree = 0) {
        const auto lock = open();
        auto &tree_nodes = nodes(tree);
        need("node", node, tree);
        need("other", other, tree);
        if (node == other)
            throw Error("other must not be the node itself, " + std::to_string(node));
        const double total =
            cost ? possible(*cost) : distance(tree_nodes.place(node), tree_nodes.place(other));
        put(Kind::link, [&](Fields &f) { f.add(byte(tree)).add(node).add(other).add(total); });
        tree_nodes.link(node, other);
    }

    /// Record that an edge was removed: the link of two nodes, or the edge to a parent.
    ///
    /// @param other Number of the other end; by default (-1) the node's parent.
    void cut(int node, int other = -1, int tree = 0) {
        const auto lock = open();
        auto &tree_nodes = nodes(tree);
        need("node", node, tree);
        const int end = other == -1 ? tree_nodes.parent(node) : other;
        need("other", end, tree);
        if (!tree_nodes.has_edge(node, end))
            throw Error("other must be joined to node " + std::to_string(node) + ", not " +
                        std::to_string(end));
        put(Kind::cut, [&](Fields &f) { f.add(byte(tree)).add(node).add(end); });
        tree_nodes.cut(node, end);
    }

    /// Record that a node was removed with all its edges; its number stays unused.
    void remove(int node, int tree = 0) {
        const auto lock = open();
        need("node", node, tree);
        put(Kind::remove, [&](Fields &f) { f.add(byte(tree)).add(node); });
        nodes(tree).remove(node);
    }

    /// Record that a motion was checked for collisions.
    ///
    /// @param node Number of the node at which it begins; -1 if it begins at none.
    /// @param other Number of the node at which it ends; -1 if it ends at none.
    /// @param part How much of it is free, from 0 to 1 for all of it.
    /// @param q The configuration at which it ends; by default that of `other`.
    void check(int node, int other, double part = 1, Configuration q = {}, int tree = 0) {
        if (!(part >= 0 && part <= 1)) throw Error("part must be a number from 0 to 1");
        if (q.size()) need(q);
        const auto lock = open();
        if (node != -1) need("node", node, tree);
        if (other != -1) need("other", other, tree);
        else if (!q.size()) throw Error("q must be given for a motion that ends at no node");
        const double *end = q.size() ? q.data() : nodes(tree).place(other);
        put(Kind::check,
            [&](Fields &f) { f.add(byte(tree)).add(node).add(other).add(part).array(end, dof_); });
    }

    /// Wait until the events so far are handed to the operating system.
    void flush() { writer_->flush(); }

    /// End the run and close the file; calls after the first do nothing.
    ///
    /// @param status How planning ended; by default solved if there is a path, else that a limit of
    ///     iterations was reached.
    void close(std::optional<Status> status = {}) {
        detail::McapFile::Texts result;
        {
            const auto lock = writer_->lock();
            if (std::exchange(closed_, true)) return;
            phase(status.value_or(metrics_.solved() ? Status::solved : Status::iteration_limit));
            result = metrics_.texts(dof_, iteration_);
        }
        result["planner"] = detail::json_text(options_.planner);
        result["world"] = detail::json_text(options_.world->name());
        result["robot"] = detail::json_text(options_.robot->spec);
        result["seed"] = std::to_string(options_.seed);
        writer_->close(result);
    }

    /// Why the file cannot be written any more; empty if it can. What was written before can be
    /// read.
    std::string error() const { return writer_->error(); }

    /// Number of events so far.
    std::uint64_t events() const {
        const auto lock = writer_->lock();
        return writer_->count();
    }

    /// The cost-to-come of a node; none if no root is above it.
    Cost cost(int node, int tree = 0) {
        const auto lock = open();
        need("node", node, tree);
        const double found = nodes(tree).cost(node);
        return std::isfinite(found) ? Cost(found) : Cost();
    }

    /// The distance between two configurations in the robot's metric.
    double distance(Configuration a, Configuration b) const {
        need(a);
        need(b);
        return distance(a.data(), b.data());
    }

  private:
    using Fields = detail::Fields;
    using Lock = detail::Writer::Lock;

    static std::uint8_t byte(int tree) { return static_cast<std::uint8_t>(tree); }

    /// Lock the recorder; wait while the disk is far behind.
    Lock open() const {
        Lock lock = writer_->lock();
        if (closed_) throw Error("the recording is closed");
        return lock;
    }

    /// Append an event with fields, `numbers` of which may come on top of a configuration.
    template <class Fill>
    void put(Kind kind, Fill &&fill, std::size_t numbers = 0) {
        const auto measured = std::chrono::steady_clock::now() - began_;
        const std::int64_t t =
            options_.clock ? options_.clock()
                           : std::chrono::duration_cast<std::chrono::nanoseconds>(measured).count();
        last_t_ = std::max(t, last_t_ + 1);
        writer_->put(kind, last_t_, iteration_, 64 + 8 * (dof_ + numbers),
                     std::forward<Fill>(fill));
        metrics_.count(kind);
    }

    void phase(Status status) {
        put(Kind::phase, [&](Fields &f) { f.add(Phase::plan).add(status); });
        metrics_.phase(status, last_t_);
    }

    detail::Nodes &nodes(int tree) {
        if (tree != 0 && tree != 1) throw Error("tree must be 0 or 1, not " + std::to_string(tree));
        return trees_[tree];
    }

    /// Throw unless a configuration is one.
    void need(Configuration q, const char *name = "q") const {
        if (q.size() != dof_ || !detail::possible(q))
            throw Error(std::string(name) + " must be " + std::to_string(dof_) + " finite numbers");
    }

    /// Throw unless a node exists.
    void need(const char *name, int node, int tree) {
        if (!nodes(tree).has(node))
            throw Error(std::string(name) + " must be a node of tree " + std::to_string(tree) +
                        ", not " + std::to_string(node));
    }

    static double possible(double cost) {
        if (!(std::abs(cost) < detail::kGreatest)) throw Error("cost must be a finite number");
        return cost;
    }

    static double known_cost(const detail::Nodes &nodes, int node) {
        const double cost = nodes.cost(node);
        if (std::isinf(cost))
            throw Error("cost must be given: no root is above node " + std::to_string(node));
        return cost;
    }

    /// Return the cost of a configuration by way of a node.
    double via(const detail::Nodes &nodes, int node, const double *q) const {
        return known_cost(nodes, node) + distance(nodes.place(node), q);
    }

    double distance(const double *a, const double *b) const {
        if (options_.robot->distance) return options_.robot->distance(a, b);
        double squares = 0;
        for (std::size_t k = 0; k < dof_; ++k) squares += (b[k] - a[k]) * (b[k] - a[k]);
        return std::sqrt(squares);
    }

    Options options_;
    const std::size_t dof_ = options_.start.size();
    const int exceptions_ = std::uncaught_exceptions();
    std::chrono::steady_clock::time_point began_;
    std::unique_ptr<detail::Writer> writer_;
    // What follows is used under the writer's lock.
    detail::Nodes trees_[2]{detail::Nodes(dof_), detail::Nodes(dof_)};
    detail::Metrics metrics_;
    std::int64_t iteration_ = 0, last_t_ = -1;
    int cells_ = 0;
    bool counts_samples_ = true, closed_ = false;
};

}  // namespace brrt
