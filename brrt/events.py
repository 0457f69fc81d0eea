"""The events of a run: their kinds and fields, and how a log of them is kept in memory.

To add a kind of event, give it a number in `Kind`, its fields in `FIELDS` and, if runs report how
many there are, a row in `COUNTS`. The layouts of kernels, files and comparisons follow from these.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum, unique
from functools import cache
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

LATEST_NS = (1 << 62) - 1
"""Latest time at which a run may begin, in ns since 1970: in the year 2116."""

Table = NDArray[np.void]
"""Events of one kind: a structured array with `seq`, `t`, `iteration` and the kind's fields."""


class Named(IntEnum):
    """An enumeration whose members have names for texts and for files."""

    @property
    def label(self) -> str:
        """The name in texts, such as "no path"."""
        return self.key.replace("_", " ")

    @property
    def key(self) -> str:
        """The name in files, paths and JSON, such as "no_path"."""
        return self.name.lower()

    @classmethod
    def label_of(cls, value: int) -> str:
        """Return the label of a number from a log, or the number if it is not a member."""
        return cls(value).label if value in set(cls) else str(value)


@unique
class Kind(Named):
    """What happened."""

    PHASE = 0
    SAMPLE = 1
    REJECT = 2
    EDGE = 3
    PATH = 4
    SHORTCUT = 5
    REWIRE = 6
    CONNECT = 7
    EXPAND = 8
    HEURISTIC = 9
    MOVE = 10
    VERTEX = 11
    LINK = 12
    CUT = 13
    REMOVE = 14
    CHECK = 15


GRAPH_KINDS = frozenset({Kind.VERTEX, Kind.LINK, Kind.CUT, Kind.REMOVE, Kind.CHECK})
"""The kinds of graphs and of pruning. A file that holds one of them has a format of its own: a
version of brrt that does not know them must not fold the rest."""


@unique
class Phase(Named):
    """A part of a run."""

    PLAN = 0
    SMOOTH = 1
    EXECUTE = 2


@unique
class Status(Named):
    """The state of a phase: it begins, or how it ended."""

    BEGIN = 0
    SOLVED = 1
    ITERATION_LIMIT = 2
    TIME_LIMIT = 3
    INTERRUPTED = 4
    DONE = 5
    NO_PATH = 6
    """The planner proved that there is no path."""


@unique
class Source(Named):
    """Origin of a sample."""

    UNIFORM = 0
    GOAL = 1
    OTHER_TREE = 2
    INFORMED = 3


@unique
class Reason(Named):
    """Why an extension failed."""

    COLLISION = 0
    NO_PROGRESS = 1
    GOAL_BLOCKED = 2
    LINK_BLOCKED = 3
    NEAR_BLOCKED = 4
    NO_GAIN = 5
    LIMITS = 6


@unique
class Stage(Named):
    """Which path of the run this is."""

    RAW = 0
    SMOOTHED = 1
    IMPROVED = 2


