// Records in the ways that tests/cpp/test_recorder.py asks for: record WAY FILE.
#include <brrt/brrt.hpp>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

brrt::Options options() {
    brrt::Options found;
    found.world = brrt::World({0, 0}, {10, 10}, "open");
    found.start = {1, 1};
    found.goal = {9, 9};
    found.planner = "mine";
    return found;
}

// The calls of `every_call` in test_recorder.py, at the times 1000, 2000 ...
void every(const std::string &path) {
    auto given = options();
    given.params = {{"step", 2}, {"name", "\xc3\xbc \"x\"\n"}, {"on", true}};
    given.seed = 4;
    given.iterations = 100;
    given.time_limit = 2.5;
    given.contract = R"({"step": 8.0})";
    given.claims.edges = "assumed";
    given.claims.goal_tolerance = 0.5;
    given.clock = [t = std::int64_t{0}]() mutable { return t += 1000; };
    given.world->box({4, 0}, {5, 0.5}).ball({8, 1}, 0.25).polygon({{0, 9}, {0.5, 9}, {0.25, 9.5}});
    brrt::Recorder rec(path, given);
    rec.edge({1, 1});
    rec.sample({1, 9});
    const int node = rec.edge(std::array<double, 2>{1, 9}, 0);
    rec.sample({9, 9}, brrt::Source::goal);
    rec.reject({9, 9}, node, brrt::Reason::no_progress);
    rec.edge(std::vector<double>{4, 5}, node);
    rec.edge({9, 9}, 2, 20.0);
    rec.path({{1, 1}, {1, 9}, {4, 5}, {9, 9}});
    rec.rewire(2, 0);
    rec.edge({9, 8}, 3);
    rec.path({{1, 1}, {4, 5}, {9, 9}});
    rec.path({{1, 1}, {9, 9}}, 12.0, brrt::Stage::smoothed);
    rec.edge({9, 9}, -1, {}, 1);
    rec.edge({8, 8}, 0, {}, 1);
    rec.connect(1, 1);
    rec.iteration(7);
    rec.expand(3, -1, {2, 2}, 1.5);
    rec.vertex({3, 3});
    rec.link(0, 5);
    rec.link(5, 4, 9.0);
    rec.check(0, 5);
    rec.check(0, -1, 0.25, {7, 7});
    rec.cut(4, 5);
    rec.rewire(5, 0);
    rec.cut(5);
    rec.remove(2);
    rec.close(brrt::Status::iteration_limit);
    rec.close();
}

void threads(const std::string &path) {
    brrt::Recorder rec(path, options());
    rec.edge({1, 1});
    std::vector<std::thread> all;
    for (int k = 0; k < 4; ++k)
        all.emplace_back([&rec, k] {
            for (int i = 0; i < 20000; ++i) {
                rec.sample({k + 1.0, i / 2000.0});
                rec.edge({k + 1.0, i / 2000.0}, 0);
                if (i % 5000 == 0) rec.flush();
            }
        });
    for (auto &thread : all) thread.join();
}

// Records until it is killed, and prints how many events are older than half a second.
void forever(const std::string &path) {
    brrt::Recorder rec(path, options());
    rec.edge({1, 1});
    std::atomic<std::uint64_t> then{0};
    std::thread([&] {
        for (;;) {
            const auto now = rec.events();
            std::this_thread::sleep_for(std::chrono::milliseconds(500));
            then = now;
            std::printf("%llu\n", static_cast<unsigned long long>(now));
            std::fflush(stdout);
        }
    }).detach();
    for (double x = 0;; x = x < 9 ? x + 1e-5 : 0) {
        rec.sample({x, 1});
        std::this_thread::sleep_for(std::chrono::microseconds(20));
    }
}

// Records more than there is room for, and goes on.
void full(const std::string &path) {
    auto given = options();
    int reports = 0;
    given.on_error = [&reports](const std::string &) { ++reports; };
    brrt::Recorder rec(path, given);
    rec.edge({1, 1});
    for (int i = 0; i < 100000; ++i) rec.sample({1, 1});
    rec.flush();
    const int last = rec.edge({2, 2}, 0);
    rec.close();
    std::printf("%d report, node %d: %s\n", reports, last, rec.error().c_str());
}

