"""`brrt.ompl`: record the planners of OMPL, which the extra `ompl` brings.

    with brrt.ompl.record(setup, "run.mcap", world=world):
        setup.solve(5.0)

Importing this imports neither ompl nor numba.
"""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brrt.errors import BrrtError
from brrt.robots import Robot
from brrt.scenario.claims import Claims
from brrt.worlds import World

if TYPE_CHECKING:
    from brrt.ompl.session import Session

__all__ = ["record"]


def record(
    subject: Any,
    path: Path | str,
    *,
    exact: bool = False,
    world: World | Path | str | None = None,
    robot: Robot | Path | str | None = None,
    goal: Any = None,
    seed: int = 0,
    claims: Claims | Mapping[str, Any] | None = None,
) -> "Session":
    """Record each `solve` of an OMPL planner; use it in a `with` statement.

    Args:
        subject: An `ompl.geometric.SimpleSetup`; or a planner with its problem definition, whose
            own `solve` is called.
        path: The .mcap file of the first solve; it is overwritten. Further ones are `run-2.mcap`
            and so on, beside it.
        exact: Whether to read the planner's data in each iteration: then nothing is inferred, and
            it takes time in proportion to the tree. By default it is read once the tree may have
            doubled, or after 0.25 s.
        world: Where it plans, as `brrt.record` takes it; without it nothing can be said of
            collisions.
        robot: What moves, as `brrt.record` takes it. By default a point in R^2 and R^3, and else
            one that is not known.
        goal: A goal configuration for goals that are regions, shape (dof,).
        seed: Of the planner's random draws, for readers.
        claims: Claims that replace what is known of the planner; see `brrt.Claims`.

    Raises:
        BrrtError: OMPL is not installed, or the subject is neither a setup nor a planner.
    """
    try:
        import_module("ompl.geometric")
    except ImportError as error:
        raise BrrtError(
            f"ompl cannot be imported ({error}); install it by pip install 'brrt[ompl]'"
        ) from None
    from brrt.ompl.session import Options, Session  # noqa: PLC0415 - imports ompl

    options = Options(exact, world, robot, goal, seed, claims)
    return Session(subject, Path(path), options)
