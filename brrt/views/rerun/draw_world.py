"""A world in Rerun: obstacles, bounds, markers with labels, and the view of it."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from brrt.views.colours import FREE, GOAL, OBSTACLE, OBSTACLE_3D, OUTLINE, START, TRACE, Colour
from brrt.views.rerun.frame import Frame
from brrt.views.rerun.stream import rrd_file, viewer_stream
from brrt.worlds.free_space import occupied
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

_CORNERS = 1 / 16, 1 / 4
"""Radii of two thin lines along the edge of a box in 2D, in radii of the others, whose round
corners leave the box's own unfilled."""
_LAYERS, _OVERLAP = 5, 1.5
"""Nested lines that fill half of a box in 2D, and their distance in radii: less than 2, so that
each covers the round corners of the next."""
_BELOW = {2: 0.04, 3: 0.05}
"""How far below the bounds the text is that explains the coordinates, as a part of the extent."""
_PIXELS = 640
"""Pixels along the longer side of the image that fills polygons: about a window's resolution."""


def show_world(world: World, *, path: Path | None = None, view: bool = False) -> None:
    """Write a world to an .rrd file, or show it in Rerun's viewer, or both.

    Raises:
        BrrtError: The file cannot be written, or there is no viewer.
    """
    name = f"world-{hashlib.sha256(world.to_json().encode()).hexdigest()[:16]}"
    layout = rrb.Blueprint(
        world_view(world),
        rrb.TimePanel(state="hidden"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
    names = name, application(world, f"{world.dim}d world")
    if path is not None:
        with rrd_file(path, *names, layout) as rec:
            _log_query(rec, world)
    if view:
        with viewer_stream(*names, layout) as rec:
            _log_query(rec, world)


def _log_query(rec: rr.RecordingStream, world: World) -> None:
    frame = Frame.of(world)
    log_world(rec, frame)
    drawn = frame.drawn
    for name, point, colour in (("start", drawn.start, START), ("goal", drawn.goal, GOAL)):
        if point is not None:
            log_marker(rec, drawn, name, point[None].astype(np.float32), colour)


def application(world: World, what: str) -> str:
    """Return the name under which a viewer keeps the layout for what is drawn in a world.

    Drawings of one name share a layout, which has the bounds of the world as it is drawn. Rerun
    takes letters, digits, spaces, "-" and "_" only; it changes other names, with a warning.
    """
    frame = Frame.of(world)
    world = frame.drawn
    size = " x ".join(f"{side:g}" for side in world.upper - world.lower)
    corner = " ".join(f"{value:g}" for value in world.lower) if world.lower.any() else ""
    details = filter(
        None,
        [corner and f"from {corner}", "y down" if world.y_down else "", frame.text and "moved"],
    )
    return " ".join(["brrt", what, size, *details]).replace("+", "").replace(".", "_")


def log_world(rec: rr.RecordingStream, frame: Frame) -> None:
    """Draw obstacles and bounds, and what the coordinates stand for where they are not the own."""
    world = frame.drawn
    if world.dim == 2 and not world.y_down:
        # Rerun's 2D views have y pointing down; most maps have it pointing up.
        rec.log("/world", rr.Transform3D(scale=[1, -1, 1]), static=True)
    archetypes = _archetypes_2d(world) if world.dim == 2 else _archetypes_3d(world)
    for entity, archetype in archetypes.items():
        rec.log(entity, archetype, static=True)
    if frame.text:
        low, high = world.lower, world.upper
        x = (low[0] + high[0]) / 2 if world.dim == 2 else high[0]
        place = np.array([[x, high[1] if world.y_down else low[1], *low[2:]]], np.float32)
        log_label(rec, world, "bounds", place, TRACE, frame.text, _BELOW[world.dim])


def log_marker(
    rec: rr.RecordingStream, world: World, name: str, place: NDArray[np.float32], colour: Colour
) -> None:
    """Draw a dot at a place, shape (1, dim), with a name below."""
    if world.dim == 2:
        disc = _discs(place, 1e-6 * world.extent)
        dot: Any = rr.LineStrips2D(disc, colors=colour, radii=-7, draw_order=100)
    else:
        dot = rr.Points3D(place, colors=colour, radii=-7)
    rec.log(f"/world/{name}", dot, static=True)
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
    """Write a text below a place, shape (1, dim), `far` below as a part of the world's extent."""
    # Rerun centres a label on its point.
    down = np.eye(world.dim, dtype=np.float32)[-1] * (1 if world.y_down else -1)
    below = place + np.float32(far * world.extent) * down
    points: Any = rr.Points2D if world.dim == 2 else rr.Points3D
    label = points(below, colors=colour, radii=0, labels=text, show_labels=True)
    rec.log(f"/world/{name}/label", label, static=True)


def world_view(
    world: World,
    overrides: Mapping[str, Any] | None = None,
    *,
    below: str = "",
    name: str = "World",
) -> Any:
    """Return a view of a world that is drawn below an entity, with components that it overrides."""
    options: dict[str, Any] = {
        "origin": "/",
        "contents": f"{below}/world/**",
        "name": name,
        "background": list(FREE),
        "overrides": overrides or {},
    }
    frame = Frame.of(world)
    world = frame.drawn
    margin = 0.04 * (world.upper - world.lower)
    low, high = world.lower - margin, world.upper + margin
    if frame.text and world.dim == 2:  # it stands below the bounds
        (high if world.y_down else low)[1] += (1 if world.y_down else -1) * _BELOW[2] * world.extent
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


def _archetypes_2d(world: World) -> dict[str, Any]:
    size = world.upper - world.lower
    found: dict[str, Any] = {
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
        found["/world/obstacles/balls"] = rr.LineStrips2D(
            discs, radii=radii, colors=OBSTACLE, draw_order=0
        )
    if len(world.boxes):
        found["/world/obstacles/boxes"] = _filled_boxes(world.boxes[:, :2], world.boxes[:, 2:])
    outside = () if world.grid is None else tuple(world.grid.outside(world.lower, world.upper))
    if world.polygons or outside:
        found |= _filled_polygons(replace(world, polygons=world.polygons + outside, grid=None))
    if world.grid is not None:
        found |= _filled_cells(world.grid)
    return found


def _filled_cells(grid: Grid) -> Iterator[tuple[str, Any]]:
    """Yield the blocked cells as an image in a frame of its own."""
    turn = rr.RotationAxisAngle([0, 0, 1], radians=grid.yaw)
    frame = rr.Transform3D(translation=[*grid.origin, 0], rotation=turn, scale=grid.resolution)
    yield "/world/obstacles/grid", frame
    yield "/world/obstacles/grid/cells", _stencil(grid.cells)


def _stencil(cells: NDArray[np.bool_]) -> rr.SegmentationImage:
    """Return an image with the colour of obstacles where cells are blocked, else transparent."""
    return rr.SegmentationImage(cells.astype(np.uint8), opacity=1.0, draw_order=-1.5)


def _discs(centres: NDArray[Any], length: Any) -> NDArray[np.float32]:
    """Return lines of hardly any length: their round ends make discs; points have shading."""
    ends = centres + length
    centres = centres.astype(np.float32)
    ends = np.maximum(ends.astype(np.float32), np.nextafter(centres, np.float32(np.inf)))
    return np.stack([centres, ends], axis=1)


def _filled_boxes(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> rr.Boxes2D:
    """Return boxes of thick lines inside each other, and an edge: Rerun fills no 2D shapes."""
    centre, half = (lower + upper) / 2, (upper - lower) / 2
    # The innermost box has a length above 0: Rerun draws no line without length.
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
    """Yield an image of what polygons cover, and their outlines: Rerun fills no 2D shapes."""
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


def _archetypes_3d(world: World) -> dict[str, Any]:
    see_through = rr.components.FillMode.TransparentFillMajorWireframe
    size = world.upper - world.lower
    found: dict[str, Any] = {
        "/world/bounds": rr.Boxes3D(
            mins=[world.lower], sizes=[size], colors=OUTLINE, radii=-0.5, fill_mode="MajorWireframe"
        )
    }
    if len(world.balls):
        found["/world/obstacles/balls"] = rr.Ellipsoids3D(
            centers=world.balls[:, :3],
            radii=world.balls[:, 3],
            colors=OBSTACLE_3D,
            fill_mode=see_through,
            line_radii=-0.5,
        )
    if len(world.boxes):
        found["/world/obstacles/boxes"] = rr.Boxes3D(
            mins=world.boxes[:, :3],
            sizes=world.boxes[:, 3:] - world.boxes[:, :3],
            colors=OBSTACLE_3D,
            fill_mode=see_through,
            radii=-0.5,
        )
    return found
