"""Paths that the planner found or shortened, moves of the robot, and its body along both."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Stage, Table
from brrt.robots import Robot
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.views.colours import GHOST, ROBOT, TRACE, TRACE_ON_CELLS, path_style
from brrt.views.rerun.draw.canvas import Canvas, growing_rows, times_of
from brrt.views.rerun.draw.decimate import Decimation, one_in_stride
from brrt.views.rerun.layout import (
    BODY_ENTITY,
    CELL_ENTITY,
    GHOSTS_ENTITY,
    ROBOT_ENTITY,
    TAIL_ENTITY,
    TRACE_ENTITY,
)

_NEVER = 1 << 62
"""The number of an event that has not come."""

_LONGEST_SHOWN = 1000
"""Waypoints up to which a path is drawn again after each accepted shortcut."""

_LEAST_GAIN = 1e-3
"""How much shorter an improved path must be than the drawn one, as a part of it, to be drawn; the
last one of a batch always is. So a few hundred paths are drawn at most."""

_GHOSTS, _APART = 24, 0.07
"""Bodies along a path, at most, and how far the body moves between two at least, as a part of the
world's extent: closer ones would cover each other."""

_MOVES_IN_3D = (2000, 20**3)
"""Limits of `Decimation` for moves between cells in 3D, where they would hide the cells."""


class PathsDrawing:
    """Draws paths and plots their costs."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._path: NDArray[np.float64] | None = None
        self._raw_cost = self._shown_cost = np.inf
        self._first_move = _NEVER
        for stage in Stage:
            name, colour, radius = path_style(stage)
            canvas.style(f"/world/path/{name}", canvas.lines, colour, -radius, 40.0 + stage)
        canvas.plot_style("/series/cost", "cost", path_style(Stage.SMOOTHED)[1], dots=True)
        canvas.style(GHOSTS_ENTITY, canvas.lines, GHOST, -0.75, 35.0)

    def write(self, events: Events) -> None:
        """Draw each path, and the path after each accepted shortcut."""
        changes = _changes(events)
        moves = events[Kind.MOVE]["seq"]
        self._first_move = min(self._first_move, int(moves[0]) if len(moves) else _NEVER)
        drawn: dict[Stage, list[tuple[Any, NDArray[np.float32]]]] = {}
        for number, (event, stage) in enumerate(changes):
            if stage is not None:
                self._path = event["waypoints"]
                if not self._gains(event, stage, last=number == len(changes) - 1):
                    continue
                self._canvas.add_text(event, self._text(event, stage))
                self._draw_ghosts(event)
                if stage is Stage.RAW and self._first_move < event["seq"]:
                    continue  # where the robot went while it planned: its trace shows it
            elif self._path is not None:
                self._path = np.delete(self._path, slice(event["i"] + 1, event["j"]), axis=0)
            if self._path is not None and (stage is not None or len(self._path) <= _LONGEST_SHOWN):
                shown = Stage.SMOOTHED if stage is None else stage
                drawn.setdefault(shown, []).append((event, self._canvas.trail(self._path)))
        for stage, items in drawn.items():
            places = [place for _, place in items]
            strips = self._canvas.strips(np.concatenate(places), [len(place) for place in places])
            rows, ones = times_of(event for event, _ in items), np.ones(len(items), np.int64)
            self._canvas.send_rows(f"/world/path/{path_style(stage)[0]}", rows, ones, strips)
        if changes:
            costs = [float(event["cost"]) for event, _ in changes]
            self._canvas.plot("/series/cost", times_of(event for event, _ in changes), costs)

    def _gains(self, event: Any, stage: Stage, *, last: bool) -> bool:
        """Return whether a path is enough shorter than the drawn one to be drawn."""
        cost = float(event["cost"])
        if stage is Stage.IMPROVED and not last and cost > (1 - _LEAST_GAIN) * self._shown_cost:
            return False
        self._shown_cost = cost
        return True

    def _text(self, event: Any, stage: Stage) -> str:
        cost, waypoints = float(event["cost"]), len(event["waypoints"])
        text = f"{stage.label} path: cost {cost:.6g}, {waypoints} waypoints"
        if stage is Stage.RAW:
            self._raw_cost = cost
        elif 0 < self._raw_cost < np.inf:
            text += f", {100 * (1 - cost / self._raw_cost):.1f} % shorter"
        return text

    def _draw_ghosts(self, event: Any) -> None:
        """Draw the body along a path, at even distances in the robot's metric."""
        path, robot = event["waypoints"], self._canvas.robot
        if not has_body(robot, path[0]):
            return
        steps = float(event["cost"]) / (_APART * self._canvas.frame.world.extent)
        poses = list(robot.along(path, int(np.clip(steps + 1, 2, _GHOSTS))))
        draw_bodies(self._canvas, GHOSTS_ENTITY, times_of([event]), [poses])


