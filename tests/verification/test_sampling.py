"""What is drawn: lies are found by the statistics of a log, and honest logs are not accused."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, Memory, Run, Scenario, World
from brrt.events import Phase, Source, Status, table_dtype
from brrt.planners import make_planner
from brrt.scenario.contract import Draws
from brrt.verification import examine
from brrt.verification.e_process import (
    Bet,
    Cells,
    Evenness,
    Together,
    Tosses,
    Watch,
    log_gamma,
    together,
)
from tests.verification.test_rules import Evidence, evidence, promise

Doctor = Callable[[np.random.Generator, np.ndarray, np.ndarray], None]
"""Changes the samples, shape (n, 2), and the sources, shape (n,), of a log of draws."""

SIZE, BIAS = 100.0, 0.05
STATISTICS = (
    "goal draws", "coin tosses", "even draws", "even informed draws", "random pairs",
)  # fmt: skip


def log_of(n: int, doctor: Doctor | None = None, seed: int = 0) -> Evidence:
    """A log of nothing but draws, as rrt makes them in an empty world: nothing joins the tree."""
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
    # What came of the draws is left out, so nothing is promised of that.
    contract = replace(make_planner(scenario).contract(run.problem), growth=None)
    return Evidence(run.manifest, run.problem.world, Events(2, tables), contract)


def biased(chance: float) -> Doctor:
    """The goal, more or less often than stated."""

    def doctor(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
        source[:] = rng.random(len(source)) < chance

    return doctor


def squeezed(axis: int, low: float, high: float) -> Doctor:
    """One coordinate from a part of its range."""

    def doctor(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
        q[:, axis] = rng.uniform(low, high, len(q))

    return doctor


def diagonal(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Each coordinate is even, but the two have to do with each other."""
    q[:, 1] = (q[:, 0] + 0.7 * q[:, 1]) % SIZE


