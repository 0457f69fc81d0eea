"""A log summed up for an explanation, in one pass; memory grows only with the trees."""

from collections import Counter

import numpy as np

from brrt.events import Events, Kind, Phase, Reason, Source, Stage, Status, Table, table_dtype
from brrt.explanation.cells import CellSummary
from brrt.replay.graph import is_vertex, joined_nodes
from brrt.replay.metrics import Metrics
from brrt.robots import Robot
from brrt.scenario.manifest import Manifest
from brrt.worlds.arrays import Floats, Ints

MOST = 10_000
"""Rejections whose geometry is examined, evenly spread over the run."""

FAILED = (Reason.COLLISION, Reason.NO_PROGRESS, Reason.LIMITS, Reason.NO_GAIN)
"""Reasons for which an extension adds no node; the others concern further tries near a node."""

_BINS = 4096


class IterationBins:
    """Sums over bins of successive iterations, whose length doubles as the run grows.

    Attributes:
        length: Iterations in a bin.
        sums: For each bin: nodes added, extensions rejected, shape (bins, 2).
        t: Time of its last event in ns; 0 without one, shape (bins,).
        nearest: Least distance of its nodes to the goal, shape (bins,).
        began: When planning began, in ns.
    """

    def __init__(self) -> None:
        self.length = 1
        self.sums = np.zeros((_BINS, 2), np.int64)
        self.t = np.zeros(_BINS, np.int64)
        self.nearest = np.full(_BINS, np.inf)
        self.began = 0

    def reach(self, iteration: int) -> None:
        """Double the length until an iteration has a bin."""
        while iteration // self.length >= _BINS:
            self.length *= 2
            rest = np.zeros((_BINS // 2, 2), np.int64)
            self.sums = np.concatenate([self.sums.reshape(-1, 2, 2).sum(axis=1), rest])
            self.t = np.concatenate([self.t.reshape(-1, 2).max(axis=1), rest[:, 0]])
            nearest = self.nearest.reshape(-1, 2).min(axis=1)
            self.nearest = np.concatenate([nearest, np.full(_BINS // 2, np.inf)])

    def count(self, table: Table, column: int) -> None:
        """Add rows to a column of sums, once `reach` was called for their iterations."""
        at = table["iteration"] // self.length
        self.sums[:, column] += np.bincount(at, minlength=_BINS)

    def approach(self, table: Table, far: Floats) -> None:
        """Take distances of nodes to the goal."""
        np.minimum.at(self.nearest, table["iteration"] // self.length, far)


class ThinnedRejects:
    """Every k-th rejection, with k doubled whenever twice `most` are exceeded."""

    def __init__(self, dof: int, most: int = MOST) -> None:
        self._most, self._stride, self._seen = most, 1, 0
        self._parts = [np.empty(0, table_dtype(Kind.REJECT, dof))]
        self._kept = 0

    def add(self, table: Table) -> None:
        """Take rows."""
        first = -self._seen % self._stride
        self._seen += len(table)
        part = table[first :: self._stride].copy()
        self._parts.append(part)
        self._kept += len(part)
        while self._kept > 2 * self._most:
            rows = np.concatenate(self._parts)[::2]
            self._parts, self._kept, self._stride = [rows], len(rows), 2 * self._stride

    def rows(self) -> Table:
        """Return the rows that were kept."""
        return np.concatenate(self._parts)


class RunSummary:
    """A fold over a run.

    Attributes:
        metrics: The run's metrics.
        bins: Sums over the course of the run.
        reasons: Rejections by reason.
        rejects: Rejections, thinned.
        goal_rejects: Those of draws of the goal, and of motions to the goal, thinned.
        drawn: Samples by source.
        goal_failed: Draws of the goal that were rejected.
        nearest: The cell, or the node of the start's tree, nearest to the goal: distance,
            configuration, number, iteration; None without one.
        paths: Iteration and cost of each path that the planner found, in order.
        cells: The cells of a lattice search.
    """

    def __init__(self, manifest: Manifest, robot: Robot) -> None:
        self._robot, self._goal, self._dof = robot, np.array(manifest.goal), manifest.dof
        self.metrics, self.bins = Metrics(manifest), IterationBins()
        self.reasons: Counter[int] = Counter()
        self.rejects = ThinnedRejects(self._dof)
        self.goal_rejects = ThinnedRejects(self._dof, MOST // 5)
        self.drawn: Counter[int] = Counter()
        self.goal_failed = 0
        self.nearest: tuple[float, list[float], int, int] | None = None
        self.paths: list[tuple[int, float]] = []
        self.cells = CellSummary(robot, self._goal)
        self._nodes: dict[int, list[Floats]] = {}
        self._iterations: dict[int, list[Ints]] = {}
        self._last_draw = np.empty(0, np.int64)

    def write(self, events: Events) -> None:
        """Take a batch."""
        self.metrics.write(events)
        reached = (int(table["iteration"].max()) for table in events.tables.values() if len(table))
        self.bins.reach(max(reached, default=0))  # in a damaged log they may fall
        for kind in (Kind.SAMPLE, Kind.EXPAND, Kind.MOVE, Kind.EDGE, Kind.LINK):
            table = events[kind]
            if len(table):
                np.maximum.at(self.bins.t, table["iteration"] // self.bins.length, table["t"])
        if Kind.EDGE in events.counts or Kind.VERTEX in events.counts:
            self._add_nodes(joined_nodes(events))
        self.bins.count(events[Kind.LINK], 0)
        if Kind.EXPAND in events.counts or Kind.MOVE in events.counts:
            self._add_expansions(events)
        self._add_rejects(events)
        for phase in events[Kind.PHASE]:
            if phase["name"] == Phase.PLAN and phase["status"] == Status.BEGIN:
                self.bins.began = int(phase["t"])
        for path in events[Kind.PATH]:
            if path["stage"] != Stage.SMOOTHED:
                self.paths.append((int(path["iteration"]), float(path["cost"])))

    def nodes(self, tree: int) -> Floats:
        """Configurations of a tree's nodes, shape (n, dof)."""
        return np.concatenate([np.empty((0, self._dof)), *self._nodes.get(tree, [])])

    def iterations(self, tree: int) -> Ints:
        """Iterations in which they were added, shape (n,)."""
        return np.concatenate([np.empty(0, np.int64), *self._iterations.get(tree, [])])

    @property
    def trees(self) -> list[int]:
        """Numbers of the trees."""
        return sorted(self._nodes)

    def motions(self, rejects: ThinnedRejects) -> tuple[Floats, Floats]:
        """Return the ends of rejected motions from nodes or cells that exist, shape (n, dof)."""
        rows = rejects.rows()
        node, ends = rows["node"], np.asarray(rows["q"])
        if not self._nodes:
            q, known = self.cells.find(node)
            return q, ends[known]
        q, known = np.empty_like(ends), np.zeros(len(rows), np.bool_)
        for tree in self.trees:
            nodes = self.nodes(tree)
            mine = (rows["tree"] == tree) & (node >= 0) & (node < len(nodes))
            q[mine], known[mine] = nodes[node[mine]], True
        return q[known], ends[known]

    def _add_expansions(self, events: Events) -> None:
        expanded = events[Kind.EXPAND]
        first = self.cells.write(events)
        self.bins.count(expanded[first], 0)
        self.bins.count(expanded[~first], 1)
        if first.any():
            self._approach(expanded[first], "cell")

    def _approach(self, table: Table, number: str) -> None:
        far = self._robot.distance(table["q"], self._goal)
        self.bins.approach(table, far)
        at = int(far.argmin())
        if self.nearest is None or far[at] < self.nearest[0]:
            q, n, iteration = (table[name][at].tolist() for name in ("q", number, "iteration"))
            self.nearest = float(far[at]), q, n, iteration

    def _add_nodes(self, edges: Table) -> None:
        self.bins.count(edges[edges["parent"] >= 0], 0)
        for tree in np.unique(edges["tree"]).tolist():
            mine = edges[edges["tree"] == tree]
            self._nodes.setdefault(tree, []).append(np.array(mine["q"]))
            self._iterations.setdefault(tree, []).append(np.array(mine["iteration"]))
            mine = mine[~is_vertex(mine)]  # that one is near the goal says nothing of a way there
            if tree == 0 and len(mine):
                self._approach(mine, "node")

    def _add_rejects(self, events: Events) -> None:
        rejects, samples = events[Kind.REJECT], events[Kind.SAMPLE]
        self.drawn.update(samples["source"].tolist())
        goals = samples["iteration"][samples["source"] == Source.GOAL]
        # The result of the last draw of a batch may be in the next one.
        goals = np.concatenate([self._last_draw, goals])
        if len(samples):
            self._last_draw = samples["iteration"][-1:][samples["source"][-1:] == Source.GOAL]
        if not len(rejects):
            return
        self.reasons.update(rejects["reason"].tolist())
        failed = rejects[np.isin(rejects["reason"], [int(reason) for reason in FAILED])]
        if self._nodes:
            self.bins.count(failed, 1)
        self.rejects.add(rejects)
        of_goal = np.isin(failed["iteration"], goals)
        self.goal_failed += int(of_goal.sum())
        tries = rejects[rejects["reason"] == Reason.GOAL_BLOCKED]
        self.goal_rejects.add(np.concatenate([failed[of_goal], tries]))
