"""Rules about draws in the long run: how often each source is used, and whether draws are uniform.

They falsely accuse at most one recording in a million, all of them together: see
`brrt.verification.e_process`. Whatever a planner has drawn before, its next draw is uniform; so it
does not matter at which draw a run ends, nor that failed draws are repeated.
"""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Source, Table
from brrt.robots import Point
from brrt.scenario.contract import Contract
from brrt.verification.context import Context
from brrt.verification.draw_tests import (
    ChanceTest,
    EvennessTest,
    JointUniformityTest,
    RelationTest,
    UniformityTest,
)
from brrt.verification.draws import coarseness, informed_samples, is_fine
from brrt.verification.e_process import EProcess, Monitor
from brrt.verification.rule import ANY_PART, Rule

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_THIN = 1e-8
"""A chord shorter than this part of the ellipsoid, squared, is too much affected by rounding."""

_SHIFTS, _SPARE_BITS = (8, 20), 26
"""Leading bits of a draw after which it is tested again, and bits that must follow these."""


class LongRunRule(Rule):
    """A rule about frequencies or uniformity, which accumulates evidence against the promise.

    Attributes:
        tests: The tests of a recording that share the rate of false alarms: of two frequencies and
            of the smoother's pairs; of uniform draws three for all axes together and four for each
            axis; of informed draws one for each axis.
        monitors: The tests of the rule.
    """

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.tests = 6 + 5 * context.dof
        self.monitors: list[Monitor] = []

    def monitor(self, test: EProcess) -> Monitor:
        """Follow a test."""
        self.monitors.append(Monitor(test, self.tests))
        return self.monitors[-1]

    def take(self, monitor: Monitor, table: Table, draws: Floats) -> None:
        """Pass draws to a test, one for each row of the table."""
        for row, message in monitor.follow(draws):
            self.result.add_finding(table[row], message)

    def finish(self) -> None:
        for monitor in self.monitors:
            for message in monitor.close():
                self.result.add_finding(None, message)


class FrequencyRule(LongRunRule):
    """A rule about how often a source is used, whatever its chance in each stretch."""

    needs = "draws"
    kind = Kind.SAMPLE
    assumes = ("samples", "times")
    what: ClassVar[str]

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.test = self.monitor(ChanceTest(self.what))

    def judge_source(self, table: Table, source: Source, chance: float) -> None:
        """Test how many of the rows are from a source, each with a chance."""
        if 0 < chance < 1:
            self.result.examined += len(table)
            occurs = np.asarray(table["source"] == source, np.float64)
            self.take(self.test, table, np.stack([occurs, np.full(len(table), chance)], axis=1))


class GoalDraws(FrequencyRule):
    name = "goal draws"
    promise = "The goal is drawn as often as stated (one false alarm in a million recordings)."
    what = "the goal"

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is not None:
            drawn = self.context.drawn
            chosen = np.isinf(drawn.best)
            if contract.draws.goal_in_reach:
                chosen &= ~(drawn.forced | drawn.unsure)
            self.judge_source(drawn.table[chosen], Source.GOAL, contract.draws.goal_bias)


class CoinTosses(FrequencyRule):
    name = "coin tosses"
    promise = "A tree aims at the other as often as stated (one false alarm in a million)."
    what = "the other tree's newest node"

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is not None:
            self.judge_source(events[Kind.SAMPLE], Source.OTHER_TREE, contract.draws.coin)


class UniformDraws(LongRunRule):
    name = "uniform draws"
    promise = (
        "Uniform samples are uniform within the bounds and independent of each other (one false "
        "alarm in a million recordings)."
    )
    needs = "draws"
    kind = Kind.SAMPLE
    assumes = ("samples", "bounds")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        names = context.robot.coordinates(context.world)
        fine = np.flatnonzero(is_fine(context.lower, context.upper))
        bits = 52 - np.log2(coarseness(context.lower, context.upper))
        self.each: list[tuple[Monitor, int | Ints, float]] = []
        """Each test, the axes that it takes, and the part of their ranges that it looks at."""
        for k in fine.tolist():
            self._follow(UniformityTest(names[k], context.lower[k], context.upper[k]), k)
            self._follow(EvennessTest(names[k]), k)
            for shift in (shift for shift in _SHIFTS if shift + _SPARE_BITS <= bits[k]):
                where = f"{names[k]} within 1/{2**shift:,} of its range"
                self._follow(UniformityTest(where), k, 2.0**shift)
        if len(fine) > 1:
            self._follow(JointUniformityTest(len(fine)), fine)
            self._follow(EvennessTest(", ".join(names[k] for k in fine[:8]), len(fine)), fine)
            self._follow(RelationTest(tuple(names[k] for k in fine)), fine)

    def _follow(self, test: EProcess, axes: int | Ints, parts: float = 1.0) -> None:
        self.each.append((self.monitor(test), axes, parts))

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is None:
            return
        samples, lower = events[Kind.SAMPLE], self.context.lower
        table = samples[samples["source"] == Source.UNIFORM]
        self.result.examined += len(table)
        part = (table["q"] - lower) / (self.context.upper - lower)
        for monitor, axes, parts in self.each:
            draws = part[:, axes]
            self.take(monitor, table, draws if parts == 1 else draws * parts % 1)


