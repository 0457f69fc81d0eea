"""What a recording looks like in Rerun: colours, the still parts of the picture, the layout."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from brrt.events import Reason, Source, Stage
from brrt.robots import Robot
from brrt.scenario.contracts import changes_of, planner_settings
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario
from brrt.views.colours import GOAL, START, Colour
from brrt.views.rerun import draw_world
from brrt.worlds.world import World

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
TRACE_ON_CELLS: Mapping[int, Colour] = {2: (24, 26, 34), 3: (130, 132, 146)}
"""By dimensions: in 2D it lies on the cells that were visited, in 3D among them."""
ROBOT: Colour = (255, 255, 255)
NEWEST: Colour = (120, 170, 235)
LINK_ENTITY, GHOSTS_ENTITY = "/world/link", "/world/path/bodies"
TRACE_ENTITY, ROBOT_ENTITY, BODY_ENTITY = "/world/trace", "/world/robot", "/world/robot/body"
CELLS_ENTITY, SEARCH_ENTITY = "/world/cells/expanded", "/world/cells/search"
CELL_ENTITY, TAIL_ENTITY = "/world/cells/current", "/world/tail"
_GROWING = (TRACE_ENTITY, CELLS_ENTITY, SEARCH_ENTITY)

_HEAT = ((98, 74, 190), (54, 110, 200), (30, 158, 164), (112, 196, 92), (250, 224, 60))
"""From cheap to dear, bright enough all the way for a dark ground."""
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
_BRIEFER, _TAIL = 5, 12
"""Rewired edges stay for a part of that: there may be several in an iteration. The places that a
robot has just left stay for another part."""


_TIMELINES = ("iteration", "event", "t")


def is_flat(manifest: Manifest) -> bool:
    """Whether the picture is drawn in 2D."""
    return manifest.dim == 2


def application(manifest: Manifest, world: World) -> str:
    """Name what shares a layout with a run, and can: Rerun wants configurations to be alike."""
    what = f"{manifest.dim}d"
    if manifest.dof != manifest.dim:
        what += f" {manifest.dof} dof"
    if manifest.scenario.execute:
        what += " driven"
    return draw_world.application(world, what)


def tree_style(number: int) -> tuple[str, Colour]:
    """Return a tree's name and colour."""
    return _TREES.get(number, (str(number), OTHER))


def path_style(stage: Stage) -> tuple[str, Colour, float]:
    """Return a path's name, its colour, and its lines' radius in points of the screen."""
    return (stage.key, *_PATHS.get(stage, (OTHER, 2.0)))


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
    draw_world.log_world(rec, world)
    robot = manifest.make_robot()
    marks = (("start", manifest.start, START), ("goal", manifest.goal, GOAL))
    for name, q, colour in marks:
        body = [np.concatenate([part, part[:1]]) for part in robot.outline(np.array(q))]
        if body:
            outline = rr.LineStrips2D(body, colors=colour, radii=-1.5, draw_order=90)
            rec.log(f"/world/{name}/body", outline, static=True)
        draw_world.log_mark(rec, world, name, places([q], robot), colour)


def document(manifest: Manifest, figures: Mapping[str, Any] | None = None) -> str:
    """Describe the run in Markdown; with its figures once it is over."""
    scenario = manifest.scenario
    settings = planner_settings(manifest)[-1]
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
    for branch, change in zip(manifest.branches, changes_of(manifest), strict=True):
        rows[f"at iteration {branch.iteration:,} of {branch.file}"] = change
    rows = _results(figures) | rows
    table = "".join(f"| {name} | {_cell(value)} |\n" for name, value in rows.items())
    return f"### {_cell(scenario.planner)}\n\n| | |\n|---|---|\n{table}"


def _results(result: Mapping[str, Any] | None) -> dict[str, str]:
    """Return the rows of a run that ended; a result may lack keys that came later."""
    if result is None:
        return {}
    iterations = result.get("iterations", 0)
    rows = {
        "status": f"{result.get('status')} after {iterations:,} iteration{'s' * (iterations != 1)}"
    }
    what = "expanded" if result.get("expanded") else "nodes"
    rows[what] = f"{result.get(what, 0):,}"
    if result.get("plan_time_s") is not None:
        rows["planning"] = f"{result['plan_time_s'] * 1e3:.4g} ms"
    for name, key in (("path", "path_cost"), ("smoothed", "smoothed_cost")):
        if result.get(key) is not None:
            rows[name] = f"{result[key]:.6g}"
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
    log = rrb.TextLogView(
        origin="/log",
        name="Log",
        columns=rrb.TextLogColumns(timeline_columns=["iteration"], text_log_columns=["body"]),
    )
    run = rrb.TextDocumentView(origin="/run", name="Run")
    right = rrb.Vertical(*plots(), log, run, row_shares=[3, 3, 3, 3, 4, 5])
    return rrb.Blueprint(
        rrb.Horizontal(world_view(world), right, column_shares=[5, 2]),
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


def plots(*below: str) -> list[rrb.TimeSeriesView]:
    """Lay out the plots of a run, or of several that were drawn below some entities."""
    axis = rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()
        )
    )
    return [
        rrb.TimeSeriesView(
            origin="/" if below else f"/series/{entity}",
            contents=[f"{each}/series/{entity}/**" for each in below] or "$origin/**",
            name=name,
            axis_x=axis,
        )
        for entity, name in (
            ("nodes", "Nodes"),
            ("cost", "Path cost"),
            ("extensions", "Extensions, %"),
            ("pace", "Time an iteration, us"),
        )
    ]


def world_view(world: World, *, below: str = "", name: str = "World") -> Any:
    """Lay out a view of a run; what is shown for a moment and what stays is set here.

    Args:
        world: The world.
        below: The entity below which the run was drawn.
        name: The view's.
    """
    past = _ranges(*[(name, rrb.TimeRangeBoundary.infinite()) for name in _TIMELINES])
    recent, just_now = _last(1), _last(_BRIEFER)
    shown = {f"/world/tree/{name}": past for name, _ in _TREES.values()}
    shown |= dict.fromkeys(_GROWING, past)
    shown[TAIL_ENTITY] = _last(_TAIL)
    shown |= {f"/world/rewired/{name}": just_now for name in REWIRED}
    shown |= {f"/world/samples/{source.key}": recent for source in Source}
    shown |= {f"/world/rejected/{reason.key}": recent for reason in Reason}
    overrides = {f"{below}{entity}": [ranges] for entity, ranges in shown.items()}
    return draw_world.world_view(world, overrides, below=below, name=name)


def _last(part: int) -> Any:
    """Show what came within a part of the fading times; making this takes a millisecond."""
    begin = rrb.TimeRangeBoundary.cursor_relative
    return _ranges(
        ("iteration", begin(seq=-FADING_ITERATIONS // part)),
        ("event", begin(seq=-FADING_EVENTS // part)),
        ("t", begin(seconds=-FADING_SECONDS / part)),
    )


def _ranges(*starts: tuple[str, Any]) -> Any:
    now = rrb.TimeRangeBoundary.cursor_relative()
    return rrb.VisibleTimeRanges(
        [rrb.VisibleTimeRange(timeline, start=start, end=now) for timeline, start in starts]
    )