template <class Call>
void refused(const char *what, Call &&call) {
    try {
        call();
        std::printf("%s: taken\n", what);
    } catch (const brrt::Error &error) {
        std::printf("%s: %s\n", what, error.what());
    }
}

void wrong(const std::string &path) {
    refused("name", [&] { brrt::Recorder(path + ".txt", options()); });
    refused("folder", [&] { brrt::Recorder("/nowhere/run.mcap", options()); });
    auto other = options();
    other.claims.motions = "curved";
    refused("claim", [&] { brrt::Recorder(path, other); });
    other = options();
    other.goal = {1, 2, 3};
    refused("goal", [&] { brrt::Recorder(path, other); });
    brrt::Recorder rec(path, options());
    rec.edge({1, 1});
    rec.edge({2, 1}, 0);
    refused("dof", [&] { rec.sample({1, 2, 3}); });
    refused("nan", [&] { rec.sample({std::nan(""), 1}); });
    refused("tree", [&] { rec.sample({1, 1}, brrt::Source::uniform, 2); });
    refused("parent", [&] { rec.edge({1, 1}, 2); });
    refused("cost", [&] { rec.edge({1, 1}, 0, HUGE_VAL); });
    refused("node", [&] { rec.reject({1, 1}, 5); });
    refused("circle", [&] { rec.rewire(0, 1); });
    refused("link", [&] { rec.link(1, 1); });
    refused("cut", [&] { rec.cut(0); });
    refused("path", [&] { rec.path({}); });
    refused("part", [&] { rec.check(0, 1, 1.5); });
    refused("iteration", [&] { rec.iteration(-1); });
    rec.vertex({3, 3});
    refused("loose", [&] { rec.edge({4, 4}, 2); });
    rec.remove(1);
    refused("removed", [&] { rec.edge({1, 1}, 1); });
    rec.close();
    refused("closed", [&] { rec.sample({1, 1}); });
}

void unknown(const std::string &path) {
    brrt::Options given;
    given.start = {0, 1, 2, 3, 4, 5, 6};
    given.goal = {1, 1, 1, 1, 1, 1, 1};
    brrt::Recorder rec(path, given);
    rec.edge(given.start);
    rec.edge(given.goal, 0);
    rec.path({given.start, given.goal});
}

void lorry(const std::string &path) {
    brrt::Grid grid;
    grid.rows = 3, grid.columns = 5, grid.resolution = 2;
    grid.blocked.assign(15, false);
    grid.blocked[7] = true;
    brrt::Options given;
    given.world = brrt::World({0, 0}, {10, 6}).grid(grid);
    given.robot = brrt::Robot::polygon({{{-0.5, -0.25}, {-0.5, 0.25}, {0.5, 0.25}, {0.5, -0.25}}});
    given.start = {1, 1, 0};
    given.goal = {9, 5, 3};
    brrt::Recorder rec(path, given);
    rec.edge({1, 1, 0});
    rec.edge({9, 1, -3}, 0);
    rec.edge({9, 5, 3}, 1);
    rec.path({{1, 1, 0}, {9, 1, -3}, {9, 5, 3}});
}

}  // namespace

int main(int, char **argv) {
    const std::string way = argv[1], path = argv[2];
    if (way == "every") every(path);
    if (way == "threads") threads(path);
    if (way == "forever") forever(path);
    if (way == "full") full(path);
    if (way == "wrong") wrong(path);
    if (way == "unknown") unknown(path);
    if (way == "lorry") lorry(path);
    if (way == "throws") {
        try {
            brrt::Recorder rec(path, options());
            rec.edge({1, 1});
            throw std::runtime_error("the planner failed");
        } catch (const std::runtime_error &error) {
            std::printf("%s\n", error.what());
        }
    }
    if (way == "aborts") {
        brrt::Recorder rec(path, options());
        rec.edge({1, 1});
        rec.flush();
        std::abort();
    }
}
