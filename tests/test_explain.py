"""Why a run failed: each figure against the log, and advice that can be followed."""

import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Kind, Memory, Recording, Run, Scenario, World, read
from brrt.events import Reason, Source, table_dtype
from brrt.replay.explain import Explanation, explain
from brrt.replay.explain.gather import FAILED, Spans, Thinned

from . import toys
from .conftest import Result, recorded
from .test_replay import cut

Command = Callable[..., Result]

GAP = Scenario(world="gap2d:gap=5", iterations=300, seed=4, clock="logical")
TRAP = Scenario(
    world="bugtrap2d", planner="lrta-star", params={"epsilon": 3}, iterations=800, clock="logical"
)
STAR = Scenario(
    world="circles2d:n=40,seed=3", planner="rrt-star", iterations=250, seed=7, clock="logical"
)
GOLDEN = Path(__file__).parents[1] / "recordings"


def explained(scenario: Scenario, size: int = 500, **at: int) -> Explanation:
    """Explain a scenario's run, read in batches of some size."""
    run, log = recorded(scenario)
    parts = cut(log, size)
    return explain(Recording(run.manifest, run.problem.world, lambda: iter(parts), None).at(**at))


@settings(max_examples=15)
@given(data=st.data())
def test_figures_are_those_of_the_log(data: st.DataObject) -> None:
    """Whatever the batches and the instant: counts, nearest node, goals, tenths."""
    scenario = data.draw(st.sampled_from([GAP, STAR]))
    run, log = recorded(scenario)
    at = data.draw(st.integers(3, len(log) - 1))
    part = log.until(seq=at)
    found = explained(scenario, data.draw(st.integers(3, 600)), event=at).facts
    edges, rejects, samples = (part[kind] for kind in (Kind.EDGE, Kind.REJECT, Kind.SAMPLE))
    failed = np.isin(rejects["reason"], FAILED)
    assert found.accepted == len(edges) - 1
    assert found.failed == failed.sum()
    assert sum(found.reasons.values()) == len(rejects)
    assert found.reasons.get("collision", 0) == (rejects["reason"] == Reason.COLLISION).sum()
    goals = samples["iteration"][samples["source"] == Source.GOAL]
    answered = np.isin(rejects["iteration"][failed], goals).sum()
    assert (found.goals.drawn if found.goals else 0) == len(goals)
    assert (found.goals.failed if found.goals else 0) == answered
    far = np.linalg.norm(edges["q"] - run.problem.goal, axis=1)
    assert found.approach is not None
    assert found.approach.far == far.min()
    assert found.approach.iteration == edges["iteration"][far.argmin()]
    assert found.tenths[-1].last == max(edges["iteration"][-1], part.last.iteration)
    first = 0
    for tenth in found.tenths:
        mine, theirs = (
            int(((t["iteration"] >= first) & (t["iteration"] <= tenth.last)).sum())
            for t in (edges[1:], rejects[failed])
        )
        assert tenth.accepted == (mine / (mine + theirs) if mine + theirs else None)
        assert tenth.nearest == far[edges["iteration"] <= tenth.last].min()
        first = tenth.last + 1


def test_batches_do_not_count() -> None:
    """The whole explanation is the same however the log is cut."""
    for scenario in (GAP, STAR, TRAP):
        assert explained(scenario, 37).as_dict() == explained(scenario, 10_000).as_dict()


def test_cells_are_summed_up() -> None:
    """Visits, first looks and lessons of LRTA*, against the log."""
    _, log = recorded(TRAP)
    found = explained(TRAP, 50).facts
    looks, moves, raised = (log[kind] for kind in (Kind.EXPAND, Kind.MOVE, Kind.HEURISTIC))
    assert found.cells["cells"] == len(np.unique(looks["cell"])) == found.accepted
    assert found.cells["expansions"] == len(looks)
    visits = np.bincount(moves["cell"][moves["cell"] >= 0])
    assert found.cells["moves_per_cell"] == pytest.approx(visits.sum() / (visits > 0).sum())
    assert found.cells["busiest"]["visits"] == visits.max()
    last = {int(row["cell"]): row for row in raised}
    goal = np.array(recorded(TRAP)[0].problem.goal)
    learnt = [float(row["h"] - np.linalg.norm(row["q"] - goal)) for row in last.values()]
    assert found.cells["deepest"]["learnt"] == pytest.approx(max(learnt))


