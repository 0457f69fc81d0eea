"""`brrt record`: run a script unchanged, and record what its planners do."""

import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brrt.replay.text import counted

from .console import SIGNALLED, Code, complain, note
from .options import Force

if TYPE_CHECKING:
    from brrt.recorder.adapters import Adapter, Solves

SETTINGS = {"allow_interspersed_args": False, "ignore_unknown_options": True}
"""What follows the script, or `-m`, is its own."""


def record(
    script: Annotated[
        list[str] | None,
        typer.Argument(
            help="A Python script, or -m and a module, and its arguments.",
            metavar="SCRIPT ARGS",
            show_default=False,
        ),
    ] = None,
    folder: Annotated[
        Path, typer.Option("--out", help="Folder of the recordings; it is made.", metavar="DIR")
    ] = Path(),
    adapter: Annotated[
        list[str] | None,
        typer.Option(
            help="Record only this kind of planners; may be repeated. Default: all that --list "
            "names.",
            metavar="NAME",
        ),
    ] = None,
    force: Force = False,
    names: Annotated[bool, typer.Option("--list", help="List the adapters, and end.")] = False,
) -> None:
    """Run a Python script, and record each solve of its planners.

    The script is not changed: it is run as by python SCRIPT ARGS, or python -m MODULE
    ARGS. Adapters recognize planners in it; each solve is a recording
    DIR/SCRIPT-1.mcap, DIR/SCRIPT-2.mcap ... They are listed on stderr at the end.

    Exit code: the script's own; 2 if it is 0 and nothing was recorded.

    Examples:
      brrt record rrt.py
      brrt record --out runs rrt.py --seed 3
      brrt record -m planning.demo
    """
    from brrt.recorder.adapters import Solves
    from brrt.recorder.log import log

    if names:
        _print_adapters()
        return
    target, args, module = _target(script or [])
    stem = target.rpartition(".")[2] if module else Path(target).stem
    adapters = _adapters(adapter)
    _check_folder(folder, stem, force=force)
    solves = Solves(folder.absolute(), stem, complain)  # the script may go to another folder
    before = log.recordings
    code = _run(target, args, adapters, solves, module=module)
    recorded = [path for path in solves.files if path.exists()]
    for path in recorded:
        note(_line(path, folder / path.name))
    # A script may also record by itself, by brrt.record.
    if code == 0 and not recorded and log.recordings == before:
        complain(
            f"{target}: no solve was recorded; brrt record --list names the planners that are "
            "recognized, and brrt.record records any other from its code"
        )
        code = Code.BAD_INPUT
    raise typer.Exit(code)


def _print_adapters() -> None:
    from brrt.recorder.adapters import ADAPTERS

    from .console import print_rows

    kinds = ADAPTERS.working()
    print_rows(
        [
            {
                "adapter": name,
                "package": ADAPTERS.package(name),
                "records": (kind.__doc__ or "").strip().split("\n")[0],
            }
            for name, kind in kinds.items()
        ]
    )


def _target(given: list[str]) -> tuple[str, list[str], bool]:
    """Return what to run, its arguments, and whether it is a module.

    Raises:
        BrrtError: It is missing, or an option is unknown.
    """
    from brrt.errors import BrrtError

    module = given[:1] == ["-m"]
    given = given[1:] if module else given
    if not given:
        raise BrrtError("name a script: brrt record SCRIPT ARGS, or brrt record -m MODULE ARGS")
    if given[0].startswith("-"):
        raise BrrtError(
            f"unknown option {given[0]}; options of the script follow its name (see brrt record "
            "--help)"
        )
    if not module and not Path(given[0]).is_file():
        raise BrrtError(f"{given[0]}: no such file; name a Python script")
    return given[0], given[1:], module


def _adapters(names: list[str] | None) -> "list[Adapter]":
    from brrt.errors import unknown
    from brrt.recorder.adapters import ADAPTERS

    for name in names or ():
        if name not in ADAPTERS:
            raise unknown("adapter", name, ADAPTERS)
    kinds = ADAPTERS.working() if not names else {name: ADAPTERS[name] for name in names}
    return [kind() for kind in kinds.values()]


def _check_folder(folder: Path, stem: str, *, force: bool) -> None:
    """Make the folder of the recordings.

    Raises:
        BrrtError: It has recordings of the same name, or cannot be made.
    """
    from brrt.errors import BrrtError

    pattern = re.compile(re.escape(stem) + r"-\d+\.mcap")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        found = sorted(path.name for path in folder.iterdir() if pattern.fullmatch(path.name))
    except OSError as error:
        raise BrrtError(f"--out {folder}: {error.strerror}") from None
    if found and not force:
        raise BrrtError(
            f"{folder / found[0]}: exists already; choose another folder by --out or add --force"
        )


def _run(
    target: str, args: list[str], adapters: "list[Adapter]", solves: "Solves", *, module: bool
) -> int:
    """Run the script; return the exit code that Python would end with."""
    import brrt
    from brrt.recorder.script import ScriptError, hide_frames, run_script

    try:
        with _as_python():
            try:
                run_script(target, args, adapters, solves, module=module)
            except SystemExit as ended:
                return _code(ended.code)
            except ScriptError:
                raise
            except BaseException as error:  # noqa: BLE001 - the script's own, as Python shows it
                hide_frames(error, [Path(brrt.__file__).parent, Path(__file__).parent])
                sys.excepthook(type(error), error, error.__traceback__)
                interrupted = isinstance(error, KeyboardInterrupt)
                return SIGNALLED + signal.SIGINT if interrupted else 1
    finally:
        with suppress(OSError):
            sys.stderr.flush()
    return 0


def _code(code: Any) -> int:
    """Return the exit code of SystemExit; what is no number is printed, as Python does."""
    if code is None or isinstance(code, int):
        return int(code or 0)
    print(code, file=sys.stderr)  # noqa: T201 - the script's own words
    return 1


@contextmanager
def _as_python() -> Iterator[None]:
    """Give a script the streams and the Ctrl-C that Python gives it."""
    streams = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = sys.__stdout__ or streams[0], sys.__stderr__ or streams[1]
    before = {
        number: signal.signal(number, handler)
        for number, handler in (
            (signal.SIGINT, signal.default_int_handler), (signal.SIGALRM, signal.SIG_DFL),
        )
    }  # fmt: skip
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        sys.stdout, sys.stderr = streams


def _line(path: Path, name: Path) -> str:
    """Say what a recording holds."""
    from brrt.errors import BrrtError
    from brrt.formats import read

    try:
        found = read(path).result
    except BrrtError as error:
        return str(error)
    if found is None:
        return f"{name}: is cut; save it with brrt recover"
    cost = f", path cost {found['path_cost']:.6g}" if found["solved"] else ""
    return f"{name}: {counted(found['events'], 'event')}, {found['status']}{cost}"
