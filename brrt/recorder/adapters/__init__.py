"""Adapters: record the solves of planners in scripts that are not changed, for `brrt record`."""

from collections.abc import Callable
from typing import Protocol

from brrt.recorder.adapters.solves import Solves
from brrt.registry import Registry


class Adapter(Protocol):
    """Hooks into one kind of planners while a script runs; it is made without arguments.

    The first line of an adapter's docstring is shown to users.
    """

    def install(self, solves: Solves) -> Callable[[], None]:
        """Hook in, and return what takes the hooks out again.

        It is called before the script begins, so it must not import the package that it hooks
        into: `imports.when_imported` calls it back once the script itself has imported that.
        What it hooks in must not change what the script does: the script's exceptions pass
        through, and errors of brrt go to `solves.failed`, not to the script.

        Args:
            solves: Opens a recording for each solve.
        """


ADAPTERS: Registry[Callable[[], Adapter]] = Registry({})

__all__ = ["ADAPTERS", "Adapter", "Solves"]
