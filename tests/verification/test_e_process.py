"""Tests by e-processes: false alarms, wealth, and the functions that they are made of."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brrt.verification.draw_tests import (
    EvennessTest,
    FrequencyTest,
    JointUniformityTest,
    RelationTest,
    UniformityTest,
)
from brrt.verification.e_process import EProcess, Monitor, Partitions, log_gamma, log_mean

BIAS = 0.05


def ended(rng: np.random.Generator) -> Iterator[tuple[EProcess, np.ndarray]]:
    """Draws of short runs that end at what they draw, as a planner's do, each with a test."""
    n = int(rng.integers(5, 150))
    u = rng.random((n, 2))
    # The first draw in a corner ends the run, so the last draw is never uniform.
    ends = np.flatnonzero((u > 0.9).all(axis=1))
    u = u[: ends[0] + 1] if len(ends) else u
    yield UniformityTest("x"), u[:, 0]
    yield JointUniformityTest(2), u
    yield EvennessTest("x"), u[:, 0]
    yield EvennessTest("x, y", 2), u
    yield RelationTest(("x", "y")), u
    chance = rng.choice([0.02, BIAS, 0.3], n)
    tosses = np.stack([rng.random(n) < chance, chance], axis=1)
    stop = np.flatnonzero(tosses[:, 0])
    yield FrequencyTest("the goal"), tosses[: stop[0] + 1] if len(stop) else tosses


@pytest.mark.parametrize("alarm", [0.05, 0.3])
def test_false_alarms_are_no_more_than_stated(alarm: float) -> None:
    """Over short runs that end because of what they drew, tested again and again.

    If the probability is at its limit, the count exceeds that below once in a million.
    """
    rng, runs, alarms = np.random.default_rng(5), 250, np.zeros(6)
    for _ in range(runs):
        for i, (test, draws) in enumerate(ended(rng)):
            monitor = Monitor(test, 1, alarm)
            alarms[i] += bool([*monitor.follow(draws), *monitor.close()])
    limit = runs * alarm + 5 * np.sqrt(runs * alarm * (1 - alarm))
    assert (alarms <= limit).all(), alarms


def test_the_expected_wealth_is_at_most_1() -> None:
    """At the end of a run, even if it is ended by what was drawn."""
    rng = np.random.default_rng(3)
    wealths = []
    for _ in range(500):
        tests = list(ended(rng))
        for test, draws in tests:
            test.add(draws)
        wealths.append([np.exp(test.log_wealth()[0]) for test, _ in tests])
    mean, error = np.mean(wealths, axis=0), np.std(wealths, axis=0) / np.sqrt(500)
    assert (mean <= 1 + 5 * error).all(), (mean, error)


@given(counts=st.lists(st.integers(0, 40), min_size=2, max_size=6), data=st.data())
def test_wealth_is_the_product_of_the_odds(counts: list[int], data: st.DataObject) -> None:
    """Against one bet after the other, in any order."""
    parts = data.draw(st.lists(st.integers(1, 9), min_size=len(counts), max_size=len(counts)))
    chances = np.array(parts) / sum(parts)
    draws = data.draw(st.permutations([i for i, n in enumerate(counts) for _ in range(n)]))
    seen, log = np.zeros(len(counts)), 0.0
    for draw in draws:
        log += np.log((seen[draw] + 0.5) / (seen.sum() + len(counts) / 2) / chances[draw])
        seen[draw] += 1
    both = Partitions([chances, np.array([0.5, 0.5])])
    wealth = both.log_wealths(np.array([*counts, 0, 0], float))
    np.testing.assert_allclose(wealth, [log, 0.0], atol=1e-9 * (1 + sum(counts)))
    assert log_mean(np.array([log, log])) == pytest.approx(log, abs=1e-9)


@given(st.floats(1e-3, 1e9))
def test_log_gamma(x: float) -> None:
    """Against the standard library's."""
    assert float(log_gamma(np.array(x))) == pytest.approx(math.lgamma(x), rel=1e-12, abs=1e-9)
