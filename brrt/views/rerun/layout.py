"""What a run looks like in Rerun's viewer: its views and plots, and the page that describes it."""

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from brrt.events import Reason, Source
from brrt.recording import Result
from brrt.scenario.contracts import changes_of, planner_settings
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario
from brrt.text import markdown
from brrt.views.colours import REWIRED, TREE_NAMES
from brrt.views.rerun import draw_world
from brrt.worlds.world import World

LINK_ENTITY, GHOSTS_ENTITY = "/world/link", "/world/path/bodies"
TRACE_ENTITY, ROBOT_ENTITY, BODY_ENTITY = "/world/trace", "/world/robot", "/world/robot/body"
CELLS_ENTITY, SEARCH_ENTITY = "/world/cells/expanded", "/world/cells/search"
CELL_ENTITY, TAIL_ENTITY = "/world/cells/current", "/world/tail"
_GROWING = (TRACE_ENTITY, CELLS_ENTITY, SEARCH_ENTITY)

_TRANSIENT_ITERATIONS, _TRANSIENT_EVENTS, _TRANSIENT_S = 300, 1000, 0.001
"""For how long samples and rejections are shown on each timeline."""
_REWIRED, _TAIL = 5, 12
"""Rewired edges and the robot's last places are shown for one in so many parts of that."""


def recording_id(manifest: Manifest) -> str:
    """Return Rerun's id of a run: equal for runs whose manifests are equal, clock included."""
    return f"{manifest.scenario.planner}-{manifest.digest()[:16]}"


def application(manifest: Manifest, world: World) -> str:
    """Return the name under which a viewer keeps the layout of a run.

    Runs share it only if their configurations have equal shapes, as Rerun requires.
    """
    what = f"{manifest.dim}d"
    if manifest.dof != manifest.dim:
        what += f" {manifest.dof} dof"
    if manifest.scenario.execute:
        what += " driven"
    return draw_world.application(world, what)


def document(manifest: Manifest, result: Result | None = None, coordinates: str = "") -> str:
    """Return a description of a run in Markdown.

    Args:
        manifest: The run's.
        result: Its result, if there is one.
        coordinates: What the coordinates of the drawing stand for, if they are not the world's own.
    """
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
    if coordinates:
        rows["coordinates"] = coordinates
    for branch, change in zip(manifest.branches, changes_of(manifest), strict=True):
        rows[f"at iteration {branch.iteration:,} of {branch.file}"] = change
    rows = _results(result) | rows
    table = "".join(f"| {markdown(name)} | {markdown(value)} |\n" for name, value in rows.items())
    return f"### {markdown(scenario.planner)}\n\n| | |\n|---|---|\n{table}"


def _results(result: Result | None) -> dict[str, str]:
    """Return the rows of a result; those of older recordings lack some keys."""
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


def _numbers(values: tuple[float, ...]) -> str:
    return ", ".join(f"{value:.10g}" for value in values)


def blueprint(manifest: Manifest, world: World, *, live: bool = False) -> rrb.Blueprint:
    """Return the layout of a run: the world, plots, the log and its description.

    A live one follows new events, another one pauses at the start.
    """
    columns = rrb.TextLogColumns(timeline_columns=["iteration"], text_log_columns=["body"])
    log = rrb.TextLogView(origin="/log", name="Log", columns=columns)
    run = rrb.TextDocumentView(origin="/run", name="Run")
    right = rrb.Vertical(*plots(), log, run, row_shares=[3, 3, 3, 3, 4, 5])
    return framed(
        rrb.Horizontal(world_view(world), right, column_shares=[5, 2]),
        executed=manifest.scenario.execute,
        live=live,
    )


def framed(views: Any, *, executed: bool, live: bool = False) -> rrb.Blueprint:
    """Return a layout of views with a collapsed time panel and no other panels.

    A run that executes its path starts on the timeline of events, since all of those moves belong
    to the last iteration.
    """
    return rrb.Blueprint(
        views,
        rrb.TimePanel(
            state="collapsed",
            timeline="event" if executed else "iteration",
            play_state="following" if live else "paused",
            fps=100,
        ),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def plots(*below: str) -> list[rrb.TimeSeriesView]:
    """Return the plots of a run, or of several that are drawn below some entities."""
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
            ("iteration_time", "Time an iteration, us"),
        )
    ]


def world_view(world: World, *, below: str = "", name: str = "World") -> Any:
    """Return the view of a run that is drawn below an entity; it sets how long items are shown."""
    past = _ranges(*3 * [rrb.TimeRangeBoundary.infinite()])
    recent, rewired = _last(1), _last(_REWIRED)
    shown = {f"/world/tree/{name}": past for name in TREE_NAMES}
    shown |= dict.fromkeys(_GROWING, past)
    shown[TAIL_ENTITY] = _last(_TAIL)
    shown |= {f"/world/rewired/{name}": rewired for name in REWIRED}
    shown |= {f"/world/samples/{source.key}": recent for source in Source}
    shown |= {f"/world/rejected/{reason.key}": recent for reason in Reason}
    overrides = {f"{below}{entity}": [ranges] for entity, ranges in shown.items()}
    return draw_world.world_view(world, overrides, below=below, name=name)


def _last(part: int) -> Any:
    """Return time ranges of one in `part` parts of the transient times; it takes a millisecond."""
    begin = rrb.TimeRangeBoundary.cursor_relative
    return _ranges(
        begin(seq=-_TRANSIENT_ITERATIONS // part),
        begin(seq=-_TRANSIENT_EVENTS // part),
        begin(seconds=-_TRANSIENT_S / part),
    )


def _ranges(iteration: Any, event: Any, t: Any) -> Any:
    """Return time ranges from a boundary on each timeline up to the cursor."""
    now, starts = rrb.TimeRangeBoundary.cursor_relative(), (iteration, event, t)
    return rrb.VisibleTimeRanges(
        [
            rrb.VisibleTimeRange(timeline, start=start, end=now)
            for timeline, start in zip(("iteration", "event", "t"), starts, strict=True)
        ]
    )
