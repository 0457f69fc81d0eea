// The metrics of a run, as `brrt replay` folds them from its events.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "../events.hpp"
#include "json.hpp"

namespace brrt::detail {

/// Counts events, and keeps the paths.
class Metrics {
  public:
    void count(Kind kind) { ++counts_[static_cast<std::size_t>(kind)]; }

    void phase(Status status, std::int64_t t) {
        (status == Status::begin ? began_ : ended_) = t;
        status_ = status;
    }

    void path(Stage stage, double cost, std::vector<double> waypoints, std::int64_t t,
              std::int64_t iteration) {
        Path found{cost, std::move(waypoints)};
        if (stage == Stage::smoothed) {
            smoothed_ = std::move(found);
            return;
        }
        if (!solved()) first_ = {t, iteration, cost};
        raw_ = std::move(found);
    }

    bool solved() const { return !raw_.waypoints.empty(); }

    /// Return each metric as JSON.
    std::map<std::string, std::string> texts(std::size_t dof, std::int64_t iterations) const {
        const auto seconds = [this](std::int64_t t) {
            return json(static_cast<double>(t - began_) / 1e9);
        };
        std::uint64_t events = 0;
        std::map<std::string, std::string> found;
        for (std::size_t kind = 0; kind < kKindCount; ++kind) {
            events += counts_[kind];
            if (kKinds[kind].count) found[kKinds[kind].count] = std::to_string(counts_[kind]);
        }
        const auto of = [this](Kind kind) { return counts_[static_cast<std::size_t>(kind)]; };
        const Path &last = smoothed_.waypoints.empty() ? raw_ : smoothed_;
        const std::string none = "null";
        found["solved"] = solved() ? "true" : "false";
        found["status"] = json_text(kStatusLabels[static_cast<std::size_t>(status_)]);
        found["iterations"] = std::to_string(iterations);
        found["events"] = std::to_string(events);
        found["nodes"] = std::to_string(of(Kind::edge) + of(Kind::vertex) - of(Kind::remove));
        found["path_cost"] = raw_.cost_text();
        found["path"] = raw_.text(dof);
        found["smoothed_cost"] = smoothed_.cost_text();
        found["smoothed_path"] = smoothed_.text(dof);
        found["plan_time_s"] = seconds(ended_);
        found["smooth_time_s"] = none;
        found["moves"] =
            last.waypoints.empty() ? none : std::to_string(last.waypoints.size() / dof - 1);
        found["first_path_s"] = solved() ? seconds(first_.t) : none;
        found["first_path_iteration"] = solved() ? std::to_string(first_.iteration) : none;
        found["first_path_cost"] = solved() ? json(first_.cost) : none;
        for (const char *name : {"max_move_time_s", "deadline_misses", "charged_moves", "stays"})
            found[name] = none;
        return found;
    }

  private:
    struct Path {
        double cost = 0;
        std::vector<double> waypoints;

        std::string cost_text() const { return waypoints.empty() ? "null" : json(cost); }
        std::string text(std::size_t dof) const {
            std::string rows;
            for (std::size_t i = 0; i < waypoints.size(); i += dof)
                rows += (i ? ", " : "") + json(&waypoints[i], dof);
            return waypoints.empty() ? "null" : "[" + rows + "]";
        }
    };
    struct First {
        std::int64_t t = 0, iteration = 0;
        double cost = 0;
    };

    std::array<std::uint64_t, kKindCount> counts_{};
    std::int64_t began_ = 0, ended_ = 0;
    Status status_ = Status::begin;
    Path raw_, smoothed_;
    First first_;
};

}  // namespace brrt::detail
