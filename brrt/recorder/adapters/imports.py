"""Call back once a script has imported a module."""

import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

Wanted = Callable[[ModuleSpec], bool]
OnImport = Callable[[ModuleType], None]


class _Finder:
    """Stands before the other finders of modules, and calls back for what they have loaded."""

    def __init__(self, wanted: Wanted, call: OnImport) -> None:
        self._wanted, self._call = wanted, call

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return what the finders after this one find, with a loader that calls back."""
        rest = sys.meta_path[sys.meta_path.index(self) + 1 :]
        for finder in rest:
            find = getattr(finder, "find_spec", None)
            spec: ModuleSpec | None = find(name, path, target) if find else None
            if spec is not None:
                loader: Any = spec.loader
                if hasattr(loader, "__dict__") and self._wanted(spec):
                    loader.exec_module = partial(self._execute, loader.exec_module)
                return spec
        return None

    def _execute(self, execute: OnImport, module: ModuleType) -> None:
        execute(module)
        self._call(module)


def when_imported(wanted: str | Wanted, call: OnImport) -> Callable[[], None]:
    """Call back after each import of a module; at once if it is imported already.

    Args:
        wanted: The module's full name, or what says by its spec whether it is wanted.
        call: Takes the module, right after its code has run. What it raises is raised by the
            import.

    Returns:
        What ends it.
    """
    if isinstance(wanted, str):
        loaded = sys.modules.get(wanted)
        if loaded is not None:
            call(loaded)
        name = wanted
        finder = _Finder(lambda spec: spec.name == name, call)
    else:
        finder = _Finder(wanted, call)
    sys.meta_path.insert(0, finder)
    return partial(sys.meta_path.remove, finder)