Choices = type[Named]


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a kind of event.

    Attributes:
        name: Name of the column.
        type: A ROS 2 primitive, `q` (one configuration, float64[dof]) or `q[]` (any number of
            configurations).
        doc: Meaning, for the documentation.
        choices: Names of the values of an integer field.
    """

    name: str
    type: str
    doc: str
    choices: Choices | None = None


_TREE = Field("tree", "uint8", "0 grows from the start, 1 from the goal")
_Q = Field("q", "q", "configuration")

FIELDS: Mapping[Kind, tuple[Field, ...]] = {
    Kind.PHASE: (
        Field("name", "uint8", "part of the run", Phase),
        Field("status", "uint8", "begins, or how it ended", Status),
    ),
    Kind.SAMPLE: (_TREE, Field("source", "uint8", "origin of the sample", Source), _Q),
    Kind.REJECT: (
        _TREE,
        Field("node", "int32", "node that the extension started from"),
        Field("reason", "uint8", "why it failed", Reason),
        Field("q", "q", "configuration that the extension headed for"),
    ),
    Kind.EDGE: (
        _TREE,
        Field("node", "int32", "node that joined the tree, numbered from 0 in each tree"),
        Field("parent", "int32", "its parent; -1 for a root"),
        Field("cost", "float64", "cost-to-come in the robot's metric"),
        _Q,
    ),
    Kind.PATH: (
        Field("stage", "uint8", "which path of the run", Stage),
        Field("cost", "float64", "its length in the robot's metric"),
        Field("waypoints", "q[]", "configurations from start to goal"),
    ),
    Kind.SHORTCUT: (
        Field("i", "int32", "first waypoint of the pair, numbered on the path before the attempt"),
        Field("j", "int32", "second waypoint"),
        Field("accepted", "bool", "whether the direct motion was free and replaced the detour"),
        Field("cost", "float64", "cost of the path after the attempt"),
    ),
    Kind.REWIRE: (
        _TREE,
        Field("node", "int32", "node that got another parent; its descendants' costs follow"),
        Field("parent", "int32", "the new parent"),
        Field("cost", "float64", "its new cost-to-come"),
    ),
    Kind.CONNECT: (
        Field("node", "int32", "node of tree 0"),
        Field("other", "int32", "node of tree 1; the motion between the two is free"),
        Field("cost", "float64", "cost of the path from start to goal over this link"),
    ),
    Kind.EXPAND: (
        Field("cell", "int32", "cell of the lattice, numbered from 0 (the start) as first seen"),
        Field("parent", "int32", "cell that it was reached from in this search; -1 for its first"),
        Field("cost", "float64", "cost from this search's first cell"),
        _Q,
    ),
    Kind.HEURISTIC: (
        Field("cell", "int32", "cell whose estimate of the cost-to-go was raised"),
        Field("h", "float64", "the new estimate; the first one is the distance to the goal"),
        _Q,
    ),
    Kind.MOVE: (
        Field("trial", "int32", "0, 1 ...: each trial begins at the start"),
        Field("step", "int32", "moves of this trial so far, this one included"),
        Field("cell", "int32", "cell of the lattice that it ends in; -1 if there is none"),
        Field("cost", "float64", "length of this trial's moves so far, this one included"),
        Field("q", "q", "configuration that the robot moves to, in a straight line"),
    ),
    Kind.VERTEX: (
        _TREE,
        Field("node", "int32", "node that joined without an edge; numbered with those of edges"),
        _Q,
    ),
    Kind.LINK: (
        _TREE,
        Field("node", "int32", "one end of an edge of a graph, which leads both ways"),
        Field("other", "int32", "the other end, a node of the same tree"),
        Field("cost", "float64", "cost of the edge; that of a later link of the two replaces it"),
    ),
    Kind.CUT: (
        _TREE,
        Field(
            "node", "int32", "one of two nodes whose edges, link and that to a parent, are removed"
        ),
        Field("other", "int32", "the other one"),
    ),
    Kind.REMOVE: (
        _TREE,
        Field("node", "int32", "node that is removed with all its edges; its number stays unused"),
    ),
    Kind.CHECK: (
        _TREE,
        Field("node", "int32", "node at which the motion begins; -1 if it is at none"),
        Field("other", "int32", "node at which it ends; -1 if it is at none"),
        Field("part", "float64", "how much of the motion is free: from 0 to 1, 1 for all of it"),
        Field("q", "q", "configuration at which it ends"),
    ),
}


class Count(NamedTuple):
    """How the events of a kind are counted.

    Attributes:
        key: Name of the count in a run's metrics; None if they do not report it.
        one: Label of a single event, after its number.
        many: Label of several events, after their number.
        by: Field whose values a transcript counts separately.
    """

    key: str | None
    one: str
    many: str
    by: str | None = None

    def text(self, number: int) -> str:
        """Write a number of events: "1 node", "1,200 nodes"."""
        return f"{number:,} {self.one if number == 1 else self.many}"


COUNTS: Mapping[Kind, Count] = {
    Kind.SAMPLE: Count("samples", "sample", "samples", "source"),
    Kind.EDGE: Count("edges", "node", "nodes", "tree"),
    Kind.REJECT: Count("rejects", "rejected", "rejected", "reason"),
    Kind.REWIRE: Count("rewires", "rewired", "rewired"),
    Kind.CONNECT: Count("links", "link", "links"),
    Kind.EXPAND: Count("expanded", "cell expanded", "cells expanded"),
    Kind.HEURISTIC: Count("learned", "estimate raised", "estimates raised"),
    Kind.SHORTCUT: Count("shortcuts", "shortcut", "shortcuts", "accepted"),
    Kind.MOVE: Count(None, "move", "moves"),
    Kind.VERTEX: Count("vertices", "vertex", "vertices", "tree"),
    Kind.LINK: Count("graph_edges", "graph edge", "graph edges", "tree"),
    Kind.CUT: Count("cuts", "edge cut", "edges cut"),
    Kind.REMOVE: Count("removals", "node removed", "nodes removed"),
    Kind.CHECK: Count("checks", "motion checked", "motions checked", "part"),
}
"""The kinds that are counted, in the order of reports."""


@cache
def table_dtype(kind: Kind, dof: int) -> np.dtype[np.void]:
    """Layout of a table: the three columns that every event has, then the kind's fields."""
    columns: list[tuple[Any, ...]] = [("seq", "<i8"), ("t", "<i8"), ("iteration", "<i8")]
    for field in FIELDS[kind]:
        if field.type == "q":
            columns.append((field.name, "<f8", (dof,)))
        elif field.type == "q[]":
            columns.append((field.name, "O"))
        else:
            columns.append((field.name, np.dtype(field.type)))
    return np.dtype(columns, align=True)


