"""The history of one cell of a lattice: its expansions, its estimate, the moves into it."""

from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from brrt.errors import BrrtError
from brrt.events import Events, Kind, Reason, Table
from brrt.replay.node_history import When
from brrt.robots import Robot
from brrt.scenario.manifest import Manifest


@dataclass(frozen=True, slots=True)
class Expansion:
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
class EstimateChange:
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
    """A cell up to an instant.

    Attributes:
        cell: Its number.
        q: Its configuration.
        distance: Its distance to the goal, which is its first estimate.
        looks: Its expansions.
        lessons: The changes of its estimate.
        visits: The moves into it.
        rejects: Number of rejected motions from it, by reason.
    """

    cell: int
    q: list[float]
    distance: float
    looks: list[Expansion]
    lessons: list[EstimateChange]
    visits: list[When]
    rejects: dict[str, int]

    @property
    def estimate(self) -> float:
        """The estimate of the cost-to-go at the instant."""
        return self.lessons[-1].after if self.lessons else self.distance

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dicts."""
        return {**asdict(self), "estimate": self.estimate}


class CellTrace:
    """A fold that keeps the events that concern a cell."""

    def __init__(self, cell: int, manifest: Manifest) -> None:
        self._cell, self._goal = cell, np.array(manifest.goal)
        kinds = Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE
        self._kept: dict[Kind, list[Table]] = {kind: [] for kind in kinds}
        self._reasons: Counter[int] = Counter()
        self._seen = -1

    def write(self, events: Events) -> None:
        """Take a batch."""
        for kind, parts in self._kept.items():
            table = events[kind]
            parts.append(table[table["cell"] == self._cell])
            self._seen = max(self._seen, int(table["cell"].max(initial=-1)))
        rejects = events[Kind.REJECT]
        self._reasons.update(rejects["reason"][rejects["node"] == self._cell].tolist())

    @property
    def has_cells(self) -> bool:
        """Whether the log has cells."""
        return self._seen >= 0

    def history(self, robot: Robot) -> CellHistory:
        """Return the history.

        Raises:
            BrrtError: The cell was neither expanded nor entered.
        """
        looks, raised, moves = (np.concatenate(self._kept[kind]) for kind in self._kept)
        known = looks if len(looks) else raised if len(raised) else moves
        if self._cell < 0 or not len(known):
            raise BrrtError(
                f"cell {self._cell} was neither expanded nor entered up to this instant; the cells "
                f"that were have the numbers 0 to {self._seen:,}"
            )
        far = float(robot.distance(known["q"][0], self._goal))
        before = [far, *raised["h"][:-1].tolist()]
        return CellHistory(
            cell=self._cell,
            q=known["q"][0].tolist(),
            distance=far,
            looks=[
                Expansion(When.of(row), int(row["parent"]), float(row["cost"])) for row in looks
            ],
            lessons=[
                EstimateChange(When.of(row), old, float(row["h"]))
                for row, old in zip(raised, before, strict=False)
            ],
            visits=[When.of(row) for row in moves],
            rejects={Reason.label_of(reason): n for reason, n in self._reasons.most_common()},
        )
