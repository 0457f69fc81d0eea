"""Events as streams of messages: trees, links, paths, bodies, cells, the robot and its trace."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import LogError
from brrt.events import Events, Kind, Stage, Table
from brrt.replay.forest import forest
from brrt.replay.graph import as_forest
from brrt.replay.tree_fold import DETACHED, TreeChanges
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.views.colours import (
    GRAPH,
    LINK,
    NEWEST,
    ROBOT,
    TRACE,
    Colour,
    heat,
    path_style,
    tree_style,
)
from brrt.views.foxglove.draw_world import (
    BODIES,
    GROUND,
    PATHS,
    dot,
    line_list,
    outline,
    pairs_along,
)
from brrt.views.foxglove.interval_topics import BATCH, interval_messages
from brrt.views.foxglove.messages import MARKER, Marker, MarkerType
from brrt.worlds.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_CUBE = {2: 0.84, 3: 0.32}
"""Edge of a cell's cube in edges of a cell, by dimensions; in 3D one sees between the cubes."""

_CELL = 0.01
"""Edge of a cell where the planner does not state it, as a part of the world's extent."""


class Message(NamedTuple):
    """A message; `t` is the time, in ns, of the last event that it shows."""

    t: int
    topic: str
    schema: str
    body: bytes


Stream = Iterator[Message]


