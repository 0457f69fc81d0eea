"""`brrt plan`: run a planner and record it."""

import shlex
import signal
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from .console import SIGNALLED, Code, Watch, note, out, print_json, print_summary, tell_of_compiling
from .instants import At, AtEvent, AtIteration, instant
from .numbers import whole_number
from .signals import stop_on_signals

if TYPE_CHECKING:
    from brrt.recording import Sink
    from brrt.replay.metrics import Metrics
    from brrt.runs.run import Run
    from brrt.scenario.scenario import Scenario


def plan(
    scenario: Annotated[
        Path | None, typer.Argument(help="A TOML file with the settings below; options win.")
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(
            help="A generator with parameters, as circles2d:n=80,seed=3, or a file. "
            "Default circles2d; brrt worlds lists them.",
            rich_help_panel="Problem",
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            help="A robot with parameters, as polygon:length=4,width=2, or a file. "
            "Default point; brrt robots lists them.",
            rich_help_panel="Problem",
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            help="Start configuration, as 5,5 or 1,2,3, or random: a free one, from the seed.",
            metavar="X,Y[,Z]",
            rich_help_panel="Problem",
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            help="Goal configuration, or random.", metavar="X,Y[,Z]", rich_help_panel="Problem"
        ),
    ] = None,
    planner: Annotated[
        str | None,
        typer.Option(help="Default rrt; brrt planners lists them.", rich_help_panel="Planner"),
    ] = None,
    param: Annotated[
        list[str] | None,
        typer.Option(
            help="A planner's parameter, as step=2; may be repeated.",
            metavar="NAME=VALUE",
            rich_help_panel="Planner",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of every random draw. Default 0.", rich_help_panel="Planner"),
    ] = None,
    iterations: Annotated[
        int | None,
        typer.Option(
            help="Iterations before giving up, as 5000 or 1e6. Default: the planner's own; with "
            "--time, no limit.",
            parser=whole_number,
            metavar="INTEGER",
            rich_help_panel="Planner",
        ),
    ] = None,
    time: Annotated[
        float | None,
        typer.Option(help="Seconds before giving up. Default none.", rich_help_panel="Planner"),
    ] = None,
    smooth: Annotated[
        bool | None,
        typer.Option(
            "--smooth/--no-smooth",
            help="Shortcut the path. Default yes.",
            rich_help_panel="Planner",
            show_default=False,
        ),
    ] = None,
    shortcuts: Annotated[
        int | None,
        typer.Option(help="Attempts of the smoother. Default 100.", rich_help_panel="Planner"),
    ] = None,
    execute: Annotated[
        bool | None,
        typer.Option(
            "--execute/--no-execute",
            help="Drive the path in moves, one in each deadline. Default no.",
            rich_help_panel="Real time",
            show_default=False,
        ),
    ] = None,
    max_move: Annotated[
        float | None,
        typer.Option(help="Longest move. Default 1.", rich_help_panel="Real time"),
    ] = None,
    deadline: Annotated[
        float | None,
        typer.Option(help="Seconds for each move. Default 2.", rich_help_panel="Real time"),
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Write the MCAP recording here. Default run.mcap (branch.mcap with --from), with "
            "run.rrd beside it, where neither --out nor --rrd is given.",
            rich_help_panel="Recording",
        ),
    ] = None,
    rrd: Annotated[
        Path | None,
        typer.Option(help="Write the Rerun recording here.", rich_help_panel="Recording"),
    ] = None,
    record: Annotated[
        bool, typer.Option("--record/--no-record", help="Write files.", rich_help_panel="Recording")
    ] = True,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite files.", rich_help_panel="Recording")
    ] = False,
    view: Annotated[
        bool,
        typer.Option(
            "--view", help="Watch it live in the Rerun viewer.", rich_help_panel="Recording"
        ),
    ] = False,
    parent: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="Go on from this recording, from the end of planning or from the instant below, "
            "with other parameters, seed, budget, smoothing or moves; what is not given stays. "
            "Budgets count from the start of the recording.",
            metavar="RUN",
            rich_help_panel="Branch",
        ),
    ] = None,
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    clock: Annotated[
        str | None,
        typer.Option(
            help="real, or logical: event n at n us, so that the file is the same in each run.",
            rich_help_panel="Recording",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the summary.")
    ] = False,
) -> None:
    """Run a planner in a world and record every event.

    brrt plan

    brrt plan --world squares2d:n=120,seed=4 --seed 7 --param step=2 --out seven.mcap

    brrt plan --world map.txt --start 0,0,1 --goal 12,12,5 --time 10 --view

    brrt plan experiment.toml --seed 3 --json

    brrt plan --from run.mcap --at-iteration 100 --param step=2
    """
    from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast
    from brrt.runs.run import Run  # noqa: PLC0415

    from .outputs import check_display, check_output  # noqa: PLC0415

    if not record and (mcap or rrd):
        raise BrrtError("--no-record contradicts --out and --rrd; leave one of them out")
    limits = instant(at, at_event, at_iteration)
    if limits and parent is None:
        raise BrrtError(
            "--at, --at-event and --at-iteration say where to branch --from a recording"
        )
    if record and mcap is None and rrd is None:
        name = "run" if parent is None else "branch"
        mcap, rrd = Path(f"{name}.mcap"), Path(f"{name}.rrd")
    check_output(mcap, "--out", ".mcap", force=force)
    check_output(rrd, "--rrd", ".rrd", force=force)
    check_display(view=view)
    given = {
        "world": world, "robot": robot, "start": start, "goal": goal, "planner": planner,
        "seed": seed, "iterations": iterations, "time": time, "smooth": smooth,
        "shortcuts": shortcuts, "execute": execute, "max_move": max_move, "deadline": deadline,
        "clock": clock,
    }  # fmt: skip
    wanted = {name: value for name, value in given.items() if value is not None}
    if parent is None:
        settings = _merged(scenario, wanted, param or [])
        prepare = partial(Run, settings)
    else:
        from .branch import check_parent, go_on  # noqa: PLC0415

        check_parent(parent, scenario, mcap, rrd)
        prepare = partial(go_on, parent, limits, wanted, _params(param or []))
    tell_of_compiling()
    with Watch(iterations, "preparing the planner").running() as watch:
        run = prepare()
        for line in run.problem.world.notes:
            note(line)
        watch.total = None if run.stop.time_s is not None else run.stop.iterations
        with stop_on_signals(run.stop):
            metrics = run.execute(_sinks(run, mcap, rrd, view=view), lambda m: _show(m, watch))
    try:
        _report(metrics, mcap, rrd, as_json=as_json)
    except OSError:
        if run.stop.signal != signal.SIGHUP:
            raise
        sys.stdout = None  # nobody is left to read it: the terminal was closed
    if run.stop.interrupted:
        raise typer.Exit(SIGNALLED + run.stop.signal)
    if not metrics.solved:
        raise typer.Exit(Code.FAILED)


