"""Recordings that break rules about draws in the long run, and correct ones that do not."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, Recording, Run, Scenario, World, verify
from brrt.events import Phase, Source, Status, table_dtype
from brrt.planners import make_planner
from brrt.scenario.contract import Draws
from tests.support.cases import (
    Case,
    Doctored,
    check_found,
    doctored,
    run_of,
)

Doctor = Callable[[np.random.Generator, np.ndarray, np.ndarray], None]
"""Changes the samples, shape (n, 2), and the sources, shape (n,), of a log of draws."""

SIZE, BIAS = 100.0, 0.05
STATISTICS = (
    "goal draws", "coin tosses", "uniform draws", "uniform informed draws", "random pairs",
)  # fmt: skip


def log_of(n: int, doctor: Doctor | None = None, seed: int = 0) -> Case:
    """A log of draws alone, as rrt makes them in an empty world: nothing joins the tree."""
    rng = np.random.default_rng(seed)
    scenario = Scenario(world="circles2d:n=0", iterations=n, clock="logical")
    run = Run(scenario)
    q, source = rng.uniform(0, SIZE, (n, 2)), (rng.random(n) < BIAS).astype(np.uint8)
    if doctor is not None:
        doctor(rng, q, source)
    q[source == Source.GOAL] = run.problem.goal
    phases, edges, samples = (
        np.zeros(count, table_dtype(kind, 2))
        for kind, count in ((Kind.PHASE, 2), (Kind.EDGE, 1), (Kind.SAMPLE, n))
    )
    edges["parent"], edges["q"] = -1, run.problem.start
    samples["q"], samples["source"], samples["iteration"] = q, source, np.arange(n) + 1
    phases["name"], phases["status"] = Phase.PLAN, [Status.BEGIN, Status.ITERATION_LIMIT]
    phases["seq"], edges["seq"], samples["seq"] = [0, n + 2], 1, np.arange(n) + 2
    phases["iteration"] = [0, n]
    tables = {Kind.PHASE: phases, Kind.SAMPLE: samples, Kind.EDGE: edges}
    for table in tables.values():
        table["t"] = table["seq"] * 1000
    # What came of the draws is missing, so the contract does not promise it.
    contract = replace(make_planner(scenario).contract(run.problem), growth=None)
    return Case(run.manifest, run.problem.world, Events(2, tables), contract)


def biased(chance: float) -> Doctor:
    """Draw the goal more or less often than stated."""

    def doctor(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
        source[:] = rng.random(len(source)) < chance

    return doctor


def squeezed(axis: int, low: float, high: float) -> Doctor:
    """Draw one coordinate from a part of its range."""

    def doctor(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
        q[:, axis] = rng.uniform(low, high, len(q))

    return doctor


def diagonal(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Make the two coordinates, each uniform, depend on each other."""
    q[:, 1] = (q[:, 0] + 0.7 * q[:, 1]) % SIZE