class UniformInformedDraws(LongRunRule):
    name = "uniform informed draws"
    promise = (
        "Informed samples are uniform in the ellipsoid, of points alone (one false alarm in a "
        "million recordings)."
    )
    needs = "draws"
    assumes = ("samples", "costs", "times", "bounds")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        for name in context.robot.coordinates(context.world):
            self.monitor(UniformityTest(f"{name} along its chord"))

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is None or not isinstance(self.context.robot, Point):
            return
        table, best = informed_samples(self.context.drawn)
        self.result.examined += len(table)
        for k, monitor in enumerate(self.monitors):
            part, valid = _along_chord(self.context, np.asarray(table["q"]), best, k)
            self.take(monitor, table[valid], part[valid])


def _along_chord(context: Context, q: Floats, best: Floats, k: int) -> tuple[Floats, Flags]:
    """Return how far along its chord each sample is on an axis, 0 to 1, and where that is exact.

    Given its other coordinates, a coordinate of an informed sample is uniform along the chord that
    the ellipsoid and the bounds leave it. The chord ends at the x at which the distances to the
    foci add up to the best cost c: s + g = c and s^2 - g^2 = 2 D x + a^2 - b^2 give
    s = alpha + beta x, and a quadratic equation in x.
    """
    others = np.arange(context.dof) != k
    start, goal = context.start, context.goal
    a = ((q - start)[:, others] ** 2).sum(axis=1)
    b = ((q - goal)[:, others] ** 2).sum(axis=1)
    apart = goal[k] - start[k]
    alpha, beta = best / 2 + (a - b - apart**2) / (2 * best), apart / best
    room, square = 1 - beta**2, alpha**2 - a * (1 - beta**2)
    half = np.sqrt(np.maximum(square, 0)) / room
    middle = alpha * beta / room
    low = np.maximum(middle - half, context.lower[k] - start[k])
    high = np.minimum(middle + half, context.upper[k] - start[k])
    valid = (square > _THIN * best**2) & (room > _THIN) & (high - low > _THIN * best)
    return (q[:, k] - start[k] - low) / (high - low), np.asarray(valid)


class RandomPairs(LongRunRule):
    name = "random pairs"
    promise = "All pairs of waypoints are as likely to be tried (one false alarm in a million)."
    needs = ANY_PART

    def finish(self) -> None:
        monitor, rng = self.monitor(UniformityTest("the pair")), np.random.default_rng(0)
        table, paths = self.context.events[Kind.SHORTCUT], self.context.planned_paths
        ends = [int(event["seq"]) for event, _ in paths]
        first = np.searchsorted(table["seq"], [*ends, 1 << 62])
        for (_, path), begin, end in zip(paths, first, first[1:], strict=False):
            if end > begin:
                some = table[begin:end]
                valid, part = _ranks(len(path), some, rng)
                self.result.examined += int(valid.sum())
                self.take(monitor, some[valid], part[valid])
        super().finish()


def _ranks(points: int, table: Table, rng: np.random.Generator) -> tuple[Flags, Floats]:
    """Return which attempts try a pair of a path, and the rank of each among all pairs, 0 to 1.

    A rank is one of few; a random number between it and the next is uniform where ranks are.
    """
    removed = np.where(table["accepted"], table["j"] - table["i"] - 1, 0).astype(np.int64)
    n = points - np.concatenate([[0], np.cumsum(removed)])[:-1]
    i, j = table["i"].astype(np.int64), table["j"].astype(np.int64)
    pairs = (n - 1) * (n - 2) // 2
    rank = i * (n - 2) - i * (i - 1) // 2 + j - i - 2
    return (i >= 0) & (i + 1 < j) & (j < n), (rank + rng.random(len(rank))) / np.maximum(pairs, 1)


RULES = (GoalDraws, CoinTosses, UniformDraws, UniformInformedDraws, RandomPairs)