def _merged(file: Path | None, given: dict[str, Any], params: list[str]) -> "Scenario":
    """Put what was given on the command line on top of the file, if there is one."""
    from brrt.planners import check_params, load_scenario  # noqa: PLC0415
    from brrt.scenario.scenario import Scenario  # noqa: PLC0415

    base = Scenario() if file is None else load_scenario(file)
    values = {**base.as_dict(), **given}
    if values["planner"] != base.planner:
        values["params"] = {}
    values["params"] = {**values["params"], **_params(params)}
    return check_params(Scenario.parse(values))


def _params(texts: list[str]) -> dict[str, str]:
    """Read the planner's parameters."""
    from brrt.errors import BrrtError  # noqa: PLC0415

    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise BrrtError(f"--param {text!r} must read name=value, as step=2")
        found[name.strip()] = value.strip()
    return found


def _sinks(run: "Run", mcap: Path | None, rrd: Path | None, *, view: bool) -> list["Sink"]:
    from brrt.formats import McapSink  # noqa: PLC0415
    from brrt.formats.background import BackgroundSink  # noqa: PLC0415

    world, sinks = run.problem.world, list["Sink"]()
    if mcap is not None:
        sinks.append(BackgroundSink(McapSink(mcap, run.manifest, world)))
    if rrd is not None or view:
        from brrt.views.rerun.sink import RerunSink  # noqa: PLC0415 - costs half a second

        sinks.append(BackgroundSink(RerunSink(run.manifest, world, path=rrd, view=view)))
    return sinks


def _show(metrics: "Metrics", watch: Watch) -> None:
    figures = metrics.as_dict()
    cost = "" if figures["path_cost"] is None else f", cost {figures['path_cost']:.4g}"
    watch.update(
        metrics.iterations,
        figures["planner"],
        f"{metrics.iterations:,} iterations, {figures['nodes']:,} nodes{cost}",
    )


def _report(metrics: "Metrics", mcap: Path | None, rrd: Path | None, *, as_json: bool) -> None:
    figures = metrics.as_dict()
    if as_json:
        print_json(figures)
        return
    print_summary(figures)
    shown = rrd or mcap  # what is drawn already opens sooner
    ways = [(mcap, "look inside", "replay"), (shown, "watch it", "view")]
    for number, (path, what, command) in enumerate(way for way in ways if way[0] is not None):
        typed = escape(shlex.quote(str(path)))
        gap = "" if number else "\n"
        out.print(
            f"{gap}{escape(str(path))}: {what} with [bold]brrt {command} {typed}[/bold]",
            soft_wrap=True,
        )
