"""Events as messages in time: trees, links, paths, bodies, cells and the robot's way."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import LogError
from brrt.events import Events, Kind, Stage, Table
from brrt.replay.forest import forest
from brrt.replay.tree_fold import TreeChanges
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.views.colours import Colour
from brrt.views.foxglove.draw_world import (
    BODIES,
    GROUND,
    LINES,
    MARKS,
    PATHS,
    mark,
    outline,
    segments,
)
from brrt.views.foxglove.interval_topics import BATCH, tell
from brrt.views.foxglove.messages import MARKER, Marker, Shape
from brrt.views.rerun import layout
from brrt.worlds.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Places = NDArray[np.float32]

_IN_PLANE, _IN_SPACE = 0.84, 0.32
"""Edge of a cell's mark in edges of a cell; small in 3D, where one has to look through."""

_CELL = 0.01
"""Edge of a cell where a planner from outside does not say, as a part of the world."""


class Item(NamedTuple):
    """A message; `t` is the time in ns of the last event that it tells of."""

    t: int
    topic: str
    schema: str
    body: bytes


Stream = Iterator[Item]


class Drawing:
    """Turns the whole log of a run into streams of messages, each in the order of time.

    Places are rounded to float32, with which viewers draw.

    Args:
        manifest: The run's.
        world: The run's.
        events: From the first event on.

    Raises:
        LogError: The trees do not hold together.
    """

    def __init__(self, manifest: Manifest, world: World, events: Events) -> None:
        self._manifest, self._world, self._events = manifest, world, events
        self._robot = manifest.make_robot()
        self._trees = forest(events, self._robot.resolved(world).distance)

    def streams(self) -> Iterator[Stream]:
        """Yield all streams."""
        for number in self._trees:
            yield self._tree(number)
            yield self._newest(number)
        yield self._links()
        yield self._paths()
        yield self._cells()
        yield self._trace()
        yield self._moves()

    def _places(self, q: NDArray[np.float64]) -> Places:
        return layout.places(q, self._robot)

    def _tree(self, number: int) -> Stream:
        """Tell which edges there are; a rewired node's old edge goes and its new one comes."""
        joins, rewires = (self._of_tree(kind, number) for kind in (Kind.EDGE, Kind.REWIRE))
        made, places = TreeChanges.of(joins, rewires), self._places(self._trees[number].q)
        t = np.concatenate([joins["t"], rewires["t"]])
        seq = np.concatenate([joins["seq"], rewires["seq"]])
        t = t[np.argsort(seq, kind="stable")]
        edges = made.parent >= 0
        node, parent = made.node[edges], made.parent[edges]
        _check_nodes(made.seq[edges], parent, len(places))
        ends = np.stack([places[parent], places[node]], axis=1)
        name, colour = layout.tree_style(number)
        return self._lines(f"/viz/tree/{name}", t[edges], node, ends, colour, 1.5)

    def _newest(self, number: int) -> Stream:
        """Show the body at the newest node, once for so many nodes."""
        table = self._of_tree(Kind.EDGE, number)
        if not len(table) or not self._robot.outline(table["q"][0]):
            return
        ends = np.append(np.arange(BATCH - 1, len(table) - 1, BATCH), len(table) - 1)
        yield from self._bodies(f"/viz/body/{layout.tree_style(number)[0]}", table[ends])

    def _bodies(self, topic: str, rows: Table) -> Stream:
        for row in rows:
            body = outline(self._robot, row["q"])
            message = segments(self._world, body, layout.NEWEST, 1.5, BODIES).message()
            yield Item(int(row["t"]), topic, MARKER, message)

    def _links(self) -> Stream:
        """Show where trees met."""
        table = self._events[Kind.CONNECT]
        if not len(table) or not {0, 1} <= self._trees.keys():
            return iter(())
        froms, tos = (self._places(self._trees[number].q) for number in (0, 1))
        _check_nodes(table["seq"], table["node"], len(froms))
        _check_nodes(table["seq"], table["other"], len(tos))
        ends = np.stack([froms[table["node"]], tos[table["other"]]], axis=1)
        keys = np.arange(len(table))
        return self._lines("/viz/link", table["t"], keys, ends, layout.LINK, 4.0)

    def _paths(self) -> Stream:
        """Show the newest path of each stage."""
        for row in self._events[Kind.PATH]:
            name, colour, radius = layout.path_style(Stage(int(row["stage"])))
            places = self._places(row["waypoints"])
            legs = np.stack([places[:-1], places[1:]], axis=1).reshape(-1, self._world.dim)
            marker = segments(self._world, legs, colour, 2 * radius, PATHS)
            yield Item(int(row["t"]), f"/viz/path/{name}", MARKER, marker.message())

    def _cells(self) -> Stream:
        """Show each cell that was expanded by its cost, or by the newest estimate of LRTA*."""
        if not len(self._events[Kind.EXPAND]) and not len(self._events[Kind.HEURISTIC]):
            return iter(())
        world = self._world
        contract = contract_of(self._manifest, world)
        t, cell, q, values = self._known(learns=contract.learns)
        ends = np.array([self._manifest.start, self._manifest.goal])
        packed = layout.heat(values / (values + (float(self._robot.distance(*ends)) or 1.0)))
        shifts = np.array([24, 16, 8, 0], np.uint32)
        colours = ((packed[:, None] >> shifts & 255) / 255).astype(np.float32)
        edge = contract.epsilon or _CELL * world.extent
        edge *= _IN_PLANE if world.dim == 2 else _IN_SPACE
        size = (edge, edge, 1e-6 * world.extent if world.dim == 2 else edge)
        cubes = partial(Marker, Shape.CUBES, layout.TRACE, size, z=GROUND * world.extent)
        places = self._places(q)
        return _told("/viz/cells", t, cell, lambda i: cubes(places[i], colours=colours[i]))

    def _known(self, *, learns: bool) -> tuple[Ints, Ints, Floats, Floats]:
        """Return when something new was known of a cell: time, cell, configuration, value.

        Args:
            learns: Whether values are estimates of the cost-to-go, at first the distance, which
                are raised; otherwise they are costs from the start, as first found.
        """
        expands, raised = self._events[Kind.EXPAND], self._events[Kind.HEURISTIC]
        goal = np.array(self._manifest.goal)
        first = self._robot.distance(expands["q"], goal) if learns else expands["cost"]
        order = np.argsort(np.concatenate([expands["seq"], raised["seq"]]), kind="stable")
        t, cell, q = (
            np.concatenate([expands[name], raised[name]])[order] for name in ("t", "cell", "q")
        )
        values = np.concatenate([first, raised["h"]])[order]
        kept = order >= len(expands)
        kept[np.unique(cell, return_index=True)[1]] = True
        return t[kept], cell[kept], q[kept], values[kept]

    def _trace(self) -> Stream:
        """Show the way that the robot has come; each trial begins at the start."""
        table = self._events[Kind.MOVE]
        if not len(table):
            return iter(())
        places = self._places(table["q"])
        start = self._places(np.array([self._manifest.start]))
        froms = np.concatenate([start, places[:-1]])
        froms[table["step"] == 1] = start
        ends = np.stack([froms, places], axis=1)
        moved = (froms != places).any(axis=1)
        keys = np.arange(moved.sum())
        return self._lines("/viz/trace", table["t"][moved], keys, ends[moved], layout.TRACE, 2.0)

    def _moves(self) -> Stream:
        """Show the robot after each move."""
        table = self._events[Kind.MOVE]
        for row, place in zip(table, self._places(table["q"]), strict=True):
            message = mark(self._world, place, layout.ROBOT, MARKS).message()
            yield Item(int(row["t"]), "/viz/robot", MARKER, message)
            body = outline(self._robot, row["q"])
            if len(body):
                marker = segments(self._world, body, layout.ROBOT, 3.0, BODIES)
                yield Item(int(row["t"]), "/viz/robot/body", MARKER, marker.message())

    def _of_tree(self, kind: Kind, number: int) -> Table:
        table = self._events[kind]
        mine: Table = table[table["tree"] == number]
        return mine

    def _lines(
        self, topic: str, t: Ints, keys: Ints, ends: Places, colour: Colour, width: float
    ) -> Stream:
        points = np.zeros((len(ends), 2, 3))
        points[..., : self._world.dim] = ends

        def draw(items: Ints) -> Marker:
            return segments(self._world, points[items].reshape(-1, 3), colour, width, LINES)

        return _told(topic, t, keys, draw)


def _check_nodes(seq: Ints, nodes: NDArray[np.integer], count: int) -> None:
    wrong = np.flatnonzero((nodes < 0) | (nodes >= count))
    if len(wrong):
        i = wrong[0]
        raise LogError(f"event {seq[i]}: there is no node {nodes[i]}")


def _told(topic: str, t: Ints, keys: Ints, draw: Callable[[Ints], Marker]) -> Stream:
    """Tell at each instant the newest item of each key, on topics `topic`/L00 and so on.

    Args:
        topic: Name that all topics begin with.
        t: When each item comes, never falling, shape (n,).
        keys: What it is the newest state of, shape (n,).
        draw: Makes a marker of some items; of none, too.
    """
    instants, born = np.unique(t, return_inverse=True)
    gone = np.full(len(t), len(instants))
    order = np.argsort(keys, kind="stable")
    follows = keys[order[1:]] == keys[order[:-1]]
    gone[order[:-1][follows]] = born[order[1:][follows]]
    seen = np.flatnonzero(born < gone)
    for told in tell(born[seen], gone[seen], len(instants)):
        body = draw(seen[told.items]).message()
        yield Item(int(instants[told.instant]), f"{topic}/L{told.topic:02d}", MARKER, body)
