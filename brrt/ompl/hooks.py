"""Validators that note what a planner checks, and ask the planner's own whether it is free."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter_ns
from typing import Any, Protocol

from ompl import base

from brrt.ompl.spaces import Read

_PARTIAL_MOTIONS = ("KPIECE1", "LBKPIECE1")
"""Planners that use how far a blocked motion is free. A validator in Python cannot tell them
(ompl 2.0.1), and would change what they do: of these the configurations are followed."""


class Follower(Protocol):
    """What follows a planner: `brrt.ompl.tracker.Tracker`."""

    iteration: int
    read: Read
    checks: list[float]
    by_checks: bool

    def asked(self) -> bool:
        """Count an iteration of a planner whose stop condition is not followed."""

    def stop(self, raised: BaseException) -> None:
        """Stop such a planner, and keep an exception until it has ended."""


@contextmanager
def hooked(planner: Any, follower: Follower) -> Iterator[None]:
    """Let checks of motions, or of configurations, be noted; put all back at the end."""
    information = planner.getSpaceInformation()
    validator, checker = information.getMotionValidator(), information.getStateValidityChecker()
    in_python = type(validator) is not base.MotionValidator
    motions = in_python or type(planner).__name__ not in _PARTIAL_MOTIONS
    if motions:
        information.setMotionValidator(_validator(information, validator, follower))
    else:
        information.setStateValidityChecker(_noting(checker, follower))
    information.setup()  # setting either undoes that
    try:
        yield
    finally:
        if motions:
            information.setMotionValidator(validator)
        else:
            information.setStateValidityChecker(checker)
        information.setup()


def _validator(information: Any, inner: Any, follower: Follower) -> Any:
    """Return a validator that notes each motion that another one checks."""
    free, read, note = inner.checkMotion, follower.read, follower.checks.extend
    by_checks = follower.by_checks

    class Validator(base.MotionValidator):  # type: ignore[misc]
        """Notes motions."""

        def checkMotion(self, a: Any, b: Any) -> bool:  # noqa: N802 - OMPL's name
            """Return whether a motion is free."""
            is_free: bool = free(a, b)
            note((perf_counter_ns(), follower.iteration, is_free, *read(a, b)))
            return is_free

    class CountingValidator(Validator):
        """Notes motions of a planner whose stop condition is not followed."""

        def checkMotion(self, a: Any, b: Any) -> bool:  # noqa: N802 - OMPL's name
            """Return whether a motion is free."""
            try:
                is_free: bool = super().checkMotion(a, b)
                follower.asked()
            except BaseException as error:  # noqa: BLE001 - raised after `solve`
                follower.stop(error)
                return False
            return is_free

    return (CountingValidator if by_checks else Validator)(information)


def _noting(checker: Any, follower: Follower) -> Callable[[Any], bool]:
    """Return a validity checker that notes the configurations that another one finds free."""
    valid, read, note = checker.isValid, follower.read, follower.checks.extend

    def is_valid(state: Any) -> bool:
        found: bool = valid(state)
        if found:
            note((perf_counter_ns(), follower.iteration, True, *read(state, state)))
        return found

    return is_valid
