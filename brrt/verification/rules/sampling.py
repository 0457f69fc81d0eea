"""Rules about what is drawn: from where, how often, and how evenly.

That a sample may be where it is can be seen; that samples are even, or of the goal as often as
stated, only in the long run. Rules about the long run find fault with a sound recording at most
once in a million recordings, all such rules together: see `brrt.verification.e_process`. What a
planner draws after all it has drawn before is even whatever came of that; so it is no matter when
a run ended, nor that draws which failed are drawn again.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Source, Stage, Table
from brrt.robots import Point
from brrt.scenario.contract import Draws
from brrt.verification.context import CLOSE, Context, Windows
from brrt.verification.e_process import Bet, Evenness, Together, Tosses, Watch
from brrt.verification.result import RuleResult
from brrt.verification.rules.log import text

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_THIN = 1e-8
"""A chord so much shorter than the ellipsoid, squared, says more of rounding than of draws."""

_FINE = 1e-9
"""Ranges that are so small a part of the coordinates in them are rounded too coarsely to judge."""


class Drawn(NamedTuple):
    """Samples, and what the planner knew when it drew them.

    Attributes:
        table: The samples, shape (n,).
        best: Cost of the best path so far, inf where there was none, shape (n,).
        forced: Whether the newest node was within a step of the goal, for which no coin is tossed.
        unsure: Whether that hangs on a rounding.
    """

    table: Table
    best: Floats
    forced: Flags
    unsure: Flags


@dataclass(slots=True)
class _Past:
    """What of the windows before is needed in the next one."""

    best: float = np.inf
    sample: int = -1
    edge: int = -1
    near: tuple[bool, bool] = (False, False)

    def drawn(self, context: Context, window: Events) -> Drawn:
        """Put the window's samples into the light of what was known."""
        table, paths, edges = window[Kind.SAMPLE], window[Kind.PATH], window[Kind.EDGE]
        paths = paths[paths["stage"] != Stage.SMOOTHED]
        costs = np.append(self.best, paths["cost"])
        best = costs[np.searchsorted(paths["seq"], table["seq"])]
        # Where settings change, a node was told to be near by those that it was added under.
        step = context.ruling(window).step or 0.0
        far = context.distance(np.asarray(edges["q"]), context.goal[None])
        forced = np.append(self.near[0], (far > 0) & (far <= step))
        unsure = np.append(self.near[1], np.abs(far - step) <= CLOSE * step + context.blur)
        seqs = np.append(self.edge, edges["seq"])
        newest = np.maximum(np.searchsorted(seqs, table["seq"]) - 1, 0)
        fresh = seqs[newest] > np.append(self.sample, table["seq"])[:-1]
        self.best, self.edge = float(costs[-1]), int(seqs[-1])
        self.near = bool(forced[-1]), bool(unsure[-1])
        self.sample = int(table["seq"][-1]) if len(table) else self.sample
        return Drawn(table, best, fresh & forced[newest], fresh & unsure[newest])


def samples(context: Context, result: RuleResult) -> Windows:
    """Samples of the goal are the goal, and no others; the other tree's goal is the start."""
    wide = context.upper - context.lower
    fine = bool((wide > _FINE * np.abs([context.lower, context.upper]).max(axis=0)).all())
    while (window := (yield)) is not None:
        table = window[Kind.SAMPLE]
        drawn = table[table["source"] == Source.UNIFORM]
        # By chance the very goal is drawn where there are few numbers to draw, or one axis.
        at_goal = (np.asarray(drawn["q"]) == context.goal).all(axis=1)
        if context.known and fine and context.dof > 1:
            result.look(drawn, at_goal, lambda _: "a draw from the bounds is the very goal")
        goals = table[table["source"] == Source.GOAL]
        q = np.asarray(goals["q"])
        wrong = (q != context.goal).any(axis=1)
        wrong &= (goals["tree"] != 1) | (q != context.start).any(axis=1)
        result.look(goals, wrong, lambda i, q=q: f"sample {text(q[i])} is not the goal")  # type: ignore[misc]


