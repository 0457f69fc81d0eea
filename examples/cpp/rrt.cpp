// An RRT of its own, recorded by brrt: rrt run.mcap, then `brrt view run.mcap`.
#include <brrt/brrt.hpp>

#include <array>
#include <cmath>
#include <iostream>
#include <random>
#include <vector>

using Point = std::array<double, 2>;

struct Circle {
    Point centre;
    double radius;
};

const std::vector<Circle> circles{{{30, 40}, 15}, {{60, 70}, 12}, {{70, 30}, 18}};
constexpr double step = 4, size = 100;

double distance(const Point &a, const Point &b) { return std::hypot(b[0] - a[0], b[1] - a[1]); }

/// Whether a motion touches no circle, exactly.
bool is_free(const Point &a, const Point &b) {
    for (const auto &[c, radius] : circles) {
        const double dx = b[0] - a[0], dy = b[1] - a[1], squared = dx * dx + dy * dy;
        double part = squared > 0 ? ((c[0] - a[0]) * dx + (c[1] - a[1]) * dy) / squared : 0;
        part = std::fmin(1, std::fmax(0, part));
        if (distance({a[0] + part * dx, a[1] + part * dy}, c) <= radius) return false;
    }
    return true;
}

int main(int argc, char **argv) {
    const Point start{5, 5}, goal{95, 95};
    brrt::Options options;
    options.world = brrt::World({0, 0}, {size, size}, "circles");
    for (const auto &[centre, radius] : circles)
        options.world->ball({centre[0], centre[1]}, radius);
    options.start = {start[0], start[1]};
    options.goal = {goal[0], goal[1]};
    options.planner = "cpp-rrt";
    options.params = {{"step", step}};
    options.iterations = 20000;
    brrt::Recorder rec(argc > 1 ? argv[1] : "rrt.mcap", options);

    std::mt19937 random(1);
    std::uniform_real_distribution<double> coordinate(0, size);
    std::vector<Point> nodes{start};
    std::vector<int> parents{-1};
    rec.edge(start);
    for (int i = 0; i < *options.iterations; ++i) {
        const bool to_goal = i % 20 == 19;
        const Point sample = to_goal ? goal : Point{coordinate(random), coordinate(random)};
        rec.sample(sample, to_goal ? brrt::Source::goal : brrt::Source::uniform);

        int nearest = 0;
        for (int k = 1; k < static_cast<int>(nodes.size()); ++k)
            if (distance(nodes[k], sample) < distance(nodes[nearest], sample)) nearest = k;
        const Point from = nodes[nearest];
        const double far = distance(from, sample), part = far > step ? step / far : 1;
        const Point to{from[0] + part * (sample[0] - from[0]),
                       from[1] + part * (sample[1] - from[1])};
        if (far == 0 || !is_free(from, to)) {
            rec.reject(sample, nearest,
                       far == 0 ? brrt::Reason::no_progress : brrt::Reason::collision);
            continue;
        }
        nodes.push_back(to);
        parents.push_back(nearest);
        const int node = rec.edge(to, nearest);
        if (to == goal) {
            std::vector<std::vector<double>> path;
            for (int k = node; k >= 0; k = parents[k])
                path.insert(path.begin(), {nodes[k][0], nodes[k][1]});
            rec.path(path);
            std::cout << "a path of " << path.size() << " waypoints after " << i + 1
                      << " samples\n";
            return 0;
        }
    }
    std::cout << "no path\n";
    return 1;
}
