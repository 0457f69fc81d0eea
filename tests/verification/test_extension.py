"""How trees grow: logs that were doctored against a planner's own rule of growing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, Problem, make_robot, verification
from brrt.events import Reason
from brrt.planners import make_planner
from brrt.verification import examine
from brrt.verification.neighbours import Neighbours, nearest
from tests.verification.test_rules import Evidence, evidence, promise
from tests.verification.test_sampling import run_of


def growing(**fields: object) -> Callable[[Evidence], Evidence]:
    """Another way of growing in the contract."""

    def change(case: Evidence) -> Evidence:
        base = make_planner(case.manifest.scenario).contract(
            Problem.of(case.manifest.scenario, case.world)
        )
        assert base.growth is not None
        return promise(growth=replace(base.growth, **fields))(case)  # type: ignore[arg-type]

    return change


def second_nearest(case: Evidence) -> Evidence:
    """A leaf's parent is another node within a step, and all else fits."""
    edges = case.log[Kind.EDGE]
    for row in range(len(edges) - 1, 1, -1):
        if row in edges["parent"]:
            continue
        far = np.linalg.norm(edges["q"][:row] - edges["q"][row], axis=1)
        for parent in np.flatnonzero(far < 5.0).tolist():
            if parent != edges["parent"][row]:
                cost = edges["cost"][parent] + far[parent]
                other = case.edit(Kind.EDGE, row, parent=parent, cost=cost)
                if other.broken() == {"steering"}:
                    return other
    raise AssertionError


def overlooked(tree: int, reasons: set[Reason]) -> Callable[[Evidence], Evidence]:
    """Without a rejection that says that the other tree tried."""

    def drop(case: Evidence) -> Evidence:
        rejects, samples = case.log[Kind.REJECT], case.log[Kind.SAMPLE]
        turn = samples["tree"][np.searchsorted(samples["seq"], rejects["seq"]) - 1]
        of_other = (rejects["tree"] == tree) & (turn != tree)
        rows = np.flatnonzero(of_other & np.isin(rejects["reason"], list(reasons)))
        return case.drop(Kind.REJECT, int(rows[0]))

    return drop


SMALLER = {"planner": "bi-rrt", "params": {"turn": "smaller", "step": 4}, "seed": 3}
COIN = {"planner": "bi-rrt", "params": {"turn": "coin", "step": 2}, "seed": 3}
BIT = {Reason.COLLISION, Reason.NO_PROGRESS}

DOCTORED: list[tuple[str, Callable[[], Evidence], set[str]]] = [
    ("turns", lambda: growing(turn="alternate")(run_of(**SMALLER)), set()),
    ("turns", lambda: growing(turn="smaller")(evidence("rrt-connect")), set()),
    ("turns", lambda: growing(turn="alternate")(run_of(**COIN)), {"link tries"}),
    ("steering", lambda: second_nearest(evidence("rrt")), set()),
    ("steering", lambda: evidence("rrt").edit(Kind.SAMPLE, 20, q=[50.0, 90.0]), set()),
    ("steering", lambda: evidence("rrt-star").edit(Kind.SAMPLE, 20, q=[50.0, 90.0]), set()),
    ("steering", lambda: evidence("rrt-connect").edit(Kind.SAMPLE, 3, q=[50.0, 90.0]), set()),
    ("steering", lambda: evidence("bi-rrt-star").edit(Kind.SAMPLE, 9, q=[50.0, 90.0]), set()),
    ("steering", lambda: growing(slices=2)(evidence("rrt")), {"extensions"}),
    ("goal tries", lambda: promise(line_of_sight=True)(evidence("rrt")), set()),
    ("link tries", lambda: growing(links="extend")(evidence("rrt-connect")), set()),
    ("link tries", lambda: growing(links="connect")(evidence("bi-rrt")), set()),
    ("link tries", lambda: growing(connects=True)(evidence("rrt-connect")), set()),
    ("link tries", lambda: growing(always_links=True)(evidence("rrt-connect")), set()),
    ("link tries", lambda: overlooked(1, BIT)(evidence("rrt-connect")), set()),
    ("link tries", lambda: overlooked(1, BIT)(evidence("bi-rrt-star")), {"extensions"}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("rule", "doctored", "also"), DOCTORED, ids=[f"{r} {i}" for i, (r, *_) in enumerate(DOCTORED)]
)
def test_doctored_growth_is_found(
    rule: str, doctored: Callable[[], Evidence], also: set[str]
) -> None:
    """As in test_checks."""
    broken = doctored().broken()
    assert rule in broken
    assert broken - {rule} <= also


def test_windows_are_nothing_to_a_log(monkeypatch: pytest.MonkeyPatch) -> None:
    """Clean runs are clean, and looked at alike, wherever the windows end that they are read in."""
    monkeypatch.setattr(verification, "_WINDOW", 1)
    for case in (run_of(**SMALLER), run_of(**COIN), evidence("bi-rrt-star"), evidence("rrt")):
        assert case.broken() == set()
        whole = examine(case.manifest, case.world, case.log)
        size, tables = len(case.log) // 25, case.log.tables
        windows = [
            Events(2, {kind: t[t["seq"] // size == n] for kind, t in tables.items()})
            for n in range(len(case.log) // size + 1)
        ]
        assert examine(case.manifest, case.world, windows) == whole


@settings(max_examples=40)
@given(
    n=st.integers(1, 120),
    seed=st.integers(0, 999),
    most=st.sampled_from([1, 300, 10**9]),
    kind=st.sampled_from(["point", "polygon:length=3,width=1"]),
    cells=st.sampled_from([2, 99]),
)
def test_neighbours_are_all_there_is(n: int, seed: int, most: int, kind: str, cells: int) -> None:
    """Against a look at each pair; nodes may stand in one place, and angles wrap."""
    rng = np.random.default_rng(seed)
    robot, dof = make_robot(kind), 2 if kind == "point" else 3
    q, places = (rng.integers(0, cells, (m, dof)) / cells * 6 - 3 for m in (n, 20))
    radius, count = rng.uniform(0, 4, 20), rng.integers(1, n + 1, 20)
    near = Neighbours(q, robot.distance, places, radius, count, most)
    found = {
        (i, j) for a, b, _ in near.pairs() for i, j in zip(a.tolist(), b.tolist(), strict=True)
    }
    far = robot.distance(places[:, None], q[None])
    there = (far <= radius[:, None]) & (np.arange(n) < count[:, None]) & near.looked[:, None]
    assert found == {(i, j) for i, j in np.argwhere(there).tolist()}
    assert near.looked.any()
    assert most < 10**9 or near.looked.all()
    node, least, second = nearest(Neighbours(q, robot.distance, places, radius, count, most))
    ordered = np.sort(np.where(there, far, np.inf), axis=1)
    np.testing.assert_array_equal(least, ordered[:, 0])
    np.testing.assert_array_equal(second, ordered[:, 1] if n > 1 else np.inf)
    assert ((node >= 0) == np.isfinite(least)).all()
