"""The facts of an explanation, against the log."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import (
    BrrtError,
    Kind,
    Memory,
    Run,
    Scenario,
    read,
    snapshot,
)
from brrt.events import Reason, Source
from brrt.explanation import explain
from brrt.explanation.summary import FAILED
from tests.conftest import recorded
from tests.support import toys
from tests.support.explanations import GAP, STAR, TRAP, explained

GOLDEN = Path(__file__).parents[2] / "recordings"


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


def test_batches_do_not_matter() -> None:
    """The whole explanation is the same however the log is split."""
    for scenario in (GAP, STAR, TRAP):
        assert explained(scenario, 37).as_dict() == explained(scenario, 10_000).as_dict()


def test_cells_are_summed_up() -> None:
    """Visits, expansions and estimates of LRTA*, against the log."""
    _, log = recorded(TRAP)
    found = explained(TRAP, 50).facts
    expanded, moves, raised = (log[kind] for kind in (Kind.EXPAND, Kind.MOVE, Kind.HEURISTIC))
    assert found.cells["cells"] == len(np.unique(expanded["cell"])) == found.accepted
    assert found.cells["expansions"] == len(expanded)
    visits = np.bincount(moves["cell"][moves["cell"] >= 0])
    assert found.cells["moves_per_cell"] == pytest.approx(visits.sum() / (visits > 0).sum())
    assert found.cells["busiest"]["visits"] == visits.max()
    last = {int(row["cell"]): row for row in raised}
    goal = np.array(recorded(TRAP)[0].problem.goal)
    learnt = [float(row["h"] - np.linalg.norm(row["q"] - goal)) for row in last.values()]
    assert found.cells["deepest"]["learnt"] == pytest.approx(max(learnt))


def test_blockers_are_named() -> None:
    """Before a gap the two walls block everything, and the gap is found."""
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
    """At the end and before the first iteration; in JSON, too."""
    recording = read(GOLDEN / f"{name}.mcap")
    for at in (0, None):
        found = explain(snapshot(recording, event=at))
        assert json.loads(json.dumps(found.as_dict(), allow_nan=False))
        assert found.rows()[1][0] == "outcome"
        assert len(found.advice) <= 3


def test_a_recording_is_explained_at_its_end() -> None:
    """A path is refused, and the message names the call that reads it."""
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
    whole = log.recording(run.manifest, run.problem.world)
    found = explain(snapshot(whole, iteration=2))
    assert found.facts.contract.step == toys.STEP
    assert not found.facts.contract.planner.registered
    assert found.facts.gap is not None
    a, b = found.facts.gap.q, found.facts.gap.other
    assert found.facts.gap.far == np.linalg.norm(np.subtract(a, b))
    trees = snapshot(whole, iteration=2).forest
    least = min(float(np.linalg.norm(trees[1].q - q, axis=1).min()) for q in trees[0].q)
    assert found.facts.gap.far == least
