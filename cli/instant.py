"""The instant of a run that a user asks for, and the events up to it."""

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from .console import note

if TYPE_CHECKING:
    from brrt.events import Events, Instant


def limits_of(at: str | None, event: int | None, iteration: int | None) -> dict[str, int]:
    """Return the instant asked for, as `Events.until` takes it."""
    from brrt.errors import BrrtError  # noqa: PLC0415

    given = {"t": at, "seq": event, "iteration": iteration}
    chosen = {name: value for name, value in given.items() if value is not None}
    if len(chosen) > 1:
        raise BrrtError("give one of --at, --at-event and --at-iteration")
    if at is not None:
        return {"t": _nanoseconds(at)}
    limits = {name: int(value) for name, value in chosen.items()}
    if any(value < 0 for value in limits.values()):
        raise BrrtError("--at-event and --at-iteration count from 0")
    return limits


def _nanoseconds(text: str) -> int:
    from brrt.errors import BrrtError  # noqa: PLC0415

    match = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*(s|ms|us|ns)?", text.strip())
    if match is None:
        raise BrrtError(f"--at must be a time like 1.5s, 20ms or 300us, not {text!r}")
    unit = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}[match[2] or "s"]
    return int(float(match[1]) * unit)


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


def note_if_beyond(limits: dict[str, int], count: int, last: "Instant") -> None:
    """Say so where the instant asked for lies after the end of the recording."""
    ends = {"seq": count - 1, "t": last.t, "iteration": last.iteration}
    texts = {
        "seq": f"with event {count - 1:,}",
        "t": f"at {last.t / 1e9:.6f} s",
        "iteration": f"with iteration {last.iteration:,}",
    }
    for name, limit in limits.items():
        if limit > ends[name]:
            note(f"the recording ends {texts[name]}; this is how it stood then")
