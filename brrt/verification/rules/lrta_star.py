"""What a robot does that looks one cell ahead: where it goes, and what it learns."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from brrt.events import Events, Kind
from brrt.scenario.contract import Lattice
from brrt.verification.context import Context, Windows
from brrt.verification.result import RuleResult
from brrt.verification.rules.lattice import Cell, indices, lattice_of

_BLIND = "a move without a look around"


def choices(context: Context, result: RuleResult) -> Windows:
    """With a lookahead of 1 each move is to a free neighbour of least cost and estimate.

    The estimate of the cell that it leads from is raised to that, and is else what it was; no
    move, that to the goal included, is made without a look around.
    """
    lattice = lattice_of(context)
    grids = [contract.lattice for _, contract in context.stretches]
    short = any(grid is not None and grid.lookahead == 1 for grid in grids)
    walk = _Walk(context, lattice) if lattice is not None and short else None
    while (window := (yield)) is not None:
        if lattice is None or walk is None:
            continue
        ruling = context.ruling(window).lattice
        judged = ruling is not None and ruling.lookahead == 1
        for kind, event, place in _in_order(context, lattice, window):
            wrong = walk.follow(kind, event, place, judged=judged)
            if judged and kind in (Kind.HEURISTIC, Kind.MOVE):
                result.one(event, wrong)


def _in_order(
    context: Context, lattice: Lattice, window: Events
) -> Iterator[tuple[Kind, np.void, Cell]]:
    """Yield what a search says, one after the other, with its place on the lattice."""
    rows = [
        (int(seq), kind, event, place)
        for kind in (Kind.REJECT, Kind.HEURISTIC, Kind.EXPAND, Kind.MOVE)
        for seq, event, place in zip(
            window[kind]["seq"], window[kind],
            map(tuple, indices(context, lattice, window[kind]["q"]).tolist()), strict=True,
        )
    ]  # fmt: skip
    rows.sort(key=lambda row: row[0])
    for _, kind, event, place in rows:
        yield kind, event, place


class _Walk:
    """What a robot knows that looks one cell ahead."""

    def __init__(self, context: Context, lattice: Lattice) -> None:
        self.context, self.lattice = context, lattice
        self.h: dict[Cell, float] = {}
        self.blocked: dict[int, set[Cell]] = {}
        self.at: tuple[int, Cell] | None = None
        self.raised: Cell | None = None
        self.numbers: dict[Cell, int] = {}
        steps = product((-1, 0, 1), repeat=len(context.start))
        most = len(context.start) if lattice.diagonals else 1
        self.steps = [step for step in steps if 0 < sum(map(abs, step)) <= most]

    def follow(self, kind: Kind, event: np.void, place: Cell, *, judged: bool) -> str | None:
        """Take in an event; say what is wrong with it."""
        if kind is Kind.REJECT:
            self.reject(int(event["node"]), place)
        elif kind is Kind.EXPAND:
            self.look(int(event["cell"]), place)
        elif kind is Kind.HEURISTIC:
            return self.learn(place, float(event["h"]))
        elif event["cell"] < 0:
            return self.arrive()
        else:
            self.numbers[place] = int(event["cell"])
            return self.judge(place) if judged else None
        return None

    def reject(self, cell: int, place: Cell) -> None:
        """Learn that a neighbour cannot be reached."""
        self.blocked.setdefault(cell, set()).add(place)

    def look(self, cell: int, place: Cell) -> None:
        """Look around from a cell; its estimate is still the one from before."""
        self.at, self.raised, self.numbers[place] = (cell, place), None, cell

    def estimate(self, place: Cell) -> float:
        """Return the estimate of the cost-to-go, which begins as the distance."""
        if place not in self.h:
            q = self.context.start + self.lattice.epsilon * np.array(place)
            self.h[place] = float(self.context.distance(q[None], self.context.goal[None])[0])
        return self.h[place]

    def learn(self, place: Cell, h: float) -> str | None:
        """Take in a new estimate; say what is wrong with where it is learnt."""
        self.h[place], self.raised = h, place
        here = self.at is not None and self.at[1] == place
        return None if here else f"an estimate of {list(place)}, where the robot does not look"

    def arrive(self) -> str | None:
        """Go to the goal; say what is wrong with that."""
        looked, self.at = self.at is not None, None
        return None if looked else _BLIND

    def judge(self, target: Cell) -> str | None:
        """Say what is wrong with a move to a cell."""
        if self.at is None:
            return _BLIND
        cell, place = self.at
        self.at = None
        blocked = self.blocked.get(cell, set())
        if target in blocked:
            return f"a move to {list(target)}, which was found blocked"
        costs = {
            other: self.lattice.epsilon * sum(map(abs, step)) ** 0.5 + self.estimate(other)
            for step in self.steps
            if (other := tuple(x + s for x, s in zip(place, step, strict=True))) not in blocked
        }
        best, chosen = min(costs.values(), default=np.inf), costs.get(target, np.inf)
        now = self.estimate(place)
        if not self.context.at_most(np.asarray(min(best, 1e300)), now):
            return f"the estimate of cell {cell} stays at {now:.12g}; it is to rise to {best:.12g}"
        if self.raised == place and not self.context.at_most(np.asarray(now), best):
            return f"the estimate of cell {cell} rises to {now:.12g}; it is to be {best:.12g}"
        if not self.context.at_most(np.asarray(chosen), best):
            return f"a move of cost and estimate {chosen:.12g}; {best:.12g} was there"
        return self._tie(target, costs) if self.lattice.ordered else None

    def _tie(self, target: Cell, costs: dict[Cell, float]) -> str | None:
        """Say whether another cell of the very same cost and estimate goes before the target."""
        h, number = self.estimate(target), self.numbers.get(target, 0)
        for other, cost in costs.items():
            if cost == costs[target] and other != target:
                if self.estimate(other) < h:
                    return f"of equal ones, {list(other)} is closer to the goal"
                if self.estimate(other) == h and self.numbers.get(other, number) < number:
                    return f"of equal ones, {list(other)} was seen first"
        return None


RULES = (choices,)
"""All rules of this file; see `brrt.verification`."""