def regular(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Draw more uniformly than chance: a sequence of low discrepancy (Weyl 1916)."""
    q[:] = np.arange(len(q))[:, None] * [0.754877666, 0.569840291] % 1 * SIZE


def repeated(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Draw each sample twice."""
    q[1::2] = q[: len(q) - 1 : 2]


def narrow_cells(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Never draw from every other of 128 strips."""
    strips = np.floor(q[:, 0] / SIZE * 128)
    q[strips % 2 == 1, 0] -= SIZE / 128


def reused(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Draw one sample in 50 a second time, some time later."""
    q[70::50] = q[: len(q) - 70 : 50]


def restarted(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Restart the generator every 2,000 draws."""
    q[:] = q[np.arange(len(q)) % 2000]


def coarse(bits: int) -> Doctor:
    """Draw numbers of few bits."""

    def doctor(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
        q[:] = np.floor(q / SIZE * 2**bits) / 2**bits * SIZE

    return doctor


def handed_on(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Draw as x what was y of the draw before."""
    q[1:, 0] = q[:-1, 1]


def on_planes(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Draw y so that 3 x - 4 y is always near a whole number, as of poor generators."""
    u = q[:, 0] / SIZE
    q[:, 1] = (3 * u / 4 + rng.integers(0, 4, len(q)) / 4 + rng.uniform(0, 1e-3, len(q))) % 1 * SIZE


def stratified(side: int) -> Doctor:
    """Draw once from each of side x side squares, in random order, then again."""

    def doctor(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
        rounds = -(-len(q) // side**2)
        order = np.concatenate([rng.permutation(side**2) for _ in range(rounds)])[: len(q)]
        low = np.stack(np.divmod(order, side), axis=1)
        q[:] = (low + rng.random(q.shape)) * SIZE / side

    return doctor


def every(period: int) -> Doctor:
    """Draw the goal at regular intervals."""

    def doctor(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
        source[:] = np.arange(len(source)) % period == period - 1

    return doctor


LIES: list[tuple[str, int, Doctor]] = [
    ("goal draws", 1000, every(20)),
    ("goal draws", 100_000, biased(0.07)),
    ("goal draws", 100_000, biased(0.03)),
    ("goal draws", 1000, biased(0.2)),
    ("goal draws", 1000, biased(0.0)),
    ("uniform draws", 100, squeezed(0, 0, SIZE / 2)),
    ("uniform draws", 100, squeezed(1, SIZE / 2, SIZE)),
    ("uniform draws", 10_000, squeezed(1, 0, 0.99 * SIZE)),
    ("uniform draws", 50_000, squeezed(0, 0.001 * SIZE, SIZE)),
    ("uniform draws", 1000, diagonal),
    ("uniform draws", 1000, regular),
    ("repeated draws", 1000, repeated),
    ("uniform draws", 1000, narrow_cells),
    ("repeated draws", 200, reused),
    ("repeated draws", 5000, restarted),
    ("uniform draws", 2000, coarse(15)),
    ("uniform draws", 20_000, coarse(24)),
    ("uniform draws", 100, handed_on),
    ("uniform draws", 100, on_planes),
    ("uniform draws", 2000, stratified(10)),
    ("uniform draws", 3000, stratified(4)),
    ("uniform draws", 5000, stratified(40)),
]


@pytest.mark.parametrize(
    ("rule", "n", "doctor"), LIES, ids=[f"{rule} {i}" for i, (rule, *_) in enumerate(LIES)]
)
@pytest.mark.parametrize("seed", range(2))
def test_lies_about_draws_are_found(rule: str, n: int, doctor: Doctor, seed: int) -> None:
    """By the one rule that they break."""
    case = log_of(n, doctor, seed)
    found = verify(case.recording(), contract=case.contract)
    results = {each.rule: each for each in found.results if each.broken}
    assert rule in results
    assert results.keys() <= {rule, "uniform draws"}
    for finding in results[rule].findings:
        assert finding.seq == -1 or 2 <= finding.seq < n + 2
        words = ("expected", "depends on that of", "is not uniform", "was drawn before")
        assert any(each in finding.message for each in words)


def test_honest_draws_are_not_accused() -> None:
    """Wherever the windows end that are read."""
    case = log_of(100_000)
    late = {kind: table[table["seq"] > 70_000] for kind, table in case.log.tables.items()}
    for batches in ([case.log], [case.log.until(seq=70_000), Events(2, late)]):
        recording = Recording(case.manifest, case.world, partial(iter, batches), {})
        found = verify(recording, contract=case.contract)
        assert found.holds
        examined = {result.rule: result.examined for result in found.results}
        assert examined["goal draws"] == 100_000
        assert 90_000 < examined["uniform draws"] < 100_000


def informed(doctor: Callable[[np.ndarray], np.ndarray] | None = None) -> Case:
    """A long run with informed sampling, some of its samples moved."""
    case = run_of(
        planner="rrt-star", world="circles2d:n=12,seed=3", params={"informed": True, "step": 8},
        iterations=3000, smooth=False,
    )  # fmt: skip
    if doctor is None:
        return case
    table = case.log[Kind.SAMPLE].copy()
    chosen = table["source"] == Source.INFORMED
    table["q"][chosen] = doctor(table["q"][chosen])
    return replace(case, log=Events(2, {**case.log.tables, Kind.SAMPLE: table}))


def drawn_in(q: np.ndarray) -> np.ndarray:
    """Move samples towards the line from start to goal, which stays inside the ellipsoid."""
    middle = q.mean(axis=1, keepdims=True)
    return np.asarray(middle + 0.9 * (q - middle))


def favourite_pair(case: Case) -> Case:
    """Try the first waypoints more often than others."""
    table = case.log[Kind.SHORTCUT].copy()
    table["i"][~table["accepted"]], table["j"][~table["accepted"]] = 0, 2
    return replace(case, log=Events(2, {**case.log.tables, Kind.SHORTCUT: table}))


DOCTORED: list[Doctored] = [
    ("goal draws", "", lambda: log_of(2000, biased(0.15)), set()),
    ("coin tosses", "", lambda: run_of(planner="bi-rrt", params={"turn": "coin", "step":
     0.5}).judged_by(draws=Draws(coin=0.1)), set()),
    ("uniform draws", "", lambda: log_of(2000, diagonal), set()),
    ("uniform informed draws", "", lambda: informed(drawn_in), {"steering"}),
    ("random pairs", "", lambda: favourite_pair(run_of(seed=3, params={"step": 1.5})),
     {"shortcuts", "smoothed"}),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)


def test_honest_runs_are_not_accused() -> None:
    """The runs that are doctored above."""
    assert informed().broken() == set()
    assert run_of(seed=3, params={"step": 1.5}).broken() == set()
    assert run_of(planner="bi-rrt", params={"turn": "coin", "step": 0.5}).broken() == set()


def test_without_a_contract_no_draws_are_judged() -> None:
    """Whatever the samples are, and that is said."""
    case = log_of(2000, biased(0.5)).with_scenario(planner="their-own", params={})
    manifest = replace(case.manifest, contract=None)
    found = verify(replace(case, manifest=manifest, contract=None).recording())
    results = {each.rule: each.examined for each in found.results}
    assert not any(results[rule] for rule in STATISTICS)
    ((reason, names),) = found.not_judged.items()
    assert "no contract" in reason
    assert set(STATISTICS) <= set(names)


@settings(max_examples=20, deadline=None)
@given(low=st.floats(-1e9, 1e9), wide=st.floats(1e-100, 1e9), seed=st.integers(0, 99))
def test_bounds_of_any_size(low: float, wide: float, seed: int) -> None:
    """Ranges in which numbers are too coarse are not judged."""
    case = log_of(300, seed=seed)
    lower, upper = np.array([low, 0.0]), np.array([low + wide, SIZE])
    if not lower[0] < upper[0]:
        return
    u = np.random.default_rng(seed).random(300)
    samples = case.log[Kind.SAMPLE].copy()
    samples["q"][:, 0] = np.minimum(low + (upper[0] - low) * u, upper[0])
    world = World("odd", lower, upper, start=lower, goal=upper)
    scenario = replace(case.manifest.scenario, start=None, goal=None)
    manifest = replace(
        case.manifest, scenario=scenario, start=tuple(lower.tolist()), goal=tuple(upper.tolist())
    )
    events = Events(2, {**case.log.tables, Kind.SAMPLE: samples})
    changed = replace(case, manifest=manifest, world=world, log=events)
    assert "uniform draws" not in changed.broken()
