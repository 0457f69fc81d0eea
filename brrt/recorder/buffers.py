"""Buffers that a planner's own compiled kernels have written to, checked before they are recorded.

The kernels call `emit_edge` and the like of `brrt.kernels.emit`; nothing here imports that.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.event_columns import COUNT, LAYOUT, POINTS, EventColumns
from brrt.events import FIELDS, Events, Field, Kind, Table
from brrt.recorder.nodes import Nodes
from brrt.worlds.arrays import GREATEST

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

KINDS = (Kind.SAMPLE, Kind.REJECT, Kind.EDGE, Kind.REWIRE, Kind.CONNECT, Kind.PATH, Kind.EXPAND)


class Buffer(Protocol):
    """The columns of a `brrt.kernels.emit.Buffer`."""

    @property
    def state(self) -> NDArray[np.int64]:
        """Numbers of events and of waypoints, and others."""

    @property
    def kind(self) -> NDArray[np.uint8]:
        """Kinds of the events."""

    @property
    def t(self) -> Ints:
        """Times in ns on the clock of `time.perf_counter_ns`."""

    @property
    def iteration(self) -> Ints:
        """Iterations."""

    @property
    def integers(self) -> NDArray[np.int32]:
        """See `EventColumns`."""

    @property
    def reals(self) -> Floats:
        """See `EventColumns`."""

    @property
    def q(self) -> Floats:
        """See `EventColumns`."""

    @property
    def points(self) -> Floats:
        """Waypoints of all paths, shape (m, dof)."""


def columns_of(buffer: Buffer, dof: int) -> EventColumns:
    """Return the events of a buffer.

    Raises:
        BrrtError: It is none, or has configurations of another size.
    """
    try:
        n, points = (int(buffer.state[at]) for at in (COUNT, POINTS))
        names = ("kind", "t", "iteration", "integers", "reals", "q")
        rows = {name: getattr(buffer, name)[:n] for name in names}
        columns = EventColumns(0, dof, points=buffer.points[:points], **rows)
    except (AttributeError, TypeError, IndexError):
        raise BrrtError(
            f"buffer must be one of brrt.kernels.emit.empty_buffer, not {buffer!r:.60}"
        ) from None
    if columns.points.shape[1] != dof:
        raise BrrtError(f"buffer must be for a dof of {dof}, not {columns.points.shape[1]}")
    return columns


def check_events(
    columns: EventColumns, trees: Sequence[Nodes], cells: int, iteration: int
) -> Events:
    """Return the events of a buffer as tables.

    Args:
        columns: The events.
        trees: The nodes so far.
        cells: The cells so far.
        iteration: The iteration so far.

    Raises:
        BrrtError: An event has an impossible value.
    """
    strange = np.setdiff1d(columns.kind, [int(kind) for kind in KINDS])
    if len(strange):
        names = ", ".join(kind.label for kind in KINDS)
        raise BrrtError(f"kind must be one of {names} in a buffer, not {int(strange[0])}")
    if (np.diff(columns.iteration, prepend=iteration) < 0).any():
        raise BrrtError(f"iteration must not fall in a buffer; it was {iteration} before")
    _check_paths(columns)
    events = columns.events()
    for kind, table in events.tables.items():
        for field in FIELDS[kind]:
            wrong = ~_possible(field, np.asarray(table[field.name]))
            _refuse(kind, field.name, table, wrong)
    for number, nodes in enumerate(trees):
        edges = events[Kind.EDGE][events[Kind.EDGE]["tree"] == number]
        _refuse(Kind.EDGE, "node", edges, edges["node"] != len(nodes) + np.arange(len(edges)))
        _refuse(Kind.EDGE, "parent", edges, edges["parent"] >= edges["node"])
    _check_nodes(events, [len(nodes) for nodes in trees], cells)
    for number, nodes in enumerate(trees):
        if (events[Kind.REWIRE]["tree"] == number).any():
            _check_circles(events, number, nodes)
    return events


def _check_paths(columns: EventColumns) -> None:
    at = next(place.at for place in LAYOUT[Kind.PATH] if place.field.type == "q[]")
    first, count = columns.integers[columns.kind == Kind.PATH, at : at + 2].T.astype(np.int64)
    if ((count < 1) | (first < 0) | (first + count > len(columns.points))).any():
        raise BrrtError("waypoints must be one at least of those in the buffer")
    if not (np.abs(columns.points) < GREATEST).all():
        raise BrrtError("waypoints must be finite numbers")


def _possible(field: Field, values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which values of a field are possible, shape (n,); numbers of nodes come later."""
    if field.choices is not None:
        return np.isin(values, [int(choice) for choice in field.choices])
    if field.type in ("q", "float64"):
        right = np.abs(np.asarray(values, np.float64)) < GREATEST
        return np.asarray(right.all(axis=1) if field.type == "q" else right)
    if field.name == "tree":
        return np.isin(values, (0, 1))
    low = -1 if field.name == "parent" else 0
    whole = values.dtype.kind in "iu"  # waypoints are not
    return np.asarray(values >= low) if whole else np.ones(len(values), np.bool_)


