"""The instant of a run that a user asks for, and the events up to it."""

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any

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
    from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast

    given = {"t": at, "seq": event, "iteration": iteration}
    chosen = {name: value for name, value in given.items() if value is not None}
    if len(chosen) > 1:
        raise BrrtError("give one of --at, --at-event and --at-iteration")
    if at is not None:
        return {"t": _nanoseconds(at)}
    found = {name: int(value) for name, value in chosen.items()}
    if any(value < 0 for value in found.values()):
        raise BrrtError("--at-event and --at-iteration count from 0")
    return found


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


def feed(
    batches: "Iterable[Events]", sinks: list[Any], limits: dict[str, int]
) -> "tuple[int, Instant] | None":
    """Hand the events up to the limits to the sinks.

    Returns:
        How many events there are and when the last one happened; None if the limits cut them.
    """
    from brrt.events import Instant  # noqa: PLC0415

    count, last = 0, Instant(0, 0)
    for batch in batches:
        part = batch.until(**limits) if limits else batch
        for sink in sinks:
            sink.write(part)
        if len(part) < len(batch):
            return None
        count, last = count + len(batch), batch.last if len(batch) else last
    return count, last


def _nanoseconds(text: str) -> int:
    from brrt.errors import BrrtError  # noqa: PLC0415

    match = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*(s|ms|us|ns)?", text.strip())
    if match is None:
        raise BrrtError(f"--at must be a time like 1.5s, 20ms or 300us, not {text!r}")
    unit = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}[match[2] or "s"]
    return int(float(match[1]) * unit)
