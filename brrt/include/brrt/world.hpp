// Worlds and robots, for brrt to draw them and to judge collisions.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "detail/base64.hpp"
#include "detail/json.hpp"

namespace brrt {

/// A value that no recording can have, or a file that cannot be opened.
class Error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

using Point = std::vector<double>;

/// A configuration of anybody's type: whatever has `data()` and `size()` (std::vector, std::array,
/// Eigen's vectors), numbers in braces, or a pointer and a count. It is read during the call only.
class Configuration {
  public:
    Configuration() = default;
    Configuration(const double *values, std::size_t count) : values_(values), count_(count) {}
    Configuration(std::initializer_list<double> values)
        : Configuration(values.begin(), values.size()) {}
    template <class T,
              class = decltype(static_cast<const double *>(std::declval<const T &>().data()))>
    Configuration(const T &values)
        : Configuration(values.data(), static_cast<std::size_t>(values.size())) {}

    const double *data() const { return values_; }
    std::size_t size() const { return count_; }

  private:
    const double *values_ = nullptr;
    std::size_t count_ = 0;
};

namespace detail {

constexpr double kGreatest = 1e100;  // of a coordinate, as in Python: squares must not overflow

inline bool possible(Configuration q) {
    // Not a number is not less than anything.
    return std::all_of(q.data(), q.data() + q.size(),
                       [](double x) { return std::abs(x) < kGreatest; });
}

/// Return a list of rows of numbers, each of which must have `width` of them (0: any number).
inline std::string rows(const std::string &name, const std::vector<Point> &values,
                        std::size_t width) {
    std::string text = "[";
    for (const Point &row : values) {
        if ((width && row.size() != width) || !possible(row))
            throw Error(name + " must be rows of " + std::to_string(width) + " finite numbers");
        text += (text.size() > 1 ? ", " : "") + json(row.data(), row.size());
    }
    return text + "]";
}

/// Return convex polygons as JSON; vertices in either direction.
inline std::string polygons(const std::string &name, const std::vector<std::vector<Point>> &parts) {
    std::string text = "[";
    for (const auto &part : parts) {
        const std::string vertices = rows(name, part, 2);
        bool left = false, right = false;
        for (std::size_t i = 0, n = part.size(); i < n; ++i) {
            const Point &a = part[i], &b = part[(i + 1) % n], &c = part[(i + 2) % n];
            const double turn = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
            left |= turn > 0, right |= turn < 0;
        }
        if (part.size() < 2 || (left && right))
            throw Error(name + " must be convex; cut it into convex parts");
        text += (text.size() > 1 ? ", " : "") + vertices;
    }
    return text + "]";
}

}  // namespace detail

/// An occupancy grid in the plane, as costmaps have it.
struct Grid {
    std::size_t rows = 0, columns = 0;
    std::vector<bool> blocked;  ///< Row by row; [0, 0] is at the origin, columns count along x.
    Point origin{0, 0};         ///< Corner of cell [0, 0].
    double resolution = 1;      ///< Side of a cell.
    double yaw = 0;             ///< Angle in radians by which the grid is turned about its origin.
};

/// Axis-aligned bounds in 2D or 3D with closed obstacles: touching one is a collision.
///
///     brrt::World world({0, 0}, {100, 100});
///     world.box({10, 10}, {20, 30}).ball({50, 50}, 8).polygon({{60, 60}, {80, 60}, {70, 75}});
class World {
  public:
    World(Point lower, Point upper, std::string name = "world")
        : lower_(std::move(lower)), upper_(std::move(upper)), name_(std::move(name)) {
        bool right = (dim() == 2 || dim() == 3) && upper_.size() == dim();
        right = right && detail::possible(lower_) && detail::possible(upper_);
        for (std::size_t k = 0; right && k < dim(); ++k) right = lower_[k] < upper_[k];
        if (!right) throw Error("bounds must be 2 or 3 numbers each, upper above lower");
    }

    /// A world of which nothing is known; it is drawn around points, such as start and goal.
    static World unknown(const std::vector<Point> &points) {
        Point low = points.at(0), high = low;
        double longest = 0, farthest = 0;
        for (std::size_t k = 0; k < low.size(); ++k) {
            for (const Point &p : points) {
                low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
                farthest = std::max(farthest, std::abs(p[k]));
            }
            longest = std::max(longest, high[k] - low[k]);
        }
        double size = std::max(longest, 1e-6 * farthest);
        if (size == 0) size = 1;
        for (std::size_t k = 0; k < low.size(); ++k) {
            // No side is shorter than a tenth of the longest.
            const double more = std::max(0.05 * size, (0.1 * size - (high[k] - low[k])) / 2);
            low[k] -= more, high[k] += more;
        }
        World world(low, high, "none");
        world.bounded_ = false;
        return world;
    }

    /// Add a box, from its least to its greatest corner.
    World &box(const Point &low, const Point &high) {
        Point row = low;
        row.insert(row.end(), high.begin(), high.end());
        for (std::size_t k = 0; k < std::min(low.size(), high.size()); ++k)
            if (low[k] > high[k]) throw Error("a box must have its minimum below its maximum");
        boxes_.push_back(row);
        return *this;
    }

