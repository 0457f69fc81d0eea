"""`brrt plan`: run a planner and record it."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brrt.shell import file_argument

from .console import SIGNALLED, Code, announce_compilation, console, note, print_json
from .options import At, AtEvent, AtIteration, instant
from .progress import ProgressBar
from .signals import stop_on_signals

if TYPE_CHECKING:
    from brrt.formats.background import BackgroundSink
    from brrt.replay.metrics import Metrics
    from brrt.runs.run import Run


def _option(*names: str, panel: str, **given: Any) -> Any:
    return typer.Option(*names, rich_help_panel=panel, show_default=False, **given)


_POINT = "X,Y[,Z]"


def plan(
    scenario: Annotated[
        Path | None, typer.Argument(help="A TOML file with the settings below; options win.")
    ] = None,
    world: Annotated[
        str | None,
        _option(
            panel="Problem",
            help="A generator with parameters, such as circles2d:n=80,seed=3, or a file. "
            "Default circles2d; listed by brrt worlds. Scattered obstacles and trees closer to the "
            "robot at start or goal than 1 % of the size are left out; the others are the same for "
            "every robot and query.",
        ),
    ] = None,
    robot: Annotated[
        str | None,
        _option(
            panel="Problem",
            help="A robot with parameters, such as polygon:length=4,width=2, or a file. "
            "Default point; listed by brrt robots.",
        ),
    ] = None,
    start: Annotated[
        str | None,
        _option(
            panel="Problem",
            metavar=_POINT,
            help="Start configuration, such as 5,5; or random: a free one drawn from the seed. "
            "Default: the world's.",
        ),
    ] = None,
    goal: Annotated[
        str | None,
        _option(panel="Problem", metavar=_POINT, help="Goal configuration, or random."),
    ] = None,
    planner: Annotated[
        str | None, _option(panel="Planner", help="Default rrt; listed by brrt planners.")
    ] = None,
    param: Annotated[
        list[str] | None,
        _option(
            panel="Planner",
            metavar="NAME=VALUE",
            help="A parameter of the planner, such as step=2; may be repeated.",
        ),
    ] = None,
    seed: Annotated[
        int | None, _option(panel="Planner", help="Seed of all random draws. Default 0.")
    ] = None,
    iterations: Annotated[
        int | None,
        _option(
            panel="Planner",
            help="Limit on iterations, such as 5000 or 1e6. Default: the planner's own, or none "
            "with --time.",
        ),
    ] = None,
    time: Annotated[
        float | None, _option(panel="Planner", help="Limit on seconds. Default none.")
    ] = None,
    smooth: Annotated[
        bool | None,
        _option("--smooth/--no-smooth", panel="Planner", help="Shortcut the path. Default yes."),
    ] = None,
    shortcuts: Annotated[
        int | None, _option(panel="Planner", help="Attempts to shortcut the path. Default 100.")
    ] = None,
    execute: Annotated[
        bool | None,
        _option(
            "--execute/--no-execute",
            panel="Real time",
            help="Follow the path in moves, one in each deadline. Default no.",
        ),
    ] = None,
    max_move: Annotated[
        float | None, _option(panel="Real time", help="Length of a move at most. Default 1.")
    ] = None,
    deadline: Annotated[
        float | None, _option(panel="Real time", help="Seconds for each move. Default 2.")
    ] = None,
    mcap: Annotated[
        Path | None,
        _option(
            "--out",
            panel="Recording",
            help="Write the MCAP recording here. Default run.mcap (branch.mcap with --from) and "
            "run.rrd beside it, if neither --out nor --rrd is given.",
        ),
    ] = None,
    rrd: Annotated[
        Path | None, _option(panel="Recording", help="Write the Rerun recording here.")
    ] = None,
    record: Annotated[
        bool, _option("--record/--no-record", panel="Recording", help="Write files. Default yes.")
    ] = True,
    force: Annotated[
        bool, _option("--force", panel="Recording", help="Overwrite existing files.")
    ] = False,
    view: Annotated[
        bool, _option("--view", panel="Recording", help="Watch the run live in the Rerun viewer.")
    ] = False,
    clock: Annotated[
        str | None,
        _option(
            panel="Recording",
            help="real, or logical: event n at n us, so that equal runs write equal files. "
            "Default real.",
        ),
    ] = None,
    parent: Annotated[
        Path | None,
        _option(
            "--from",
            panel="Branch",
            metavar="RUN",
            help="Continue this recording from the end of planning, or from the instant below, "
            "with other parameters, seed, limits, smoothing or moves. Settings that are not given "
            "stay. Limits count from the start of the recording.",
        ),
    ] = None,
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the summary.")
    ] = False,
) -> None:
    """Run a planner in a world and record every event.

    Examples:
      brrt plan
      brrt plan --world squares2d:n=120 --seed 7 --param step=2 --out seven.mcap
      brrt plan --world map.txt --start 0,0,1 --goal 12,12,5 --time 10 --view
      brrt plan experiment.toml --seed 3 --json
      brrt plan --from run.mcap --at-iteration 100 --param step=2
    """
    limits = instant(at, at_event, at_iteration)
    given = {
        "world": world, "robot": robot, "start": start, "goal": goal, "planner": planner,
        "seed": seed, "iterations": iterations, "time": time, "smooth": smooth,
        "shortcuts": shortcuts, "execute": execute, "max_move": max_move, "deadline": deadline,
        "clock": clock,
    }  # fmt: skip
    settings = {name: value for name, value in given.items() if value is not None}
    mcap, rrd = _outputs(mcap, rrd, parent, record=record, force=force, view=view)
    _check_branch(parent, limits, scenario, mcap, rrd)
    params = _params(param or [])
    announce_compilation()
    with ProgressBar(iterations, "preparing the planner").running() as bar:
        if parent is None:
            run = _new_run(scenario, settings, params)
        else:
            run = _branched_run(parent, limits, settings, params)
        metrics = _execute(run, _sinks(run, mcap, rrd, view=view), bar)
    _report(metrics.as_dict(), mcap, rrd, as_json=as_json)
    if run.stop.interrupted:
        raise typer.Exit(SIGNALLED + run.stop.signal)
    if not metrics.solved:
        raise typer.Exit(Code.FAILED)


def _params(texts: list[str]) -> dict[str, str]:
    """Split the planner's parameters into names and values."""
    from brrt.errors import BrrtError

    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise BrrtError(f"--param {text!r} must read name=value, as step=2")
        found[name.strip()] = value.strip()
    return found


