"""`brrt.record`: a recording of any planner in Python, event by event or in arrays."""

from __future__ import annotations

import math
import struct
import threading
import time
from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrt.errors import BrrtError, unknown
from brrt.events import LATEST_NS, Events, Kind, Named, Phase, Reason, Source, Stage, Status
from brrt.formats.background import BackgroundSink
from brrt.formats.mcap.sink import McapSink
from brrt.recorder import log
from brrt.recorder.rows import events_of, row_dtype, row_struct
from brrt.recording import Result, Sink
from brrt.replay.metrics import Metrics
from brrt.robots import Robot
from brrt.robots.point import Point
from brrt.scenario.contract import Contract
from brrt.scenario.manifest import Manifest, made_by
from brrt.scenario.query import Query
from brrt.scenario.scenario import Scenario
from brrt.worlds import World, make_world
from brrt.worlds.arrays import GREATEST

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_ROWS, _LATE_S = 8192, 0.2
"""Events of a batch at most, and seconds that one waits."""

_MOST_NODES = 2**31 - 1


class _Tree:
    """The nodes of a tree, for numbers and costs that the caller leaves out.

    Args:
        dof: Numbers in a configuration.

    Attributes:
        q: Configurations of the nodes, one after the other.
        parent: Their parents; -1 for a root.
        cost: Their costs now.
        children: The children of each node; None until a rewire needs them.
        rows: For `Recorder.tree`: number of the node in each row of the caller's arrays.
    """

    def __init__(self, dof: int) -> None:
        self._dof = dof
        self.q, self.parent, self.cost = array("d"), array("q"), array("d")
        self.children: list[set[int]] | None = None
        self.rows = np.empty(0, np.int64)

    def __len__(self) -> int:
        return len(self.parent)

    def place(self, node: int) -> Sequence[float]:
        """Return the configuration of a node."""
        return self.q[node * self._dof : (node + 1) * self._dof]

    def join(self, q: Sequence[float], parent: int, cost: float) -> None:
        """Add a node."""
        self.q.extend(q)
        self.parent.append(parent)
        self.cost.append(cost)
        if self.children is not None:
            self.children.append(set())
            if parent >= 0:
                self.children[parent].add(len(self.parent) - 1)

    def join_many(self, q: Floats, parent: Ints, cost: Floats) -> None:
        """Add nodes."""
        for column, values in ((self.q, q), (self.parent, parent), (self.cost, cost)):
            column.frombytes(np.ascontiguousarray(values).tobytes())
        self.children = None

    def move(self, node: int, parent: int, cost: float) -> None:
        """Give a node another parent; its descendants' costs follow."""
        if self.children is None:
            self.children = [set() for _ in self.parent]
            for child, up in enumerate(self.parent):
                if up >= 0:
                    self.children[up].add(child)
        if self.parent[node] >= 0:
            self.children[self.parent[node]].discard(node)
        self.children[parent].add(node)
        self.parent[node] = parent
        change, below = cost - self.cost[node], [node]
        while below:
            at = below.pop()
            self.cost[at] += change
            below += self.children[at]

    def above(self, node: int, ancestor: int) -> bool:
        """Return whether a node is another one or one of its ancestors."""
        while node >= 0 and node != ancestor:
            node = self.parent[node]
        return node == ancestor


class _MeasuredSink:
    """Folds the metrics on the thread that writes, and closes the sink with them."""

    def __init__(self, sink: Sink, manifest: Manifest) -> None:
        self._sink, self._metrics = sink, Metrics(manifest)

    def write(self, events: Events) -> None:
        """Take a batch."""
        if len(events):
            self._metrics.write(events)
        self._sink.write(events)

    def close(self, result: Result | None) -> None:
        """Close the sink with the metrics, unless the recording failed."""
        self._sink.close(None if result is None else self._metrics.as_dict())


