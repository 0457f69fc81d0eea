"""Cells of a lattice search, summed up: expansions, moves and estimates of each."""

from typing import Any

import numpy as np

from brrt.events import Events, Kind
from brrt.robots import Robot
from brrt.worlds.arrays import Bools, Floats, Ints


class CellSummary:
    """A fold over the events of cells; memory grows with the cells, not with the moves."""

    def __init__(self, robot: Robot, goal: Floats) -> None:
        self._robot, self._goal = robot, goal
        self._q = np.zeros((0, len(goal)))
        self._expansions, self._visits = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._estimate = np.zeros(0)
        self.moves = 0

    def write(self, events: Events) -> Bools:
        """Take a batch; return which of its expansions are the first of their cells."""
        expanded, raised, moves = (events[k] for k in (Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE))
        cells = [np.asarray(table["cell"], np.int64) for table in (expanded, raised, moves)]
        self._grow(max((int(each.max(initial=-1)) for each in cells), default=-1) + 1)
        first = np.zeros(len(expanded), np.bool_)
        first[np.unique(cells[0], return_index=True)[1]] = True
        first &= self._expansions[cells[0]] == 0
        self._q[cells[0]] = expanded["q"]
        self._expansions += np.bincount(cells[0], minlength=len(self._expansions))
        new = expanded[first]
        self._estimate[cells[0][first]] = self._robot.distance(new["q"], self._goal)
        self._estimate[cells[1]] = raised["h"]  # the last one of a cell is kept
        entered = cells[2][cells[2] >= 0]
        self._visits += np.bincount(entered, minlength=len(self._visits))
        self.moves += len(moves)
        return first

    def _grow(self, cells: int) -> None:
        room = len(self._expansions)
        if cells <= room:
            return
        more = max(2 * room, cells, 1024) - room
        for name in ("_q", "_expansions", "_visits", "_estimate"):
            old = getattr(self, name)
            setattr(self, name, np.concatenate([old, np.zeros((more, *old.shape[1:]), old.dtype)]))

    @property
    def q(self) -> Floats:
        """Configurations of the expanded cells, shape (m, dof)."""
        return self._q[self._expansions > 0]

    def find(self, cell: Ints) -> tuple[Floats, Bools]:
        """Return the configurations of cells that were expanded, shape (m, dof), and which were."""
        known = (cell >= 0) & (cell < len(self._expansions))
        known[known] = self._expansions[cell[known]] > 0
        return self._q[cell[known]], known

    def as_dict(self) -> dict[str, Any]:
        """Return the sums, the most visited cell and the one whose estimate rose most."""
        known = self._expansions > 0
        if not known.any():
            return {}
        q, visits, estimate = self._q[known], self._visits[known], self._estimate[known]
        learnt = estimate - self._robot.distance(q, self._goal)
        deepest, busiest = int(learnt.argmax()), int(visits.argmax())
        return {
            "cells": len(q),
            "expansions": int(self._expansions.sum()),
            "moves": self.moves,
            "moves_per_cell": float(visits.sum() / max(int((visits > 0).sum()), 1)),
            "busiest": {"q": q[busiest].tolist(), "visits": int(visits[busiest])},
            "raised": int((learnt > 0).sum()),
            "deepest": {
                "q": q[deepest].tolist(),
                "estimate": float(estimate[deepest]),
                "learnt": float(learnt[deepest]),
            },
        }
