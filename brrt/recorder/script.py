"""Run a script unchanged, as Python runs it, with adapters that record its planners."""

import builtins
import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, TracebackType

from brrt.errors import BrrtError
from brrt.files import read_bytes
from brrt.recorder.adapters import Adapter, Solves
from brrt.recorder.adapters.classes import DECORATOR, announced, compile_script

_MOST_BYTES = 64_000_000


class ScriptError(BrrtError):
    """A script cannot be read, or there is none."""


def run_script(
    target: str, args: Sequence[str], adapters: Iterable[Adapter], solves: Solves, *, module: bool
) -> None:
    """Run a script as the module `__main__`, with `sys.argv` and `sys.path` as Python sets them.

    What the script raises is raised, SystemExit too; recordings that are open then are closed.

    Args:
        target: The script's file, or the name of a module.
        args: Its arguments.
        adapters: What records planners.
        solves: Opens the recordings.
        module: Whether it is a module, as in `python -m`.

    Raises:
        ScriptError: The script cannot be read, or there is no such module.
    """
    with ExitStack() as hooks:
        hooks.callback(solves.close)
        for adapter in adapters:
            hooks.callback(adapter.install(solves))
        main = _module(target) if module else _script(target)
        name = str(main.__file__)
        try:
            source = read_bytes(Path(name), "a script", _MOST_BYTES)
        except BrrtError as error:
            raise ScriptError(str(error)) from None
        main.__dict__.update({"__builtins__": builtins, DECORATOR: announced})
        sys.argv = [name if module else target, *args]
        sys.modules["__main__"] = main
        exec(compile_script(source, name), main.__dict__)  # noqa: S102 - what the user asks for


def _script(target: str) -> ModuleType:
    """Return an empty module for a script, whose folder is where its imports come from."""
    sys.path[0] = os.path.dirname(os.path.realpath(target))  # noqa: PTH120 - as Python does
    main, file = ModuleType("__main__"), str(Path(target).absolute())
    main.__file__, main.__loader__ = file, SourceFileLoader("__main__", file)
    return main


def _module(name: str) -> ModuleType:
    """Return an empty module for `python -m name`; packages that it is in are imported.

    Raises:
        ScriptError: There is none, or it is not in Python.
    """
    sys.path[0] = str(Path.cwd())
    try:
        spec = find_spec(name)
        if spec is not None and spec.submodule_search_locations is not None:
            spec = find_spec(f"{name}.__main__")
    except (ModuleNotFoundError, ValueError) as error:
        raise ScriptError(f"-m {name}: {error}") from None
    if spec is None or not isinstance(spec.loader, SourceFileLoader):
        raise ScriptError(f"-m {name}: there is no such module in Python that can be run")
    main = ModuleType("__main__")
    main.__spec__, main.__loader__, main.__package__ = spec, spec.loader, spec.parent
    main.__file__ = spec.origin
    return main


def hide_frames(error: BaseException, folders: Sequence[Path]) -> None:
    """Take the frames of files in folders out of the tracebacks of an error and its causes."""
    seen, waiting = set[int](), [error]
    while waiting:
        each = waiting.pop()
        if id(each) in seen:
            continue
        seen.add(id(each))
        each.__traceback__ = _shown(each.__traceback__, folders)
        group = each.exceptions if isinstance(each, BaseExceptionGroup) else ()
        waiting += [e for e in (each.__cause__, each.__context__, *group) if e is not None]


def _shown(trace: TracebackType | None, folders: Sequence[Path]) -> TracebackType | None:
    kept = list[TracebackType]()
    while trace is not None:
        file = Path(trace.tb_frame.f_code.co_filename)
        if not any(file.is_relative_to(folder) for folder in folders):
            kept.append(trace)
        trace = trace.tb_next
    first: TracebackType | None = None
    for each in reversed(kept):
        each.tb_next, first = first, each
    return first