def _changes(events: Events) -> list[tuple[Any, Stage | None]]:
    """Return the events that change the path, in order, with their stage; shortcuts have none."""
    paths, shortcuts = events[Kind.PATH], events[Kind.SHORTCUT]
    changes: list[tuple[Any, Stage | None]]
    changes = [(event, Stage(int(event["stage"]))) for event in paths]
    changes += [(event, None) for event in shortcuts[shortcuts["accepted"]]]
    changes.sort(key=lambda change: int(change[0]["seq"]))
    return changes


class MovesDrawing:
    """Draws the moves of the robot: where it is, and its trace."""

    def __init__(self, canvas: Canvas, manifest: Manifest) -> None:
        self._canvas = canvas
        self._edge = edge = contract_of(manifest, canvas.frame.world).cell * canvas.frame.scale
        limits = _MOVES_IN_3D if edge and canvas.dim > 2 else ()
        self._decimation = Decimation(canvas.world, *limits)
        self._start = canvas.places([manifest.start])
        self._at, self._drawn = self._start, 0
        colour = TRACE_ON_CELLS[canvas.dim] if edge else TRACE
        canvas.style(TRACE_ENTITY, canvas.lines, colour, -0.4 if edge else -0.5, 28.0)
        canvas.style(ROBOT_ENTITY, canvas.points, ROBOT, -5, 60.0)
        if has_body(canvas.robot, np.array(manifest.start)):
            canvas.style(BODY_ENTITY, canvas.lines, ROBOT, -1.5, 55.0)
        if edge:
            canvas.style(TAIL_ENTITY, canvas.points, ROBOT, -1.25, 30.0)
            canvas.style(CELL_ENTITY, canvas.boxes, ROBOT, -1, 58.0)

    def write(self, events: Events) -> None:
        """Draw the moves of a batch."""
        table = events[Kind.MOVE]
        if not len(table):
            return
        before = self._decimation.count
        places = self._draw_trace(table)
        shown = np.union1d(one_in_stride(before, len(table)), [len(table) - 1])
        rows, ones = table[shown], np.ones(len(shown), np.int64)
        points = self._canvas.points.columns(positions=places[shown])
        self._canvas.send_rows(ROBOT_ENTITY, rows, ones, points)
        if self._edge:
            self._canvas.send_rows(TAIL_ENTITY, rows, ones, points)
            half = np.full((len(rows), self._canvas.dim), self._edge / 2, np.float32)
            cells = self._canvas.boxes.columns(centers=places[shown], half_sizes=half)
            self._canvas.send_rows(CELL_ENTITY, rows, ones, cells)
        if has_body(self._canvas.robot, table["q"][0]):
            draw_bodies(self._canvas, BODY_ENTITY, rows, [[q] for q in rows["q"]])

    def _draw_trace(self, table: Table) -> NDArray[np.float32]:
        """Draw where the robot has been; return the place after each move, shape (n, dim)."""
        places = self._canvas.places(table["q"])
        froms = np.concatenate([self._at, places[:-1]])
        froms[table["step"] == 1] = self._start  # each trial begins there
        self._at = places[-1:]
        kept = self._decimation.keep(places)
        if self._decimation.began_within(len(table)):
            text = f"moves: beyond {self._decimation.full:,} only those to new places are drawn"
            self._canvas.add_text(table[-1], text)
        if kept.any():
            rows, lines = table[kept], self._canvas.segments(froms[kept], places[kept])
            self._canvas.send(TRACE_ENTITY, rows, growing_rows(self._drawn, len(rows)), lines)
            self._drawn += len(rows)
        return places


def has_body(robot: Robot, q: NDArray[np.float64]) -> bool:
    """Whether a robot has lines that show its body."""
    return bool(body_lines(robot, q))


def body_lines(robot: Robot, q: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the lines that show a body, shape (k, d) each: its outline, or its skeleton."""
    outline = [np.concatenate([part, part[:1]]) for part in robot.outline(q)]
    return outline or [line for line in robot.skeleton(q[None]) if len(line)]


def draw_bodies(canvas: Canvas, entity: str, rows: Table, poses: list[Any]) -> None:
    """Draw the body at one configuration or more, a list of them a row."""
    strips, counts = list[NDArray[np.float32]](), []
    for row in poses:
        lines_of = [line for q in row for line in body_lines(canvas.robot, q)]
        strips += [canvas.frame.points(line).astype(np.float32) for line in lines_of]
        counts.append(len(lines_of))
    if strips:
        lines = canvas.strips(np.concatenate(strips), [len(strip) for strip in strips])
        canvas.send_rows(entity, rows, np.array(counts), lines)