class Recorder:
    """Takes the events of a planner, from any thread, and writes them to a file.

    Use it by `brrt.record`. Methods raise `BrrtError` for values that no event can have.

    Attributes:
        iteration: The planner's iteration, for the next events. By default it is the number of
            samples so far; once it is set, it is what it was set to.
        dof: Numbers in a configuration.
    """

    def __init__(self, sink: Sink, query: Query, clock: Callable[[], int] | None = None) -> None:
        self._sink, self._robot, self.dof = sink, query.robot, query.dof
        self._plain = isinstance(query.robot, Point)
        packed = row_struct(self.dof)
        self._pack, self._size, self._zeros = packed.pack_into, packed.size, (0.0,) * self.dof
        self._lock = threading.RLock()
        self._count = self._first = self._points_count = 0
        self._points: list[Floats] = []
        self._trees: dict[int, _Tree] = {}
        self._iteration, self._counts_samples = 0, True
        self._solved = self._closed = False
        self._last_t = -1
        self._new_rows()
        self._origin = 0 if clock else time.perf_counter_ns()
        self._clock = clock or time.perf_counter_ns
        self._write(Kind.PHASE, Phase.PLAN, Status.BEGIN, 0, 0.0, self._zeros)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._flush_late, name="brrt flush", daemon=True)
        self._thread.start()
        log.opened(self)

    @property
    def iteration(self) -> int:
        """See the class."""
        return self._iteration

    @iteration.setter
    def iteration(self, value: Any) -> None:
        if not isinstance(value, int | np.integer) or not self._iteration <= value < 1 << 60:
            raise BrrtError(
                f"iteration must be a whole number from {self._iteration} on, not {value!r:.60}"
            )
        self._iteration, self._counts_samples = int(value), False

    def sample(self, q: ArrayLike, source: Source | str = Source.UNIFORM, *, tree: int = 0) -> None:
        """Record that a configuration was drawn, shape (dof,)."""
        values, origin = self._configuration(q), _choice("source", Source, source)
        with self._lock:
            if self._counts_samples:
                self._iteration += 1
            self._write(Kind.SAMPLE, tree, origin, 0, 0.0, values)

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
        values = self._configuration(q)
        with self._lock:
            nodes = self._trees.get(tree) or self._tree(tree)
            number, above = len(nodes.parent), -1 if parent is None else parent
            if node is not None and node != number:
                raise BrrtError(f"node {node!r:.20} of tree {tree} must be {number}, its next")
            if not -1 <= above < number:
                raise BrrtError(f"parent must be a node of tree {tree}, not {parent!r:.20}")
            if cost is None:
                cost = 0.0
                if above >= 0:
                    cost = nodes.cost[above] + self._far(nodes.place(above), values)
            self._write(Kind.EDGE, tree, number, above, cost, values)
            nodes.join(values, above, cost)
            return number

    def reject(
        self,
        q: ArrayLike,
        node: int = 0,
        reason: Reason | str = Reason.COLLISION,
        *,
        tree: int = 0,
    ) -> None:
        """Record that an extension from a node towards a configuration was rejected."""
        values, why = self._configuration(q), _choice("reason", Reason, reason)
        with self._lock:
            self._write(Kind.REJECT, tree, node, why, 0.0, values)

    def rewire(self, node: int, parent: int, *, cost: float | None = None, tree: int = 0) -> None:
        """Record that a node got another parent; the costs of its descendants follow.

        Args:
            node: Its number.
            parent: Number of the new parent.
            cost: Its new cost-to-come; by default its parent's plus the distance.
            tree: 0 grows from the start, 1 from the goal.
        """
        with self._lock:
            nodes = self._tree(tree)
            for name, value in (("node", node), ("parent", parent)):
                if not 0 <= value < len(nodes):
                    raise BrrtError(f"{name} must be a node of tree {tree}, not {value!r:.20}")
            if nodes.above(parent, node):
                raise BrrtError(f"parent {parent} of node {node} must not descend from it")
            if cost is None:
                cost = nodes.cost[parent] + self._far(nodes.place(parent), nodes.place(node))
            self._write(Kind.REWIRE, tree, node, parent, cost, self._zeros)
            nodes.move(node, parent, cost)

    def connect(self, node: int, other: int, *, cost: float | None = None) -> None:
        """Record a free motion between a node of tree 0 and one of tree 1.

        Args:
            node: Number of the node of tree 0.
            other: Number of the node of tree 1.
            cost: Of the path over the link; by default by the costs of the nodes.
        """
        with self._lock:
            if cost is None:
                a, b = self._tree(0), self._tree(1)
                if not (0 <= node < len(a) and 0 <= other < len(b)):
                    raise BrrtError(f"nodes {node!r:.20} and {other!r:.20} must be in the trees")
                cost = a.cost[node] + self._far(a.place(node), b.place(other)) + b.cost[other]
            self._write(Kind.CONNECT, node, other, 0, cost, self._zeros)

    def path(
        self, waypoints: ArrayLike, *, cost: float | None = None, stage: Stage | str | None = None
    ) -> None:
        """Record a path from start to goal.

        Args:
            waypoints: Its configurations, shape (n, dof).
            cost: Its cost; by default its length in the robot's metric.
            stage: By default the first path is raw and those after it are improved.
        """
        rows = np.array(waypoints, np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.dof or not len(rows):
            raise BrrtError(f"waypoints must be rows of {self.dof} numbers, not {rows.shape}")
        if cost is None:
            cost = float(np.sum(self._robot.distance(rows[:-1], rows[1:])))
        with self._lock:
            if stage is None:
                stage = Stage.IMPROVED if self._solved else Stage.RAW
            if self._count == _ROWS:
                self._flush()  # waypoints stay with the event that they belong to
            kept = _choice("stage", Stage, stage)
            self._write(Kind.PATH, kept, self._points_count, len(rows), cost, self._zeros)
            self._points.append(rows)
            self._points_count += len(rows)
            self._solved = True

    def expand(self, cell: int, parent: int, q: ArrayLike, cost: float) -> None:
        """Record that a search expanded a cell; see the kind `expand` in docs/events.md."""
        values = self._configuration(q)
        with self._lock:
            self._write(Kind.EXPAND, cell, parent, 0, cost, values)

    def samples(self, q: ArrayLike, source: Any = Source.UNIFORM, *, tree: Any = 0) -> None:
        """Record that configurations were drawn, shape (n, dof); see `sample`."""
        rows = self._configurations(q)
        with self._lock:
            iteration: Any = None
            if self._counts_samples:
                iteration = self._iteration + 1 + np.arange(len(rows))
                self._iteration += len(rows)
            self._write_many(Kind.SAMPLE, len(rows), (tree, source, 0), q=rows, iteration=iteration)

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
        rows, above = self._configurations(q), np.asarray(parent, np.int64)
        with self._lock:
            nodes = self._tree(tree)
            numbers = len(nodes) + np.arange(len(rows))
            if above.shape != numbers.shape or ((above < -1) | (above >= numbers)).any():
                raise BrrtError(f"parent must be, for each row, a node of tree {tree} before it")
            costs = self._costs(nodes, rows, above) if cost is None else np.asarray(cost, float)
            self._write_many(Kind.EDGE, len(rows), (tree, numbers, above), real=costs, q=rows)
            nodes.join_many(rows, above, np.broadcast_to(costs, numbers.shape))
            return numbers

    def rejects(
        self, q: ArrayLike, node: Any = 0, reason: Any = Reason.COLLISION, *, tree: Any = 0
    ) -> None:
        """Record rejected extensions towards configurations, shape (n, dof); see `reject`."""
        rows = self._configurations(q)
        self._write_many(Kind.REJECT, len(rows), (tree, node, reason), q=rows)

    def tree(self, q: ArrayLike, parent: ArrayLike, *, tree: int = 0) -> None:
        """Record a whole tree as it is now: nodes that are new, and parents that changed.

        Between two calls rows keep their meaning, and new rows follow the old ones.

        Args:
            q: Configurations of its nodes, shape (n, dof).
            parent: Row of the parent of each node, -1 for a root, shape (n,).
            tree: 0 grows from the start, 1 from the goal.
        """
        rows, above = self._configurations(q), np.asarray(parent, np.int64)
        with self._lock:
            nodes = self._tree(tree)
            known = len(nodes.rows)
            if above.shape != (len(rows),) or ((above < -1) | (above >= len(rows))).any():
                raise BrrtError("parent must be, for each row, the row of a node, or -1")
            if len(rows) < known:
                raise BrrtError(f"q must have at least the {known} rows of the last call")
            numbers = np.append(nodes.rows, np.full(len(rows) - known, -1)).astype(np.int64)
            new = _from_root(above, known)
            numbers[new] = len(nodes) + np.arange(len(new))
            ups = np.where(above >= 0, numbers[above], -1)
            self.edges(rows[new], ups[new], tree=tree)
            nodes.rows = numbers
            now = np.array(nodes.parent, np.int64)[numbers[:known]]
            self._rewire_all(numbers, ups, np.flatnonzero(now != ups[:known]), tree)

    def _rewire_all(self, numbers: Ints, ups: Ints, changed: Ints, tree: int) -> None:
        """Rewire rows, each once its new parent no longer descends from it."""
        nodes, left = self._tree(tree), changed.tolist()
        while left:
            later = [row for row in left if nodes.above(int(ups[row]), int(numbers[row]))]
            if len(later) == len(left) or min(ups[left]) < 0:
                raise BrrtError(f"parent: row {left[0]} becomes a root or its own ancestor")
            for row in left:
                if not nodes.above(int(ups[row]), int(numbers[row])):
                    self.rewire(int(numbers[row]), int(ups[row]), tree=tree)
                elif row not in later:
                    later.append(row)
            left = later

    def flush(self) -> None:
        """Hand the events so far to the thread that writes them."""
        with self._lock:
            self._flush()

    def close(self, status: Status | str | None = None) -> None:
        """End the run and the file.

        Args:
            status: How planning ended; by default solved if there is a path, else that a limit of
                iterations was reached.
        """
        with self._lock:
            if self._closed:
                return
            if status is None:
                status = Status.SOLVED if self._solved else Status.ITERATION_LIMIT
            ended = _choice("status", Status, status)
            self._write(Kind.PHASE, Phase.PLAN, ended, 0, 0.0, self._zeros)
            self._flush()
            self._closed = True
        log.closed(self)
        self._stop.set()
        self._thread.join()
        self._sink.close({})

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

    def _tree(self, number: int) -> _Tree:
        found = self._trees.get(number)
        if found is None:
            if number not in (0, 1):
                raise BrrtError(f"tree must be 0 or 1, not {number!r:.20}")
            found = self._trees[number] = _Tree(self.dof)
        return found

    def _far(self, a: Sequence[float], b: Sequence[float]) -> float:
        """Return the distance in the robot's metric."""
        if self._plain:
            return math.dist(a, b)
        return float(self._robot.distance(np.array(a), np.array(b)))

    def _costs(self, nodes: _Tree, rows: Floats, above: Ints) -> Floats:
        """Return what new nodes cost, each after its parent, shape (n,)."""
        old, place = len(nodes), np.array(nodes.q).reshape(-1, self.dof)
        far = self._robot.distance(np.concatenate([place, rows])[np.maximum(above, 0)], rows)
        far = np.where(above >= 0, far, 0.0)
        if len(rows) and int(above.max()) < old:  # no parent is among the new nodes
            return far + np.where(above >= 0, np.append(nodes.cost, 0.0)[above], 0.0)
        costs = nodes.cost[:]
        for up, length in zip(above.tolist(), far.tolist(), strict=True):
            costs.append(length if up < 0 else costs[up] + length)
        return np.array(costs[old:])

    def _configuration(self, q: ArrayLike) -> Sequence[float]:
        """Return a configuration as numbers, which is what packs fast."""
        values = q.tolist() if isinstance(q, np.ndarray) else q
        try:
            total = sum(values)  # type: ignore[arg-type]
        except TypeError:
            raise BrrtError(f"q must be {self.dof} numbers, not {q!r:.60}") from None
        if len(values) != self.dof:  # type: ignore[arg-type]
            raise BrrtError(f"q must be {self.dof} numbers, not {len(values)}")  # type: ignore[arg-type]
        if not -GREATEST < total < GREATEST:
            raise BrrtError(f"q must be finite numbers, not {q!r:.60}")
        return values  # type: ignore[return-value]

    def _configurations(self, q: ArrayLike) -> Floats:
        rows = np.asarray(q, np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.dof:
            raise BrrtError(f"q must have the shape (n, {self.dof}), not {rows.shape}")
        if len(rows) and not (np.abs(rows).max() < GREATEST):
            raise BrrtError("q must be finite numbers")
        return rows

    def _write(
        self, kind: Kind, first: int, second: int, third: int, real: float, q: Sequence[float]
    ) -> None:
        """Write an event with its whole numbers in the order of `events.FIELDS`; needs the lock."""
        if self._closed:
            raise BrrtError("the recording is closed")
        if self._count == _ROWS:
            self._flush()
        t = self._clock() - self._origin
        if t <= self._last_t:
            t = self._last_t + 1
        try:
            self._pack(
                self._bytes, self._count * self._size, t, self._iteration, real, *q,
                first, second, third, kind,
            )  # fmt: skip
            if not -GREATEST < real < GREATEST:
                raise BrrtError(f"cost of a {kind.label} event must be finite, not {real!r:.20}")
        except (struct.error, TypeError) as error:
            raise BrrtError(f"a {kind.label} event cannot be recorded: {error}") from None
        self._last_t = t
        self._count += 1

    def _write_many(
        self,
        kind: Kind,
        count: int,
        integers: tuple[Any, Any, Any],
        *,
        real: Any = 0.0,
        q: Any = 0.0,
        iteration: Any = None,
    ) -> None:
        """Write events of one kind; each value is one for all or an array, shape (count,)."""
        columns = [np.broadcast_to(np.asarray(value), (count,)) for value in integers]
        reals = np.broadcast_to(np.asarray(real, np.float64), (count,))
        if not np.isfinite(reals).all():
            raise BrrtError(f"cost of {kind.label} events must be finite")
        for column in columns:
            if column.dtype.kind not in "iub" or (np.abs(column) > _MOST_NODES).any():
                raise BrrtError(f"a {kind.label} event needs whole numbers, not {column.dtype}")
        with self._lock:
            if self._closed:
                raise BrrtError("the recording is closed")
            done = 0
            while done < count:
                if self._count == _ROWS:
                    self._flush()
                part = slice(done, min(count, done + _ROWS - self._count))
                rows = self._rows[self._count : self._count + part.stop - done]
                low = max(self._clock() - self._origin, self._last_t + 1)
                rows["t"] = np.arange(low, low + len(rows))
                rows["iteration"] = self._iteration if iteration is None else iteration[part]
                rows["kind"], rows["real"] = kind, reals[part]
                rows["q"] = q if np.ndim(q) == 0 else q[part]
                for place, column in enumerate(columns):
                    rows["integers"][:, place] = column[part]
                self._last_t, self._count = low + len(rows) - 1, self._count + len(rows)
                done = part.stop

    def _new_rows(self) -> None:
        self._bytes = bytearray(_ROWS * self._size)
        self._rows = np.frombuffer(self._bytes, row_dtype(self.dof))

    def _flush(self) -> None:
        if self._count:
            points = np.concatenate([np.empty((0, self.dof)), *self._points])
            batch = events_of(self._rows[: self._count], points, self._first, self.dof)
            self._first += self._count
            self._points, self._points_count, self._count = [], 0, 0
            self._new_rows()
            self._sink.write(batch)

    def _flush_late(self) -> None:
        """Flush what waits while the planner records nothing."""
        while not self._stop.wait(_LATE_S):
            with self._lock:
                if not self._closed:
                    self._flush()


def _from_root(parent: Ints, known: int) -> Ints:
    """Return the rows from `known` on, each after its parent's.

    Raises:
        BrrtError: Parents form a circle.
    """
    ready = np.arange(len(parent)) < known
    fresh, order = np.arange(known, len(parent)), [np.empty(0, np.int64)]
    while len(fresh):
        now = (parent[fresh] < 0) | ready[parent[fresh]]
        if not now.any():
            raise BrrtError(f"parent: the parents of row {fresh[0]} lead to no root")
        order.append(fresh[now])
        ready[fresh[now]], fresh = True, fresh[~now]
    return np.concatenate(order)


def _choice(name: str, choices: type[Named], value: Any) -> int:
    """Return a member of an enumeration, given itself or its name."""
    if isinstance(value, choices):
        return value
    if isinstance(value, str):
        for choice in choices:
            if value in (choice.label, choice.key):
                return choice
    raise unknown(name, str(value), [choice.label for choice in choices])


def record(
    path: Path | str,
    *,
    world: World | str,
    start: Any = None,
    goal: Any = None,
    robot: Robot | str = "point",
    planner: str = "external",
    params: Mapping[str, Any] | None = None,
    seed: int = 0,
    iterations: int | None = None,
    time_limit: float | None = None,
    contract: Contract | None = None,
    clock: Callable[[], int] | None = None,
) -> Recorder:
    """Open a recording of a planner; use it in a `with` statement, or call `close`.

    Args:
        path: The .mcap file; it is overwritten.
        world: Where it plans: a `World`, a generator's name or a file.
        start: First configuration, shape (dof,); by default the world's own.
        goal: Last configuration, shape (dof,); by default the world's own.
        robot: What moves: a `Robot`, a name with parameters or a file.
        planner: The planner's name. One of brrt's own names means: judge it by that contract.
        params: Its parameters, for readers.
        seed: Of its random draws, for readers.
        iterations: Its limit of iterations, for readers.
        time_limit: Its limit of time in s, for readers.
        contract: What it promises; `brrt.verify` judges by it.
        clock: Returns the time of the next event in ns since the run began, for converters of
            other logs; by default the time is measured.

    Raises:
        BrrtError: Start or goal is not free, a value is wrong, or the file cannot be written.
    """
    if Path(path).suffix != ".mcap":
        raise BrrtError(f"{path}: name a file that ends in .mcap")
    place = make_world(world) if isinstance(world, str) else world
    scenario = Scenario(
        world=place.name, robot=robot if isinstance(robot, str) else robot.kind, planner=planner,
        params=params or {}, start=start, goal=goal, seed=seed, iterations=iterations,
        time=time_limit, smooth=False,
    )  # fmt: skip
    query = Query.of(scenario, place, None if isinstance(robot, str) else robot)
    manifest = Manifest(
        scenario=scenario,
        start=tuple(query.start.tolist()),
        goal=tuple(query.goal.tolist()),
        dim=place.dim,
        dof=query.dof,
        epoch_ns=min(max(time.time_ns(), 0), LATEST_NS),
        made_by=made_by(),
        robot=query.robot.to_json(),
        contract=contract,
    )
    sink = BackgroundSink(_MeasuredSink(McapSink(path, manifest, place), manifest))
    return Recorder(sink, query, clock)
