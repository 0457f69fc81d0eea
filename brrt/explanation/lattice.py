"""What a search on a lattice looked at, and what it learnt: sums by cell."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.robots import Robot

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Cells:
    """A fold over what concerns cells; memory grows with the cells, not with the moves.

    Args:
        robot: What moves; measures how far cells are from the goal.
        goal: Where it should get, shape (dof,).
    """

    def __init__(self, robot: Robot, goal: Floats) -> None:
        self._robot, self._goal = robot, goal
        self._q = np.zeros((0, len(goal)))
        self._looks, self._visits = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._estimate = np.zeros(0)
        self.moves = 0

    def write(self, events: Events) -> Flags:
        """Take in a batch; return which expansions are of cells that were not expanded before."""
        looks, raised, moves = (events[k] for k in (Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE))
        cells = [np.asarray(table["cell"], np.int64) for table in (looks, raised, moves)]
        self._grow(max((int(each.max(initial=-1)) for each in cells), default=-1) + 1)
        first = np.zeros(len(looks), np.bool_)
        first[np.unique(cells[0], return_index=True)[1]] = True
        first &= self._looks[cells[0]] == 0
        self._q[cells[0]] = looks["q"]
        self._looks += np.bincount(cells[0], minlength=len(self._looks))
        fresh = looks[first]
        self._estimate[cells[0][first]] = self._robot.distance(fresh["q"], self._goal)
        self._estimate[cells[1]] = raised["h"]  # of several the last one stays
        entered = cells[2][cells[2] >= 0]
        self._visits += np.bincount(entered, minlength=len(self._visits))
        self.moves += len(moves)
        return first

    def _grow(self, cells: int) -> None:
        room = len(self._looks)
        if cells <= room:
            return
        more = max(2 * room, cells, 1024) - room
        self._q = np.concatenate([self._q, np.zeros((more, self._q.shape[1]))])
        self._looks = np.concatenate([self._looks, np.zeros(more, np.int64)])
        self._visits = np.concatenate([self._visits, np.zeros(more, np.int64)])
        self._estimate = np.concatenate([self._estimate, np.zeros(more)])

    @property
    def known(self) -> Flags:
        """Which numbers are those of cells that were expanded, shape (n,)."""
        return self._looks > 0

    @property
    def q(self) -> Floats:
        """Where the expanded cells are, shape (m, dof)."""
        return self._q[self.known]

    def origins(self, rejects: Table) -> Floats:
        """Where rejected motions left from, nan where no such cell is known, shape (n, dof)."""
        q = np.full((len(rejects), self._q.shape[1]), np.nan)
        cell = np.asarray(rejects["node"], np.int64)
        there = (cell >= 0) & (cell < len(self._looks))
        there[there] = self.known[cell[there]]
        q[there] = self._q[cell[there]]
        return q

    def as_dict(self) -> dict[str, Any]:
        """Sum up: how often cells were looked at and entered, and where most was learnt."""
        looks = self._looks[self.known]
        if not len(looks):
            return {}
        q, visits = self._q[self.known], self._visits[self.known]
        learnt = self._estimate[self.known] - self._robot.distance(q, self._goal)
        deepest, busiest = int(learnt.argmax()), int(visits.argmax())
        return {
            "cells": len(looks),
            "expansions": int(looks.sum()),
            "moves": self.moves,
            "moves_per_cell": float(visits.sum() / max(int((visits > 0).sum()), 1)),
            "busiest": {"q": q[busiest].tolist(), "visits": int(visits[busiest])},
            "raised": int((learnt > 0).sum()),
            "deepest": {
                "q": q[deepest].tolist(),
                "estimate": float(self._estimate[self.known][deepest]),
                "learnt": float(learnt[deepest]),
            },
        }