@settings(max_examples=40)
@given(st.lists(st.integers(0, 40_000), min_size=1, max_size=60))
def test_spans_are_bins(iterations: list[int]) -> None:
    """Sums by spans, whose length doubles on the way, are those of the final length."""
    spans, dtype = Spans(), table_dtype(Kind.EDGE, 2)
    for iteration in sorted(iterations):
        table = np.zeros(1, dtype)
        table["iteration"] = iteration
        spans.reach(iteration)
        spans.count(table, 0)
        spans.approach(table, np.array([float(iteration)]))
    at = np.array(iterations) // spans.length
    assert spans.sums[:, 0].tolist() == np.bincount(at, minlength=len(spans.sums)).tolist()
    for place in np.unique(at).tolist():
        assert spans.nearest[place] == min(i for i in iterations if i // spans.length == place)


@settings(max_examples=40)
@given(st.lists(st.integers(0, 30), max_size=30))
def test_thinned_rows_are_even(sizes: list[int]) -> None:
    """What is kept of rejections is every n-th, from the first on, at most twice the limit."""
    thinned, seen = Thinned(2, most=10), 0
    for size in sizes:
        table = np.zeros(size, table_dtype(Kind.REJECT, 2))
        table["seq"] = np.arange(seen, seen + size)
        seen += size
        thinned.add(table)
    kept = thinned.rows()["seq"].tolist()
    assert len(kept) <= 20
    stride = kept[1] - kept[0] if len(kept) > 1 else 1
    assert kept == list(range(0, seen, stride))[: len(kept)]
    assert seen - (kept[-1] if kept else 0) <= stride


def test_what_is_in_the_way_is_named() -> None:
    """In front of a gap the two walls turn everything down, and the gap is found."""
    found = explained(GAP).facts
    assert [each.name.split(" (")[0] for each in found.blockers] == ["box 0", "box 1"]
    assert sum(each.share for each in found.blockers) == pytest.approx(1)
    assert found.way.connected
    assert found.narrow is not None
    assert found.narrow.low <= 5 <= found.narrow.high
    tree_goes_through = found.narrow.behind > 0
    assert tree_goes_through == (found.narrow.through is not None)
    assert found.coverage is not None
    assert 0.3 < found.coverage.share < 0.7


@pytest.mark.parametrize(
    "name",
    ["boxes3d-bi-rrt-star", "circles2d-chain", "polygons2d-polygon", "squares2d-a-star",
     "boxes3d-lrta-star", "squares2d-bi-rrt-coin"],
)  # fmt: skip
def test_every_planner_and_robot_is_explained(name: str) -> None:
    """Also as it stood before anything had happened, and in JSON."""
    recording = read(GOLDEN / f"{name}.mcap")
    for at in (0, None):
        found = explain(recording.at(event=at))
        assert json.loads(json.dumps(found.as_dict(), allow_nan=False))
        assert found.rows()[1][0] == "outcome"
        assert len(found.advice) <= 3


def test_a_planner_from_outside_is_explained() -> None:
    """One that is not known here has no settings to advise on."""
    scenario = Scenario(world="circles2d:n=10,seed=2", planner="toy", iterations=60)
    run, log = Run(scenario, planner=toys.Pair()), Memory()
    run.execute([log])
    whole = Recording(run.manifest, run.problem.world, lambda: iter(log.batches), None)
    found = explain(whole.at(iteration=2))
    assert found.facts.contract is None
    assert found.facts.gap is not None
    a, b = found.facts.gap.q, found.facts.gap.other
    assert found.facts.gap.far == np.linalg.norm(np.subtract(a, b))
    trees = whole.at(iteration=2).forest
    least = min(float(np.linalg.norm(trees[1].q - q, axis=1).min()) for q in trees[0].q)
    assert found.facts.gap.far == least


CASES: dict[str, tuple[list[str], str]] = {
    "tiny step": (["--world", "circles2d", "--param", "step=0.2", "--iterations", "1500"], "step="),
    "no bias": (["--world", "empty2d", "--param", "goal_bias=0", "--param", "step=2",
                 "--iterations", "800"], "goal_bias=0.05"),
    "greedy": (["--world", "enclosure2d", "--param", "goal_bias=0.9", "--iterations", "1000"],
               "goal_bias=0.05"),
    "bug trap": (["--world", "bugtrap2d", "--iterations", "2000", "--seed", "3"],
                 "--planner rrt-connect"),
    "few iterations": (["--world", "squares2d:n=120,seed=4", "--seed", "7", "--iterations", "300"],
                       "--from run.mcap --iterations 30000"),
    "coarse cells": (["--world", "passage2d:gap=3", "--planner", "a-star", "--param", "epsilon=7"],
                     "epsilon="),
}  # fmt: skip


def commands(text: str) -> list[list[str]]:
    """The commands on a screen, as a shell takes them: what stands behind `brrt`."""
    lines = text.replace("\\\n", "").splitlines()
    return [shlex.split(line)[1:] for line in lines if line.startswith("   brrt ")]


@pytest.mark.parametrize("case", CASES)
def test_what_is_advised_first_helps(case: str, brrt: Command) -> None:
    """An unsolved run, explained; the first command, typed as it is printed, solves it."""
    args, change = CASES[case]
    assert brrt("plan", *args, "--out", "run.mcap").code == 1
    done = brrt("explain", "run.mcap")
    assert (done.code, done.err) == (0, "")
    words = commands(done.out)[0]
    assert change in " ".join(words)
    assert brrt(*words).code == 0
    assert read(Path("run-1.mcap")).at().best_path is not None


def test_a_walled_off_goal_needs_a_look(brrt: Command) -> None:
    """More of anything would not help, and is not advised."""
    boxes = np.array([[60, 60, 95, 62], [60, 93, 95, 95], [60, 60, 62, 95], [93, 60, 95, 95]])
    ends = {"start": np.array([5.0, 5.0]), "goal": np.array([80.0, 80.0])}
    World("walled", np.zeros(2), np.full(2, 100.0), boxes=boxes, **ends).save("walled.json")  # type: ignore[arg-type]
    brrt("plan", "--world", "walled.json", "--iterations", 500, "--out", "run.mcap")
    found = brrt("explain", "run.mcap", "--json").json
    assert [each["command"] for each in found["advice"]] == ["brrt worlds show walled.json"]
    assert "there is no way from start to goal" in found["advice"][0]["why"]


def test_what_improves_no_more_is_said(brrt: Command) -> None:
    """Half of the iterations would have done; and late moves are told."""
    brrt("plan", "--planner", "rrt-star", "--world", "empty2d", "--iterations", 4000,
         "--execute", "--deadline", 1e-6, "--out", "run.mcap")  # fmt: skip
    found = brrt("explain", "run.mcap", "--json").json
    assert any("the deadline is 1e-06 s" in each["why"] for each in found["advice"])
    assert any("--iterations 2000" in each["command"] for each in found["advice"])
    assert "later than 1e-06 s" in brrt("explain", "run.mcap").out


def test_it_fits_a_screen(brrt: Command) -> None:
    """80 columns, and about 24 lines; from Python it is the same text."""
    for args in (["--world", "gap2d:gap=1", "--iterations", 2000],
                 ["--planner", "lrta-star", "--world", "bugtrap2d", "--param", "epsilon=3"],
                 ["--planner", "rrt-star", "--iterations", 2000]):  # fmt: skip
        brrt("plan", *args, "--out", "run.mcap", "--force")
        text = brrt("explain", "run.mcap").out
        assert all(len(line) <= 80 for line in text.splitlines())
        assert len(text.splitlines()) <= 33
        assert text == str(explain(read(Path("run.mcap")).at())) + "\n"


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
