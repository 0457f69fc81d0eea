"""What an adapter is."""

from abc import ABC, abstractmethod
from collections.abc import Callable

from brrt.recorder.adapters.solves import Solves


class Adapter(ABC):
    """Hooks into one kind of planners while a script runs; it is made without arguments.

    The first line of an adapter's docstring is shown to users. What it hooks in must not change
    what the script does: the script's exceptions pass through, and errors of brrt go to
    `Solves.failed`.
    """

    @abstractmethod
    def install(self, solves: Solves) -> Callable[[], None]:
        """Hook in, and return what takes the hooks out again.

        It is called before the script begins, so it must not import the package that it hooks
        into: `imports.when_imported` calls it back once the script itself has imported that, and
        `classes.when_defined` once the script has defined a class.

        Args:
            solves: Opens a recording for each solve.
        """
