"""A run as plain data, and where its events go: `Recording`, `Sink` and `Memory`."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, Protocol

from brrt.errors import BrrtError, unknown
from brrt.events import Events, Kind
from brrt.robots import Robot
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World

Result = Mapping[str, Any]
"""The metrics of a whole run, under the names that `--json` prints."""

Limits = Mapping[str, int]
"""An instant, as `Events.until` takes it; the end of the run where it is empty."""


class Sink(Protocol):
    """Where the events of a run go."""

    def write(self, events: Events) -> None:
        """Take a batch; an empty one asks the sink to write what it has buffered for too long."""

    def close(self, result: Result | None) -> None:
        """Release everything.

        Args:
            result: The run's metrics; None if the run did not come to its own end.
        """


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Recording:
    """A run that was recorded, in a file or in memory.

    Attributes:
        manifest: What was run.
        world: The world that it ran in.
        batches: Returns the events in batches, in order; each call reads them anew.
        result: The metrics that the writer stored at the end; None if the run's end is missing.
        counts: Events of each kind, as the end of the file states them; None if it does not.
        name: Name of the file without its folder; empty for a run in memory.
    """

    manifest: Manifest
    world: World
    batches: Callable[[], Iterable[Events]]
    result: Result | None = None
    counts: Mapping[Kind, int] | None = None
    name: str = ""

    def __repr__(self) -> str:
        scenario, result = self.manifest.scenario, self.result
        end = "the run's end is missing"
        if result is not None:
            end = f"{result.get('events')} events, {result.get('status')}"
        run = f"{scenario.planner} in {scenario.world}, seed {scenario.seed}"
        return f"<Recording {self.name or 'in memory'}: {run}; {end}>"

    def events(self) -> Events:
        """Return all events as one batch."""
        return Events.concat(self.manifest.dof, self.batches())

    def until(self, **limits: int | None) -> "Recording":
        """Return the run up to an instant, see `Events.until`, with its events in memory."""
        events = self.events().until(**limits)
        if any(limit is not None for limit in limits.values()):
            return replace(self, batches=lambda: (events,), result=None, counts=None)
        return replace(self, batches=lambda: (events,))

    def robot(self) -> Robot:
        """Return the robot of the run, with all its settings resolved in the world."""
        return self.manifest.make_robot().resolved(self.world)

    def to_pandas(self, **instant: Any) -> dict[str, Any]:
        """Return the run as data frames by name: one for each kind of event, nodes, best path.

        Args:
            instant: `time`, `event` or `iteration`, as `brrt.snapshot` takes them.

        Raises:
            BrrtError: pandas is missing, or the instant is wrong.
        """
        from brrt.exports.frames import to_pandas  # noqa: PLC0415 - it imports this module

        return to_pandas(self, **instant)

    def to_networkx(self, **instant: Any) -> Any:
        """Return the trees, or the cells of a search, as a `networkx.DiGraph`.

        Args:
            instant: `time`, `event` or `iteration`, as `brrt.snapshot` takes them.

        Raises:
            BrrtError: networkx is missing, or the instant is wrong.
            LogError: The events do not make trees.
        """
        from brrt.exports.graphs import to_networkx  # noqa: PLC0415 - it imports this module

        return to_networkx(self, **instant)


class Memory:
    """A sink that keeps every batch.

    Attributes:
        batches: The batches so far.
        result: The metrics, once the run has come to its own end.
    """

    def __init__(self) -> None:
        self.batches: list[Events] = []
        self.result: Result | None = None

    def write(self, events: Events) -> None:
        """Keep a batch."""
        self.batches.append(events)

    def close(self, result: Result | None) -> None:
        """Keep the metrics."""
        self.result = result

    def events(self) -> Events:
        """Return all events as one batch.

        Raises:
            ValueError: Nothing was written.
        """
        if not self.batches:
            raise ValueError("nothing has been recorded")
        return Events.concat(self.batches[0].dof, self.batches)

    def recording(self, manifest: Manifest, world: World, name: str = "") -> Recording:
        """Return what was kept as a recording of the run with this manifest and world."""
        return Recording(manifest, world, lambda: self.batches, self.result, name=name)


_COLUMNS = ("iteration", "seq", "t")
_LONGEST_S = 9e9
"""Longer than any run, in seconds; its nanoseconds fit into 64 bits. More than any count, too."""


def instant(
    *, time: float | None = None, event: int | None = None, iteration: int | None = None
) -> dict[str, int]:
    """Return an instant as `Events.until` takes it; empty, the run's end, if none is given.

    Args:
        time: Seconds since the run began.
        event: Number of the last event.
        iteration: The last iteration.

    Raises:
        BrrtError: More than one is given, or a value is not a number from 0 on.
    """
    given: dict[str, Any] = {"time": time, "event": event, "iteration": iteration}
    chosen = {name: value for name, value in given.items() if value is not None}
    if len(chosen) > 1:
        raise BrrtError(f"give one of time, event and iteration, not {' and '.join(chosen)}")
    for name, value in chosen.items():
        whole = name == "time" or (_counts(value) and value == int(value))
        if not (_counts(value) and value < _LONGEST_S and whole):
            what = "seconds from 0 on" if name == "time" else "a whole number from 0 on"
            raise BrrtError(f"{name} must be {what}, not {value!r:.60}")
    if time is not None:
        return {"t": round(time * 1e9)}
    return {"seq" if name == "event" else name: int(value) for name, value in chosen.items()}


def check_limits(limits: Mapping[str, Any], *others: str) -> None:
    """Check that keyword arguments are an instant as `Events.until` takes it.

    Args:
        limits: The keyword arguments.
        others: Names of the other arguments of the function, for the message.

    Raises:
        BrrtError: A name is unknown, or a value is not a whole number from 0 on.
    """
    for name, value in limits.items():
        if name not in _COLUMNS:
            raise unknown("argument", name, (*others, *_COLUMNS))
        if value is not None and not (_counts(value) and value == int(value)):
            raise BrrtError(f"{name} must be a whole number from 0 on, not {value!r:.60}")


def _counts(value: Any) -> bool:
    """Whether a value is a finite number from 0 on."""
    number = isinstance(value, Real) and not isinstance(value, bool)
    return number and bool(0 <= value < math.inf)
