"""Advice that follows from facts can be followed."""

import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import (
    World,
    explain,
    read,
    snapshot,
)
from brrt.explanation import Advice
from tests.conftest import Result
from tests.support.explanations import FEW_ITERATIONS, commands

Command = Callable[..., Result]


CASES: dict[str, tuple[list[str], str]] = {
    "tiny step": (["--world", "circles2d", "--param", "step=0.2", "--iterations", "1500"], "step="),
    "no bias": (["--world", "empty2d", "--param", "goal_bias=0", "--param", "step=2",
                 "--iterations", "800"], "goal_bias=0.05"),
    "greedy": (["--world", "enclosure2d", "--param", "goal_bias=0.9", "--iterations", "1000"],
               "goal_bias=0.05"),
    "bug trap": (["--world", "bugtrap2d", "--iterations", "2000", "--seed", "3"],
                 "--planner rrt-connect"),
    "few iterations": (FEW_ITERATIONS, "--from run.mcap --iterations 30000"),
    "coarse cells": (["--world", "passage2d:gap=3", "--planner", "a-star",
                      "--param", "cell=7.5"],
                     "cell="),
    "much too coarse cells": (["--world", "passage2d:gap=0.2", "--planner", "a-star", "--param",
                               "cell=7.5"], "--iterations"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_first_advice_helps(case: str, brrt: Command) -> None:
    """The first command that is printed after an unsolved run solves it."""
    args, change = CASES[case]
    assert brrt("plan", *args, "--out", "run.mcap").code == 1
    done = brrt("explain", "run.mcap")
    assert (done.code, done.err) == (0, "")
    words = commands(done.out)[0]
    assert change in " ".join(words)
    assert brrt(*words).code == 0
    assert snapshot(read(Path("run-1.mcap"))).best_path is not None


def test_a_path_that_improves_no_more(brrt: Command) -> None:
    """Half of the iterations are advised, and late moves are reported."""
    brrt("plan", "--planner", "rrt-star", "--world", "empty2d", "--iterations", 4000,
         "--execute", "--deadline", 1e-6, "--out", "run.mcap")  # fmt: skip
    found = brrt("explain", "run.mcap", "--json").json
    assert any("the deadline is 1e-06 s" in each["why"] for each in found["advice"])
    assert any("--iterations 2000" in each["command"] for each in found["advice"])
    text = " ".join(brrt("explain", "run.mcap").out.split())
    assert "missed the deadline of 1e-06 s" in text


def test_each_advice_writes_its_own_file(brrt: Command) -> None:
    """Commands can be pasted one after the other, also those after the first of them."""
    brrt("plan", "--world", "gap2d:gap=1", "--iterations", 1200, "--out", "run.mcap")
    words = commands(brrt("explain", "run.mcap").out)
    assert len(words) > 1
    for each in words:
        assert brrt(*each).code in (0, 1)
    names = {"run.mcap", *(f"run-{i + 1}.mcap" for i in range(len(words)))}
    assert {path.name for path in Path().glob("*.mcap")} == names
    text = brrt("explain", "run-1.mcap", "--json").json["advice"]
    assert all("--out run-1-" in each["command"] for each in text)


def test_a_passage_that_nothing_came_near(brrt: Command) -> None:
    """A run that only began to spread is continued, and nothing else is advised."""
    brrt("plan", *FEW_ITERATIONS, "--out", "run.mcap")
    done = brrt("explain", "run.mcap").out
    assert "none came within" in " ".join(done.split())
    assert len(commands(done)) == 1


def test_advice_does_not_repeat_what_failed(brrt: Command) -> None:
    """Planning from the start gets a larger budget; a step falls by ten at most, then stays."""
    for planner in ("rrt", "rrt-connect", "rrt-star"):
        args = ["--world", "passage2d:gap=0.2", "--planner", planner, "--iterations", 1500]
        for _ in range(2):
            brrt("plan", *args, "--param", "step=20", "--out", "run.mcap", "--force")
            advised = commands(brrt("explain", "run.mcap").out)
            assert advised
            for words in advised:
                more = int(words[words.index("--iterations") + 1])
                assert more >= 6000
                steps = [float(word[5:]) for word in words if word.startswith("step=")]
                assert all(2 <= step <= 20 for step in steps)
                assert not steps or more >= 1500 * 20 / steps[0]
            args += ["--seed", 1]


def test_rejected_samples_of_the_goal(brrt: Command) -> None:
    """They are reported for a solved run, too; with fewer of them it takes less time."""
    args = ["--world", "bugtrap2d", "--param", "goal_bias=0.3"]
    assert brrt("plan", *args, "--out", "run.mcap").code == 0
    done = brrt("explain", "run.mcap").out
    facts = brrt("explain", "run.mcap", "--json").json
    share = f"{facts['goals']['failed'] / facts['figures']['iterations']:.0%}"
    assert f"({share} of the iterations)" in " ".join(done.split())
    assert f"rejected, mostly by {facts['goals']['blockers'][0]['name']}" in " ".join(done.split())
    words = commands(done)[0]
    assert "goal_bias=0.05" in words
    assert brrt(*words).code == 0
    assert "--param goal_bias" not in brrt("explain", "run-1.mcap").out


def test_a_cramped_body_gets_a_cheaper_planner(brrt: Command) -> None:
    """Few extensions are accepted, so the tree is not called spreading."""
    brrt("plan", "--world", "polygons2d", "--robot", "polygon:length=8,width=4", "--planner",
         "bi-rrt-star", "--iterations", 3000, "--out", "run.mcap")  # fmt: skip
    done = brrt("explain", "run.mcap").out
    assert "spreading" not in done
    assert any("rrt-connect" in words for words in commands(done))


def test_advice_for_a_branch(brrt: Command) -> None:
    """It is continued with all that a branch can change; its parent is named."""
    tiny = CASES["tiny step"][0]
    brrt("plan", *FEW_ITERATIONS, "--out", "few.mcap")
    brrt("plan", "--from", "few.mcap", "--at-iteration", 100, "--seed", 5, "--out", "branch.mcap")
    done = brrt("explain", "branch.mcap").out
    assert "from few.mcap after iteration 100: draws from seed 5" in done
    (words,) = commands(done)
    assert words[:4] == ["plan", "--from", "branch.mcap", "--iterations"]
    assert brrt(*words).code == 0

    brrt("plan", *tiny, "--out", "tiny.mcap")
    brrt("plan", "--from", "tiny.mcap", "--at-iteration", 300, "--param", "step=0.3",
         "--out", "branch.mcap", "--force")  # fmt: skip
    words = commands(brrt("explain", "branch.mcap").out)[0]
    assert words[:5] == ["plan", "--from", "branch.mcap", "--at-iteration", "300"]
    assert brrt(*words, "--force").code == 0


def test_a_cut_recording_is_continued(brrt: Command) -> None:
    """From the cut file itself; a snapshot of a complete one is not cut."""
    brrt("plan", "--world", "gap2d:gap=0.2", "--iterations", 9000, "--out", "run.mcap")
    whole = Path("run.mcap").read_bytes()
    Path("cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    done = brrt("explain", "cut.mcap").out
    assert "the recording is cut after" in " ".join(done.split())
    assert brrt(*commands(done)[0]).code == 1
    figures = [brrt("replay", name, "--json").json for name in ("run.mcap", "cut-1.mcap")]
    assert figures[0]["nodes"] == figures[1]["nodes"]
    early = brrt("explain", "run.mcap", "--at-iteration", 500).out
    assert "not solved yet after 500 iterations" in early
    assert "is cut" not in early


def test_a_lattice_search_ends_with_its_cells(brrt: Command) -> None:
    """As many iterations are advised."""
    brrt("plan", "--world", "maze2d:size=30", "--planner", "a-star", "--iterations", 100,
         "--out", "run.mcap")  # fmt: skip
    words = commands(brrt("explain", "run.mcap").out)[0]
    assert words[:5] == ["plan", "--from", "run.mcap", "--iterations", "3721"]
    assert brrt(*words).code == 0


@settings(max_examples=60)
@given(
    st.lists(st.text("ab 'x=,/", min_size=1, max_size=30), min_size=1, max_size=9),
    st.integers(0, 3),
)
def test_a_folded_command_is_the_command(values: list[str], flags: int) -> None:
    """A shell reads the lines as the words; each fits a screen if its words do."""
    words = ["brrt", "plan", *(f"--flag{i}" for i in range(flags))]
    words += [part for i, value in enumerate(values) for part in (f"--option{i}", value)]
    lines = Advice("why", tuple(words)).command_lines()
    assert shlex.split("\n".join(lines).replace("\\\n", "")) == words
    assert all(len(line) <= 79 for line in lines)
    assert all(line.endswith(" \\") for line in lines[:-1])


def test_cells_near_the_goal_are_blocked(tmp_path: Path, brrt: Command) -> None:
    """The longer move that is advised leads to the goal from the nearest cell that was reached."""
    near = [[x - 0.1, y - 0.1, x + 0.1, y + 0.1] for x in (5, 7) for y in (5, 7)]
    world = tmp_path / "near.json"
    World("near", np.zeros(2), np.full(2, 10.0), boxes=np.array(near)).save(world)
    out = tmp_path / "run.mcap"
    options = ["--planner", "a-star", "--start", "1,1", "--goal", "6,6", "--param", "cell=2",
               "--param", "max_move=1.42", "--out", str(out)]  # fmt: skip
    assert brrt("plan", "--world", str(world), *options).code == 1
    advice = explain(read(out)).as_dict()["advice"][0]
    assert "max_move=3.17" in advice["command"]
    words = [word if word != "max_move=1.42" else "max_move=3.17" for word in options[:-2]]
    assert brrt("plan", "--world", str(world), *words, "--no-record").code == 0
