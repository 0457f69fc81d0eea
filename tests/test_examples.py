"""The experiments of examples/, as a user runs them, and what they are there to show.

Planners are compared by iterations and by the extensions they try, never by the clock.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from brrt import Problem, Run, Scenario
from tests.conftest import Result

EXAMPLES = Path(__file__).parents[1] / "examples"
FILES = sorted(EXAMPLES.glob("*.toml"))
SEEDS = 15
CLASSIC = ["house-easy", "arm-easy"]


def promised(path: Path) -> str:
    """The first word of the file: what comes out."""
    return path.read_text().split()[1].rstrip(":")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_runs_as_its_first_line_says(path: Path, brrt: Callable[..., Result]) -> None:
    """Exit code 0 or 1; the recording verifies, and replays to the same figures."""
    done = brrt("plan", path, "--out", "run.mcap", "--json")
    assert done.err == "" or "compiling" in done.err
    outcome = promised(path)
    assert outcome in {"Solved", "Unsolved"}
    assert done.code == (0 if outcome == "Solved" else 1)
    assert done.json["solved"] == (outcome == "Solved")
    assert brrt("replay", "run.mcap", "--json").json == done.json
    checked = brrt("verify", "run.mcap", "--json")
    assert checked.code == 0, checked.out
    assert checked.json["holds"]


def test_the_unreachable_goal_ends_in_the_budget(brrt: Callable[..., Result]) -> None:
    """The run says so to people too, and so does its recording."""
    file = EXAMPLES / "arm-unreachable.toml"
    done = brrt("plan", file, "--out", "run.mcap")
    assert done.code == 1
    assert "not solved, iteration limit" in done.out
    replayed = brrt("replay", "run.mcap")
    assert replayed.code == 0
    assert "not solved, iteration limit" in replayed.out
    figures = brrt("replay", "run.mcap", "--json").json
    assert figures["iterations"] == Scenario.load(file).iterations
    assert figures["path"] is None


def test_the_readme_names_every_file() -> None:
    """None is left unexplained."""
    text = (EXAMPLES / "README.md").read_text()
    for path in FILES:
        assert f"`{path.name}`" in text


@cache
def _figures(name: str, planner: str) -> list[dict[str, Any]]:
    """Run a scenario file with many seeds, or the standard planner in its place."""
    base = Scenario.load(EXAMPLES / f"{name}.toml")
    if planner != base.planner:
        assert planner == "rrt"
        params: Mapping[str, Any] = Scenario.load(EXAMPLES / "house-easy.toml").params
        base = replace(base, planner=planner, params=params)
    return [Run(replace(base, seed=seed)).execute().as_dict() for seed in range(SEEDS)]


def extensions(figures: list[dict[str, Any]]) -> float:
    """Median of the extensions tried: each became a node or was rejected."""
    return float(median(each["nodes"] + each["rejects"] for each in figures))


def motions(figures: list[dict[str, Any]], path: str) -> float:
    """Median of the motions of the paths that were found."""
    return float(median(len(each[path]) - 1 for each in figures if each["solved"]))


def cost(figures: list[dict[str, Any]], path: str) -> float:
    """Median of the costs of the paths that were found."""
    return float(median(each[path] for each in figures if each["solved"]))


@pytest.mark.parametrize(("name", "times"), [("house-easy", 2.0), ("arm-easy", 4.0)])
def test_two_trees_need_a_fraction_of_the_work(name: str, times: float) -> None:
    """Both planners always solve the easy worlds; one needs several times the iterations.

    It tries more extensions too, but fewer times as many: an iteration of two trees makes several.
    """
    one, two = _figures(name, "rrt"), _figures(f"{name}-bi", "bi-rrt")
    assert all(each["solved"] for each in one + two)
    assert median(f["iterations"] for f in one) > 5 * median(f["iterations"] for f in two)
    assert extensions(one) > times * extensions(two)


@pytest.mark.parametrize("name", CLASSIC)
def test_two_trees_make_the_longer_raw_path(name: str) -> None:
    """They go all the way to each sample."""
    one, two = _figures(name, "rrt"), _figures(f"{name}-bi", "bi-rrt")
    assert cost(two, "path_cost") > 1.05 * cost(one, "path_cost")
    assert motions(two, "path") > motions(one, "path")


@pytest.mark.parametrize(
    ("name", "planner"),
    [("house-easy", "rrt"), ("arm-easy", "rrt"), ("house-easy-bi", "bi-rrt"),
     ("arm-easy-bi", "bi-rrt"), ("house-hard", "bi-rrt"), ("arm-hard", "bi-rrt")],
)  # fmt: skip
def test_smoothing_saves_most_motions(name: str, planner: str) -> None:
    """Between 5 and 20 times as many before as after, and no path gets costlier."""
    figures = _figures(name, planner)
    factor = motions(figures, "path") / motions(figures, "smoothed_path")
    assert 4.5 <= factor <= 20
    assert all(f["smoothed_cost"] <= f["path_cost"] for f in figures)


@pytest.mark.parametrize(("name", "times"), [("house-hard", 10.0), ("arm-hard", 3.0)])
def test_the_hard_worlds_are_hard(name: str, times: float) -> None:
    """Two trees solve them with each seed; one alone needs many times as much."""
    one, two = _figures(name, "rrt"), _figures(name, "bi-rrt")
    assert all(each["solved"] for each in two)
    assert extensions(one) > times * extensions(two)
    assert extensions(two) > 5 * extensions(_figures(name.replace("hard", "easy-bi"), "bi-rrt"))


def test_each_seed_has_its_query() -> None:
    """Circles and squares: start and goal change with the seed, the world does not."""
    for name in ("circles", "squares"):
        base = Scenario.load(EXAMPLES / f"{name}.toml")
        problems = [Problem.of(replace(base, seed=seed)) for seed in range(5)]
        assert len({tuple(problem.start) for problem in problems}) == 5
        assert len({problem.world.to_json() for problem in problems}) == 1


def test_squares_fit_a_map_of_any_size() -> None:
    """The user says how large and how many."""
    base = Scenario.load(EXAMPLES / "squares.toml")
    for size, n in ((30, 20), (1000, 5000)):
        world = f"squares2d:n={n},size={size},min_side=2,max_side=8"
        run = Run(replace(base, world=world))
        assert len(run.problem.world.boxes) == n
        assert run.problem.world.extent == size
        assert run.execute().solved
