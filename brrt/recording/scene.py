"""What a recording looks like in Rerun: colours, the still parts of the picture, the layout."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from brrt.events import Reason, Source, Stage
from brrt.robots import Robot
from brrt.scenario import Manifest, Scenario
from brrt.worlds.occupancy import Grid
from brrt.worlds.survey import covered
from brrt.worlds.world import World

Colour = tuple[int, int, int]

FREE: Colour = (34, 37, 45)
"""Free space: not black, so that dark obstacles stand out against it."""
OBSTACLE: Colour = (10, 11, 14)
OBSTACLE_3D = (112, 120, 137)
OUTLINE: Colour = (96, 103, 118)
START: Colour = (255, 145, 30)
GOAL: Colour = (60, 215, 100)
OTHER: Colour = (180, 120, 255)
"""For what has no colour of its own here."""
SAMPLES: Mapping[Source, Colour] = {
    Source.UNIFORM: (135, 143, 158),
    Source.GOAL: GOAL,
    Source.OTHER_TREE: (176, 128, 168),
    Source.INFORMED: (94, 158, 160),
}
REJECTS: Mapping[Reason, Colour] = {
    Reason.COLLISION: (150, 74, 80),
    Reason.NO_PROGRESS: (120, 110, 90),
    Reason.GOAL_BLOCKED: (140, 90, 150),
    Reason.LINK_BLOCKED: (176, 112, 66),
    Reason.NEAR_BLOCKED: (108, 66, 72),
    Reason.NO_GAIN: (84, 90, 108),
    Reason.LIMITS: (150, 142, 70),
}
REWIRED: Mapping[str, Colour] = {"start": (150, 235, 255), "goal": (255, 190, 220)}
"""New edges of the trees of these names, for a moment."""
LINK: Colour = (255, 236, 170)
GHOST: Colour = (150, 128, 60)
TRACE: Colour = (205, 205, 215)
ROBOT: Colour = (255, 255, 255)
NEWEST: Colour = (120, 170, 235)
LINK_ENTITY, GHOSTS_ENTITY = "/world/link", "/world/path/bodies"
TRACE_ENTITY, ROBOT_ENTITY, BODY_ENTITY = "/world/trace", "/world/robot", "/world/robot/body"
CELLS_ENTITY, SEARCH_ENTITY = "/world/cells/expanded", "/world/cells/search"
_GROWING = (TRACE_ENTITY, CELLS_ENTITY, SEARCH_ENTITY)

_HEAT = ((48, 40, 92), (50, 80, 130), (36, 124, 128), (96, 170, 88), (232, 214, 66))
"""From cheap to dear."""
_TREES: Mapping[int, tuple[str, Colour]] = {
    0: ("start", (74, 144, 255)),
    1: ("goal", (255, 82, 82)),
}
_PATHS: Mapping[Stage, tuple[Colour, float]] = {
    Stage.RAW: ((255, 240, 100), 1.5),
    Stage.SMOOTHED: ((255, 184, 0), 3.0),
    Stage.IMPROVED: ((255, 226, 60), 2.5),
}
FADING_ITERATIONS, FADING_EVENTS, FADING_SECONDS = 300, 1000, 0.001
"""How long samples and rejections stay in sight on each timeline."""
_BRIEFER = 5
"""Rewired edges stay for a part of that: there may be several in an iteration."""

_LAYERS, _OVERLAP = 5, 1.5
"""Lines that fill half of a box in 2D, and their distance in radii: less than 2, so that each
covers the missing corner of the next."""
_PIXELS = 640
"""Along the longer side of the image that fills polygons: as fine as a window shows a map."""


def is_flat(manifest: Manifest) -> bool:
    """Whether the picture is drawn in 2D."""
    return manifest.dim == 2


def tree_style(number: int) -> tuple[str, Colour]:
    """Return a tree's name and colour."""
    return _TREES.get(number, (str(number), OTHER))


def path_style(stage: Stage) -> tuple[str, Colour, float]:
    """Return a path's name, its colour, and its lines' radius in points of the screen."""
    return (stage.name.lower(), *_PATHS.get(stage, (OTHER, 2.0)))


