"""`brrt plan --from`: go on from a recording with other settings."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .console import note

if TYPE_CHECKING:
    from brrt.runs.run import Run


def check_parent(parent: Path, scenario: Path | None, *outputs: Path | None) -> None:
    """See that what is asked for goes together with a recording to go on from.

    Raises:
        BrrtError: It does not.
    """
    from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast

    if scenario is not None:
        raise BrrtError(f"--from goes on with the recorded scenario; leave out {scenario}")
    for path in outputs:
        if path is not None and path.exists() and parent.exists() and path.samefile(parent):
            raise BrrtError(
                f"{path} is the recording that --from goes on from; choose another name"
            )


def go_on(
    parent: Path, limits: Mapping[str, int], given: dict[str, Any], params: Mapping[str, str]
) -> "Run":
    """Make the run that goes on from a recording, and say from where.

    Args:
        parent: The recording.
        limits: The instant, as `Events.until` takes it; empty for the end of planning.
        given: Settings of the scenario that were given.
        params: The planner's parameters that were given.

    Raises:
        BrrtError: There is nothing to go on from, or a setting is of no use.
    """
    from brrt.errors import RecordingError  # noqa: PLC0415
    from brrt.formats import BrokenError, read  # noqa: PLC0415
    from brrt.runs.branch import BranchedRun, last_complete_iteration  # noqa: PLC0415

    seed = given.pop("seed", None)
    try:
        run = BranchedRun(read(parent), params=params, seed=seed, settings=given, **limits)
    except BrokenError as error:
        last, _ = last_complete_iteration(read(parent, partial=True).batches(), {})
        if last < 0:
            raise RecordingError(f"{error.fault}; nothing of planning is whole") from None
        raise RecordingError(
            f"{error.fault}; it is whole as far as iteration {last:,}: branch there at the latest "
            f"(--at-iteration {last})"
        ) from None
    here = run.manifest.branches[-1]
    note(
        f"goes on from {parent} behind iteration {here.iteration:,}; the {here.events:,} events "
        "up to there were planned again and are the recorded ones"
    )
    return run
