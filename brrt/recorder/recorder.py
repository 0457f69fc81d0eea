"""The recorder: takes the events of a planner, and hands them in batches to a sink."""

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrt.errors import BrrtError
from brrt.event_columns import COUNT, FIRST_SEQ, POINTS, EventColumns
from brrt.events import Kind, Phase, Reason, Source, Stage, Status, Table, table_dtype
from brrt.recorder import log
from brrt.recorder.buffers import Buffer, apply_changes, check_events, columns_of, rising
from brrt.recorder.graph_events import GraphEvents
from brrt.recorder.nodes import Nodes, from_root
from brrt.recorder.rows import ROOM, Rows
from brrt.recorder.values import (
    choice,
    chosen,
    configuration,
    configurations,
    cost_of,
    costs_of,
    whole,
    wholes,
)
from brrt.recording import Sink
from brrt.robots.point import Point
from brrt.scenario.query import Query

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LATE_S = 0.05
"""How long an event may wait here; files keep it for 0.3 s more, and half a second is promised."""

_SAMPLE, _EDGE = Kind.SAMPLE, Kind.EDGE
"""Looking up a member of an enumeration takes a twentieth of what an event may take."""

_MOST = 2**31 - 1
"""Nodes and cells have numbers of 32 bits."""


class Recorder(GraphEvents):
    """Takes the events of a planner, from any thread, and hands them to a sink.

    Use it by `brrt.record`. Methods raise `BrrtError` for values that no event can have, and for
    what the sink raises.

    Args:
        sink: Takes the events; it is closed with an empty result, or with None if it failed.
        query: The problem.
        clock: Returns the time of the next event in ns since the run began; None to measure it.
    """

    def __init__(self, sink: Sink, query: Query, clock: Callable[[], int] | None = None) -> None:
        self._sink, self._robot, self._dof = sink, query.robot, query.dof
        self._is_point = isinstance(query.robot, Point)
        self._lock = threading.RLock()
        origin = 0 if clock else time.perf_counter_ns()
        measured = clock or time.perf_counter_ns
        self._rows, self._cells = Rows(self._dof, measured, origin, self._make_room), 0
        self._trees = Nodes(self._dof), Nodes(self._dof)
        self._iteration, self._counts_samples = 0, True
        self._solved = self._closed = False
        self._error: BaseException | None = None
        self._origin = origin
        self._put(Kind.PHASE, 0.0, None, Phase.PLAN, Status.BEGIN)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._flush_late, name="brrt flush", daemon=True)
        self._thread.start()
        log.opened(self)

    @property
    def iteration(self) -> int:
        """The planner's iteration, for the next events.

        The number of samples so far; once it is set, it is what it was set to.
        """
        return self._iteration

    @iteration.setter
    def iteration(self, value: Any) -> None:
        with self._lock:
            low = self._iteration
            what = f"a whole number from {low} on"
            self._iteration = whole("iteration", value, low, 1 << 60, what)
            self._counts_samples = False

    def sample(self, q: ArrayLike, source: Source | str = Source.UNIFORM, *, tree: int = 0) -> None:
        """Record that a configuration was drawn, shape (dof,)."""
        values, origin = configuration(q, self._dof), choice("source", Source, source)
        with self._lock:
            if tree != 0 or tree.__class__ is not int:
                self._nodes(tree)
            iteration = self._iteration + self._counts_samples
            self._rows.put(_SAMPLE, iteration, 0.0, values, tree, origin)
            self._iteration = iteration

    def edge(
        self,
        q: ArrayLike,
        parent: int | None = None,
        *,
        cost: float | None = None,
        node: int | None = None,
        tree: int = 0,
    ) -> int:
        """Record that a node joined a tree, and return its number.

        Args:
            q: Its configuration, shape (dof,).
            parent: Number of its parent; None for a root.
            cost: Its cost-to-come; by default its parent's plus the distance.
            node: Its number, to check: nodes of a tree are numbered 0, 1, 2 ...
            tree: 0 grows from the start, 1 from the goal.
        """
        values = configuration(q, self._dof)
        with self._lock:
            nodes = self._trees[0] if tree.__class__ is int and not tree else self._nodes(tree)
            number = len(nodes.parent)
            if parent is None:
                up = -1
            elif parent.__class__ is int and 0 <= parent < number and not nodes.removed:
                up = parent
            else:
                up = self._node("parent", parent, tree, low=-1)
            if node is not None and node != number:
                raise BrrtError(f"node of tree {tree} must be {number}, its next, not {node!r:.60}")
            if cost is not None:
                total = cost_of(cost)
            elif up < 0:
                total = 0.0
            else:
                above = self._known_cost(nodes, up) if nodes.loose else nodes.cost[up]
                if self._is_point:
                    total = above + nodes.straight(up, values)
                else:
                    total = above + self._far(nodes.place(up), values)
            self._rows.put(_EDGE, self._iteration, total, values, tree, number, up)
            nodes.join(values, up, total)
            return number

    def reject(
        self,
        q: ArrayLike,
        node: int = 0,
        reason: Reason | str = Reason.COLLISION,
        *,
        tree: int = 0,
    ) -> None:
        """Record that an extension from a node, or a cell, towards a configuration was rejected."""
        values, why = configuration(q, self._dof), choice("reason", Reason, reason)
        with self._lock:
            most = max(len(self._nodes(tree)), self._cells, 1)
            at = whole("node", node, 0, most, f"a node of tree {tree} or an expanded cell")
            if at in self._nodes(tree).removed:
                raise BrrtError(f"node must be a node of tree {tree}; {at} was removed")
            self._put(Kind.REJECT, 0.0, values, tree, at, why)

    def rewire(self, node: int, parent: int, *, cost: float | None = None, tree: int = 0) -> None:
        """Record that a node got another parent; the costs of its descendants follow.

        Args:
            node: Its number.
            parent: Number of the new parent.
            cost: Its new cost-to-come; by default its parent's plus the distance.
            tree: 0 grows from the start, 1 from the goal.
        """
        with self._lock:
            nodes = self._nodes(tree)
            at, up = self._node("node", node, tree), self._node("parent", parent, tree)
            if nodes.descends(up, at):
                raise BrrtError(f"parent of node {at} must not descend from it, as {up} does")
            if cost is not None:
                total = cost_of(cost)
            else:
                far = self._far(nodes.place(up), nodes.place(at))
                total = self._known_cost(nodes, up) + far
            self._put(Kind.REWIRE, total, None, tree, at, up)
            nodes.move(at, up, total)

    def connect(self, node: int, other: int, *, cost: float | None = None) -> None:
        """Record a free motion between a node of tree 0 and one of tree 1.

        Args:
            node: Number of the node of tree 0.
            other: Number of the node of tree 1.
            cost: Of the path over the link; by default by the costs of the nodes.
        """
        with self._lock:
            (a, b), i, j = self._trees, self._node("node", node, 0), self._node("other", other, 1)
            if cost is not None:
                total = cost_of(cost)
            else:
                far = self._far(a.place(i), b.place(j))
                total = self._known_cost(a, i) + far + self._known_cost(b, j)
            self._put(Kind.CONNECT, total, None, i, j)

    def path(
        self, waypoints: ArrayLike, *, cost: float | None = None, stage: Stage | str | None = None
    ) -> None:
        """Record a path from start to goal.

        Args:
            waypoints: Its configurations, shape (n, dof), n at least 1.
            cost: Its cost; by default its length in the robot's metric.
            stage: By default the first path is raw and those after it are improved.
        """
        rows = configurations("waypoints", waypoints, self._dof)
        if not len(rows):
            raise BrrtError("waypoints must be one configuration at least")
        if cost is not None:
            length = cost_of(cost)
        else:
            length = float(np.sum(self._robot.distance(rows[:-1], rows[1:])))
        with self._lock:
            due = Stage.IMPROVED if self._solved else Stage.RAW
            kept = choice("stage", Stage, due if stage is None else stage)
            self._rows.put_path(self._iteration, kept, length, rows)
            self._solved = True

    def expand(self, cell: int, parent: int, q: ArrayLike, cost: float) -> None:
        """Record that a search expanded a cell.

        Args:
            cell: Its number.
            parent: Number of the cell that it was reached from; -1 for the first of a search.
            q: Its configuration, shape (dof,).
            cost: Its cost from the first cell of the search.
        """
        values, total = configuration(q, self._dof), cost_of(cost)
        at = whole("cell", cell, 0, _MOST, "the number of a cell")
        up = whole("parent", parent, -1, _MOST, "the number of a cell, or -1")
        with self._lock:
            self._put(Kind.EXPAND, total, values, at, up)
            self._cells = max(self._cells, at + 1)

    def samples(self, q: ArrayLike, source: Any = Source.UNIFORM, *, tree: int = 0) -> None:
        """Record that configurations were drawn, shape (n, dof); see `sample`."""
        rows = configurations("q", q, self._dof)
        origin = chosen("source", Source, source, len(rows))
        with self._lock:
            self._nodes(tree)
            iteration: Any = self._iteration
            if self._counts_samples:
                iteration = self._iteration + 1 + np.arange(len(rows))
            fields = {"tree": tree, "source": origin, "q": rows}
            self._put_many(Kind.SAMPLE, len(rows), fields, iteration)
            self._iteration += len(rows) * self._counts_samples

    def edges(
        self, q: ArrayLike, parent: ArrayLike, *, cost: ArrayLike | None = None, tree: int = 0
    ) -> NDArray[np.int64]:
        """Record that nodes joined a tree, in this order; return their numbers, shape (n,).

        Args:
            q: Their configurations, shape (n, dof).
            parent: Numbers of their parents, -1 for roots, shape (n,).
            cost: Their costs-to-come, shape (n,); by default by the distances.
            tree: 0 grows from the start, 1 from the goal.
        """
        rows = configurations("q", q, self._dof)
        with self._lock:
            nodes = self._nodes(tree)
            numbers = len(nodes) + np.arange(len(rows))
            what = f"for each row a node of tree {tree} before it, or -1"
            up = wholes("parent", parent, len(rows), -1, numbers, what)
            self._check_present("parent", up, tree)
            total = self._costs(nodes, rows, up) if cost is None else costs_of(cost, len(rows))
            fields = {"tree": tree, "node": numbers, "parent": up, "cost": total, "q": rows}
            self._put_many(Kind.EDGE, len(rows), fields, self._iteration)
            nodes.join_many(rows, up, total)
            return numbers

    def rejects(
        self, q: ArrayLike, node: Any = 0, reason: Any = Reason.COLLISION, *, tree: int = 0
    ) -> None:
        """Record rejected extensions towards configurations, shape (n, dof); see `reject`."""
        rows = configurations("q", q, self._dof)
        why = chosen("reason", Reason, reason, len(rows))
        with self._lock:
            most = max(len(self._nodes(tree)), self._cells, 1)
            at = wholes("node", node, len(rows), 0, most, f"nodes of tree {tree} or expanded cells")
            self._check_present("node", at, tree)
            fields = {"tree": tree, "node": at, "reason": why, "q": rows}
            self._put_many(Kind.REJECT, len(rows), fields, self._iteration)

    def tree(self, q: ArrayLike, parent: ArrayLike, *, tree: int = 0) -> None:
        """Record a whole tree as it is now: nodes that are new, and parents that changed.

        Between two calls rows keep their meaning, and new rows follow the old ones.

        Args:
            q: Configurations of its nodes, shape (n, dof).
            parent: Row of the parent of each node, -1 for a root, shape (n,).
            tree: 0 grows from the start, 1 from the goal.
        """
        rows = configurations("q", q, self._dof)
        up = wholes("parent", parent, len(rows), -1, len(rows), "for each row a row, or -1")
        with self._lock:
            nodes = self._nodes(tree)
            known = len(nodes.rows)
            if len(rows) < known:
                raise BrrtError(f"q must have at least the {known} rows of the last call")
            new = from_root(up, known)
            numbers = np.append(nodes.rows, np.empty(len(rows) - known, np.int64))
            numbers[new] = len(nodes) + np.arange(len(new))
            parents = np.where(up >= 0, numbers[up], -1)
            self.edges(rows[new], parents[new], tree=tree)
            nodes.rows = numbers
            now = np.array(nodes.parent, np.int64)[numbers[:known]]
            changed = np.flatnonzero(now != parents[:known])
            pairs = np.stack([numbers[changed], parents[changed]], axis=1)
            self._rewire_all(dict(pairs.tolist()), tree)

    def _rewire_all(self, parents: dict[int, int], tree: int) -> None:
        """Rewire nodes, each once its new parent no longer descends from it."""
        nodes = self._nodes(tree)
        while parents:
            waiting = {}
            for node, up in parents.items():
                if nodes.descends(up, node) or up < 0:
                    waiting[node] = up
                else:
                    self.rewire(node, up, tree=tree)
            if len(waiting) == len(parents):
                node, up = next(iter(waiting.items()))
                raise BrrtError(f"parent of node {node} cannot become {up}: a circle, or a root")
            parents = waiting

    def take(self, buffer: Buffer) -> None:
        """Record the events that compiled kernels wrote to a buffer, and empty it.

        Args:
            buffer: Made by `brrt.kernels.emit.empty_buffer`, and written to by its functions
                `emit_edge` and so on. Its nodes and costs are the kernel's own; its times are kept,
                unless the recording has a clock of the caller.

        Raises:
            BrrtError: An event has an impossible value; none of the buffer is recorded then.
        """
        with self._lock:
            self._check_open()
            columns = columns_of(buffer, self._dof)
            events = check_events(columns, self._trees, self._cells, self._iteration)
            if not len(events):
                return
            now = self._rows.now()
            t = columns.t - self._origin if self._origin else np.full(len(events), now)
            columns = replace(columns, t=rising(t, self._rows.last_t))
            self._put_columns(columns, events[Kind.PATH])
            apply_changes(events, self._trees)
            self._iteration, self._counts_samples = int(columns.iteration[-1]), False
            self._cells = max(self._cells, int(events[Kind.EXPAND]["cell"].max(initial=-1)) + 1)
            self._solved |= len(events[Kind.PATH]) > 0
            buffer.state[FIRST_SEQ] += len(events)
            buffer.state[[COUNT, POINTS]] = 0

    def put(self, columns: EventColumns) -> None:
        """Record events other than paths of a caller that knows them to be possible.

        Nodes have the caller's numbers; events by other methods must not name them.
        """
        with self._lock:
            columns = replace(columns, t=rising(columns.t, self._rows.last_t))
            self._put_columns(columns, np.empty(0, table_dtype(Kind.PATH, self._dof)))

    def _put_columns(self, columns: EventColumns, paths: Table) -> None:
        """Record checked events, of which the paths have waypoints."""
        done = 0
        for stop, path in zip(
            [*paths["seq"].tolist(), len(columns.kind)], [*paths, None], strict=True
        ):
            while done < stop:
                self._make_room()
                done += self._rows.put_columns(columns, slice(done, stop))
            if path is not None:
                self._rows.put_path(
                    int(path["iteration"]), int(path["stage"]), float(path["cost"]),
                    path["waypoints"].copy(), int(columns.t[stop]),
                )  # fmt: skip
                done += 1

    def flush(self) -> None:
        """Hand the events so far to the sink."""
        with self._lock:
            self._check_open()
            self._flush()

    def close(self, status: Status | str | None = None) -> None:
        """End the run and close the sink.

        Args:
            status: How planning ended; by default solved if there is a path, else that a limit of
                iterations was reached.
        """
        if status is None:
            status = Status.SOLVED if self._solved else Status.ITERATION_LIMIT
        ended = choice("status", Status, status)
        with self._lock:
            if self._closed:
                return
            try:
                self._put(Kind.PHASE, 0.0, None, Phase.PLAN, ended)
                self._flush()
            except BaseException as error:  # noqa: BLE001 - raised below, once all is closed
                self._error = error
            self._closed, self._rows.room = True, 0
        log.closed(self)
        self._stop.set()
        self._thread.join()
        self._sink.close({} if self._error is None else None)
        if self._error is not None:
            raise self._error

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file; an exception ends the run as interrupted and is passed on."""
        self.close(None if kind is None else Status.INTERRUPTED)

    def _nodes(self, tree: int) -> Nodes:
        if type(tree) is int and 0 <= tree < 2:
            return self._trees[tree]
        return self._trees[whole("tree", tree, 0, 2, "0 or 1")]

    def _node(self, name: str, node: Any, tree: int, low: int = 0) -> int:
        nodes = self._nodes(tree)
        count, removed = len(nodes.parent), nodes.removed
        if not removed and type(node) is int and low <= node < count:
            return node  # the usual case, without a message
        at = whole(name, node, low, count, f"a node of tree {tree}")
        if at in removed:
            raise BrrtError(f"{name} must be a node of tree {tree}; {at} was removed")
        return at

    def _node_rows(self, name: str, values: ArrayLike, count: int, tree: int, low: int = 0) -> Ints:
        """Return numbers of nodes, each from `low` on, shape (count,)."""
        most = len(self._nodes(tree))
        numbers = wholes(name, values, count, low, most, f"nodes of tree {tree}")
        self._check_present(name, numbers, tree)
        return numbers

    def _check_present(self, name: str, numbers: Ints, tree: int) -> None:
        """Raise unless no node of an array was removed."""
        removed = self._nodes(tree).removed
        gone = removed.intersection(numbers.tolist()) if removed else ()
        if gone:
            raise BrrtError(f"{name} must be nodes of tree {tree}; {min(gone)} was removed")

    def _far(self, a: Sequence[float], b: Sequence[float]) -> float:
        """Return the distance in the robot's metric."""
        if self._is_point:
            return math.dist(a, b)
        return float(self._robot.distance(np.array(a), np.array(b)))

    def _costs(self, nodes: Nodes, rows: Floats, up: Ints) -> Floats:
        """Return what new nodes cost, each after its parent, shape (n,)."""
        old = len(nodes)
        for parent in np.unique(up[(up >= 0) & (up < old)]).tolist() if nodes.loose else ():
            self._known_cost(nodes, parent)
        begins, known, new = rows.copy(), (up >= 0) & (up < old), np.flatnonzero(up >= old)
        begins[known], begins[new] = nodes.places(up[known]), rows[up[new] - old]
        far = np.asarray(self._robot.distance(begins, rows), np.float64)
        cost = np.where(up >= 0, far, 0.0)
        cost[known] += nodes.costs(up[known])
        totals = cost.tolist()
        for row, parent in zip(new.tolist(), (up[new] - old).tolist(), strict=True):
            totals[row] += totals[parent]
        return np.array(totals)

    def _check_open(self) -> None:
        """Raise if the sink failed, or if the recording is closed."""
        if self._closed:
            raise BrrtError("the recording is closed")
        if self._error is not None:
            raise self._error

    def _make_room(self) -> None:
        """Hand a full batch over; raise if no more may be recorded."""
        self._check_open()
        if self._rows.count == ROOM:
            self._flush()

    def _put(self, kind: Kind, real: float, q: Sequence[float] | None, *integers: int) -> None:
        """Record an event; see `Rows.put`."""
        self._rows.put(kind, self._iteration, real, q, *integers)

    def _put_many(self, kind: Kind, count: int, fields: dict[str, Any], iteration: Any) -> None:
        """Record events of one kind; see `Rows.put_many`."""
        done = 0
        while done < count:
            self._make_room()
            part = slice(done, count)
            done += self._rows.put_many(kind, iteration, fields, part)

    def _flush(self) -> None:
        if self._rows.count:
            self._sink.write(self._rows.take())

    def _flush_late(self) -> None:
        """Hand over what waits while the planner records nothing."""
        while not self._stop.wait(_LATE_S):
            with self._lock:
                if not self._closed and self._error is None:
                    try:
                        self._flush()
                    except BaseException as error:  # noqa: BLE001 - raised at the next call
                        self._error, self._rows.room = error, 0
