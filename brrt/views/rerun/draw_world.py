"""A world in Rerun: its obstacles and bounds, marks for start and goal, and a view of it."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from brrt.views.colours import FREE, OBSTACLE, OBSTACLE_3D, OUTLINE, Colour
from brrt.worlds.free_space import occupied
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

_CORNERS = 1 / 16, 1 / 4
"""Thinner lines along the edge of a box in 2D, in radii of the others, whose corners are round."""
_LAYERS, _OVERLAP = 5, 1.5
"""Lines that fill half of a box in 2D, and their distance in radii: less than 2, so that each
covers the missing corner of the next."""
_PIXELS = 640
"""Along the longer side of the image that fills polygons: as fine as a window shows a map."""


def application(world: World, what: str) -> str:
    """Name what shares a layout: a viewer keeps one for each application, and shows the last.

    Args:
        world: What is seen of it is part of the layout.
        what: Is drawn in it.
    """
    size = " x ".join(f"{side:g}" for side in world.upper - world.lower)
    corner = ", ".join(f"{value:g}" for value in world.lower) if world.lower.any() else ""
    ways = filter(None, [corner and f"from {corner}", "y down" if world.y_down else ""])
    return " ".join(["brrt", what, size, *ways])


def log_world(rec: rr.RecordingStream, world: World) -> None:
    """Draw obstacles and bounds."""
    if world.dim == 2 and not world.y_down:
        # Rerun's 2D views have y pointing down; most maps have it pointing up.
        rec.log("/world", rr.Transform3D(scale=[1, -1, 1]), static=True)
    still = _still_2d(world) if world.dim == 2 else _still_3d(world)
    for entity, archetype in still.items():
        rec.log(entity, archetype, static=True)


def log_mark(
    rec: rr.RecordingStream, world: World, name: str, place: NDArray[np.float32], colour: Colour
) -> None:
    """Mark a place, shape (1, d), and write a name below."""
    rec.log(f"/world/{name}", _mark(place, colour, world.extent), static=True)
    log_label(rec, world, name, place, colour, name)


def log_label(
    rec: rr.RecordingStream,
    world: World,
    name: str,
    place: NDArray[np.float32],
    colour: Colour,
    text: str,
    far: float = 0.012,
) -> None:
    """Write a text below a place, shape (1, d), so far as a part of the world's extent."""
    # Rerun writes a label across its point; this one stands below.
    down = np.eye(world.dim, dtype=np.float32)[-1] * (1 if world.y_down else -1)
    below = place + np.float32(far * world.extent) * down
    rec.log(f"/world/{name}/label", _label(below, colour, text), static=True)


def world_view(
    world: World,
    overrides: Mapping[str, Any] | None = None,
    *,
    below: str = "",
    name: str = "World",
) -> Any:
    """Lay out a view of the world and of what happens in it; the whole of it is in sight.

    Args:
        world: The world.
        overrides: What the view changes of its entities.
        below: The entity below which the world was drawn.
        name: The view's.
    """
    options: dict[str, Any] = {
        "origin": "/",
        "contents": f"{below}/world/**",
        "name": name,
        "background": list(FREE),
        "overrides": overrides or {},
    }
    margin = 0.04 * (world.upper - world.lower)
    low, high = world.lower - margin, world.upper + margin
    if world.dim == 2:
        y_range = [low[1], high[1]] if world.y_down else [-high[1], -low[1]]
        bounds = rrb.VisualBounds2D(x_range=[low[0], high[0]], y_range=y_range)
        return rrb.Spatial2DView(visual_bounds=bounds, **options)
    centre = (world.lower + world.upper) / 2
    reach = float(np.linalg.norm(world.upper - world.lower))
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=centre + reach * np.array([-0.6, -0.8, 0.5]),
        look_target=centre,
        eye_up=[0, 0, 1],
    )
    return rrb.Spatial3DView(eye_controls=eye, line_grid=False, **options)


def _mark(place: NDArray[np.float32], colour: Colour, extent: float) -> Any:
    if place.shape[1] == 2:
        return rr.LineStrips2D(
            _discs(place, 1e-6 * extent), colors=colour, radii=-7, draw_order=100
        )
    return rr.Points3D(place, colors=colour, radii=-7)


def _label(place: NDArray[np.float32], colour: Colour, text: str) -> Any:
    points: Any = rr.Points2D if place.shape[1] == 2 else rr.Points3D
    return points(place, colors=colour, radii=0, labels=text, show_labels=True)