class Instant(NamedTuple):
    """The time of an event: `t` in ns, and the planner's iteration."""

    t: int
    iteration: int


class LazyTables(Mapping[Kind, Table]):
    """Tables that are built on first access, usually on the thread that writes them.

    Args:
        counts: Number of events of each kind that occurs.
        last: Time of the last event.
        build: Builds the table of a kind.
    """

    def __init__(
        self, counts: Mapping[Kind, int], last: Instant, build: Callable[[Kind], Table]
    ) -> None:
        self.counts, self.last = counts, last
        self._build = build
        self._built: dict[Kind, Table] = {}

    def __getitem__(self, kind: Kind) -> Table:
        if kind not in self._built:
            if kind not in self.counts:
                raise KeyError(kind)
            self._built[kind] = self._build(kind)
        return self._built[kind]

    def __iter__(self) -> Iterator[Kind]:
        return iter(self.counts)

    def __len__(self) -> int:
        return len(self.counts)


@dataclass(frozen=True, slots=True, eq=False)
class Events:
    """A batch of events in one table per kind; a whole log is one long batch.

    Attributes:
        dof: Numbers in a configuration.
        tables: The events of each kind that occurs, ordered by `seq`.
    """

    dof: int
    tables: Mapping[Kind, Table]

    def __len__(self) -> int:
        return sum(self.counts.values())

    @property
    def counts(self) -> Mapping[Kind, int]:
        """Number of events of each kind that occurs."""
        if isinstance(self.tables, LazyTables):
            return self.tables.counts
        return {kind: len(table) for kind, table in self.tables.items()}

    @property
    def last(self) -> Instant:
        """Time of the last event; zero if there is none."""
        if isinstance(self.tables, LazyTables):
            return self.tables.last
        tables = [table for table in self.tables.values() if len(table)]
        if not tables:
            return Instant(0, 0)
        end = max(tables, key=lambda table: int(table["seq"][-1]))[-1]
        return Instant(int(end["t"]), int(end["iteration"]))

    def __getitem__(self, kind: Kind) -> Table:
        found = self.tables.get(kind)
        return np.empty(0, table_dtype(kind, self.dof)) if found is None else found

    @classmethod
    def concat(cls, dof: int, batches: Iterable["Events"]) -> Self:
        """Join consecutive batches into one log."""
        parts: dict[Kind, list[Table]] = {}
        for batch in batches:
            for kind, table in batch.tables.items():
                parts.setdefault(kind, []).append(table)
        return cls(dof, {kind: _joined(parts[kind]) for kind in sorted(parts)})

    def until(
        self, *, seq: int | None = None, t: int | None = None, iteration: int | None = None
    ) -> "Events":
        """Return the events up to and including a `seq`, a time (ns) or an iteration.

        None of the three columns decreases along a log, so each table is cut by bisection.
        """
        tables = self.tables
        for column, last in (("seq", seq), ("t", t), ("iteration", iteration)):
            if last is not None:
                tables = {
                    kind: table[: np.searchsorted(table[column], last, side="right")]
                    for kind, table in tables.items()
                }
        return Events(self.dof, {kind: table for kind, table in tables.items() if len(table)})

    def kinds_in_order(self) -> tuple[int, NDArray[np.uint8]]:
        """Return the first `seq` and the kinds of the events in the order of `seq`, shape (n,)."""
        first = min((int(table["seq"][0]) for table in self.tables.values()), default=0)
        order = np.empty(len(self), np.uint8)
        for kind, table in self.tables.items():
            order[table["seq"] - first] = kind
        return first, order


def _joined(tables: list[Table]) -> Table:
    """Concatenate tables of one kind; as plain bytes, which is five times as fast as by fields."""
    dtype = tables[0].dtype
    if len(tables) == 1:
        return tables[0]
    if dtype.hasobject or any(table.dtype != dtype for table in tables):
        return np.concatenate(tables)
    return np.concatenate([table.view(f"V{dtype.itemsize}") for table in tables]).view(dtype)
