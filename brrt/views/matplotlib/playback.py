"""The state of a run after any of its events: the log is folded once, then cut by number."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import LogError
from brrt.events import Instant, Kind, Phase, Stage, Status
from brrt.recording import Recording
from brrt.replay.forest import forest
from brrt.replay.graph import as_forest, links_after, structure_of
from brrt.replay.tree_fold import TreeChanges, of_tree
from brrt.scenario.contracts import contract_of

Floats = NDArray[np.float64]


class TreeEdges(NamedTuple):
    """Edges of a tree.

    Attributes:
        ends: Places of the parent and the node, shape (m, 2, dim).
        rewired: Whether the node has got a new parent since it was added, shape (m,).
    """

    ends: Floats
    rewired: NDArray[np.bool_]


class CurrentPaths(NamedTuple):
    """Paths after an event, each with its cost.

    Attributes:
        raw: The best path of the planner so far.
        short: The same after the shortcuts so far.
    """

    raw: tuple[Floats, float] | None
    short: tuple[Floats, float] | None


class Playback:
    """The trees, cells, moves and paths of a run, after any of its events.

    Raises:
        LogError: The events contradict each other.
    """

    def __init__(self, recording: Recording) -> None:
        self._events, self._manifest = recording.events(), recording.manifest
        self.robot = recording.robot()
        self.contract = contract_of(self._manifest, recording.world)
        self._places: dict[int, Floats] = {}
        self._changes: dict[int, TreeChanges] = {}
        folded = as_forest(self._events)
        edges, rewires = (folded[kind] for kind in (Kind.EDGE, Kind.REWIRE))
        for number, tree in forest(self._events, self.robot.distance).items():
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
        """Whether the planner expands cells of a lattice."""
        return len(self._cells) > 0

    @property
    def learns(self) -> bool:
        """Whether cells have estimates of the cost-to-go instead of costs from the start."""
        return self.contract.learns

    @property
    def last(self) -> int:
        """Number of the last event; -1 if there is none."""
        return max((int(t["seq"][-1]) for t in self._events.tables.values() if len(t)), default=-1)

    @property
    def planned(self) -> int:
        """Number of the event that ends planning, or of the last one."""
        phases = self._events[Kind.PHASE]
        ended = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)]
        return int(ended["seq"][0]) if len(ended) else self.last

    def instant(self, seq: int) -> Instant:
        """Return the time and iteration of an event."""
        return self._events.until(seq=seq).last

    def nodes(self, seq: int) -> int:
        """Return the number of nodes of all trees, or of expanded cells, after an event."""
        if self.has_cells:
            return int(np.searchsorted(self._cells["seq"], seq, side="right"))
        events = self._events
        joined, left = (Kind.EDGE, Kind.VERTEX), (Kind.REMOVE,)
        counts = (
            sum(int(np.searchsorted(events[kind]["seq"], seq, side="right")) for kind in kinds)
            for kinds in (joined, left)
        )
        return next(counts) - next(counts)

    def links(self, number: int, seq: int) -> Floats:
        """Return the ends of the links of a graph after an event, shape (n, 2, dim)."""
        links = links_after(structure_of(self._events).until(seq=seq), number)
        ends = np.stack([links["node"], links["other"]], axis=1)
        return np.asarray(self._places[number][ends])

    def edges(self, number: int, seq: int) -> TreeEdges:
        """Return the edges of a tree after an event."""
        made, places = self._changes[number], self._places[number]
        upto = int(np.searchsorted(made.seq, seq, side="right"))
        node, joins = made.node[:upto], made.joins[:upto]
        parent = np.full(len(places), -1, np.int64)
        parent[node] = made.parent[:upto]  # the last of several changes of a node stays
        rewired = np.zeros(len(places), np.bool_)
        rewired[node[~joins]] = True
        child = np.flatnonzero(parent >= 0)
        ends = np.stack([places[parent[child]], places[child]], axis=1)
        return TreeEdges(ends, rewired[child])

    def cells(self, seq: int) -> tuple[Floats, Floats]:
        """Return the places of expanded cells, shape (n, dim), and their values, shape (n,)."""
        known = self._cells[: np.searchsorted(self._cells["seq"], seq, side="right")]
        values = self._values[: np.searchsorted(self._values["seq"], seq, side="right")]
        if not len(known):
            return np.empty((0, self._manifest.dim)), np.empty(0)
        order = np.argsort(known["cell"])
        numbers, latest = known["cell"][order], np.empty(len(known))
        latest[order[np.searchsorted(numbers, values["cell"])]] = values["value"]
        return self.robot.places(known["q"]), latest

    def trace(self, seq: int) -> list[Floats]:
        """Return the places of the robot in each trial, shape (m, dim)."""
        moves = self._events[Kind.MOVE]
        moves = moves[: np.searchsorted(moves["seq"], seq, side="right")]
        start = self.robot.places(np.array([self._manifest.start]))
        trials = np.split(
            self.robot.places(moves["q"]), np.flatnonzero(np.diff(moves["trial"])) + 1
        )
        return [np.concatenate([start, trial]) for trial in trials if len(trial)]

    def rejects(self, seq: int, newest: int) -> Floats:
        """Return begin and end of the newest rejected extensions, shape (n, 2, dim)."""
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
            known = cells["cell"][at] == rows["node"]
            ends[known, 0] = self.robot.places(cells["q"][at[known]])
        ends[:, 1] = self.robot.places(rows["q"])
        return np.asarray(ends[~np.isnan(ends).any(axis=(1, 2))])

    def paths(self, seq: int) -> CurrentPaths:
        """Return the paths after an event."""
        part = self._events.until(seq=seq)
        found = [(Stage(int(row["stage"])), row) for row in part[Kind.PATH]]
        raw = next((row for stage, row in reversed(found) if stage is not Stage.SMOOTHED), None)
        if raw is None:
            return CurrentPaths(None, None)
        stage, last = found[-1]
        best = np.asarray(raw["waypoints"]), float(raw["cost"])
        if stage is Stage.SMOOTHED:
            return CurrentPaths(best, (np.asarray(last["waypoints"]), float(last["cost"])))
        cuts = part[Kind.SHORTCUT]
        cuts = cuts[(cuts["seq"] > raw["seq"]) & cuts["accepted"]]
        if not len(cuts):
            return CurrentPaths(best, None)
        short = best[0]
        for cut in cuts:
            short = np.delete(short, slice(int(cut["i"]) + 1, int(cut["j"])), axis=0)
        return CurrentPaths(best, (short, float(cuts[-1]["cost"])))

    def _estimates(self) -> tuple[NDArray[np.void], NDArray[np.void]]:
        """Return the first expansion of each cell, and all values that cells get, in order.

        The first estimate of the cost-to-go is the distance to the goal.
        """
        expands, raised = self._events[Kind.EXPAND], self._events[Kind.HEURISTIC]
        first = expands[np.sort(np.unique(expands["cell"], return_index=True)[1])]
        seen = first if self.learns else expands
        raised = raised[np.isin(raised["cell"], first["cell"])]
        goal = np.array(self._manifest.goal)
        own = self.robot.distance(seen["q"], goal) if self.learns else seen["cost"]
        dtype = [("seq", "<i8"), ("cell", "<i4"), ("value", "<f8")]
        values = np.zeros(len(seen) + len(raised), dtype)
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
            "which does not exist"
        )
