"""A run as it stood at an instant: trees, figures, paths, nodes, each folded when asked for."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Any, Protocol

from brrt.errors import BrrtError, unknown
from brrt.events import Events, Instant, Kind
from brrt.replay.cell_history import CellHistory, CellTrace
from brrt.replay.forest import Tree, forest
from brrt.replay.history_records import NodeHistory
from brrt.replay.metrics import Metrics, Path
from brrt.replay.node_history import NodeTrace
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World


class Fold(Protocol):
    """What takes in events, batch by batch."""

    def write(self, events: Events) -> None:
        """Take a batch."""


def feed(
    batches: Iterable[Events], folds: Iterable[Fold], limits: Mapping[str, int]
) -> tuple[int, Instant] | None:
    """Hand the events up to the limits to the folds; read no batch beyond the one that has them.

    Args:
        batches: A log.
        folds: What takes them in.
        limits: The instant, as `Events.until` takes it; the end where it is empty.

    Returns:
        How many events there are and when the last one happened; None if the limits cut them.
    """
    folds = list(folds)
    count, last = 0, Instant(0, 0)
    for batch in batches:
        part = batch.until(**limits) if limits else batch
        for fold in folds:
            fold.write(part)
        if len(part) < len(batch):
            return None
        count, last = count + len(batch), batch.last if len(batch) else last
    return count, last


def instant(
    *, time: float | None = None, event: int | None = None, iteration: int | None = None
) -> dict[str, int]:
    """Return an instant as `Events.until` takes it; empty, the end of the run, if none is given.

    Args:
        time: Seconds since the run began.
        event: Number of the last event.
        iteration: The last iteration.

    Raises:
        BrrtError: More than one is given, or it is no number from 0 on.
    """
    given: dict[str, Any] = {"time": time, "event": event, "iteration": iteration}
    chosen = {name: value for name, value in given.items() if value is not None}
    if len(chosen) > 1:
        raise BrrtError(f"give one of time, event and iteration, not {' and '.join(chosen)}")
    for name, value in chosen.items():
        if not _counts(value) or not value < _FOREVER or (name != "time" and value != int(value)):
            what = "seconds from 0 on" if name == "time" else "a whole number from 0 on"
            raise BrrtError(f"{name} must be {what}, not {value!r:.60}")
    if time is not None:
        return {"t": round(time * 1e9)}
    return {"seq" if name == "event" else name: int(value) for name, value in chosen.items()}


def check_limits(limits: Mapping[str, Any], *others: str) -> None:
    """See that an instant is given as `Events.until` takes it.

    Args:
        limits: The instant, or what was given for one.
        others: Names of arguments that there are beside it, for the message.

    Raises:
        BrrtError: A name is none of an instant, or a value no whole number from 0 on.
    """
    for name, value in limits.items():
        if name not in _COLUMNS:
            raise unknown("argument", name, (*others, *_COLUMNS))
        if value is not None and not (_counts(value) and value == int(value)):
            raise BrrtError(f"{name} must be a whole number from 0 on, not {value!r:.60}")


def _counts(value: Any) -> bool:
    """Whether it is a number from 0 on, and finite."""
    number = isinstance(value, Real) and not isinstance(value, bool)
    return number and bool(0 <= value < math.inf)


_COLUMNS = ("iteration", "seq", "t")
_LIMITS = {"seq": "event", "iteration": "iteration"}
_FOREVER = 9e9
"""Longer than any run, in seconds; its nanoseconds fit into 64 bits. And more than any count."""


class Structure:
    """Keeps the events that trees are rebuilt from."""

    def __init__(self, dof: int) -> None:
        self._dof = dof
        self._batches: list[Events] = []

    def write(self, events: Events) -> None:
        """Take in a batch."""
        kept = {k: t for k in (Kind.EDGE, Kind.REWIRE) if len(t := events[k])}
        if kept:
            self._batches.append(Events(events.dof, kept))

    def forest(self) -> Mapping[int, Tree]:
        """Rebuild the trees.

        Raises:
            RecordingError: The events make no trees.
        """
        return forest(Events.concat(self._dof, self._batches))


@dataclass(frozen=True, eq=False, repr=False)
class Snapshot:
    """A run as it stood at an instant; what is not asked for is not read.

    Attributes:
        manifest: The run's.
        world: Where it took place.
        batches: Call it for the whole log.
        limits: The instant, as `Events.until` takes it; the end where it is empty.
        name: The recording's file; empty where there is none.
    """

    manifest: Manifest
    world: World
    batches: Callable[[], Iterator[Events]]
    limits: Mapping[str, int]
    name: str = ""

    def __repr__(self) -> str:
        scenario = self.manifest.scenario
        instant = ", ".join(
            f"after {value / 1e9:g} s" if name == "t" else f"after {_LIMITS[name]} {value:,}"
            for name, value in self.limits.items()
        )
        run = f"{scenario.planner} in {scenario.world}, seed {scenario.seed}"
        return f"<Moment of {run}: {instant or 'its end'}>"

    @cached_property
    def events(self) -> Events:
        """All events up to the instant and those of it."""
        kept = _Kept()
        self.feed(kept)
        return Events.concat(self.manifest.dof, kept.batches)

    @cached_property
    def forest(self) -> Mapping[int, Tree]:
        """The trees by number: 0 grows from the start, 1 from the goal.

        Raises:
            RecordingError: The log's edges make no trees.
        """
        structure = Structure(self.manifest.dof)
        self.feed(structure)
        return structure.forest()

    @cached_property
    def metrics(self) -> Metrics:
        """The figures, those that `brrt replay` prints: `metrics.as_dict()`."""
        metrics = Metrics(self.manifest)
        self.feed(metrics)
        return metrics

    @property
    def best_path(self) -> Path | None:
        """Cost and waypoints, shape (n, dof), of the path that stood; None where none did."""
        return self.metrics.best_path

    def node(self, node: int, tree: int = 0) -> NodeHistory | CellHistory:
        """Tell what became of a node, or of a cell where the planner searches a lattice.

        Args:
            node: Its number.
            tree: Number of its tree.

        Raises:
            BrrtError: There was no such node.
            RecordingError: The log's edges make no trees.
        """
        robot = self.manifest.make_robot().resolved(self.world)
        trace, cell = NodeTrace(node, tree, self.manifest.dof), CellTrace(node, self.manifest)
        self.feed(trace, cell)
        if trace.has_trees or not cell.has_cells:
            return trace.history(robot, self.world)
        if tree != 0:
            raise BrrtError("a planner on a lattice has cells and no trees; leave the tree out")
        return cell.history(robot)

    def feed(self, *folds: Fold) -> None:
        """Hand the events to folds of yours, such as `Metrics`, in one pass over the file."""
        # What is in memory already need not be read again.
        known = self.__dict__.get("events")
        if known is None:
            feed(self.batches(), folds, self.limits)
        else:
            feed([known], folds, {})


class _Kept:
    """Keeps everything."""

    def __init__(self) -> None:
        self.batches: list[Events] = []

    def write(self, events: Events) -> None:
        """Take in a batch."""
        self.batches.append(events)
