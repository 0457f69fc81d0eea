"""The adapter of `brrt record`: an unchanged script that plans with OMPL becomes recordings."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

from brrt.errors import BrrtError


class OmplAdapter:
    """OMPL's planners: each SimpleSetup.solve and Planner.solve is a recording."""

    def install(self, solves: Any) -> Callable[[], None]:
        """Hook into OMPL once the script has imported it; return what takes the hooks out.

        Args:
            solves: Names the files, and takes errors that the script must not notice.
        """
        when_imported = import_module("brrt.recorder.adapters.imports").when_imported
        hooked: list[tuple[Any, Any]] = []

        def hook(module: Any) -> None:
            classes: list[Any] = [each for each in vars(module).values() if isinstance(each, type)]
            for kind in classes:
                if "solve" in vars(kind):
                    hooked.append((kind, kind.solve))
                    kind.solve = _recording(kind.solve, solves)

        forget = when_imported("ompl.geometric", hook)

        def undo() -> None:
            forget()
            for kind, solve in hooked:
                kind.solve = solve
            hooked.clear()

        return undo


def _recording(original: Callable[..., Any], solves: Any) -> Callable[..., Any]:
    """Return a `solve` that records."""

    def solve(subject: Any, *request: Any, **named: Any) -> Any:
        """Plan; see the documentation of OMPL."""
        from brrt.ompl.session import Options, prepare  # noqa: PLC0415 - imports ompl

        name = f"{type(subject).__name__}.solve"
        arguments = (*request, *named.values())
        try:
            tracker, limit = prepare(
                subject, arguments, solves.next_file(), Options(), must_record=False
            )
        except BrrtError as error:
            solves.failed(name, error)
            return original(subject, *request, **named)
        status = tracker.solve(lambda condition: original(subject, condition), limit)
        if tracker.error is not None:
            solves.failed(name, tracker.error)
        return status

    return solve
