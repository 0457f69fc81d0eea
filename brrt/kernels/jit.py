"""How kernels are compiled, and where their compiled code is cached."""

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

from brrt.kernels.cache import KernelCache
from brrt.kernels.private_folder import fault_of_folder, make_private

config: Any = _config

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parents[1]
_SOURCES = ("events.py", "kernels", "planners")


def _sources_digest() -> str:
    """Digest of all files that kernels are compiled from.

    Numba checks only the time of the file that it compiles, so without this a kernel would keep the
    old version of a helper that was edited in another file.
    """
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__}".encode())
    for name in _SOURCES:
        path = _PACKAGE / name
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> tuple[Path | None, str]:
    """Make the folder for compiled code; return it, or None and the reason why there is none."""
    given = os.environ.get("BRRT_CACHE_DIR")
    root = Path(given) if given else user_cache_path("brrt", appauthor=False)
    folder = root
    try:
        for folder in (root, root / "kernels", root / "kernels" / _sources_digest()):
            make_private(folder)
            fault = fault_of_folder(folder, shared=folder == root)
            if fault is not None:
                return None, f"{folder} is not used: {fault}"
    except OSError as error:
        return None, f"{folder}: {error.strerror or error}"
    return folder, ""


CACHE_FOLDER, WITHOUT_CACHE = _cache_folder()
"""The folder for compiled code, and why there is none."""


class _FirstCompilation(event.Listener):
    def __init__(self, notify: Callable[[], None]) -> None:
        self._notify: Callable[[], None] | None = notify

    def on_start(self, event: Any) -> None:  # noqa: ARG002
        notify, self._notify = self._notify, None
        if notify is not None:
            notify()

    def on_end(self, event: Any) -> None:
        pass


def on_compiling(notify: Callable[[], None]) -> None:
    """Call `notify` once, before the first function that is not in the cache is compiled."""
    event.register("numba:compile", _FirstCompilation(notify))


def kernel(fn: F) -> F:
    """Compile a function that Python calls.

    In nopython mode with IEEE semantics, without the GIL, cached on disk. No fastmath: the same
    seed gives the same bits on every machine.
    """
    return _compiled(fn, {"_nrt": False})


def prepared(fn: F, *args: Any) -> F:
    """Compile or load a kernel for arguments of these types, and return its entry point.

    At each call of a kernel numba determines the types of all arrays in its arguments. For a
    planner that takes 50 us, five times that with cold caches, which is longer than many queries
    take to solve. The entry point needs no types; call it with arguments of the same types.
    """
    if config.DISABLE_JIT:
        return fn
    dispatcher: Any = fn
    signature = tuple(numba.typeof(arg) for arg in args)
    dispatcher.compile(signature)
    return cast("F", dispatcher.overloads[signature].entry_point)


def inline_helper(fn: F) -> F:
    """Compile a function into every kernel that calls it; Python cannot call it."""
    return _compiled(fn, INLINE_HELPER)


def helper(fn: F) -> F:
    """Compile a function that kernels call, only once: one that is long or rarely called."""
    return _compiled(fn, HELPER)


HELPER: dict[str, Any] = {
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "nogil": True,
    "error_model": "numpy",
}
"""Options of a function that kernels call. Numba would count the references to each array of a
NamedTuple at each call, atomically, which takes most of a loop's time. Without that (`_nrt`), the
function must not allocate or keep an array. Without wrappers for Python it compiles in two thirds
of the time."""

INLINE_HELPER: dict[str, Any] = {**HELPER, "forceinline": True}


def _compiled(fn: F, options: dict[str, Any]) -> F:
    if config.DISABLE_JIT:
        return fn
    dispatcher: Any = numba.njit(**{"nogil": True, "error_model": "numpy", **options})(fn)
    if CACHE_FOLDER is not None:
        _cache(dispatcher, CACHE_FOLDER)
    resolve = dispatcher.get_call_template
    dispatcher.get_call_template = lambda args, kws: resolve(
        tuple(map(_plain, args)), {k: _plain(v) for k, v in kws.items()}
    )
    if options.get("no_cpython_wrapper"):
        _refuse_python(dispatcher)
    return cast("F", dispatcher)


def _cache(dispatcher: Any, folder: Path) -> None:
    """Let numba load and save compiled code in a folder."""
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        dispatcher._cache = KernelCache(dispatcher.py_func)  # noqa: SLF001 - what `cache=True` sets
    finally:
        config.CACHE_DIR = before


def _plain(argument: Any) -> Any:
    """Return the type that a callee is compiled for: int64 for all integers, no literals.

    Otherwise numba compiles it again for each constant and each width of an argument. That takes
    twice as long, and inlining propagates constants anyway.
    """
    argument = types.unliteral(argument)
    return types.int64 if isinstance(argument, types.Integer) else argument


def _refuse_python(dispatcher: Any) -> None:
    """Raise an error when Python calls the function, which has no wrapper and would crash."""

    def refuse(*args: Any, **kwargs: Any) -> None:  # noqa: ARG001
        name = dispatcher.py_func.__qualname__
        raise TypeError(f"{name} can only be called by kernels; call it from a @kernel function")

    def keep(compiled: Any) -> None:
        dispatcher.overloads[tuple(compiled.signature.args)] = compiled

    dispatcher._compile_for_args = refuse  # noqa: SLF001 - what a call from Python ends up in
    dispatcher.add_overload = keep