def packed(colour: Colour) -> int:
    """Return a colour as Rerun packs it."""
    red, green, blue = colour
    return red << 24 | green << 16 | blue << 8 | 255


def heat(values: NDArray[np.float64]) -> NDArray[np.uint32]:
    """Return colours for values from 0 to 1, as Rerun packs them, shape (n,)."""
    at = np.linspace(0, 1, len(_HEAT))
    red, green, blue = (
        np.interp(values, at, channel).astype(np.uint32) for channel in np.transpose(_HEAT)
    )
    return np.asarray(red << 24 | green << 16 | blue << 8 | 255, np.uint32)


def places(values: Any, robot: Robot) -> NDArray[np.float32]:
    """Where configurations, shape (n, dof), are drawn, shape (n, dim)."""
    return np.ascontiguousarray(robot.places(np.asarray(values, np.float64)), np.float32)


def log_scene(rec: rr.RecordingStream, manifest: Manifest, world: World) -> None:
    """Draw obstacles, bounds, start and goal."""
    if is_flat(manifest):
        # Rerun's 2D views have y pointing down; maps have it pointing up.
        rec.log("/world", rr.Transform3D(scale=[1, -1, 1]), static=True)
    still = _still_2d(world) if is_flat(manifest) else _still_3d(world)
    for entity, archetype in still.items():
        rec.log(entity, archetype, static=True)
    robot = manifest.make_robot()
    marks = (("start", manifest.start, START), ("goal", manifest.goal, GOAL))
    for name, q, colour in marks:
        place = places([q], robot)
        body = [np.concatenate([part, part[:1]]) for part in robot.outline(np.array(q))]
        if body:
            outline = rr.LineStrips2D(body, colors=colour, radii=-1.5, draw_order=90)
            rec.log(f"/world/{name}/body", outline, static=True)
        rec.log(f"/world/{name}", _mark(place, colour, world.extent), static=True)
        # Rerun writes a label across its point; this one stands below.
        below = (
            place - np.float32(0.012 * world.extent) * np.eye(manifest.dim, dtype=np.float32)[-1]
        )
        rec.log(f"/world/{name}/label", _label(below, colour, name), static=True)


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
    radius = half.min(axis=1) / (1 + _OVERLAP * (_LAYERS - 1))
    inset = (1 + _OVERLAP * np.arange(_LAYERS)[:, None]) * radius
    nested = np.maximum(half - inset[..., None], 0).reshape(-1, 2)
    return rr.Boxes2D(
        centers=np.tile(centre, (_LAYERS + 1, 1)),
        half_sizes=np.concatenate([nested, half]),
        radii=np.concatenate([np.tile(radius, _LAYERS), np.full(len(half), -0.5)]),
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
    yield "/world/obstacles/inside/pixels", _stencil(covered(hulls, points).reshape(rows, columns))
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


def document(manifest: Manifest, figures: Mapping[str, Any] | None = None) -> str:
    """Describe the run in Markdown; with its figures once it is over."""
    scenario = manifest.scenario
    settings = scenario.settings()
    rows = {
        "world": scenario.world,
        "robot": scenario.robot,
        "start": _numbers(manifest.start),
        "goal": _numbers(manifest.goal),
        "seed": scenario.seed,
        "budget": _budget(scenario),
        "settings": ", ".join(f"{name}={value}" for name, value in settings.items()),
        "made by": ", ".join(f"{name} {value}" for name, value in manifest.made_by.items()),
    }
    rows = _results(figures) | rows
    table = "".join(f"| {name} | {_cell(value)} |\n" for name, value in rows.items())
    return f"### {_cell(scenario.planner)}\n\n| | |\n|---|---|\n{table}"


def _results(figures: Mapping[str, Any] | None) -> dict[str, str]:
    if figures is None:
        return {}
    rows = {"status": f"{figures['status']} after {figures['iterations']:,} iterations"}
    rows["nodes"] = f"{figures['nodes']:,}"
    if figures["plan_time_s"] is not None:
        rows["planning"] = f"{figures['plan_time_s'] * 1e3:.4g} ms"
    for name, key in (("path", "path_cost"), ("smoothed", "smoothed_cost")):
        if figures[key] is not None:
            rows[name] = f"{figures[key]:.6g}"
    return rows


def _budget(scenario: Scenario) -> str:
    limits = [] if scenario.time is None else [f"{scenario.time:g} s"]
    if scenario.iterations is not None:
        limits.append(f"{scenario.iterations:,} iterations")
    return ", ".join(limits) or "the planner's own"


def _cell(value: object) -> str:
    return str(value).replace("|", "\\|").replace("\n", " ")


def _numbers(values: tuple[float, ...]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def blueprint(manifest: Manifest, world: World, *, live: bool = False) -> rrb.Blueprint:
    """Lay out the world, the plots, the log and the manifest.

    Args:
        manifest: The run's.
        world: The run's.
        live: Follow what comes, instead of waiting at the start.
    """
    axis = rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()
        )
    )
    plots = [
        rrb.TimeSeriesView(origin=f"/series/{entity}", name=name, axis_x=axis)
        for entity, name in (
            ("nodes", "Nodes"),
            ("cost", "Path cost"),
            ("rejected", "Rejected extensions, %"),
        )
    ]
    log = rrb.TextLogView(
        origin="/log",
        name="Log",
        columns=rrb.TextLogColumns(timeline_columns=["iteration"], text_log_columns=["body"]),
    )
    run = rrb.TextDocumentView(origin="/run", name="Run")
    right = rrb.Vertical(*plots, log, run, row_shares=[3, 3, 3, 4, 5])
    return rrb.Blueprint(
        rrb.Horizontal(_world_view(manifest, world), right, column_shares=[5, 2]),
        rrb.TimePanel(
            state="collapsed",
            # A robot that drives the path afterwards does so within the planner's last iteration.
            timeline="event" if manifest.scenario.execute else "iteration",
            play_state="following" if live else "paused",
            fps=100,
        ),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _world_view(manifest: Manifest, world: World) -> Any:
    past = [(name, rrb.TimeRangeBoundary.infinite()) for name in ("iteration", "event", "t")]
    recent = [
        ("iteration", rrb.TimeRangeBoundary.cursor_relative(seq=-FADING_ITERATIONS)),
        ("event", rrb.TimeRangeBoundary.cursor_relative(seq=-FADING_EVENTS)),
        ("t", rrb.TimeRangeBoundary.cursor_relative(seconds=-FADING_SECONDS)),
    ]
    shown = {f"/world/tree/{name}": past for name, _ in _TREES.values()}
    just_now = [
        ("iteration", rrb.TimeRangeBoundary.cursor_relative(seq=-FADING_ITERATIONS // _BRIEFER)),
        ("event", rrb.TimeRangeBoundary.cursor_relative(seq=-FADING_EVENTS // _BRIEFER)),
        ("t", rrb.TimeRangeBoundary.cursor_relative(seconds=-FADING_SECONDS / _BRIEFER)),
    ]
    shown |= dict.fromkeys(_GROWING, past)
    shown |= {f"/world/rewired/{name}": just_now for name in REWIRED}
    shown |= {f"/world/samples/{source.name.lower()}": recent for source in Source}
    shown |= {f"/world/rejected/{reason.name.lower()}": recent for reason in Reason}
    options: dict[str, Any] = {
        "origin": "/",
        "contents": "/world/**",
        "name": "World",
        "background": list(FREE),
        "overrides": {entity: [_ranges(starts)] for entity, starts in shown.items()},
    }
    margin = 0.04 * (world.upper - world.lower)
    low, high = world.lower - margin, world.upper + margin
    if is_flat(manifest):
        bounds = rrb.VisualBounds2D(x_range=[low[0], high[0]], y_range=[-high[1], -low[1]])
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


def _ranges(starts: list[tuple[str, Any]]) -> Any:
    now = rrb.TimeRangeBoundary.cursor_relative()
    return rrb.VisibleTimeRanges(
        [rrb.VisibleTimeRange(timeline, start=start, end=now) for timeline, start in starts]
    )