def regular(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """More even than chance: a sequence of low discrepancy (Weyl 1916)."""
    q[:] = np.arange(len(q))[:, None] * [0.754877666, 0.569840291] % 1 * SIZE


def repeated(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Each sample comes twice."""
    q[1::2] = q[: len(q) - 1 : 2]


def narrow_cells(rng: np.random.Generator, q: np.ndarray, source: np.ndarray) -> None:
    """Every other of 128 strips is never drawn from."""
    strips = np.floor(q[:, 0] / SIZE * 128)
    q[strips % 2 == 1, 0] -= SIZE / 128


LIES: list[tuple[str, int, Doctor]] = [
    ("goal draws", 100_000, biased(0.07)),
    ("goal draws", 100_000, biased(0.03)),
    ("goal draws", 1000, biased(0.2)),
    ("goal draws", 1000, biased(0.0)),
    ("even draws", 100, squeezed(0, 0, SIZE / 2)),
    ("even draws", 100, squeezed(1, SIZE / 2, SIZE)),
    ("even draws", 10_000, squeezed(1, 0, 0.99 * SIZE)),
    ("even draws", 50_000, squeezed(0, 0.001 * SIZE, SIZE)),
    ("even draws", 1000, diagonal),
    ("even draws", 1000, regular),
    ("even draws", 1000, repeated),
    ("even draws", 1000, narrow_cells),
]


@pytest.mark.parametrize(
    ("rule", "n", "doctor"), LIES, ids=[f"{rule} {i}" for i, (rule, *_) in enumerate(LIES)]
)
@pytest.mark.parametrize("seed", range(2))
def test_lies_about_draws_are_found(rule: str, n: int, doctor: Doctor, seed: int) -> None:
    """By the rule that they break alone, at a draw and not only at the end of the log."""
    case = log_of(n, doctor, seed)
    results = {
        t.rule: t for t in examine(case.manifest, case.world, case.log, case.contract) if t.broken
    }
    assert results.keys() == {rule}
    for found in results[rule].findings:
        assert found.seq == -1 or 2 <= found.seq < n + 2
        assert "due" in found.message or "tells of the next" in found.message


def test_honest_draws_are_not_accused() -> None:
    """Nor is it a matter of where the windows end that are read."""
    case = log_of(100_000)
    batches = [case.log.until(seq=70_000), _after(case.log, 70_000)]
    for events in (case.log, batches):
        results = examine(case.manifest, case.world, events, case.contract)
        assert not [result.findings for result in results if result.broken]
        looked = {result.rule: result.examined for result in results}
        assert looked["goal draws"] == 100_000
        assert 3 * 90_000 < looked["even draws"] < 3 * 100_000


def _after(log: Events, seq: int) -> Events:
    return Events(log.dof, {kind: t[t["seq"] > seq] for kind, t in log.tables.items()})


def ended(rng: np.random.Generator) -> Iterator[tuple[Bet, np.ndarray]]:
    """Draws of short runs that end at what they draw, as a planner's do, with bets on them."""
    n = int(rng.integers(5, 150))
    u = rng.random((n, 2))
    # The first draw in a corner ends the run; so the last draw of a run that ends is never even.
    ends = np.flatnonzero((u > 0.9).all(axis=1))
    u = u[: ends[0] + 1] if len(ends) else u
    yield Evenness("x"), u[:, 0]
    yield Together(2), u
    tosses = (u[:, 0] < BIAS).astype(float)
    stop = np.flatnonzero(tosses)
    yield Tosses(BIAS, "the goal"), tosses[: stop[0] + 1] if len(stop) else tosses


@pytest.mark.parametrize("alarm", [0.05, 0.3])
def test_false_alarms_are_no_more_than_stated(alarm: float) -> None:
    """Over short runs that end because of what they drew, looked at again and again.

    With a true chance at its limit, the count below is exceeded once in a million times.
    """
    rng, runs, alarms = np.random.default_rng(5), 250, np.zeros(3)
    for _ in range(runs):
        for i, (bet, draws) in enumerate(ended(rng)):
            watch = Watch(bet, 1, alarm)
            alarms[i] += bool([*watch.follow(draws), *watch.close()])
    limit = runs * alarm + 5 * np.sqrt(runs * alarm * (1 - alarm))
    assert (alarms <= limit).all(), alarms


def test_a_gambler_wins_nothing_on_average() -> None:
    """What he owns at the end of a run, be it ended by what was drawn, is worth 1 at most."""
    rng = np.random.default_rng(3)
    owned = []
    for _ in range(500):
        bets = list(ended(rng))
        for bet, draws in bets:
            bet.add(draws)
        owned.append([np.exp(bet.judge()[0]) for bet, _ in bets])
    mean, error = np.mean(owned, axis=0), np.std(owned, axis=0) / np.sqrt(500)
    assert (mean <= 1 + 5 * error).all(), (mean, error)


@given(counts=st.lists(st.integers(0, 40), min_size=2, max_size=6), data=st.data())
def test_wealth_is_the_product_of_the_odds(counts: list[int], data: st.DataObject) -> None:
    """Against the slow way: one bet after the other, in whatever order."""
    parts = data.draw(st.lists(st.integers(1, 9), min_size=len(counts), max_size=len(counts)))
    chances = np.array(parts) / sum(parts)
    draws = data.draw(st.permutations([i for i, n in enumerate(counts) for _ in range(n)]))
    seen, log = np.zeros(len(counts)), 0.0
    for draw in draws:
        log += np.log((seen[draw] + 0.5) / (seen.sum() + len(counts) / 2) / chances[draw])
        seen[draw] += 1
    both = Cells([chances, np.array([0.5, 0.5])])
    wealth = both.wealth(np.array([*counts, 0, 0], float))
    np.testing.assert_allclose(wealth, [log, 0.0], atol=1e-9 * (1 + sum(counts)))
    assert together(np.array([log, log])) == pytest.approx(log, abs=1e-9)


@given(st.floats(1e-3, 1e9))
def test_log_gamma(x: float) -> None:
    """Against the standard library's."""
    assert float(log_gamma(np.array(x))) == pytest.approx(math.lgamma(x), rel=1e-12, abs=1e-9)


def run_of(**given: Any) -> Evidence:
    """A clean run."""
    memory = Memory()
    run = Run(Scenario(**({"clock": "logical", "world": "circles2d:n=40,seed=3"} | given)))
    run.execute([memory])
    return Evidence(run.manifest, run.problem.world, memory.events(), None)


def informed(doctor: Callable[[np.ndarray], np.ndarray] | None = None) -> Evidence:
    """A long run with informed sampling in an empty world, some of its samples moved."""
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
    """Closer to the line from start to goal, so inside the ellipsoid all the same."""
    middle = q.mean(axis=1, keepdims=True)
    return np.asarray(middle + 0.9 * (q - middle))


def favourite_pair(case: Evidence) -> Evidence:
    """A smoother that tries the first waypoints more often than others."""
    table = case.log[Kind.SHORTCUT].copy()
    table["i"][~table["accepted"]], table["j"][~table["accepted"]] = 0, 2
    return replace(case, log=Events(2, {**case.log.tables, Kind.SHORTCUT: table}))


def source(row: int, value: Source) -> Callable[[Evidence], Evidence]:
    """Another source of one sample."""
    return lambda case: case.edit(Kind.SAMPLE, row, source=value)


DOCTORED: list[tuple[str, Callable[[], Evidence], set[str]]] = [
    ("sources", lambda: source(3, Source.OTHER_TREE)(evidence("rrt")), set()),
    ("sources", lambda: source(3, Source.INFORMED)(evidence("rrt-star")), {"informed samples"}),
    ("sources", lambda: source(-1, Source.UNIFORM)(informed()), set()),
    ("sources", lambda: source(3, Source.OTHER_TREE)(evidence("rrt-connect")), {
        "link tries"}),
    ("sources", lambda: promise(draws=Draws(goal_bias=0.0))(evidence("rrt")), set()),
    ("informed samples", lambda: informed(lambda q: q * [1, 0] + [0, 1.0]), {
        "even informed draws", "steering"}),
    ("goal draws", lambda: log_of(2000, biased(0.15)), set()),
    ("coin tosses", lambda: promise(draws=Draws(coin=0.1))(
        run_of(planner="bi-rrt", params={"turn": "coin", "step": 0.5})), set()),
    ("even draws", lambda: log_of(2000, diagonal), set()),
    ("even informed draws", lambda: informed(drawn_in), {"steering"}),
    ("random pairs", lambda: favourite_pair(run_of(seed=3, params={"step": 1.5})), {
        "shortcuts", "smoothed"}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("rule", "doctored", "also"), DOCTORED, ids=[f"{r} {i}" for i, (r, *_) in enumerate(DOCTORED)]
)
def test_doctored_draws_are_found(
    rule: str, doctored: Callable[[], Evidence], also: set[str]
) -> None:
    """As in test_checks."""
    broken = doctored().broken()
    assert rule in broken
    assert broken - {rule} <= also


def test_honest_runs_are_not_accused() -> None:
    """Of what the doctored ones above are made from."""
    assert informed().broken() == set()
    assert run_of(seed=3, params={"step": 1.5}).broken() == set()
    assert run_of(planner="bi-rrt", params={"turn": "coin", "step": 0.5}).broken() == set()


def test_of_a_planner_that_is_not_known_no_draws_are_judged() -> None:
    """Whatever it says of a sample's source."""
    case = log_of(2000, biased(0.5)).scenario(planner="their-own", params={})
    manifest = replace(case.manifest, contract=None)
    results = {t.rule: t.examined for t in examine(manifest, case.world, case.log)}
    assert not any(results[rule] for rule in STATISTICS)


@settings(max_examples=20, deadline=None)
@given(low=st.floats(-1e9, 1e9), wide=st.floats(1e-300, 1e9), seed=st.integers(0, 99))
def test_bounds_of_any_size(low: float, wide: float, seed: int) -> None:
    """A range that the numbers in it are too coarse for is not judged."""
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
    results = {t.rule: t for t in examine(manifest, world, events, case.contract)}
    assert not results["even draws"].broken, results["even draws"].findings