def _refuse(kind: Kind, name: str, table: Table, wrong: NDArray[np.bool_]) -> None:
    if wrong.any():
        event = table[wrong.argmax()]
        raise BrrtError(
            f"{name} of event {int(event['seq'])} of the buffer ({kind.label}) cannot be "
            f"{event[name]!s:.60}"
        )


def _check_nodes(events: Events, known: Sequence[int], cells: int) -> None:
    """Check that rejections, rewires and links name nodes that exist then."""
    edges = events[Kind.EDGE]
    joins = [edges["seq"][edges["tree"] == tree] for tree in (0, 1)]
    expanded = max(cells, int(events[Kind.EXPAND]["cell"].max(initial=-1)) + 1)

    def exist(tree: int, table: Table) -> Ints:
        return np.asarray(known[tree] + np.searchsorted(joins[tree], table["seq"]))

    for kind, names in ((Kind.REJECT, ("node",)), (Kind.REWIRE, ("node", "parent"))):
        table = events[kind]
        count = np.where(table["tree"] == 0, exist(0, table), exist(1, table))
        if kind is Kind.REJECT:
            count = np.maximum(count, max(expanded, 1))
        for name in names:
            _refuse(kind, name, table, (table[name] < 0) | (table[name] >= count))
    links = events[Kind.CONNECT]
    for tree, name in ((0, "node"), (1, "other")):
        _refuse(Kind.CONNECT, name, links, links[name] >= exist(tree, links))


def _check_circles(events: Events, number: int, nodes: Nodes) -> None:
    """Check that no rewire of a tree makes a circle."""
    edges, rewires = (events[kind][events[kind]["tree"] == number] for kind in _CHANGES)
    parent = [*nodes.parent, *edges["parent"].tolist()]
    for row, (node, up) in enumerate(rewires[["node", "parent"]].tolist()):
        at = up
        while at >= 0 and at != node:
            at = parent[at]
        _refuse(
            Kind.REWIRE, "parent", rewires, np.arange(len(rewires)) == (row if at == node else -1)
        )
        parent[node] = up


_CHANGES = Kind.EDGE, Kind.REWIRE


def apply_changes(events: Events, trees: Sequence[Nodes]) -> None:
    """Let nodes join, and rewire them, in the order of the events."""
    edges, rewires = (events[kind] for kind in _CHANGES)
    if not len(rewires):
        for number, nodes in enumerate(trees):
            mine = edges[edges["tree"] == number]
            nodes.join_many(
                np.asarray(mine["q"]), mine["parent"].astype(np.int64), np.asarray(mine["cost"])
            )
        return
    names = ["seq", "tree", "node", "parent", "cost"]
    changes = [(*row, q) for row, q in zip(edges[names].tolist(), edges["q"].tolist(), strict=True)]
    changes += [(*row, None) for row in rewires[names].tolist()]
    for _, tree, node, parent, cost, q in sorted(changes, key=lambda change: change[0]):
        if q is None:
            trees[tree].move(node, parent, cost)
        else:
            trees[tree].join(q, parent, cost)


def rising(t: Ints, last: int) -> Ints:
    """Return times of which each is at least 1 ns after the one before, and after `last`."""
    order = np.arange(len(t))
    return np.asarray(np.maximum.accumulate(np.maximum(t - order, last + 1)) + order)
