"""The facts in words."""

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brrt import (
    Scenario,
    World,
    read,
    record,
    snapshot,
)
from brrt.explanation import explain
from tests.conftest import Result
from tests.support.explanations import STAR, explained

Command = Callable[..., Result]


def test_it_fits_a_screen(brrt: Command) -> None:
    """80 columns, and at most 33 lines; from Python it is the same text."""
    for args in (["--world", "gap2d:gap=1", "--iterations", 2000],
                 ["--planner", "lrta-star", "--world", "bugtrap2d", "--param", "cell=3"],
                 ["--planner", "rrt-star", "--iterations", 2000]):  # fmt: skip
        brrt("plan", *args, "--out", "run.mcap", "--force")
        text = brrt("explain", "run.mcap").out
        assert all(len(line) <= 80 for line in text.splitlines())
        assert len(text.splitlines()) <= 33
        assert text == str(explain(snapshot(read(Path("run.mcap"))))) + "\n"


@pytest.mark.parametrize(
    ("args", "message"),
    [(["none.mcap"], "none.mcap: No such file"), (["a.mcap", "--at-event", "-2"], "count from 0")],
)
def test_bad_input_is_one_line(args: list[Any], message: str, brrt: Command) -> None:
    """Exit code 2."""
    brrt("plan", "--out", "a.mcap")
    done = brrt("explain", *args)
    assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
    assert message in done.err


def test_words_of_a_lattice_search() -> None:
    """A cell is entered once, not 1 times, and no tree grows."""
    scenario = Scenario(world="empty2d", planner="lrta-star", params={"cell": 3}, iterations=20)
    found = explained(scenario)
    rows = dict(found.rows())
    assert rows["moves"] == "20; each cell was entered once"
    assert "reached at the very end" in rows["nearest"]
    assert "growing" not in str(found)
    assert "still planning" in dict(explained(STAR, iteration=200).rows())["outcome"]


def test_a_solved_run(brrt: Command) -> None:
    """Two trees meet in the passage: the path leads through, and no node is called outside."""
    brrt("plan", "--world", "passage2d:gap=0.3", "--planner", "rrt-connect", "--out", "run.mcap")
    done = brrt("explain", "run.mcap").out
    assert "the run's path leads through it" in " ".join(done.split())
    assert "got through" not in done
    assert "nearest" not in done


def test_places_far_from_the_origin(brrt: Command) -> None:
    """Places in a world of 20 m at UTM coordinates differ in explain, replay --node and show."""
    World(
        "utm", np.array([388096.25, 3948996.5]), np.array([388116.25, 3949016.5]),
        boxes=np.array([[388104.25, 3948996.5, 388106.25, 3949014.5]]),
        start=np.array([388097.25, 3949006.5]), goal=np.array([388115.25, 3949006.5]),
    ).save("utm.json")  # fmt: skip
    brrt("plan", "--world", "utm.json", "--iterations", 300, "--out", "run.mcap")
    explained = " ".join(brrt("explain", "run.mcap").out.split())
    assert "box 0 (388104.25,3948996.5 to 388106.25,3949014.5)" in explained
    assert re.search(r"around \(38810\d\.\d+, 39490\d\d\.\d+\)", explained)
    node = brrt("replay", "run.mcap", "--node", 3).out
    assert re.search(r"at \(38\d{4}\.\d+, 39490\d\d\.\d+\)", node)
    shown = brrt("worlds", "show", "utm.json").out
    assert "[388096.25, 388116.25] x [3948996.5, 3949016.5]" in shown
    assert "388097.25, 3949006.5" in shown
    text = brrt("replay", "run.mcap", "--text").out
    assert "from 388097.25, 3949006.5 to 388115.25, 3949006.5" in text


def test_a_goal_that_is_tried_more_often_than_once_an_iteration(tmp_path: Path) -> None:
    """There is no share of more than 100 %."""
    with record(tmp_path / "run.mcap", world="circles2d:n=40", planner="mine") as rec:
        rec.edge([5, 5])
        for _ in range(20):
            rec.sample([95, 95], "goal")
            for _ in range(5):
                rec.reject([95, 95], 0)
    told = " ".join(str(explain(read(tmp_path / "run.mcap"))).split())
    assert "rejected 100 times (5 an iteration)" in told


def test_a_graph_of_another_planner(tmp_path: Path) -> None:
    """Links count as extensions; what one tree's distance says and a seed of ours are left out."""
    with record(tmp_path / "run.mcap", world="circles2d:n=1", planner="mine") as rec:
        nodes = [rec.edge([5, 5]), *(rec.vertex([10 + 8 * n, 90 - n]) for n in range(10))]
        for number, pair in enumerate(pairwise(nodes), 1):
            rec.iteration = number
            rec.link(*pair)
        rec.reject([50, 50], 3)
    told = " ".join(str(explain(read(tmp_path / "run.mcap"))).split())
    assert "91% of 11 extensions accepted" in told
    assert "to goal" not in told
    assert "seed" not in told
    with record(tmp_path / "seeded.mcap", world="circles2d:n=1", planner="mine", seed=4) as rec:
        rec.edge([5, 5])
    assert "seed 4" in str(explain(read(tmp_path / "seeded.mcap")))