def sources(context: Context, result: RuleResult) -> Windows:
    """Each sample is from a source that the planner may draw from then; a path ends some runs."""
    past = _Past()
    while (window := (yield)) is not None:
        drawn, contract = past.drawn(context, window), context.ruling(window)
        draws = contract.draws
        if draws is None:
            continue
        source = drawn.table["source"]
        may = _allowed(draws, drawn)
        over = np.isfinite(drawn.best) & (contract.stops is True)
        wrong = over | ~np.select(
            [source == s for s in Source], [may[s] for s in Source], default=True
        )
        result.look(
            drawn.table, np.asarray(wrong),
            lambda i, source=source, best=drawn.best: (  # type: ignore[misc]
                f"a draw from source {Source(source[i]).label} "
                + ("where there is no path" if np.isinf(best[i]) else "where there is a path")
            ),
        )  # fmt: skip


def _allowed(draws: Draws, drawn: Drawn) -> dict[Source, Flags]:
    """From which source each sample may be."""
    none = np.isinf(drawn.best)
    sure = drawn.forced & ~drawn.unsure & draws.goal_in_reach
    maybe = (drawn.forced | drawn.unsure) & draws.goal_in_reach
    informed = ~none & draws.informed
    return {
        Source.UNIFORM: np.where(none, ~sure & (draws.goal_bias < 1), ~informed),
        Source.GOAL: none & (maybe | (draws.goal_bias > 0)),
        Source.OTHER_TREE: np.full(len(none), draws.coin > 0),
        Source.INFORMED: informed,
    }


def informed_samples(context: Context, result: RuleResult) -> Windows:
    """Informed samples are where a path may lead that costs less than the best; of points alone.

    A body draws from the bounds until it has found such a place, and gives up after 1000 draws.
    """
    past = _Past()
    while (window := (yield)) is not None:
        drawn = past.drawn(context, window)
        if not isinstance(context.robot, Point):
            continue
        chosen = (drawn.table["source"] == Source.INFORMED) & np.isfinite(drawn.best)
        some, best = drawn.table[chosen], drawn.best[chosen]
        q = np.asarray(some["q"])
        least = context.distance(context.start[None], q) + context.distance(q, context.goal[None])
        result.look(
            some, ~context.at_most(least, best),
            lambda i, n=least, b=best: f"a path over it costs {n[i]:.9g}; one of {b[i]:.9g} is had",  # type: ignore[misc]
        )  # fmt: skip


def _tests(context: Context) -> int:
    """Bets on a recording: on two coins a stretch, each axis twice, all axes, and on pairs."""
    return 2 * len(context.stretches) + 2 + 2 * context.dof


def _follow(result: RuleResult, watch: Watch, table: Table, draws: Floats) -> None:
    """Take draws, one a row of the table, into a bet."""
    result.examined += len(table)
    for row, words in watch.follow(draws):
        result.fault(table[row], words)


def _close(result: RuleResult, *watches: Watch | None) -> None:
    for watch in watches:
        for _, words in () if watch is None else watch.close():
            result.fault(None, words)


def _tosses(context: Context, what: str, chance: Callable[[Draws], float]) -> list[Watch | None]:
    """Make a bet for each stretch in which a coin is tossed."""
    chances = [0.0 if c.draws is None else chance(c.draws) for _, c in context.stretches]
    return [Watch(Tosses(p, what), _tests(context)) if 0 < p < 1 else None for p in chances]


def _watch(context: Context, watches: list[Watch | None], table: Table) -> Watch | None:
    """Choose the bet on the stretch that the rows of a window belong to."""
    return watches[int(context.stretch(table[:1])[0])] if len(table) else None


def goal_draws(context: Context, result: RuleResult) -> Windows:
    """The goal is drawn as often as stated (one false alarm in a million recordings)."""
    watches, past = _tosses(context, "the goal", lambda draws: draws.goal_bias), _Past()
    while (window := (yield)) is not None:
        drawn, draws = past.drawn(context, window), context.ruling(window).draws
        watch = _watch(context, watches, drawn.table)
        if draws is None or watch is None:
            continue
        chosen = np.isinf(drawn.best)
        if draws.goal_in_reach:
            chosen &= ~(drawn.forced | drawn.unsure)
        some = drawn.table[chosen]
        _follow(result, watch, some, np.asarray(some["source"] == Source.GOAL, np.float64))
    _close(result, *watches)


def coin_tosses(context: Context, result: RuleResult) -> Windows:
    """A tree heads for the other as often as stated (one false alarm in a million recordings)."""
    watches = _tosses(context, "the other tree's newest node", lambda draws: draws.coin)
    while (window := (yield)) is not None:
        table = window[Kind.SAMPLE]
        watch = _watch(context, watches, table)
        if watch is not None:
            fell = np.asarray(table["source"] == Source.OTHER_TREE, np.float64)
            _follow(result, watch, table, fell)
    _close(result, *watches)


