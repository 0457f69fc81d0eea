"""What became of one cell of a lattice: how often it was looked at, what was learnt of it."""

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from brrt.errors import BrrtError
from brrt.events import Events, Kind, Reason, Table
from brrt.replay.history_records import When, as_plain
from brrt.replay.transcript import choice_name
from brrt.robots import Robot
from brrt.scenario.manifest import Manifest


@dataclass(frozen=True, slots=True)
class Look:
    """A search expanded the cell.

    Attributes:
        when: Its event.
        parent: Cell that the search reached it from; -1 for the search's first.
        cost: Cost from the search's first cell.
    """

    when: When
    parent: int
    cost: float


@dataclass(frozen=True, slots=True)
class Lesson:
    """The estimate of the cell's cost-to-go was raised.

    Attributes:
        when: Its event.
        before: The estimate before.
        after: And after.
    """

    when: When
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class CellHistory:
    """All that a log says about a cell up to an instant.

    Attributes:
        cell: Its number.
        q: Where it is.
        distance: How far it is from the goal, which is its first estimate.
        looks: Each time it was expanded.
        lessons: Each time its estimate was raised.
        visits: Each time the robot moved into it.
        rejects: How many motions from it failed, by reason.
    """

    cell: int
    q: list[float]
    distance: float
    looks: list[Look]
    lessons: list[Lesson]
    visits: list[When]
    rejects: dict[str, int]

    @property
    def estimate(self) -> float:
        """What the cost-to-go is thought to be at the instant."""
        return self.lessons[-1].after if self.lessons else self.distance

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers, texts, lists and dicts."""
        return {**as_plain(self), "estimate": self.estimate}


class CellTrace:
    """A fold that keeps what a cell's history is told from.

    Args:
        cell: The cell's number.
        manifest: The run's.
    """

    def __init__(self, cell: int, manifest: Manifest) -> None:
        self._cell, self._goal = cell, np.array(manifest.goal)
        self._kept: dict[Kind, list[Table]] = {
            kind: [] for kind in (Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE)
        }
        self._reasons: Counter[str] = Counter()
        self._seen = -1

    def write(self, events: Events) -> None:
        """Take in a batch."""
        for kind, parts in self._kept.items():
            table = events[kind]
            parts.append(table[table["cell"] == self._cell])
            self._seen = max(self._seen, int(table["cell"].max(initial=-1)))
        rejects = events[Kind.REJECT]
        for reason in rejects["reason"][rejects["node"] == self._cell].tolist():
            self._reasons[choice_name(Reason, reason)] += 1

    @property
    def has_cells(self) -> bool:
        """Whether there are cells in the log."""
        return self._seen >= 0

    def history(self, robot: Robot) -> CellHistory:
        """Tell the history.

        Raises:
            BrrtError: The cell was never expanded.
        """
        looks, raised, moves = (np.concatenate(self._kept[kind]) for kind in self._kept)
        known = looks if len(looks) else raised if len(raised) else moves
        if self._cell < 0 or not len(known):
            raise BrrtError(
                f"cell {self._cell} was neither expanded nor entered by then; "
                f"those that were are numbered from 0 to {self._seen:,}"
            )
        far = float(robot.distance(known["q"][0], self._goal))
        before = [far, *raised["h"][:-1].tolist()]
        return CellHistory(
            cell=self._cell,
            q=known["q"][0].tolist(),
            distance=far,
            looks=[Look(When.of(row), int(row["parent"]), float(row["cost"])) for row in looks],
            lessons=[
                Lesson(When.of(row), old, float(row["h"]))
                for row, old in zip(raised, before, strict=False)
            ],
            visits=[When.of(row) for row in moves],
            rejects=dict(self._reasons.most_common()),
        )
