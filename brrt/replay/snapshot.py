"""A run at an instant: trees, metrics, paths, nodes, each folded when it is asked for."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

from brrt.errors import BrrtError
from brrt.events import Events, Instant, Kind
from brrt.recording import Limits, Memory, Recording, instant
from brrt.replay.cell_history import CellHistory, CellTrace
from brrt.replay.forest import Tree, forest
from brrt.replay.history_records import NodeHistory
from brrt.replay.metrics import Metrics, Path
from brrt.replay.node_history import NodeTrace


class Fold(Protocol):
    """What takes in events, batch by batch."""

    def write(self, events: Events) -> None:
        """Take a batch."""


def feed(
    batches: Iterable[Events], folds: Iterable[Fold], limits: Limits
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


def until(batches: Iterable[Events], limits: Limits) -> Iterator[Events]:
    """Yield the events up to an instant; read no batch beyond the one that holds it."""
    for batch in batches:
        part = batch.until(**limits) if limits else batch
        yield part
        if len(part) < len(batch):
            return


_LIMITS = {"seq": "event", "iteration": "iteration"}


@dataclass(frozen=True, eq=False, repr=False)
class Snapshot:
    """A run at an instant. Each property is folded from the events when it is first used.

    Attributes:
        recording: The run.
        limits: The instant, as `Events.until` takes it; the end of the run where it is empty.
    """

    recording: Recording
    limits: Limits = field(default_factory=dict)

    def __repr__(self) -> str:
        scenario = self.recording.manifest.scenario
        instant = ", ".join(
            f"after {value / 1e9:g} s" if name == "t" else f"after {_LIMITS[name]} {value:,}"
            for name, value in self.limits.items()
        )
        run = f"{scenario.planner} in {scenario.world}, seed {scenario.seed}"
        return f"<Snapshot of {run}: {instant or 'its end'}>"

    @cached_property
    def events(self) -> Events:
        """All events up to the instant."""
        kept = Memory()
        self.feed(kept)
        return Events.concat(self.recording.manifest.dof, kept.batches)

    @cached_property
    def forest(self) -> Mapping[int, Tree]:
        """The trees by number: 0 grows from the start, 1 from the goal.

        Raises:
            RecordingError: The events do not make trees.
        """
        edges = [
            Events(batch.dof, {kind: batch[kind] for kind in (Kind.EDGE, Kind.REWIRE)})
            for batch in self._batches()
        ]
        return forest(Events.concat(self.recording.manifest.dof, edges))

    @cached_property
    def metrics(self) -> Metrics:
        """The metrics, as `brrt replay` prints them: `metrics.as_dict()`."""
        metrics = Metrics(self.recording.manifest)
        self.feed(metrics)
        return metrics

    @property
    def best_path(self) -> Path | None:
        """Cost and waypoints, shape (n, dof), of the best path so far; None if there is none."""
        return self.metrics.best_path

    def node(self, node: int, tree: int = 0) -> NodeHistory | CellHistory:
        """Return the history of a node, or of a cell if the planner searches a lattice.

        Args:
            node: Its number.
            tree: Number of its tree.

        Raises:
            BrrtError: There is no such node.
            RecordingError: The events do not make trees.
        """
        run = self.recording
        trace, cell = NodeTrace(node, tree, run.manifest.dof), CellTrace(node, run.manifest)
        self.feed(trace, cell)
        if trace.has_trees or not cell.has_cells:
            return trace.history(run.robot(), run.world)
        if tree != 0:
            raise BrrtError("a planner on a lattice has cells and no trees; leave the tree out")
        return cell.history(run.robot())

    def feed(self, *folds: Fold) -> None:
        """Pass the events to folds, such as `Metrics`, in one pass over the recording."""
        feed(self._batches(), folds, {})

    def _batches(self) -> Iterator[Events]:
        """Yield the events up to the instant; from memory if they have been read before."""
        known = self.__dict__.get("events")
        yield from until(self.recording.batches(), self.limits) if known is None else [known]


def snapshot(
    recording: Recording,
    *,
    time: float | None = None,
    event: int | None = None,
    iteration: int | None = None,
) -> Snapshot:
    """Return a run at an instant; at its end if none is given.

    Nothing is read until a property of it is used, and then no further than the instant.

    Args:
        recording: The run.
        time: Seconds since the run began.
        event: Number of the last event.
        iteration: The last iteration.

    Raises:
        BrrtError: More than one is given, or a value is not a number from 0 on.
    """
    return Snapshot(recording, instant(time=time, event=event, iteration=iteration))
