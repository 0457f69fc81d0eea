"""Rules about single samples: their sources and places."""

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Source, Stage
from brrt.replay.text import vector
from brrt.robots import Point
from brrt.scenario.contract import Contract, Draws
from brrt.verification.context import Context
from brrt.verification.draws import Drawn, informed_samples, is_fine
from brrt.verification.rule import Rule
from brrt.verification.timeline import row_keys

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_REMEMBERED = 1_000_000
"""Draws with which others are compared."""

_SMALL = 1e-3
"""Informed samples are compared if the best path is longer than this part of the bounds."""

_KEYS = np.dtype([("key", "<u8"), ("first", "<f8"), ("seq", "<i8")])


class Samples(Rule):
    name = "samples"
    promise = (
        "Samples of the goal are the goal, as closely as claimed (of tree 1 also the start), and "
        "no others are."
    )
    kind = Kind.SAMPLE
    assumes = ("samples",)

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        # In one dimension, or with few numbers to draw from, the goal itself is drawn by chance.
        fine = context.dof > 1 and is_fine(context.lower, context.upper).all()
        self.never_goal = context.has_contract and fine

    def window(self, events: Events, contract: Contract) -> None:
        context, table = self.context, events[Kind.SAMPLE]
        uniform = table[table["source"] == Source.UNIFORM]
        if self.never_goal:
            at_goal = (uniform["q"] == context.goal).all(axis=1)
            self.judge(uniform, at_goal, lambda _: "a uniform sample is exactly the goal")
        goals = table[table["source"] == Source.GOAL]
        wrong = (goals["q"] != context.goal).any(axis=1)
        wrong &= (goals["tree"] != 1) | (goals["q"] != context.start).any(axis=1)
        if context.claims.goal_tolerance:
            far = context.distance(goals["q"], context.goal[None])
            wrong &= ~context.at_most(far, context.claims.goal_tolerance)
        self.judge(goals, wrong, lambda i: f"sample {vector(goals['q'][i])} is not the goal")


class Sources(Rule):
    name = "sources"
    promise = "Each sample is from a source that the planner uses then; a path ends some runs."
    needs = "draws"
    kind = Kind.SAMPLE
    assumes = ("samples", "times")

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


class InformedSamples(Rule):
    name = "informed samples"
    promise = "Informed samples are where a path may cost less than the best; of points alone."
    assumes = ("samples", "costs", "times")

    def window(self, events: Events, contract: Contract) -> None:
        context = self.context
        if not isinstance(context.robot, Point):  # bodies fall back on samples from the bounds
            return
        table, best = informed_samples(context.drawn)
        to_start = context.distance(context.start[None], table["q"])
        least = to_start + context.distance(table["q"], context.goal[None])
        self.judge(
            table, ~context.at_most(least, best),
            lambda i: f"a path through it costs at least {least[i]:.9g}; the best, {best[i]:.9g}",
        )  # fmt: skip


class InformedNodes(Rule):
    name = "informed nodes"
    promise = "Where samples are informed, no node joins through which no path can cost less."
    needs = "near"
    assumes = ("costs", "times")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.best = np.inf

    def window(self, events: Events, contract: Contract) -> None:
        context, edges, paths = self.context, events[Kind.EDGE], events[Kind.PATH]
        paths = paths[paths["stage"] != Stage.SMOOTHED]
        costs = np.append(self.best, paths["cost"])
        best, self.best = costs[np.searchsorted(paths["seq"], edges["seq"])], float(costs[-1])
        draws = contract.draws
        if contract.near is None or contract.growth is None or not (draws and draws.informed):
            return
        edges, best = edges[np.isfinite(best)], best[np.isfinite(best)]
        to_start = context.distance(context.start[None], edges["q"])
        least = to_start + context.distance(edges["q"], context.goal[None])
        self.judge(
            edges, ~context.at_most(least, best),
            lambda i: f"a path through it costs at least {least[i]:.9g}; the best, {best[i]:.9g}",
        )  # fmt: skip


class RepeatedDraws(Rule):
    """Judges the first million draws of a generator against each other, later ones against them."""

    name = "repeated draws"
    promise = "No uniform or informed sample is drawn twice."
    needs = "draws"
    kind = Kind.SAMPLE
    assumes = ("samples", "bounds")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        fine = context.dof > 1 and bool(is_fine(context.lower, context.upper).all())
        branches = context.manifest.branches
        reseeded = [branch.events for branch in branches if branch.seed is not None]
        self.firsts, self.judges, self.stream = np.array(reseeded, np.int64), fine, 0
        self.seen = np.empty(0, _KEYS)

    def window(self, events: Events, contract: Contract) -> None:
        if contract.draws is None or not self.judges:
            return
        drawn, wide = self.context.drawn, float((self.context.upper - self.context.lower).max())
        source = drawn.table["source"]
        # The ellipsoid of a goal at the start, or almost there, holds few numbers.
        large = drawn.best > _SMALL * wide
        table = drawn.table[(source == Source.UNIFORM) | ((source == Source.INFORMED) & large)]
        # Windows end where branches begin; a branch that draws from its own seed may draw again
        # what its parent has drawn.
        stream = int(np.searchsorted(self.firsts, table["seq"][:1], "right").sum())
        if stream != self.stream:
            self.stream, self.seen = stream, self.seen[:0]
        keys = np.empty(len(table), _KEYS)
        keys["key"] = row_keys((), np.asarray(table["q"]))
        keys["first"], keys["seq"] = table["q"][:, 0], table["seq"]
        known = np.concatenate([self.seen, keys])
        known = known[np.argsort(known["key"], kind="stable")]
        again = np.ones(max(len(known) - 1, 0), bool)
        for name in ("key", "first"):
            again &= known[name][1:] == known[name][:-1]
        before, later = known["seq"][:-1][again].tolist(), known["seq"][1:][again].tolist()
        earlier = dict(zip(later, before, strict=True))
        twice = np.isin(table["seq"], later)
        self.judge(
            table, twice,
            lambda i: (
                f"sample {vector(table['q'][i])} was drawn before, by event "
                f"{earlier[int(table['seq'][i])]}"
            ),
        )  # fmt: skip
        if len(self.seen) < _REMEMBERED:
            self.seen = known


RULES = (Samples, Sources, InformedSamples, InformedNodes, RepeatedDraws)
