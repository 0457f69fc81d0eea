"""The adapter of `brrt record`: an unchanged script that plans with OMPL becomes recordings."""

from collections.abc import Callable
from functools import wraps
from types import ModuleType
from typing import Any

from brrt.errors import BrrtError
from brrt.recorder.adapters import Adapter, Solves, when_imported


class OmplAdapter(Adapter):
    """OMPL's planners: each SimpleSetup.solve and Planner.solve.

    Nothing is known of the script's obstacles, so nothing is said of collisions.
    """

    def install(self, solves: Solves) -> Callable[[], None]:
        """See `Adapter.install`."""
        hooked: list[tuple[Any, Any]] = []

        def hook(module: ModuleType) -> None:
            for kind in list(vars(module).values()):
                if isinstance(kind, type) and "solve" in vars(kind):
                    solve = vars(kind)["solve"]
                    hooked.append((kind, solve))
                    kind.solve = _recording(solve, solves)  # type: ignore[attr-defined]

        end = when_imported("ompl.geometric", hook)

        def undo() -> None:
            end()
            for kind, solve in hooked:
                kind.solve = solve

        return undo


def _recording(original: Callable[..., Any], solves: Solves) -> Callable[..., Any]:
    """Return a `solve` that records."""

    @wraps(original)
    def solve(subject: Any, *request: Any, **named: Any) -> Any:
        from brrt.ompl.session import Options, prepare  # noqa: PLC0415 - imports ompl

        name = f"{type(subject).__name__}.solve"
        arguments = (*request, *named.values())
        try:
            file = solves.next_file()
            tracker, limit = prepare(subject, arguments, file, Options(), must_record=False)
        except BrrtError as error:
            solves.failed(name, error)
            return original(subject, *request, **named)
        status = tracker.solve(lambda condition: original(subject, condition), limit)
        if tracker.error is not None:
            solves.failed(name, tracker.error)
        return status

    return solve
