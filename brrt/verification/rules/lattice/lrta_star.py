"""The rule about robots that search one cell ahead: where they go, and what they learn."""

from itertools import product

import numpy as np

from brrt.events import Events, Kind
from brrt.scenario.contract import Contract, Lattice
from brrt.verification.context import Context
from brrt.verification.rule import Rule
from brrt.verification.rules.lattice.cells import Cell, indices

_NO_SEARCH = "a move without a search"


class Choices(Rule):
    """Judges moves and estimates with a lookahead of 1.

    The estimate of the cell that a move leads from is raised to the least cost and estimate of its
    neighbours, or is not lower already; no move, that to the goal included, is made without a
    search.
    """

    name = "choices"
    promise = "With a lookahead of 1 each move is to a free neighbour of least cost and estimate."
    needs = "lattice"
    kind = Kind.EXPAND
    assumes = ("motions", "costs", "collisions")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        lattices = [contract.lattice for _, contract in context.stretches]
        short = any(lattice is not None and lattice.lookahead == 1 for lattice in lattices)
        lattice = context.contract.lattice
        self.learner = _Learner(context, lattice) if lattice is not None and short else None

    def window(self, events: Events, contract: Contract) -> None:
        if self.learner is None:
            return
        judged = contract.lattice is not None and contract.lattice.lookahead == 1
        for kind, event, place in self.learner.in_order(events):
            wrong = self.learner.follow(kind, event, place, judged=judged)
            if judged and kind in (Kind.HEURISTIC, Kind.MOVE):
                self.judge_one(event, wrong)


class _Learner:
    """What a robot that searches one cell ahead knows.

    Args:
        context: The recording.
        lattice: The lattice.
    """

    def __init__(self, context: Context, lattice: Lattice) -> None:
        self._context, self._lattice = context, lattice
        self._h: dict[Cell, float] = {}
        self._blocked: dict[int, set[Cell]] = {}
        self._numbers: dict[Cell, int] = {}
        # The cell that was expanded last, and whether its estimate has been raised since.
        self._at: tuple[int, Cell] | None = None
        # In which expansion each cell was seen first, and how many there were; None once a search
        # of several cells has seen others.
        self._seen: dict[Cell, int] | None = {tuple(np.zeros(len(context.start), int).tolist()): 0}
        self._expansions = 0
        self._raised: Cell | None = None
        steps = product((-1, 0, 1), repeat=len(context.start))
        most = len(context.start) if lattice.diagonals else 1
        self._steps = [step for step in steps if 0 < sum(map(abs, step)) <= most]

    def in_order(self, events: Events) -> list[tuple[Kind, np.void, Cell]]:
        """Return the events of a search by number, each with its place on the lattice."""
        rows = [
            (int(event["seq"]), kind, event, tuple(place))
            for kind in (Kind.REJECT, Kind.HEURISTIC, Kind.EXPAND, Kind.MOVE)
            for event, place in zip(
                events[kind],
                indices(self._context, self._lattice, events[kind]["q"]).tolist(),
                strict=True,
            )
        ]
        rows.sort(key=lambda row: row[0])
        return [row[1:] for row in rows]

    def follow(self, kind: Kind, event: np.void, place: Cell, *, judged: bool) -> str | None:
        """Take an event; return what is wrong with it."""
        self._seen = self._seen if judged else None
        if kind is Kind.REJECT:
            self._blocked.setdefault(int(event["node"]), set()).add(place)
        elif kind is Kind.EXPAND:
            cell = int(event["cell"])
            self._expansions += 1
            self._at, self._raised, self._numbers[place] = (cell, place), None, cell
        elif kind is Kind.HEURISTIC:
            self._h[place], self._raised = float(event["h"]), place
            if self._at is None or self._at[1] != place:
                return f"an estimate of {list(place)}, which was not expanded"
        elif event["cell"] < 0:
            searched, self._at = self._at is not None, None
            return None if searched else _NO_SEARCH
        else:
            self._numbers[place] = int(event["cell"])
            return self._judge(place) if judged else None
        return None

    def _estimate(self, place: Cell) -> float:
        """Return the estimate of the cost-to-go, which begins as the distance."""
        if place not in self._h:
            q = self._context.start + self._lattice.cell * np.array(place)
            self._h[place] = float(self._context.distance(q[None], self._context.goal[None])[0])
        return self._h[place]

    def _judge(self, target: Cell) -> str | None:
        """Return what is wrong with a move to a cell."""
        if self._at is None:
            return _NO_SEARCH
        cell, place = self._at
        self._at = None
        blocked = self._blocked.get(cell, set())
        if target in blocked:
            return f"a move to {list(target)}, which is blocked"
        costs = {
            other: self._lattice.cell * sum(map(abs, step)) ** 0.5 + self._estimate(other)
            for step in self._steps
            if (other := tuple(x + s for x, s in zip(place, step, strict=True))) not in blocked
        }
        if self._seen is not None:
            for other in costs:
                self._seen.setdefault(other, self._expansions)
        best, chosen = min(costs.values(), default=np.inf), costs.get(target, np.inf)
        now, at_most = self._estimate(place), self._context.at_most
        if not at_most(np.asarray(min(best, 1e300)), now):
            return f"the estimate of cell {cell} stays at {now:.12g}, below {best:.12g}"
        if self._raised == place and not at_most(np.asarray(now), best):
            return f"the estimate of cell {cell} rises to {now:.12g}, above {best:.12g}"
        if not at_most(np.asarray(chosen), best):
            return f"a move of cost and estimate {chosen:.12g}; the least is {best:.12g}"
        return self._judge_tie(target, costs) if self._lattice.ordered else None

    def _judge_tie(self, target: Cell, costs: dict[Cell, float]) -> str | None:
        """Return whether a cell of equal cost and estimate has priority over the target."""
        h, number = self._estimate(target), self._numbers.get(target, 0)
        seen = self._seen or {}
        for other, cost in costs.items():
            if cost == costs[target] and other != target:
                if self._estimate(other) < h:
                    return f"of equal cells, {list(other)} is closer to the goal"
                older = self._numbers.get(other, number) < number
                older |= seen.get(other, 0) < seen.get(target, 0)
                if self._estimate(other) == h and older:
                    return f"of equal cells, {list(other)} was seen first"
        return None


RULES = (Choices,)
