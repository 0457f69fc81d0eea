"""Why a run failed: each figure against the log, and advice that can be followed."""

import json
import re
import shlex
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import (
    BrrtError,
    Kind,
    Memory,
    Polygon,
    Recording,
    Run,
    Scenario,
    World,
    make_world,
    read,
    snapshot,
)
from brrt.events import Reason, Source, table_dtype
from brrt.explanation import Advice, Explanation, explain
from brrt.explanation.clearance import ClearanceSearch
from brrt.explanation.summary import FAILED, IterationBins, RunSummary, ThinnedRejects
from brrt.scenario.manifest import Manifest
from tests.conftest import Result, recorded
from tests.support import toys
from tests.support.logs import split

Command = Callable[..., Result]

GAP = Scenario(world="gap2d:gap=5", iterations=300, seed=4, clock="logical")
TRAP = Scenario(
    world="bugtrap2d", planner="lrta-star", params={"epsilon": 3}, iterations=800, clock="logical"
)
STAR = Scenario(
    world="circles2d:n=40,seed=3", planner="rrt-star", iterations=250, seed=7, clock="logical"
)
GOLDEN = Path(__file__).parents[2] / "recordings"


def explained(scenario: Scenario, size: int = 500, **at: int) -> Explanation:
    """Explain a scenario's run, read in batches of some size."""
    run, log = recorded(scenario)
    parts = split(log, size)
    return explain(snapshot(Recording(run.manifest, run.problem.world, lambda: iter(parts)), **at))


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
    bins, dtype = IterationBins(), table_dtype(Kind.EDGE, 2)
    for iteration in sorted(iterations):
        table = np.zeros(1, dtype)
        table["iteration"] = iteration
        bins.reach(iteration)
        bins.count(table, 0)
        bins.approach(table, np.array([float(iteration)]))
    at = np.array(iterations) // bins.length
    assert bins.sums[:, 0].tolist() == np.bincount(at, minlength=len(bins.sums)).tolist()
    for place in np.unique(at).tolist():
        assert bins.nearest[place] == min(i for i in iterations if i // bins.length == place)


@settings(max_examples=40)
@given(st.lists(st.integers(0, 30), max_size=30))
def test_thinned_rows_are_even(sizes: list[int]) -> None:
    """What is kept of rejections is every n-th, from the first on, at most twice the limit."""
    thinned, seen = ThinnedRejects(2, most=10), 0
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
    assert found.clearance.connected
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
        found = explain(snapshot(recording, event=at))
        assert json.loads(json.dumps(found.as_dict(), allow_nan=False))
        assert found.rows()[1][0] == "outcome"
        assert len(found.advice) <= 3


def test_a_recording_is_explained_at_its_end() -> None:
    """A path is not taken for one: the message says how it becomes one."""
    file = GOLDEN / "circles2d-chain.mcap"
    assert str(explain(read(file))) == str(explain(snapshot(read(file))))
    for path in (file, str(file)):
        with pytest.raises(BrrtError, match=r"brrt\.explain\(brrt\.read\('.*chain\.mcap'\)\)$"):
            explain(path)  # type: ignore[arg-type]
    with pytest.raises(BrrtError, match=r"not 5$"):
        explain(5)  # type: ignore[arg-type]


def test_a_planner_from_outside_is_explained() -> None:
    """By the contract that it states; no command could plan it again."""
    scenario = Scenario(world="circles2d:n=10,seed=2", planner="toy", iterations=60)
    run, log = Run(scenario, planner=toys.Pair()), Memory()
    run.execute([log])
    whole = Recording(run.manifest, run.problem.world, lambda: iter(log.batches), None)
    found = explain(snapshot(whole, iteration=2))
    assert found.facts.contract.step == toys.STEP
    assert not found.facts.contract.planner.registered
    assert found.facts.gap is not None
    a, b = found.facts.gap.q, found.facts.gap.other
    assert found.facts.gap.far == np.linalg.norm(np.subtract(a, b))
    trees = snapshot(whole, iteration=2).forest
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
    "much too coarse cells": (["--world", "passage2d:gap=0.2", "--planner", "a-star", "--param",
                               "epsilon=7"], "--iterations"),
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
    assert snapshot(read(Path("run-1.mcap"))).best_path is not None


BODY = "polygon:length=8,width=7"


@pytest.mark.parametrize(
    "world", [["--world", "passage2d:gap=6"], ["--world", "polygons2d:n=25"]], ids=["gap", "room"]
)
def test_a_body_that_is_too_wide_is_told(world: list[str], brrt: Command) -> None:
    """No advice to search on, or otherwise: a look at the picture."""
    brrt("plan", *world, "--robot", BODY, "--iterations", 1500, "--out", "run.mcap")
    found = brrt("explain", "run.mcap", "--json").json
    assert found["body"] == pytest.approx(7)
    assert found["widest"] < 7
    (advice,) = found["advice"]
    assert "no pose of this body fits through: it is at least 7 wide, the widest" in advice["why"]
    assert advice["command"] == "brrt plot run.mcap --out run-1.png"


@settings(max_examples=6)
@given(st.sampled_from([7.1, 7.6, 9]), st.floats(-3, 3), st.floats(-3, 3))
def test_a_body_that_gets_through_is_not_too_wide(gap: float, dx: float, dy: float) -> None:
    """Wherever its reference point lies: what was solved is never told to be too narrow."""
    body = np.add([[-4, -3.5], [4, -3.5], [4, 3.5], [-4, 3.5]], [dx, dy])
    robot = Polygon(parts=(body, body[:3] / 2))
    world = make_world(f"passage2d:gap={gap}")
    start, goal = np.array([12.0, 50.0, 0]), np.array([88.0, 50.0, 0])
    middle = float(world.boxes[:, 1].max() - gap / 2)
    way = np.array([start, [12, middle - dy, 0], [88, middle - dy, 0], goal])
    free = all(
        robot.collision(world, q) is None
        for a, b in pairwise(way)
        for q in robot.interpolate(a, b, np.linspace(0, 1, 40))
    )
    ends = tuple(start.tolist()), tuple(goal.tolist())
    summary = RunSummary(Manifest(Scenario(), *ends, dim=2, dof=3, epoch_ns=0, made_by={}), robot)
    found = ClearanceSearch(world, robot, summary).find(start, goal, 5.0)
    assert found.body == pytest.approx(7)
    assert free
    assert not found.too_narrow
    assert found.connected


def test_a_walled_off_goal_needs_a_look(brrt: Command) -> None:
    """More of anything would not help, and is not advised."""
    boxes = np.array([[60, 60, 95, 62], [60, 93, 95, 95], [60, 60, 62, 95], [93, 60, 95, 95]])
    ends = {"start": np.array([5.0, 5.0]), "goal": np.array([80.0, 80.0])}
    World("walled", np.zeros(2), np.full(2, 100.0), boxes=boxes, **ends).save("walled.json")  # type: ignore[arg-type]
    brrt("plan", "--world", "walled.json", "--iterations", 500, "--out", "run.mcap")
    found = brrt("explain", "run.mcap", "--json").json
    assert [each["command"] for each in found["advice"]] == ["brrt plot run.mcap --out run-1.png"]
    assert (
        "no way from start to goal: a closed wall of obstacles stands between them"
        in found["advice"][0]["why"]
    )


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


def test_each_advice_writes_a_file_of_its_own(brrt: Command) -> None:
    """Pasted one after the other, and then what is advised on the first: nothing is in the way."""
    brrt("plan", "--world", "gap2d:gap=1", "--iterations", 1200, "--out", "run.mcap")
    words = commands(brrt("explain", "run.mcap").out)
    assert len(words) > 1
    for each in words:
        assert brrt(*each).code in (0, 1)
    names = {"run.mcap", *(f"run-{i + 1}.mcap" for i in range(len(words)))}
    assert {path.name for path in Path().glob("*.mcap")} == names
    text = brrt("explain", "run-1.mcap", "--json").json["advice"]
    assert all("--out run-1-" in each["command"] for each in text)


def test_a_passage_that_nothing_came_near_is_not_blamed(brrt: Command) -> None:
    """What had hardly begun goes on: the first advice, and the only one."""
    brrt("plan", *CASES["few iterations"][0], "--out", "run.mcap")
    done = brrt("explain", "run.mcap").out
    assert "none came within" in " ".join(done.split())
    assert len(commands(done)) == 1


def test_what_was_too_little_is_not_advised_again(brrt: Command) -> None:
    """Planning anew gets a larger budget; steps are cut by ten at most, and not lengthened then."""
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


def test_a_corner_of_the_start_is_no_passage() -> None:
    """Where a maze's way is narrowest in the start's own cell, it says so; not in open space."""
    for world, told in (("maze2d", True), ("empty2d", False), ("passage2d:gap=1", False)):
        way = dict(explained(Scenario(world=world, iterations=50, seed=1)).rows())["way"]
        assert ("close to the start" in way) == told


def test_a_lattice_is_told_in_its_own_words() -> None:
    """It enters a cell once, not 1 times, and is nowhere said to grow."""
    scenario = Scenario(world="empty2d", planner="lrta-star", params={"epsilon": 3}, iterations=20)
    found = explained(scenario)
    rows = dict(found.rows())
    assert rows["moves"] == "20; each cell was entered once"
    assert "it came nearer up to the very end" in rows["nearest"]
    assert "growing" not in str(found)
    assert "planning goes on" in dict(explained(STAR, iteration=200).rows())["outcome"]


def test_draws_of_the_goal_that_took_long_are_told(brrt: Command) -> None:
    """Of a run that was solved all the same; with fewer of them it takes less long."""
    args = ["--world", "bugtrap2d", "--param", "goal_bias=0.3"]
    assert brrt("plan", *args, "--out", "run.mcap").code == 0
    done = brrt("explain", "run.mcap").out
    facts = brrt("explain", "run.mcap", "--json").json
    share = f"{facts['goals']['failed'] / facts['figures']['iterations']:.0%}"
    assert f"({share} of the iterations)" in " ".join(done.split())
    assert f"in vain, most by {facts['goals']['blockers'][0]['name']}" in " ".join(done.split())
    words = commands(done)[0]
    assert "goal_bias=0.05" in words
    assert brrt(*words).code == 0
    assert "--param goal_bias" not in brrt("explain", "run-1.mcap").out


def test_a_cramped_body_gets_a_planner_that_costs_less(brrt: Command) -> None:
    """Hardly an extension is accepted: nobody says that the tree was spreading."""
    brrt("plan", "--world", "polygons2d", "--robot", "polygon:length=8,width=4", "--planner",
         "bi-rrt-star", "--iterations", 3000, "--out", "run.mcap")  # fmt: skip
    done = brrt("explain", "run.mcap").out
    assert "spreading" not in done
    assert any("rrt-connect" in words for words in commands(done))


def test_a_branch_is_advised_to_branch(brrt: Command) -> None:
    """From itself, for all that a branch can change; and it names its parent."""
    few, tiny = (CASES[name][0] for name in ("few iterations", "tiny step"))
    brrt("plan", *few, "--out", "few.mcap")
    brrt("plan", "--from", "few.mcap", "--at-iteration", 100, "--seed", 5, "--out", "branch.mcap")
    done = brrt("explain", "branch.mcap").out
    assert "few.mcap, behind iteration 100: draws from seed 5" in done
    (words,) = commands(done)
    assert words[:4] == ["plan", "--from", "branch.mcap", "--iterations"]
    assert brrt(*words).code == 0

    brrt("plan", *tiny, "--out", "tiny.mcap")
    brrt("plan", "--from", "tiny.mcap", "--at-iteration", 300, "--param", "step=0.3",
         "--out", "branch.mcap", "--force")  # fmt: skip
    words = commands(brrt("explain", "branch.mcap").out)[0]
    assert words[:5] == ["plan", "--from", "branch.mcap", "--at-iteration", "300"]
    assert brrt(*words, "--force").code == 0


def test_a_run_that_was_cut_goes_on(brrt: Command) -> None:
    """From the cut file itself, where it breaks off; an instant of a whole one is no cut."""
    brrt("plan", "--world", "gap2d:gap=0.2", "--iterations", 9000, "--out", "run.mcap")
    whole = Path("run.mcap").read_bytes()
    Path("cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    done = brrt("explain", "cut.mcap", "--partial").out
    assert "cut short, not solved: the recording breaks off after" in " ".join(done.split())
    assert brrt(*commands(done)[0]).code == 1
    figures = [brrt("replay", name, "--json").json for name in ("run.mcap", "cut-1.mcap")]
    assert figures[0]["nodes"] == figures[1]["nodes"]
    early = brrt("explain", "run.mcap", "--at-iteration", 500).out
    assert "not solved yet after 500 iterations" in early
    assert "breaks off" not in early


def test_a_solved_run_is_told_as_one(brrt: Command) -> None:
    """Two trees meet in the passage: the path leads through, and nobody is said to be outside."""
    brrt("plan", "--world", "passage2d:gap=0.3", "--planner", "rrt-connect", "--out", "run.mcap")
    done = brrt("explain", "run.mcap").out
    assert "the path leads through there" in " ".join(done.split())
    assert "got through" not in done
    assert "nearest" not in done


def test_cells_too_coarse_to_tell_send_nobody_to_the_map(brrt: Command) -> None:
    """A hole in a wall that no cell fits: a longer search may find it."""
    brrt("plan", "--world", "gap3d:gap=1", "--iterations", 3000, "--out", "run.mcap")
    found = brrt("explain", "run.mcap", "--json").json
    assert found["connected"] is None
    assert 1 <= found["widest"] < 7
    assert found["advice"][0]["command"].startswith("brrt plan --from run.mcap --iterations ")
    assert "too coarse to show one" in found["advice"][0]["why"]


def test_a_search_on_a_lattice_ends_with_its_cells(brrt: Command) -> None:
    """So many iterations decide it."""
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


def test_events_left_out_add_up(brrt: Command) -> None:
    """Of many rejections four are listed and the last: with the others they are all."""
    brrt("plan", "--world", "gap2d:gap=1", "--iterations", 500, "--out", "run.mcap")
    node = int(np.bincount(read(Path("run.mcap")).events()[Kind.REJECT]["node"]).argmax())
    done = brrt("replay", "run.mcap", "--node", node).out
    told = re.search(r"(\d+) extensions? from this node", done)
    more = re.search(r"\.\.\. (\d+) more, the last:", done)
    assert told is not None
    assert more is not None
    listed = re.findall(r"^ +event ", done, re.MULTILINE)
    assert int(told[1]) == len(listed) + int(more[1])
