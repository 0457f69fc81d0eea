"""Paths: each that the planner found, each that shortcuts led to, and the body along the last."""

from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Events, Kind, Stage, Table
from brrt.views.rerun import layout
from brrt.views.rerun.draw.canvas import Canvas, moments

_LONGEST_SHOWN = 1000
"""Waypoints up to which a path is drawn anew after each accepted shortcut."""

_LEAST_GAIN = 1e-3
"""How much shorter an improved path must be than the one in sight to take its place, as a part of
it; the last one of a batch always does. So there are some hundred of them and a few more."""

_GHOSTS, _APART = 24, 0.07
"""Places along a path at which the body is shown, at most, and how far it moves between two at
least, as a part of the world's extent: closer ones are a blot."""


class Paths:
    """Draws paths and plots their costs.

    Args:
        canvas: Where they are drawn.
    """

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._path: NDArray[np.float64] | None = None
        self._raw_cost = self._shown_cost = np.inf
        for stage in Stage:
            name, colour, radius = layout.path_style(stage)
            canvas.style(f"/world/path/{name}", canvas.lines, colour, -radius, 40.0 + stage)
        gold = layout.path_style(Stage.SMOOTHED)[1]
        canvas.plot_style("/series/cost", "cost", gold)
        canvas.plot_dots("/series/cost", "cost", gold)
        canvas.style(layout.GHOSTS_ENTITY, rr.LineStrips2D, layout.GHOST, -0.75, 35.0)

    def write(self, events: Events) -> None:
        """Draw each path, and those between them as shortcuts are accepted."""
        changes = self._changes(events)
        drawn: dict[Stage, list[tuple[Any, NDArray[np.float32]]]] = {}
        for number, (event, stage) in enumerate(changes):
            if stage is not None:
                self._path = event["waypoints"]
                if not self._worth_it(event, stage, last=number == len(changes) - 1):
                    continue
                self._canvas.tell(event, self._text(event, stage))
                self._draw_ghosts(event)
            elif self._path is not None:
                self._path = np.delete(self._path, slice(event["i"] + 1, event["j"]), axis=0)
            if self._path is not None and (stage is not None or len(self._path) <= _LONGEST_SHOWN):
                shown = Stage.SMOOTHED if stage is None else stage
                drawn.setdefault(shown, []).append((event, self._canvas.places(self._path)))
        for stage, items in drawn.items():
            places = [place for _, place in items]
            strips = self._canvas.strips(np.concatenate(places), [len(place) for place in places])
            rows, entity = moments(event for event, _ in items), layout.path_style(stage)[0]
            ones = np.ones(len(rows), np.int64)
            self._canvas.send_rows(f"/world/path/{entity}", rows, ones, strips)
        if changes:
            costs = [float(event["cost"]) for event, _ in changes]
            self._canvas.plot("/series/cost", moments(event for event, _ in changes), costs)

    def _changes(self, events: Events) -> list[tuple[Any, Stage | None]]:
        """Return what changes the path, in order; shortcuts have no stage."""
        paths, shortcuts = events[Kind.PATH], events[Kind.SHORTCUT]
        changes: list[tuple[Any, Stage | None]]
        changes = [(event, Stage(int(event["stage"]))) for event in paths]
        changes += [(event, None) for event in shortcuts[shortcuts["accepted"]]]
        changes.sort(key=lambda change: int(change[0]["seq"]))
        return changes

    def _worth_it(self, event: Any, stage: Stage, *, last: bool) -> bool:
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
        """Show the body along a path, evenly by the robot's metric."""
        path, robot = event["waypoints"], self._canvas.robot
        if not robot.outline(path[0]):
            return
        steps = float(event["cost"]) / (_APART * self._canvas.world.extent)
        bodies = list(robot.along(path, int(np.clip(steps + 1, 2, _GHOSTS))))
        draw_bodies(self._canvas, layout.GHOSTS_ENTITY, moments([event]), [bodies])


def draw_bodies(canvas: Canvas, entity: str, rows: Table, poses: list[Any]) -> None:
    """Draw the body at one configuration or more at each moment."""
    strips, counts = list[NDArray[np.float32]](), []
    for row in poses:
        parts = [part for q in row for part in canvas.robot.outline(q)]
        strips += [np.concatenate([part, part[:1]]).astype(np.float32) for part in parts]
        counts.append(len(parts))
    if strips:
        lines = canvas.strips(np.concatenate(strips), [len(strip) for strip in strips])
        canvas.send_rows(entity, rows, np.array(counts), lines)