def _outputs(
    mcap: Path | None,
    rrd: Path | None,
    parent: Path | None,
    *,
    record: bool,
    force: bool,
    view: bool,
) -> tuple[Path | None, Path | None]:
    """Return the files to write.

    Raises:
        BrrtError: One of them cannot be written, or the options contradict each other.
    """
    from brrt.errors import BrrtError

    from .output_file import check_display, check_output

    if not record and (mcap or rrd):
        raise BrrtError("--no-record contradicts --out and --rrd; leave one of them out")
    if record and mcap is None and rrd is None:
        name = "run" if parent is None else "branch"
        mcap, rrd = Path(f"{name}.mcap"), Path(f"{name}.rrd")
    check_output(mcap, "--out", ".mcap", force=force)
    check_output(rrd, "--rrd", ".rrd", force=force)
    check_display(view=view)
    return mcap, rrd


def _check_branch(
    parent: Path | None, limits: Mapping[str, int], scenario: Path | None, *outputs: Path | None
) -> None:
    """Raise if the options of a branch contradict each other, or if it would overwrite its parent.

    Raises:
        BrrtError: They do.
    """
    from brrt.errors import BrrtError

    if parent is None:
        if limits:
            raise BrrtError(
                "--at, --at-event and --at-iteration say where to branch; add --from RUN"
            )
        return
    if scenario is not None:
        raise BrrtError(f"--from continues the recorded scenario; leave out {scenario}")
    for path in outputs:
        if path is not None and path.exists() and parent.exists() and path.samefile(parent):
            raise BrrtError(f"{path} is the recording that --from continues; choose another name")


