"""Rules about samples: their sources, how often each is used, and whether draws are uniform.

Frequencies and uniformity show in the long run alone. Rules about them falsely accuse at most one
recording in a million, all of them together: see `brrt.verification.e_process`. Whatever a planner
has drawn before, its next draw is uniform; so it does not matter at which draw a run ends, nor
that failed draws are repeated.
"""

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Source, Table
from brrt.replay.text import vector
from brrt.robots import Point
from brrt.scenario.contract import Contract, Draws
from brrt.verification.context import Context
from brrt.verification.draws import Drawn
from brrt.verification.e_process import (
    BernoulliTest,
    EProcess,
    JointUniformityTest,
    Monitor,
    UniformityTest,
)
from brrt.verification.rule import ANY_PART, Rule

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_THIN = 1e-8
"""A chord shorter than this part of the ellipsoid, squared, is too much affected by rounding."""

_FINE = 1e-9
"""Ranges that are a smaller part of their coordinates are rounded too coarsely to be judged."""


def _is_fine(context: Context) -> Flags:
    """Return which axes have enough numbers between their bounds, shape (dof,)."""
    wide = context.upper - context.lower
    return np.asarray(wide > _FINE * np.abs([context.lower, context.upper]).max(axis=0))


class Samples(Rule):
    name = "samples"
    promise = "Samples of the goal are the goal (of tree 1 also the start), and no others are."
    kind = Kind.SAMPLE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        # In one dimension, or with few numbers to draw from, the goal itself is drawn by chance.
        self.never_goal = context.has_contract and context.dof > 1 and _is_fine(context).all()

    def window(self, events: Events, contract: Contract) -> None:
        context, table = self.context, events[Kind.SAMPLE]
        uniform = table[table["source"] == Source.UNIFORM]
        if self.never_goal:
            at_goal = (uniform["q"] == context.goal).all(axis=1)
            self.judge(uniform, at_goal, lambda _: "a uniform sample is exactly the goal")
        goals = table[table["source"] == Source.GOAL]
        wrong = (goals["q"] != context.goal).any(axis=1)
        wrong &= (goals["tree"] != 1) | (goals["q"] != context.start).any(axis=1)
        self.judge(goals, wrong, lambda i: f"sample {vector(goals['q'][i])} is not the goal")


class Sources(Rule):
    name = "sources"
    promise = "Each sample is from a source that the planner uses then; a path ends some runs."
    needs = "draws"
    kind = Kind.SAMPLE

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is None:
            return
        drawn = self.context.drawn
        source, allowed = drawn.table["source"], _allowed(contract.draws, drawn)
        ended = np.isfinite(drawn.best) & (contract.stops is True)
        right = np.select([source == s for s in Source], [allowed[s] for s in Source], default=True)
        self.judge(
            drawn.table, ended | ~right,
            lambda i: (
                f"a sample from source {Source(source[i]).label} "
                + ("without a path" if np.isinf(drawn.best[i]) else "although there is a path")
            ),
        )  # fmt: skip


def _allowed(draws: Draws, drawn: Drawn) -> dict[Source, Flags]:
    """Return from which source each sample may be, shape (n,) each."""
    no_path = np.isinf(drawn.best)
    surely = drawn.forced & ~drawn.unsure & draws.goal_in_reach
    perhaps = (drawn.forced | drawn.unsure) & draws.goal_in_reach
    informed = ~no_path & draws.informed
    return {
        Source.UNIFORM: np.where(no_path, ~surely & (draws.goal_bias < 1), ~informed),
        Source.GOAL: no_path & (perhaps | (draws.goal_bias > 0)),
        Source.OTHER_TREE: np.full(len(no_path), draws.coin > 0),
        Source.INFORMED: informed,
    }


def _informed(drawn: Drawn) -> tuple[Table, Floats]:
    """Return the informed samples, and what the best path cost then."""
    chosen = (drawn.table["source"] == Source.INFORMED) & np.isfinite(drawn.best)
    return drawn.table[chosen], drawn.best[chosen]


class InformedSamples(Rule):
    name = "informed samples"
    promise = "Informed samples are where a path may cost less than the best; of points alone."

    def window(self, events: Events, contract: Contract) -> None:
        context = self.context
        if not isinstance(context.robot, Point):  # bodies fall back on samples from the bounds
            return
        table, best = _informed(context.drawn)
        to_start = context.distance(context.start[None], table["q"])
        least = to_start + context.distance(table["q"], context.goal[None])
        self.judge(
            table, ~context.at_most(least, best),
            lambda i: f"a path through it costs at least {least[i]:.9g}; the best, {best[i]:.9g}",
        )  # fmt: skip


