"""The `brrt` command: its commands, and how errors become one line."""

import sys
from collections.abc import Sequence

import typer

from .console import Code, complain
from .diff import diff
from .explain import explain
from .export import export
from .lists import planners, robots
from .plan import plan
from .plot import plot
from .recover import recover
from .replay import replay
from .saved import naming_runs
from .verify import verify
from .view import view
from .worlds import app as worlds

app = typer.Typer(
    name="brrt",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="""The flight recorder for motion planners.

Run a planner, record every sample, rejection, edge and path with its time, look inside, replay.

[bold]brrt plan[/bold] plans in a random world and writes run.mcap and run.rrd

[bold]brrt replay run.mcap[/bold] rebuilds the run's figures and trees from the file alone

[bold]brrt verify run.mcap[/bold] proves what the planner promises: free, in bounds, costs right

[bold]brrt diff a.mcap b.mcap[/bold] compares two runs, and says where they part


[bold]brrt explain run.mcap[/bold] says why it failed, or took long, and what to try

[bold]brrt view run.mcap[/bold] shows the tree as it grows

[bold]brrt export run.mcap --foxglove viz.mcap[/bold] writes it for Foxglove and Lichtblick

[bold]brrt recover cut.mcap --out whole.mcap[/bold] saves what a killed run left

[bold]brrt planners[/bold] lists what there is to set

Exit codes: 0 solved, equal, holds; 1 no path, differs, broken; 2 bad input; 130 Ctrl-C,
143 SIGTERM, 129 a closed terminal: the files are whole all the same.""",
)

app.command()(plan)
app.command()(naming_runs(replay))
app.command()(naming_runs(plot))
app.command()(verify)
app.command()(diff)
app.command()(naming_runs(explain))
app.command()(naming_runs(export))
app.command()(naming_runs(view))
app.command()(recover)
app.command()(planners)
app.command()(robots)
app.add_typer(worlds, name="worlds")


@app.callback(invoke_without_command=True)
def options(
    version: bool = typer.Option(False, "--version", help="Print the version and leave."),
) -> None:
    """See the help of `app`."""
    if version:
        from importlib.metadata import version as version_of  # noqa: PLC0415

        typer.echo(version_of("brrt"))
        raise typer.Exit


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line; bad input is one line on stderr and exit code 2."""
    sys.exit(_run(args))


def _run(args: Sequence[str] | None) -> int:
    try:
        return int(app(args, prog_name="brrt", standalone_mode=False) or 0)
    except typer.Abort:
        return Code.INTERRUPTED
    except KeyboardInterrupt:
        return Code.INTERRUPTED
    except BrokenPipeError:
        # Whoever read our output has gone: nothing more to say, and nothing to say it to.
        sys.stdout = None
        return Code.FAILED
    except Exception as error:
        # Wrong usage: typer brings its own copy of click, whose classes have no public name.
        usage = getattr(error, "format_message", None)
        if usage is not None:
            complain(f"{usage()} (see brrt --help)")
            return Code.BAD_INPUT
        from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast

        if not isinstance(error, BrrtError):
            raise
        complain(str(error))
    return Code.BAD_INPUT