def _new_run(file: Path | None, settings: dict[str, Any], params: dict[str, str]) -> "Run":
    """Prepare a run of the file's scenario, if there is a file, changed by the options."""
    from brrt.planners import check_params, load_scenario
    from brrt.runs.run import Run
    from brrt.scenario.scenario import Scenario

    base = Scenario() if file is None else load_scenario(file)
    values = {**base.as_dict(), **settings}
    kept = values["params"] if values["planner"] == base.planner else {}
    return Run(check_params(Scenario.parse({**values, "params": {**kept, **params}})))


def _branched_run(
    parent: Path, limits: Mapping[str, int], settings: dict[str, Any], params: dict[str, str]
) -> "Run":
    """Prepare a run that continues a recording, and report from where.

    Raises:
        BrrtError: The recording cannot be continued there, or not with these settings.
    """
    from brrt.errors import RecordingError
    from brrt.formats import BrokenError, read
    from brrt.runs.branch import BranchedRun, last_complete_iteration

    seed = settings.pop("seed", None)
    try:
        run = BranchedRun(read(parent), params=params, seed=seed, settings=settings, **limits)
    except BrokenError as error:
        last, _ = last_complete_iteration(read(parent, partial=True).batches(), {})
        if last < 0:
            raise RecordingError(f"{error.fault}; no iteration of planning is whole") from None
        raise RecordingError(
            f"{error.fault}; it is whole as far as iteration {last:,}: branch there at the latest "
            f"(--at-iteration {last})"
        ) from None
    here = run.manifest.branches[-1]
    note(
        f"continues {parent} after iteration {here.iteration:,}; the {here.events:,} events up to "
        "there were planned again and equal the recorded ones"
    )
    return run


def _sinks(
    run: "Run", mcap: Path | None, rrd: Path | None, *, view: bool
) -> Iterator["BackgroundSink"]:
    from brrt.formats import McapSink
    from brrt.formats.background import BackgroundSink

    world = run.problem.world
    if mcap is not None:
        yield BackgroundSink(McapSink(mcap, run.manifest, world), mcap)
    if rrd is not None or view:
        from brrt.views.rerun.sink import RerunSink

        yield BackgroundSink(RerunSink(run.manifest, world, path=rrd, view=view), rrd)


def _execute(run: "Run", sinks: Iterable["BackgroundSink"], bar: ProgressBar) -> "Metrics":
    """Open the sinks, and run until the end or a signal."""
    opened = list["BackgroundSink"]()

    def unfinished() -> list[Path]:
        return [sink.path for sink in opened if sink.path is not None and not sink.closed]

    def show(metrics: "Metrics") -> None:
        best = metrics.best_path
        cost = "" if best is None else f", cost {best[0]:.4g}"
        nodes = metrics.counts[Kind.EDGE]
        figures = f"{metrics.iterations:,} iterations, {nodes:,} nodes{cost}"
        bar.update(metrics.iterations, run.manifest.scenario.planner, figures)

    from brrt.events import Kind

    for line in run.problem.world.notes:
        note(line)
    bar.total = None if run.stop.time_s is not None else run.stop.iterations
    with stop_on_signals(run.stop, unfinished):
        try:
            opened.extend(sinks)  # one by one, so that a signal meanwhile names what is open
        except BaseException:
            for sink in opened:
                sink.close(None)
            raise
        return run.execute(opened, show)


def _report(
    metrics: Mapping[str, Any], mcap: Path | None, rrd: Path | None, *, as_json: bool
) -> None:
    """Print the metrics, and the commands to open the files with."""
    from rich.markup import escape

    from .summary import print_summary

    if as_json:
        print_json(metrics)
        return
    print_summary(metrics)
    shown = rrd or mcap  # brrt view opens the one faster that holds a drawing
    ways = [(mcap, "look inside", "replay"), (shown, "watch it", "view")]
    gap = "\n"
    for path, what, command in ways:
        if path is None:
            continue
        typed = escape(file_argument(path))
        console().print(
            f"{gap}{escape(str(path))}: {what} with [bold]brrt {command} {typed}[/bold]",
            soft_wrap=True,
        )
        gap = ""