def even_draws(context: Context, result: RuleResult) -> Windows:
    """Uniform samples are even over the bounds (one false alarm in a million recordings)."""
    low, wide = context.lower, context.upper - context.lower
    fine = np.flatnonzero(wide > _FINE * np.abs([context.lower, context.upper]).max(axis=0))
    names = context.robot.coordinates(context.world)
    bets: list[tuple[Any, Bet]] = [
        (k, Evenness(names[k], low[k], context.upper[k])) for k in fine.tolist()
    ]
    if len(fine) > 1:
        bets.append((fine, Together(len(fine))))
    watches = [(axes, Watch(bet, _tests(context))) for axes, bet in bets]
    while (window := (yield)) is not None:
        if context.ruling(window).draws is None:
            continue
        table = window[Kind.SAMPLE]
        some = table[table["source"] == Source.UNIFORM]
        part = (np.asarray(some["q"]) - low) / wide
        for axes, watch in watches:
            _follow(result, watch, some, part[:, axes])
    _close(result, *(watch for _, watch in watches))


def even_informed_draws(context: Context, result: RuleResult) -> Windows:
    """Informed samples are even, of points alone (one false alarm in a million recordings).

    With its other coordinates as they are, each coordinate of a sample is even along the chord that
    the ellipsoid and the bounds leave it.
    """
    past = _Past()
    names = context.robot.coordinates(context.world)
    watches = [Watch(Evenness(f"{name} along its chord"), _tests(context)) for name in names]
    while (window := (yield)) is not None:
        drawn = past.drawn(context, window)
        if context.ruling(window).draws is None or not isinstance(context.robot, Point):
            continue
        chosen = (drawn.table["source"] == Source.INFORMED) & np.isfinite(drawn.best)
        some, best = drawn.table[chosen], drawn.best[chosen]
        for k, watch in enumerate(watches):
            part, sound = _along_chord(context, np.asarray(some["q"]), best, k)
            _follow(result, watch, some[sound], part[sound])
    _close(result, *watches)


def _along_chord(context: Context, q: Floats, best: Floats, k: int) -> tuple[Floats, Flags]:
    """How far along its chord each sample lies on an axis, 0 to 1, and whether that can be told.

    The chord holds the x at which the ways to the foci add up to the best cost c: from
    s + g = c and s^2 - g^2 = 2 D x + a^2 - b^2 follows s = alpha + beta x, and a square in x.
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
    sound = (square > _THIN * best**2) & (room > _THIN) & (high - low > _THIN * best)
    return (q[:, k] - start[k] - low) / (high - low), np.asarray(sound)


def random_pairs(context: Context, result: RuleResult) -> None:
    """Any two waypoints are as likely to be tried (one false alarm in a million recordings)."""
    if not context.known:
        return
    table = context.events[Kind.SHORTCUT]
    rng, watch = np.random.default_rng(0), Watch(Evenness("the pair"), _tests(context))
    for points, some in _smoothings(context, table):
        gone = np.where(some["accepted"], some["j"] - some["i"] - 1, 0).astype(np.int64)
        n = points - np.concatenate([[0], np.cumsum(gone)])[:-1]
        i, j = some["i"].astype(np.int64), some["j"].astype(np.int64)
        pairs = (n - 1) * (n - 2) // 2
        rank = i * (n - 2) - i * (i - 1) // 2 + j - i - 2
        there = (i >= 0) & (i + 1 < j) & (j < n)
        # A rank is one of few; a number drawn between it and the next is as even as they are.
        part = (rank + rng.random(len(rank))) / np.maximum(pairs, 1)
        _follow(result, watch, some[there], part[there])
    _close(result, watch)


def _smoothings(context: Context, table: Table) -> Iterator[tuple[int, Table]]:
    """Yield for each path that is smoothed its waypoints and the attempts."""
    found = context.found
    ends = [int(event["seq"]) for event, _ in found]
    first = np.searchsorted(table["seq"], [*ends, 1 << 62])
    for (_, path), begin, end in zip(found, first, first[1:], strict=False):
        if end > begin:
            yield len(path), table[begin:end]


RULES = (
    samples, sources, informed_samples, goal_draws, coin_tosses, even_draws,
    even_informed_draws, random_pairs,
)  # fmt: skip
"""All rules of this file; see `brrt.verification`."""
