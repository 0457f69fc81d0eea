"""The one place that knows how kernels are compiled, and where the compiled code is kept."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba import types
from numba.core import config as _config
from numba.core import event
from platformdirs import user_cache_path

config: Any = _config

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parents[1]
_SOURCES = ("events.py", "kernels", "planners")


def _sources_digest() -> str:
    """Digest of everything that a kernel is compiled from.

    Numba looks at the time of the calling file alone, so a helper that was edited in another file
    would go on running as it was.
    """
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__}".encode())
    for name in _SOURCES:
        place = _PACKAGE / name
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    """Make the folder for compiled code; None where nothing can be written."""
    root = os.environ.get("BRRT_CACHE_DIR")
    folder = Path(root) if root else user_cache_path("brrt", appauthor=False)
    folder = folder / "kernels" / _sources_digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) else None


CACHE_FOLDER = _cache_folder()


class _FirstCompilation(event.Listener):
    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell: Callable[[], None] | None = tell

    def on_start(self, event: Any) -> None:  # noqa: ARG002
        tell, self._tell = self._tell, None
        if tell is not None:
            tell()

    def on_end(self, event: Any) -> None:
        pass


def on_compiling(tell: Callable[[], None]) -> None:
    """Call `tell` once, as soon as something has to be compiled that is not kept from before."""
    event.register("numba:compile", _FirstCompilation(tell))


def kernel(fn: F) -> F:
    """Compile a loop that Python calls.

    Nopython mode with IEEE semantics, without the GIL, cached on disk. No fastmath: the same seed
    gives the same bits on every machine.
    """
    return _compiled(fn, {"_nrt": False})


def prepared(fn: F, *args: Any) -> F:
    """Compile or load a kernel for arguments like these, and return its way in.

    Numba looks up the type of every array in every argument at each call, 50 us for a planner's
    and five times that with cold caches: longer than many a query takes to solve. The way in that
    is returned knows them already; give it arguments of the same types.
    """
    if config.DISABLE_JIT:
        return fn
    dispatcher: Any = fn
    signature = tuple(numba.typeof(arg) for arg in args)
    dispatcher.compile(signature)
    return cast("F", dispatcher.overloads[signature].entry_point)


def inline_helper(fn: F) -> F:
    """Compile `fn` as `kernel` does, into every kernel that calls it; Python cannot call it."""
    return _compiled(fn, INLINED)


def helper(fn: F) -> F:
    """Compile `fn` as `inline_helper` does, but only once: for what is long or seldom called."""
    return _compiled(fn, BORROWING)


BORROWING: dict[str, Any] = {
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "nogil": True,
    "error_model": "numpy",
}
"""A call counts references to each array of a NamedTuple, atomically; in a loop of a microsecond
that is most of the time. So what a kernel calls borrows its arguments, and neither makes nor keeps
an array. Without the wrappers for Python it compiles in two thirds of the time."""

INLINED: dict[str, Any] = {**BORROWING, "forceinline": True}


def _compiled(fn: F, options: dict[str, Any]) -> F:
    before = config.CACHE_DIR
    config.CACHE_DIR = str(CACHE_FOLDER or "")
    try:
        both = {"cache": CACHE_FOLDER is not None, "nogil": True, "error_model": "numpy", **options}
        dispatcher = numba.njit(**both)(fn)
    finally:
        config.CACHE_DIR = before
    if config.DISABLE_JIT:
        return fn
    resolve = dispatcher.get_call_template
    dispatcher.get_call_template = lambda args, kws: resolve(
        tuple(map(_plain, args)), {k: _plain(v) for k, v in kws.items()}
    )
    if options.get("no_cpython_wrapper"):
        _refuse_python(dispatcher)
    return cast("F", dispatcher)


def _plain(argument: Any) -> Any:
    """Return the type that a callee is compiled for: one for all integers, none for constants.

    Numba compiles it anew for each constant and each width that it is called with; a kernel would
    take twice as long to compile, for nothing that inlining does not bring anyway.
    """
    argument = types.unliteral(argument)
    return types.int64 if isinstance(argument, types.Integer) else argument


def _refuse_python(dispatcher: Any) -> None:
    """Let a call from Python be an error; without a wrapper it would be a crash."""

    def refuse(*args: Any, **kwargs: Any) -> None:  # noqa: ARG001
        name = dispatcher.py_func.__qualname__
        raise TypeError(f"{name} is called by kernels alone; call it from a @kernel function")

    def keep(compiled: Any) -> None:
        dispatcher.overloads[tuple(compiled.signature.args)] = compiled

    dispatcher._compile_for_args = refuse  # noqa: SLF001 - what a call from Python ends up in
    dispatcher.add_overload = keep