class MarkerStreams:
    """Turns the log of a run into streams of messages, each in the order of time.

    Raises:
        LogError: The events contradict each other.
    """

    def __init__(self, manifest: Manifest, world: World, events: Events) -> None:
        self._manifest, self._world = manifest, world
        self._events = as_forest(events)
        self._robot = manifest.make_robot()
        self._trees = forest(events, self._robot.resolved(world).distance)

    def streams(self) -> Iterator[Stream]:
        """Yield all streams."""
        for number in self._trees:
            yield self._graph(number)
            yield self._tree(number)
            yield self._newest(number)
        yield self._links()
        yield self._paths()
        yield self._cells()
        yield self._trace()
        yield self._moves()

    def _places(self, q: Floats) -> Floats:
        return np.asarray(self._robot.places(q))

    def _tree(self, number: int) -> Stream:
        """Show the edges; the edge of a rewired node goes when its new one comes."""
        joins, rewires = (self._of_tree(kind, number) for kind in (Kind.EDGE, Kind.REWIRE))
        made, places = TreeChanges.of(joins, rewires), self._places(self._trees[number].q)
        t = np.concatenate([joins["t"], rewires["t"]])
        seq = np.concatenate([joins["seq"], rewires["seq"]])
        t = t[np.argsort(seq, kind="stable")]
        edges = (made.parent >= 0) | (made.parent == DETACHED)
        node, parent = made.node[edges], made.parent[edges]
        _check_nodes(made.seq[edges], parent[parent >= 0], len(places))
        ends = np.stack([places[np.maximum(parent, 0)], places[node]], axis=1)
        name, colour = tree_style(number)
        return self._lines(f"/viz/tree/{name}", t[edges], node, ends, colour, 1.5, parent >= 0)

    def _graph(self, number: int) -> Stream:
        """Show the links of a graph; one that is cut, or loses a node, goes."""
        links, cuts = (self._of_tree(kind, number) for kind in (Kind.LINK, Kind.CUT))
        if not len(links):
            return iter(())
        places = self._places(self._trees[number].q)
        pairs = np.stack([links["node"], links["other"]], axis=1)
        states = [_states(links, pairs, True), _states(cuts, _pairs(cuts), False)]
        for row in self._of_tree(Kind.REMOVE, number):
            own = pairs[(pairs == row["node"]).any(axis=1) & (links["seq"] < row["seq"])]
            states.append(_states(np.repeat(row[None], len(own)), own, False))
        found = np.concatenate(states)
        found = found[np.argsort(found["seq"], kind="stable")]
        _check_nodes(found["seq"], found["pair"].max(axis=1), len(places))
        low, high = np.sort(found["pair"], axis=1).T
        keys = low.astype(np.int64) << 32 | high
        name, ends = tree_style(number)[0], places[found["pair"]]
        topic = f"/viz/graph/{name}"
        return self._lines(topic, found["t"], keys, ends, GRAPH, 1.0, found["there"])

    def _newest(self, number: int) -> Stream:
        """Show the body at the newest node, once in `BATCH` nodes."""
        table = self._of_tree(Kind.EDGE, number)
        if not len(table) or not len(outline(self._robot, table["q"][0])):
            return
        ends = np.append(np.arange(BATCH - 1, len(table) - 1, BATCH), len(table) - 1)
        for row in table[ends]:
            body = line_list(self._world, outline(self._robot, row["q"]), NEWEST, 1.5, BODIES)
            yield _message(row, f"/viz/body/{tree_style(number)[0]}", body)

    def _links(self) -> Stream:
        """Show the links between two trees."""
        table = self._events[Kind.CONNECT]
        if not len(table) or not {0, 1} <= self._trees.keys():
            return iter(())
        froms, tos = (self._places(self._trees[number].q) for number in (0, 1))
        _check_nodes(table["seq"], table["node"], len(froms))
        _check_nodes(table["seq"], table["other"], len(tos))
        ends = np.stack([froms[table["node"]], tos[table["other"]]], axis=1)
        return self._lines("/viz/link", table["t"], np.arange(len(table)), ends, LINK, 4.0)

    def _paths(self) -> Stream:
        """Show the newest path of each stage."""
        for row in self._events[Kind.PATH]:
            name, colour, radius = path_style(Stage(int(row["stage"])))
            legs = pairs_along(self._robot.trail(row["waypoints"]))
            yield _message(
                row, f"/viz/path/{name}", line_list(self._world, legs, colour, 2 * radius, PATHS)
            )

    def _cells(self) -> Stream:
        """Show each expanded cell in the colour of its cost, or of LRTA*'s newest estimate."""
        if not len(self._events[Kind.EXPAND]) and not len(self._events[Kind.HEURISTIC]):
            return iter(())
        world = self._world
        contract = contract_of(self._manifest, world)
        t, cell, q, values = self._values(learns=contract.learns)
        ends = np.array([self._manifest.start, self._manifest.goal])
        scale = float(self._robot.distance(*ends)) or 1.0
        colours = np.ones((len(cell), 4), np.float32)
        colours[:, :3] = heat(values / (values + scale)) / 255
        edge = contract.cell or _CELL * world.extent
        edge *= _CUBE[world.dim]
        size = (edge, edge, 1e-6 * world.extent if world.dim == 2 else edge)
        cubes = partial(Marker, MarkerType.CUBES, TRACE, size, z=GROUND * world.extent)
        places = self._places(q)
        return _newest_states("/viz/cells", t, cell, lambda i: cubes(places[i], colours=colours[i]))

    def _values(self, *, learns: bool) -> tuple[Ints, Ints, Floats, Floats]:
        """Return the values that cells get, in order: time, cell, configuration, value.

        They are estimates of the cost-to-go, at first the distance, if the planner learns; else
        the first costs from the start.
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
        """Show where the robot has been; each trial begins at the start."""
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
        return self._lines("/viz/trace", table["t"][moved], keys, ends[moved], TRACE, 2.0)

    def _moves(self) -> Stream:
        """Show the robot after each move."""
        table = self._events[Kind.MOVE]
        for row, place in zip(table, self._places(table["q"]), strict=True):
            yield _message(row, "/viz/robot", dot(self._world, place, ROBOT))
            body = outline(self._robot, row["q"])
            if len(body):
                marker = line_list(self._world, body, ROBOT, 3.0, BODIES)
                yield _message(row, "/viz/robot/body", marker)

    def _of_tree(self, kind: Kind, number: int) -> Table:
        table = self._events[kind]
        mine: Table = table[table["tree"] == number]
        return mine

    def _lines(
        self,
        topic: str,
        t: Ints,
        keys: Ints,
        ends: Floats,
        colour: Colour,
        width: float,
        there: NDArray[np.bool_] | None = None,
    ) -> Stream:
        points = np.zeros((len(ends), 2, 3))
        points[..., : self._world.dim] = ends

        def draw(items: Ints) -> Marker:
            return line_list(self._world, points[items].reshape(-1, 3), colour, width)

        return _newest_states(topic, t, keys, draw, there)


_STATE = np.dtype([("seq", "<i8"), ("t", "<i8"), ("pair", "<i4", (2,)), ("there", "?")])


def _pairs(table: Table) -> Ints:
    return np.stack([table["node"], table["other"]], axis=1)


def _states(table: Table, pairs: Ints, there: bool) -> Table:
    """Return the states that events give to the links of pairs of nodes, shape (n,)."""
    states = np.empty(len(table), _STATE)
    states["seq"], states["t"] = table["seq"], table["t"]
    states["pair"], states["there"] = pairs, there
    return states


def _message(row: np.void, topic: str, marker: Marker) -> Message:
    return Message(int(row["t"]), topic, MARKER, marker.message())


def _check_nodes(seq: Ints, nodes: NDArray[np.integer], count: int) -> None:
    wrong = np.flatnonzero((nodes < 0) | (nodes >= count))
    if len(wrong):
        i = wrong[0]
        raise LogError(f"event {seq[i]}: there is no node {nodes[i]}")


def _newest_states(
    topic: str,
    t: Ints,
    keys: Ints,
    draw: Callable[[Ints], Marker],
    there: NDArray[np.bool_] | None = None,
) -> Stream:
    """Show at each instant the newest state of each key, on topics `topic`/L00 and so on.

    Args:
        topic: Beginning of the topics' names.
        t: When each state begins, never falling, shape (n,).
        keys: What it is a state of, shape (n,).
        draw: Returns a marker of some of the states; also of none.
        there: Which states are shown, shape (n,); all if it is None.
    """
    instants, born = np.unique(t, return_inverse=True)
    gone = np.full(len(t), len(instants))
    order = np.argsort(keys, kind="stable")
    follows = keys[order[1:]] == keys[order[:-1]]
    gone[order[:-1][follows]] = born[order[1:][follows]]
    visible = np.flatnonzero((born < gone) & (True if there is None else there))
    for instant, level, items in interval_messages(born[visible], gone[visible], len(instants)):
        body = draw(visible[items]).message()
        yield Message(int(instants[instant]), f"{topic}/L{level:02d}", MARKER, body)
