"""What a picture shows of a run after any of its events: folded once, then cut by number."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import LogError
from brrt.events import Events, Instant, Kind, Phase, Stage, Status
from brrt.replay.forest import forest
from brrt.replay.tree_fold import TreeChanges, of_tree
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """A run with its events, in memory.

    Attributes:
        name: What a legend calls it.
        manifest: The run's.
        world: Where it took place.
        events: From the first one on.
    """

    name: str
    manifest: Manifest
    world: World
    events: Events

    @property
    def improves(self) -> bool:
        """Whether the planner found better paths after its first."""
        return bool((self.events[Kind.PATH]["stage"] == Stage.IMPROVED).any())


class Edges(NamedTuple):
    """Edges of a tree.

    Attributes:
        ends: Where they begin, at the parent, and end, shape (m, 2, dim).
        rewired: Whether the node has got a new parent since it joined, shape (m,).
    """

    ends: Floats
    rewired: NDArray[np.bool_]


class Paths(NamedTuple):
    """Paths as they stand at an instant.

    Attributes:
        raw: The best one that the planner has found, and its cost.
        short: What shortcuts have made of it so far, and its cost.
    """

    raw: tuple[Floats, float] | None
    short: tuple[Floats, float] | None


class History:
    """The trees, cells, moves and paths of a run, at any of its events.

    Args:
        record: The run.

    Raises:
        LogError: The events do not make trees.
    """

    def __init__(self, record: Record) -> None:
        self._events, self._manifest = record.events, record.manifest
        self.robot = record.manifest.make_robot().resolved(record.world)
        self.contract = contract_of(record.manifest, record.world)
        self._places: dict[int, Floats] = {}
        self._changes: dict[int, TreeChanges] = {}
        for number, tree in forest(record.events, self.robot.distance).items():
            edges, rewires = (record.events[kind] for kind in (Kind.EDGE, Kind.REWIRE))
            made = TreeChanges.of(of_tree(edges, number), of_tree(rewires, number))
            _check_parents(made, len(tree))
            self._places[number] = self.robot.places(tree.q)
            self._changes[number] = made
        self._cells, self._values = self._estimates()

    @property
    def trees(self) -> list[int]:
        """Numbers of the trees."""
        return list(self._places)

    @property
    def has_cells(self) -> bool:
        """Whether the planner searched a lattice."""
        return len(self._cells) > 0

    @property
    def learns(self) -> bool:
        """Whether the cells have estimates of the cost-to-go, and not costs from the start."""
        return self.contract.learns

    @property
    def last(self) -> int:
        """Number of the last event; -1 where there is none."""
        return max((int(t["seq"][-1]) for t in self._events.tables.values() if len(t)), default=-1)

    @property
    def planned(self) -> int:
        """Number of the event that ended planning, or of the last one."""
        phases = self._events[Kind.PHASE]
        ended = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)]
        return int(ended["seq"][0]) if len(ended) else self.last

    def instant(self, seq: int) -> Instant:
        """When an event happened."""
        return self._events.until(seq=seq).last

    def nodes(self, seq: int) -> int:
        """Count the nodes of all trees, or the expanded cells, after an event."""
        if self.has_cells:
            return int(np.searchsorted(self._cells["seq"], seq, side="right"))
        edges = self._events[Kind.EDGE]["seq"]
        return int(np.searchsorted(edges, seq, side="right"))

    def edges(self, number: int, seq: int) -> Edges:
        """Return a tree's edges as they are after an event."""
        made, places = self._changes[number], self._places[number]
        upto = int(np.searchsorted(made.seq, seq, side="right"))
        node, joins = made.node[:upto], made.joins[:upto]
        parent = np.full(len(places), -1, np.int64)
        parent[node] = made.parent[:upto]  # of several changes to a node, the last one stays
        rewired = np.zeros(len(places), np.bool_)
        rewired[node[~joins]] = True
        child = np.flatnonzero(parent >= 0)
        ends = np.stack([places[parent[child]], places[child]], axis=1)
        return Edges(ends, rewired[child])

    def cells(self, seq: int) -> tuple[Floats, Floats]:
        """Return where the expanded cells are, shape (n, dim), and their values, shape (n,)."""
        known = self._cells[: np.searchsorted(self._cells["seq"], seq, side="right")]
        values = self._values[: np.searchsorted(self._values["seq"], seq, side="right")]
        if not len(known):
            return np.empty((0, self._manifest.dim)), np.empty(0)
        order = np.argsort(known["cell"])
        numbers, latest = known["cell"][order], np.empty(len(known))
        latest[order[np.searchsorted(numbers, values["cell"])]] = values["value"]
        return self.robot.places(known["q"]), latest

    def trace(self, seq: int) -> list[Floats]:
        """Return the way of each trial's moves, shape (m, dim) each."""
        moves = self._events[Kind.MOVE]
        moves = moves[: np.searchsorted(moves["seq"], seq, side="right")]
        start = self.robot.places(np.array([self._manifest.start]))
        ways = np.split(self.robot.places(moves["q"]), np.flatnonzero(np.diff(moves["trial"])) + 1)
        return [np.concatenate([start, way]) for way in ways if len(way)]

    def rejects(self, seq: int, newest: int) -> Floats:
        """Return from where to where the newest extensions were tried in vain, (n, 2, dim)."""
        table = self._events[Kind.REJECT]
        end = int(np.searchsorted(table["seq"], seq, side="right"))
        rows = table[max(0, end - newest) : end]
        ends = np.full((len(rows), 2, self._manifest.dim), np.nan)
        for number, places in self._places.items():
            mine = (rows["tree"] == number) & (rows["node"] >= 0) & (rows["node"] < len(places))
            ends[mine, 0] = places[rows["node"][mine]]
        if self.has_cells:
            order = np.argsort(self._cells["cell"])
            cells = self._cells[order]
            at = np.minimum(np.searchsorted(cells["cell"], rows["node"]), len(cells) - 1)
            there = cells["cell"][at] == rows["node"]
            ends[there, 0] = self.robot.places(cells["q"][at[there]])
        ends[:, 1] = self.robot.places(rows["q"])
        return np.asarray(ends[~np.isnan(ends).any(axis=(1, 2))])

    def paths(self, seq: int) -> Paths:
        """Return the paths as they stand after an event."""
        part = self._events.until(seq=seq)
        found = [(Stage(int(row["stage"])), row) for row in part[Kind.PATH]]
        raw = next((row for stage, row in reversed(found) if stage is not Stage.SMOOTHED), None)
        if raw is None:
            return Paths(None, None)
        stage, last = found[-1]
        best = np.asarray(raw["waypoints"]), float(raw["cost"])
        if stage is Stage.SMOOTHED:
            return Paths(best, (np.asarray(last["waypoints"]), float(last["cost"])))
        cuts = part[Kind.SHORTCUT]
        cuts = cuts[(cuts["seq"] > raw["seq"]) & cuts["accepted"]]
        if not len(cuts):
            return Paths(best, None)
        short = best[0]
        for cut in cuts:
            short = np.delete(short, slice(int(cut["i"]) + 1, int(cut["j"])), axis=0)
        return Paths(best, (short, float(cuts[-1]["cost"])))

    def _estimates(self) -> tuple[NDArray[np.void], NDArray[np.void]]:
        """Return cells as they are first expanded, and every value that one gets, in order.

        An estimate that was not raised yet is the distance to the goal.
        """
        expands, raised = self._events[Kind.EXPAND], self._events[Kind.HEURISTIC]
        first = expands[np.sort(np.unique(expands["cell"], return_index=True)[1])]
        seen = first if self.learns else expands
        raised = raised[np.isin(raised["cell"], first["cell"])]
        goal = np.array(self._manifest.goal)
        own = self.robot.distance(seen["q"], goal) if self.learns else seen["cost"]
        layout = [("seq", "<i8"), ("cell", "<i4"), ("value", "<f8")]
        values = np.zeros(len(seen) + len(raised), layout)
        for name in ("seq", "cell"):
            values[name] = np.concatenate([seen[name], raised[name]])
        values["value"] = np.concatenate([own, raised["h"]])
        return first, values[np.argsort(values["seq"], kind="stable")]


def _check_parents(made: TreeChanges, nodes: int) -> None:
    wrong = np.flatnonzero((made.parent >= nodes) | (made.parent == made.node))
    if len(wrong):
        i = int(wrong[0])
        raise LogError(
            f"event {made.seq[i]}: node {made.node[i]} gets parent {made.parent[i]}, "
            "which is not there"
        )
