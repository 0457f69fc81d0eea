"""The instant of a run that a user asks for."""

import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from brrt.events import Events, Instant

At = Annotated[
    str | None,
    typer.Option(
        help="As it stood at this time of the run, as 1.5s, 20ms or 300us.",
        metavar="TIME",
        rich_help_panel="Instant",
    ),
]
AtEvent = Annotated[
    int | None, typer.Option(help="As it stood after this event.", rich_help_panel="Instant")
]
AtIteration = Annotated[
    int | None, typer.Option(help="As it stood after this iteration.", rich_help_panel="Instant")
]


def instant(at: str | None, event: int | None, iteration: int | None) -> dict[str, int]:
    """Return the instant asked for, as `Events.until` takes it; empty if there is none.

    Raises:
        BrrtError: It is no time, lies before the start, or more than one is given.
    """
    from brrt import recording  # noqa: PLC0415
    from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast

    if sum(value is not None for value in (at, event, iteration)) > 1:
        raise BrrtError("give one of --at, --at-event and --at-iteration")
    if any(value is not None and value < 0 for value in (event, iteration)):
        raise BrrtError("--at-event and --at-iteration count from 0")
    time = None if at is None else _seconds(at)
    return recording.instant(time=time, event=event, iteration=iteration)


def beyond(limits: dict[str, int], count: int, last: "Instant") -> str | None:
    """Say how the recording ends if the instant asked for lies after that.

    Args:
        limits: The instant.
        count: Events that there are.
        last: When the last of them happened.
    """
    ends = {"seq": count - 1, "t": last.t, "iteration": last.iteration}
    texts = {
        "seq": f"with event {count - 1:,}",
        "t": f"at {last.t / 1e9:.6f} s",
        "iteration": f"with iteration {last.iteration:,}",
    }
    for name, limit in limits.items():
        if limit > ends[name]:
            return f"the recording ends {texts[name]}"
    return None


class Counted:
    """Yields batches and keeps count, so that `beyond` can be asked how far they went."""

    def __init__(self, batches: "Iterable[Events]") -> None:
        from brrt.events import Instant  # noqa: PLC0415 - keep --help fast

        self._batches = batches
        self.count, self.last = 0, Instant(0, 0)

    def __iter__(self) -> "Iterator[Events]":
        for batch in self._batches:
            self.count += len(batch)
            self.last = batch.last if len(batch) else self.last
            yield batch


def _seconds(text: str) -> float:
    from brrt.errors import BrrtError  # noqa: PLC0415

    match = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*(s|ms|us|ns)?", text.strip())
    if match is None:
        raise BrrtError(f"--at must be a time like 1.5s, 20ms or 300us, not {text!r}")
    return float(match[1]) * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[match[2] or "s"]
