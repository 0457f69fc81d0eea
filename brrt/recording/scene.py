"""What a recording looks like in Rerun: colours, the still parts of the picture, the layout."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from brrt.events import Reason, Source, Stage
from brrt.scenario import Manifest
from brrt.worlds.world import World

Colour = tuple[int, int, int]

FREE: Colour = (34, 37, 45)
"""Free space: not black, so that dark obstacles stand out against it."""
OBSTACLE: Colour = (10, 11, 14)
OBSTACLE_3D = (112, 120, 137)
OUTLINE: Colour = (96, 103, 118)
START: Colour = (255, 145, 30)
GOAL: Colour = (60, 215, 100)
TREES: Mapping[int, tuple[str, Colour]] = {
    0: ("start", (74, 144, 255)),
    1: ("goal", (255, 82, 82)),
}
"""Names and colours of the trees that planners grow."""
PATHS: Mapping[Stage, tuple[str, Colour, float]] = {
    Stage.RAW: ("raw", (255, 240, 100), 1.5),
    Stage.SMOOTHED: ("smoothed", (255, 184, 0), 3.0),
}
"""Names, colours and radii of the paths, in points of the screen."""
SAMPLES: Mapping[Source, Colour] = {Source.UNIFORM: (135, 143, 158), Source.GOAL: GOAL}
REJECTS: Mapping[Reason, Colour] = {
    Reason.COLLISION: (150, 74, 80),
    Reason.NO_PROGRESS: (120, 110, 90),
    Reason.GOAL_BLOCKED: (140, 90, 150),
}
_OTHER: Colour = (180, 120, 255)

FADING_ITERATIONS, FADING_EVENTS, FADING_SECONDS = 300, 1000, 0.001
"""How long samples and rejections stay in sight on each timeline."""

_LAYERS, _OVERLAP = 8, 1.5


def is_flat(manifest: Manifest) -> bool:
    """Whether the picture is drawn in 2D."""
    return manifest.dim == 2  # noqa: PLR2004


def tree_entity(number: int) -> str:
    """Where a tree is drawn."""
    return f"/world/tree/{TREES[number][0] if number in TREES else number}"


def tree_colour(number: int) -> Colour:
    """Return the colour of a tree."""
    return TREES[number][1] if number in TREES else _OTHER


def log_scene(rec: Any, manifest: Manifest, world: World) -> None:  # noqa: ANN401
    """Draw obstacles, bounds, start and goal."""
    if is_flat(manifest):
        # Rerun's 2D views have y pointing down; maps have it pointing up.
        rec.log("/world", rr.Transform3D(scale=[1, -1, 1]), static=True)
    still = _still_2d(world) if is_flat(manifest) else _still_3d(world)
    for entity, archetype in still.items():
        rec.log(entity, archetype, static=True)
    for name, q, colour in (("start", manifest.start, START), ("goal", manifest.goal, GOAL)):
        look: dict[str, Any] = {"colors": colour, "radii": -7, "labels": name, "show_labels": True}
        place = np.array([q[: manifest.dim]])
        if is_flat(manifest):
            mark = rr.LineStrips2D(_discs(place, 1e-6 * world.extent), draw_order=100, **look)
        else:
            mark = rr.Points3D(place, **look)
        rec.log(f"/world/{name}", mark, static=True)


def _still_2d(world: World) -> dict[str, Any]:
    size = world.upper - world.lower
    still: dict[str, Any] = {
        "/world/bounds": rr.Boxes2D(
            mins=[world.lower], sizes=[size], colors=OUTLINE, radii=-1, draw_order=-1
        )
    }
    if len(world.balls):
        radii = world.balls[:, 2]
        discs = _discs(world.balls[:, :2], 1e-3 * radii[:, None])
        still["/world/obstacles/balls"] = rr.LineStrips2D(
            discs, radii=radii, colors=OBSTACLE, draw_order=0
        )
    if len(world.boxes):
        still["/world/obstacles/boxes"] = _filled_boxes(world.boxes[:, :2], world.boxes[:, 2:])
    return still


def _discs(centres: NDArray[np.float64], nowhere: Any) -> NDArray[np.float32]:  # noqa: ANN401
    """Lines that hardly go anywhere: their round ends make a disc, and points have shading."""
    return np.stack([centres, centres + nowhere * np.array([1.0, 0.0])], axis=1).astype(np.float32)


def _filled_boxes(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> Any:  # noqa: ANN401
    """Boxes of thick lines nested in each other: Rerun has no filled shapes in 2D."""
    centre, half = (lower + upper) / 2, (upper - lower) / 2
    layers = int(np.clip(32_000 // len(half), 2, _LAYERS))
    radius = half.min(axis=1) / (1 + _OVERLAP * (layers - 1))
    inset = (1 + _OVERLAP * np.arange(layers)[:, None]) * radius
    nested = np.maximum(half - inset[..., None], 0).reshape(-1, 2)
    return rr.Boxes2D(
        centers=np.tile(centre, (layers, 1)),
        half_sizes=nested,
        radii=np.tile(radius, layers),
        colors=OBSTACLE,
        draw_order=0,
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
    settings = scenario.make_planner().as_dict()
    rows = {
        "world": scenario.world,
        "robot": scenario.robot,
        "start": _numbers(manifest.start),
        "goal": _numbers(manifest.goal),
        "seed": scenario.seed,
        "budget": f"{scenario.iterations:,} iterations"
        + (f", {scenario.time:g} s" if scenario.time else ""),
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


def _cell(value: object) -> str:
    return str(value).replace("|", "\\|").replace("\n", " ")


def _numbers(values: tuple[float, ...]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def blueprint(manifest: Manifest, world: World) -> Any:  # noqa: ANN401 - a rerun Blueprint
    """Lay out the world, the plots, the log and the manifest, with the time at the start."""
    axis = rrb.TimeAxis(view_range=rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()))
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
        rrb.TimePanel(state="collapsed", timeline="iteration", play_state="paused", fps=100),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _world_view(manifest: Manifest, world: World) -> Any:  # noqa: ANN401
    past = [(name, rrb.TimeRangeBoundary.infinite()) for name in ("iteration", "event", "t")]
    recent = [
        ("iteration", rrb.TimeRangeBoundary.cursor_relative(seq=-FADING_ITERATIONS)),
        ("event", rrb.TimeRangeBoundary.cursor_relative(seq=-FADING_EVENTS)),
        ("t", rrb.TimeRangeBoundary.cursor_relative(seconds=-FADING_SECONDS)),
    ]
    shown = {tree_entity(number): past for number in TREES}
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


def _ranges(starts: list[tuple[str, Any]]) -> Any:  # noqa: ANN401
    now = rrb.TimeRangeBoundary.cursor_relative()
    return rrb.VisibleTimeRanges(
        [rrb.VisibleTimeRange(timeline, start=start, end=now) for timeline, start in starts]
    )
