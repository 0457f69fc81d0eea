"""The `brrt` command: the table of its commands, and errors as one line."""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from traceback import print_exception
from typing import Any

import typer
from typer.main import get_command

from .command import Command, Group
from .console import SIGNALLED, Code, complain, note
from .streams import output_error, robust_streams

_COMMANDS = {
    "plan": "plan",
    "replay": "replay",
    "plot": "plot",
    "verify": "verify",
    "diff": "diff",
    "explain": "explain",
    "export": "export",
    "view": "view",
    "recover": "recover",
    "record": "record",
    "planners": "lists",
    "robots": "lists",
    "worlds": "worlds",
    "include-dir": "include_dir",
}
"""The module of each command. It is imported when the command runs, or for the list of all."""


class _Commands(Mapping[str, Any]):
    """The commands by name: a function of that name, or the module's `app` if it has one."""

    def __getitem__(self, name: str) -> Any:
        module = import_module(f".{_COMMANDS[name]}", __package__)
        app = getattr(module, "app", None)
        if app is None:
            app = typer.Typer(add_completion=False)
            settings, command = getattr(module, "SETTINGS", None), name.replace("-", "_")
            app.command(name, cls=Command, context_settings=settings)(getattr(module, command))
        return get_command(app)

    def __iter__(self) -> Iterator[str]:
        return iter(_COMMANDS)

    def __len__(self) -> int:
        return len(_COMMANDS)


class _Brrt(Group):
    """The group of all commands."""

    def __init__(self, *args: Any, **given: Any) -> None:
        super().__init__(*args, **given)
        self.commands: Any = _Commands()

    def invoke(self, ctx: Any) -> Any:
        """Run a command; typer would take an EOFError for Ctrl-D at a prompt, of which none is."""
        try:
            return super().invoke(ctx)
        except EOFError as error:
            raise RuntimeError(f"a file ends too early: {error}") from error


app = typer.Typer(
    name="brrt",
    cls=_Brrt,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def options(
    version: bool = typer.Option(False, "--version", help="Print the version and exit."),
) -> None:
    """The flight recorder for motion planners.

    Run a planner and record every sample, rejection, edge and path with its time.
    Then replay the recording, verify it, compare, explain and draw it, from the file alone.

    A first tour:
      [bold]brrt plan[/bold]              plan in a random world, write run.mcap and run.rrd
      [bold]brrt replay run.mcap[/bold]   the metrics and the trees of the run
      [bold]brrt verify run.mcap[/bold]   check the run against what its planner promises
      [bold]brrt view run.rrd[/bold]      watch the trees grow

    Exit codes: 0 solved, equal, verified; 1 no path, different, a rule is broken;
    2 bad input, or output that cannot be written; 130 Ctrl-C, 143 SIGTERM, 129 terminal
    closed. After a signal the files are complete up to that moment.
    """
    if version:
        from importlib.metadata import version as version_of

        typer.echo(version_of("brrt"))
        raise typer.Exit


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line; bad input is one line on stderr and exit code 2."""
    with robust_streams():
        try:
            code = _run(args)
        except SystemExit as ended:
            code = int(ended.code or 0)
        error = output_error()
        if error is not None:
            complain(f"cannot write: {error.strerror}")
            code = code if code > SIGNALLED else Code.BAD_INPUT
    sys.exit(code)


def _run(args: Sequence[str] | None) -> int:
    from brrt.registry import on_broken

    on_broken(note)
    try:
        return int(app(args, prog_name="brrt", standalone_mode=False) or 0)
    except (typer.Abort, KeyboardInterrupt):
        return Code.INTERRUPTED
    except Exception as error:  # noqa: BLE001 - reported
        # Wrong usage: typer brings its own copy of click, whose classes have no public name.
        usage = getattr(error, "format_message", None)
        if usage is not None:
            if usage():  # empty where the help is printed instead of a command
                where = getattr(getattr(error, "ctx", None), "command_path", "brrt")
                complain(f"{usage()} (see {where} --help)")
            return Code.BAD_INPUT
        from brrt.errors import BrrtError
        from brrt.output_names import TakenError

        if _short_of_memory(error):
            complain("the memory does not suffice; free some, or use a smaller world or budget")
        elif isinstance(error, BrrtError | OSError):
            for each in (error, error.__context__):  # where both files of a run have another name
                if each is error or isinstance(each, TakenError):
                    complain(str(each))
        else:
            print_exception(error)  # Python would end with code 1, which says "no path"
    return Code.BAD_INPUT


def _short_of_memory(error: Exception) -> bool:
    """Whether an allocation failed, or under a limit what fails when libraries are not mapped."""
    if isinstance(error, MemoryError) or str(error) == "can't start new thread":
        return True
    from brrt.errors import address_space

    library = isinstance(error, ImportError) or "shared object" in str(error)
    return library and math.isfinite(address_space())