def _still_2d(world: World) -> dict[str, Any]:
    size = world.upper - world.lower
    still: dict[str, Any] = {
        "/world/bounds": rr.Boxes2D(
            mins=[world.lower], sizes=[size], colors=OUTLINE, radii=-1, draw_order=-1
        ),
        "/world/obstacles": rr.AnnotationContext(
            [(0, "free", (0, 0, 0, 0)), (1, "blocked", OBSTACLE)]
        ),
    }
    if len(world.balls):
        radii = world.balls[:, 2]
        discs = _discs(world.balls[:, :2], 1e-3 * radii[:, None])
        still["/world/obstacles/balls"] = rr.LineStrips2D(
            discs, radii=radii, colors=OBSTACLE, draw_order=0
        )
    if len(world.boxes):
        still["/world/obstacles/boxes"] = _filled_boxes(world.boxes[:, :2], world.boxes[:, 2:])
    outside = () if world.grid is None else tuple(world.grid.outside(world.lower, world.upper))
    if world.polygons or outside:
        still |= _filled_polygons(replace(world, polygons=world.polygons + outside, grid=None))
    if world.grid is not None:
        still |= _still_cells(world.grid)
    return still


def _still_cells(grid: Grid) -> Iterator[tuple[str, Any]]:
    """Draw the cells as an image in a frame of its own."""
    turn = rr.RotationAxisAngle([0, 0, 1], radians=grid.yaw)
    frame = rr.Transform3D(translation=[*grid.origin, 0], rotation=turn, scale=grid.resolution)
    yield "/world/obstacles/grid", frame
    yield "/world/obstacles/grid/cells", _stencil(grid.cells)


def _stencil(cells: NDArray[np.bool_]) -> rr.SegmentationImage:
    """Draw pixels in the colour of obstacles, or not at all."""
    return rr.SegmentationImage(cells.astype(np.uint8), opacity=1.0, draw_order=-1.5)


def _discs(centres: NDArray[Any], length: Any) -> NDArray[np.float32]:
    """Lines that hardly go anywhere: their round ends make a disc, where points have shading."""
    ends = centres + length
    centres = centres.astype(np.float32)
    ends = np.maximum(ends.astype(np.float32), np.nextafter(centres, np.float32(np.inf)))
    return np.stack([centres, ends], axis=1)


def _filled_boxes(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> rr.Boxes2D:
    """Boxes of thick lines nested in each other, and an edge: Rerun fills no shapes in 2D."""
    centre, half = (lower + upper) / 2, (upper - lower) / 2
    # The innermost box is no point: Rerun draws no line that goes nowhere.
    thick = half.min(axis=1) / (1.25 + _OVERLAP * (_LAYERS - 1))
    inset = np.append(_CORNERS, 1 + _OVERLAP * np.arange(_LAYERS))[:, None] * thick
    radii = np.append(_CORNERS, np.ones(_LAYERS))[:, None] * thick
    nested = (half - inset[..., None]).reshape(-1, 2)
    return rr.Boxes2D(
        centers=np.tile(centre, (len(radii) + 1, 1)),
        half_sizes=np.concatenate([nested, half]),
        radii=np.append(radii, np.full(len(half), -0.5)),
        colors=OBSTACLE,
        draw_order=0,
    )


def _filled_polygons(world: World) -> Iterator[tuple[str, Any]]:
    """Polygons as lines around an image of what they cover: Rerun fills no shapes in 2D."""
    pixel = world.extent / _PIXELS
    columns, rows = np.maximum(1, np.ceil((world.upper - world.lower) / pixel)).astype(int)
    y, x = np.mgrid[:rows, :columns]
    points = world.lower + pixel * (np.stack([x, y], axis=-1).reshape(-1, 2) + 0.5)
    hulls = replace(world, balls=np.empty((0, 3)), boxes=np.empty((0, 4)))
    yield (
        "/world/obstacles/inside",
        rr.Transform3D(translation=[*world.lower, 0], scale=pixel),
    )
    yield "/world/obstacles/inside/pixels", _stencil(occupied(hulls, points).reshape(rows, columns))
    outlines = [np.concatenate([polygon, polygon[:1]]) for polygon in world.polygons]
    radii = [-0.5 if len(polygon) > 2 else -1.5 for polygon in world.polygons]
    yield (
        "/world/obstacles/polygons",
        rr.LineStrips2D(outlines, radii=radii, colors=OBSTACLE, draw_order=0),
    )


def _still_3d(world: World) -> dict[str, Any]:
    see_through = rr.components.FillMode.TransparentFillMajorWireframe
    size = world.upper - world.lower
    still: dict[str, Any] = {
        "/world/bounds": rr.Boxes3D(
            mins=[world.lower], sizes=[size], colors=OUTLINE, radii=-0.5, fill_mode="MajorWireframe"
        )
    }
    if len(world.balls):
        still["/world/obstacles/balls"] = rr.Ellipsoids3D(
            centers=world.balls[:, :3],
            radii=world.balls[:, 3],
            colors=OBSTACLE_3D,
            fill_mode=see_through,
            line_radii=-0.5,
        )
    if len(world.boxes):
        still["/world/obstacles/boxes"] = rr.Boxes3D(
            mins=world.boxes[:, :3],
            sizes=world.boxes[:, 3:] - world.boxes[:, :3],
            colors=OBSTACLE_3D,
            fill_mode=see_through,
            radii=-0.5,
        )
    return still