class LongRunRule(Rule):
    """A rule about frequencies or uniformity, which accumulates evidence against the promise.

    Attributes:
        tests: The tests of a recording that share the rate of false alarms: for each stretch on
            two frequencies, for each axis on uniform and on informed draws, on all axes together,
            and on the smoother's pairs.
    """

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.tests = 2 * len(context.stretches) + 2 + 2 * context.dof
        self.monitors: list[Monitor | None] = []

    def monitor(self, test: EProcess) -> Monitor:
        """Follow a test."""
        return Monitor(test, self.tests)

    def take(self, monitor: Monitor, table: Table, draws: Floats) -> None:
        """Pass draws to a test, one for each row of the table."""
        self.result.examined += len(table)
        for row, message in monitor.follow(draws):
            self.result.add_finding(table[row], message)

    def finish(self) -> None:
        for monitor in self.monitors:
            for message in () if monitor is None else monitor.close():
                self.result.add_finding(None, message)


class FrequencyRule(LongRunRule):
    """A rule about how often a source is used, tested apart in each stretch."""

    needs = "draws"
    kind = Kind.SAMPLE
    what: ClassVar[str]

    def __init__(self, context: Context, chance: Callable[[Draws], float]) -> None:
        super().__init__(context)
        draws = [contract.draws for _, contract in context.stretches]
        chances = [0.0 if each is None else chance(each) for each in draws]
        self.monitors = [
            self.monitor(BernoulliTest(p, self.what)) if 0 < p < 1 else None for p in chances
        ]

    def judge_source(self, table: Table, source: Source) -> None:
        """Test how many of the rows are from a source."""
        monitor = self.monitors[int(self.context.stretch(table[:1])[0])] if len(table) else None
        if monitor is not None:
            self.take(monitor, table, np.asarray(table["source"] == source, np.float64))


class GoalDraws(FrequencyRule):
    name = "goal draws"
    promise = "The goal is drawn as often as stated (one false alarm in a million recordings)."
    what = "the goal"

    def __init__(self, context: Context) -> None:
        super().__init__(context, lambda draws: draws.goal_bias)

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is not None:
            drawn = self.context.drawn
            chosen = np.isinf(drawn.best)
            if contract.draws.goal_in_reach:
                chosen &= ~(drawn.forced | drawn.unsure)
            self.judge_source(drawn.table[chosen], Source.GOAL)


class CoinTosses(FrequencyRule):
    name = "coin tosses"
    promise = "A tree aims at the other as often as stated (one false alarm in a million)."
    what = "the other tree's newest node"

    def __init__(self, context: Context) -> None:
        super().__init__(context, lambda draws: draws.coin)

    def window(self, events: Events, contract: Contract) -> None:
        self.judge_source(events[Kind.SAMPLE], Source.OTHER_TREE)


class UniformDraws(LongRunRule):
    name = "uniform draws"
    promise = "Uniform samples are uniform within the bounds (one false alarm in a million)."
    needs = "draws"
    kind = Kind.SAMPLE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        names, fine = context.robot.coordinates(context.world), np.flatnonzero(_is_fine(context))
        tests: list[EProcess] = [
            UniformityTest(names[k], context.lower[k], context.upper[k]) for k in fine.tolist()
        ]
        self.axes: list[int | NDArray[np.int64]] = [*fine.tolist()]
        if len(fine) > 1:
            self.axes.append(fine)
            tests.append(JointUniformityTest(len(fine)))
        self.monitors = list(map(self.monitor, tests))

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is None:
            return
        samples, lower = events[Kind.SAMPLE], self.context.lower
        table = samples[samples["source"] == Source.UNIFORM]
        part = (table["q"] - lower) / (self.context.upper - lower)
        for axes, monitor in zip(self.axes, self.monitors, strict=True):
            if monitor is not None:
                self.take(monitor, table, part[:, axes])


class UniformInformedDraws(LongRunRule):
    name = "uniform informed draws"
    promise = (
        "Informed samples are uniform in the ellipsoid, of points alone (one false alarm in a "
        "million recordings)."
    )
    needs = "draws"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        names = context.robot.coordinates(context.world)
        self.monitors = [self.monitor(UniformityTest(f"{name} along its chord")) for name in names]

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is None or not isinstance(self.context.robot, Point):
            return
        table, best = _informed(self.context.drawn)
        for k, monitor in enumerate(self.monitors):
            part, valid = _along_chord(self.context, np.asarray(table["q"]), best, k)
            if monitor is not None:
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
                self.take(monitor, some[valid], part[valid])
        self.monitors = [monitor]
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


RULES = (
    Samples, Sources, InformedSamples, GoalDraws, CoinTosses, UniformDraws, UniformInformedDraws,
    RandomPairs,
)  # fmt: skip