    /// Add a circle or a sphere.
    World &ball(const Point &centre, double radius) {
        if (!(radius >= 0)) throw Error("radius must be at least 0");
        balls_.push_back(centre);
        balls_.back().push_back(radius);
        return *this;
    }

    /// Add a convex polygon; in 2D.
    World &polygon(std::vector<Point> vertices) {
        if (dim() != 2) throw Error("polygons are for 2D worlds");
        polygons_.push_back(std::move(vertices));
        return *this;
    }

    /// Take an occupancy grid; in 2D.
    World &grid(Grid grid) {
        if (dim() != 2) throw Error("grids are for 2D worlds");
        if (grid.rows == 0 || grid.columns == 0 || grid.blocked.size() != grid.rows * grid.columns)
            throw Error("grid: blocked must have rows x columns values");
        if (!(grid.resolution > 0) || grid.origin.size() != 2)
            throw Error("grid: resolution must be above 0");
        grid_ = {std::move(grid)};
        return *this;
    }

    std::size_t dim() const { return lower_.size(); }
    const std::string &name() const { return name_; }

    /// The world as brrt reads it.
    std::string to_json() const {
        const std::string version = bounded_ ? grid_.empty() ? "1" : "2" : "3";
        std::string text = "{\"schema\": \"brrt.world\", \"version\": " + version;
        text += ", \"name\": " + detail::json_text(name_);
        text += ", \"lower\": " + detail::json(lower_.data(), dim());
        text += ", \"upper\": " + detail::json(upper_.data(), dim());
        if (!balls_.empty()) text += ", \"balls\": " + detail::rows("balls", balls_, dim() + 1);
        if (!boxes_.empty()) text += ", \"boxes\": " + detail::rows("boxes", boxes_, 2 * dim());
        if (!polygons_.empty())
            text += ", \"polygons\": " + detail::polygons("polygons", polygons_);
        for (const Grid &grid : grid_) {
            text += ", \"grid\": {\"rows\": " + std::to_string(grid.rows);
            text += ", \"columns\": " + std::to_string(grid.columns);
            text += ", \"origin\": " + detail::json(grid.origin.data(), 2);
            text += ", \"resolution\": " + detail::json(grid.resolution) +
                    ", \"yaw\": " + detail::json(grid.yaw);
            text += ", \"cells\": \"" +
                    detail::base64(detail::zlib_stored(detail::packed(grid.blocked))) + "\"}";
        }
        return text + (bounded_ ? "}" : ", \"bounded\": false}");
    }

  private:
    Point lower_, upper_;
    std::string name_;
    std::vector<Point> balls_, boxes_;
    std::vector<std::vector<Point>> polygons_;
    std::vector<Grid> grid_;  // one, or none
    bool bounded_ = true;
};

/// What moves: its name and definition as brrt reads them, and its metric, which costs have by
/// default.
struct Robot {
    std::string kind;        ///< A registered robot.
    std::string definition;  ///< JSON, as `Robot.to_json()` of brrt in Python.
    std::string spec;        ///< What a scenario says of it: the kind, with parameters.
    std::size_t dof = 0;     ///< Numbers in a configuration; 0 for as many as the start has.
    std::function<double(const double *, const double *)> distance;

    /// A point in the plane or in space.
    static Robot point() { return {"point", head("point") + "}", "point", 0, nullptr}; }

    /// A body of convex polygons in the plane, at pose (x, y, theta) = (0, 0, 0). Its metric is
    /// hypot(dx, dy) + radius |dtheta|, where radius is the largest distance of a vertex from (0,
    /// 0).
    static Robot polygon(const std::vector<std::vector<Point>> &parts) {
        double radius = 0;
        const std::string json = detail::polygons("polygons of the robot", parts);
        for (const auto &part : parts)
            for (const Point &vertex : part)
                radius = std::max(radius, std::hypot(vertex[0], vertex[1]));
        const auto distance = [radius](const double *a, const double *b) {
            constexpr double kTurn = 6.283185307179586;
            return std::hypot(b[0] - a[0], b[1] - a[1]) +
                   radius * std::abs(std::remainder(b[2] - a[2], kTurn));
        };
        return {"polygon", head("polygon") + ", \"polygons\": " + json + "}", "polygon", 3,
                distance};
    }

    /// A robot of which nothing is known but how many numbers a configuration has, 1 to 32; the
    /// first of them are drawn as a position. Nothing is said of its collisions; its metric is
    /// Euclidean.
    static Robot opaque(std::size_t dof, std::size_t drawn = 2) {
        if (dof < 1 || dof > 32)
            throw Error("a configuration must have 1 to 32 numbers, not " + std::to_string(dof));
        const std::string count = std::to_string(dof);
        const std::string json = head("opaque") + ", \"numbers\": " + count +
                                 ", \"drawn\": " + std::to_string(drawn) + "}";
        return {"opaque", json, "opaque:numbers=" + count, dof, nullptr};
    }

  private:
    static std::string head(const std::string &kind) {
        return "{\"schema\": \"brrt.robot\", \"version\": 1, \"kind\": \"" + kind + "\"";
    }
};

}  // namespace brrt
