"""What an explanation needs of a log: one pass, whose memory grows with the trees alone."""

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Reason, Source, Stage, Status, Table, table_dtype
from brrt.explanation.lattice import Cells
from brrt.replay.metrics import Metrics
from brrt.robots import Robot
from brrt.scenario.manifest import Manifest

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST = 10_000
"""Rejections that are looked at closely at most, evenly spread over the run."""

FAILED = (Reason.COLLISION, Reason.NO_PROGRESS, Reason.LIMITS, Reason.NO_GAIN)
"""Reasons for which an extension adds no node; others are further tries around a node."""

_PARTS = 4096


class Spans:
    """Sums over spans of iterations of one length, which doubles as the run grows longer.

    Attributes:
        sums: For each span: nodes that joined, extensions that failed, shape (spans, 2).
        t: When its last event was, ns; 0 where there is none, shape (spans,).
        nearest: How near to the goal a node joined, shape (spans,).
        began: When planning began, ns.
    """

    def __init__(self) -> None:
        self.length = 1
        self.sums = np.zeros((_PARTS, 2), np.int64)
        self.t = np.zeros(_PARTS, np.int64)
        self.nearest = np.full(_PARTS, np.inf)
        self.began = 0

    def reach(self, iteration: int) -> None:
        """Double the length until an iteration has its span."""
        while iteration // self.length >= _PARTS:
            self.length *= 2
            rest = np.zeros((_PARTS // 2, 2), np.int64)
            self.sums = np.concatenate([self.sums.reshape(-1, 2, 2).sum(axis=1), rest])
            self.t = np.concatenate([self.t.reshape(-1, 2).max(axis=1), rest[:, 0]])
            nearest = self.nearest.reshape(-1, 2).min(axis=1)
            self.nearest = np.concatenate([nearest, np.full(_PARTS // 2, np.inf)])

    def count(self, table: Table, column: int) -> None:
        """Add rows to a column of sums; their iterations must have been reached."""
        at = table["iteration"] // self.length
        self.sums[:, column] += np.bincount(at, minlength=_PARTS)

    def approach(self, table: Table, far: Floats) -> None:
        """Take in how far nodes are from the goal."""
        np.minimum.at(self.nearest, table["iteration"] // self.length, far)


class Thinned:
    """Rejections; of more than `most` every second, of twice as many every fourth ...

    Args:
        dof: Numbers in a configuration.
        most: Rows to keep; there may be up to twice as many.
    """

    def __init__(self, dof: int, most: int = MOST) -> None:
        self._most, self._stride, self._seen = most, 1, 0
        self._parts = [np.empty(0, table_dtype(Kind.REJECT, dof))]
        self._kept = 0

    def add(self, table: Table) -> None:
        """Take in rows."""
        first = -self._seen % self._stride
        self._seen += len(table)
        part = table[first :: self._stride].copy()
        self._parts.append(part)
        self._kept += len(part)
        while self._kept > 2 * self._most:
            rows = np.concatenate(self._parts)[::2]
            self._parts, self._kept, self._stride = [rows], len(rows), 2 * self._stride

    def rows(self) -> Table:
        """Return what was kept."""
        return np.concatenate(self._parts)


class Nearest(NamedTuple):
    """The node or cell nearest to the goal: how far from there, where, its number, and when."""

    far: float
    q: list[float]
    node: int
    iteration: int
    t: int


class Gather:
    """A fold over a run.

    Args:
        manifest: The run's.
        robot: What moves, settled in the world.

    Attributes:
        metrics: The run's figures.
        spans: Sums over the course of the run.
        reasons: Rejections by reason.
        rejects: Rejections, thinned.
        goal_rejects: Those in answer to a draw of the goal, or to a try to join it, thinned.
        drawn: Samples by source.
        goal_failed: Draws of the goal that were rejected.
        nearest: The start's tree's node nearest to the goal, or the cell; None without any.
        cells: What a search on a lattice looked at.
        paths: Iteration, time (ns) and cost of each path that the planner found, better ones
            after worse.
    """

    def __init__(self, manifest: Manifest, robot: Robot) -> None:
        self._robot, self._goal, self._dof = robot, np.array(manifest.goal), manifest.dof
        self.metrics, self.spans = Metrics(manifest), Spans()
        self.reasons: Counter[int] = Counter()
        self.rejects, self.goal_rejects = Thinned(self._dof), Thinned(self._dof, MOST // 5)
        self.drawn: Counter[int] = Counter()
        self.goal_failed = 0
        self.nearest: Nearest | None = None
        self.paths: list[tuple[int, int, float]] = []
        self.cells = Cells(robot, self._goal)
        self._nodes: dict[int, list[Floats]] = {}
        self._when: dict[int, list[Ints]] = {}
        self._last_draw = np.empty(0, np.int64)

    def write(self, events: Events) -> None:
        """Take in a batch."""
        self.metrics.write(events)
        reached = (int(table["iteration"].max()) for table in events.tables.values() if len(table))
        self.spans.reach(max(reached, default=0))  # in a doctored log they may fall
        for kind in (Kind.SAMPLE, Kind.EXPAND, Kind.MOVE, Kind.EDGE):
            table = events[kind]
            if len(table):
                np.maximum.at(self.spans.t, table["iteration"] // self.spans.length, table["t"])
        if Kind.EDGE in events.counts:
            self._join(events[Kind.EDGE])
        if Kind.EXPAND in events.counts or Kind.MOVE in events.counts:
            self._look(events)
        self._reject(events)
        for phase in events[Kind.PHASE]:
            if phase["name"] == Phase.PLAN and phase["status"] == Status.BEGIN:
                self.spans.began = int(phase["t"])
        for path in events[Kind.PATH]:
            if path["stage"] != Stage.SMOOTHED:
                row = int(path["iteration"]), int(path["t"]), float(path["cost"])
                self.paths.append(row)

    def nodes(self, tree: int) -> Floats:
        """Configurations of a tree's nodes, shape (n, dof)."""
        return np.concatenate([np.empty((0, self._dof)), *self._nodes.get(tree, [])])

    def iterations(self, tree: int) -> Ints:
        """When they joined, shape (n,)."""
        return np.concatenate([np.empty(0, np.int64), *self._when.get(tree, [])])

    @property
    def trees(self) -> list[int]:
        """Numbers of the trees."""
        return sorted(self._nodes)

    def origins(self, rejects: Table) -> Floats:
        """Where extensions left from, nan where no such node is known, shape (n, dof)."""
        if not self._nodes:
            return self.cells.origins(rejects)
        q = np.full((len(rejects), self._dof), np.nan)
        for tree in self.trees:
            nodes = self.nodes(tree)
            node = rejects["node"]
            mine = (rejects["tree"] == tree) & (node >= 0) & (node < len(nodes))
            q[mine] = nodes[node[mine]]
        return q

    def _look(self, events: Events) -> None:
        looks = events[Kind.EXPAND]
        fresh = self.cells.write(events)
        self.spans.count(looks[fresh], 0)
        self.spans.count(looks[~fresh], 1)
        if fresh.any():
            self._approach(looks[fresh], "cell")

    def _approach(self, table: Table, number: str) -> None:
        far = self._robot.distance(table["q"], self._goal)
        self.spans.approach(table, far)
        at = int(far.argmin())
        if self.nearest is None or far[at] < self.nearest.far:
            row = table[at]
            when = int(row["iteration"]), int(row["t"])
            self.nearest = Nearest(float(far[at]), row["q"].tolist(), int(row[number]), *when)

    def _join(self, edges: Table) -> None:
        self.spans.count(edges[edges["parent"] >= 0], 0)
        for tree in np.unique(edges["tree"]).tolist():
            mine = edges[edges["tree"] == tree]
            self._nodes.setdefault(tree, []).append(np.array(mine["q"]))
            self._when.setdefault(tree, []).append(np.array(mine["iteration"]))
            if tree == 0:
                self._approach(mine, "node")

    def _reject(self, events: Events) -> None:
        rejects, samples = events[Kind.REJECT], events[Kind.SAMPLE]
        for source, count in zip(*np.unique(samples["source"], return_counts=True), strict=True):
            self.drawn[int(source)] += int(count)
        goals = samples["iteration"][samples["source"] == Source.GOAL]
        # What comes of the last draw of a batch may stand in the next one.
        goals = np.concatenate([self._last_draw, goals])
        if len(samples):
            self._last_draw = samples["iteration"][-1:][samples["source"][-1:] == Source.GOAL]
        if not len(rejects):
            return
        for reason, count in zip(*np.unique(rejects["reason"], return_counts=True), strict=True):
            self.reasons[int(reason)] += int(count)
        failed = rejects[np.isin(rejects["reason"], [int(reason) for reason in FAILED])]
        if self._nodes:
            self.spans.count(failed, 1)
        self.rejects.add(rejects)
        answers = np.isin(failed["iteration"], goals)
        self.goal_failed += int(answers.sum())
        tries = rejects[rejects["reason"] == Reason.GOAL_BLOCKED]
        self.goal_rejects.add(np.concatenate([failed[answers], tries]))
