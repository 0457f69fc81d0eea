"""A run at an instant: trees, metrics, paths, nodes, each folded when it is first used."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from brrt.errors import BrrtError
from brrt.events import Events
from brrt.recording import Limits, Recording, instant
from brrt.replay.cell_history import CellHistory, CellTrace
from brrt.replay.fold import Fold, feed, until
from brrt.replay.forest import Tree, forest
from brrt.replay.graph import structure_of
from brrt.replay.metrics import Metrics, Path
from brrt.replay.node_history import NodeHistory, NodeTrace

_NAMES = {"seq": "event", "iteration": "iteration"}


@dataclass(frozen=True, eq=False, repr=False)
class Snapshot:
    """A run at an instant. Each property is folded from the events when it is first used.

    Attributes:
        recording: The run.
        limits: The instant, as `Events.until` takes it; the end of the run if it is empty.
    """

    recording: Recording
    limits: Limits = field(default_factory=dict)

    def __repr__(self) -> str:
        scenario = self.recording.manifest.scenario
        run = f"{scenario.planner} in {scenario.world}, seed {scenario.seed}"
        end = "its last event"
        for name, value in self.limits.items():
            end = f"time {value / 1e9:g} s" if name == "t" else f"{_NAMES[name]} {value:,}"
        return f"<Snapshot of {run}, after {end}>"

    @cached_property
    def events(self) -> Events:
        """All events up to the instant."""
        return Events.concat(self.recording.manifest.dof, self._batches())

    @cached_property
    def forest(self) -> Mapping[int, Tree]:
        """The trees by number: 0 grows from the start, 1 from the goal.

        Raises:
            RecordingError: The events do not make trees.
        """
        run = self.recording
        parts = (structure_of(each) for each in self._batches())
        return forest(Events.concat(run.manifest.dof, parts), run.robot().distance)

    @cached_property
    def metrics(self) -> Metrics:
        """The metrics; `metrics.as_dict()` is what `brrt replay --json` prints."""
        metrics = Metrics(self.recording.manifest)
        self.feed(metrics)
        return metrics

    @property
    def best_path(self) -> Path | None:
        """Cost and waypoints, shape (n, dof), of the best path so far; None if there is none."""
        return self.metrics.best_path

    def node(self, node: int, tree: int = 0) -> NodeHistory | CellHistory:
        """Return the history of a node, or of a cell if the planner searches a lattice.

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
            raise BrrtError("a run on a lattice has cells and no trees; give no tree")
        return cell.history(run.robot())

    def feed(self, *folds: Fold) -> None:
        """Pass the events to folds, such as `Metrics`, in one pass."""
        feed(self._batches(), folds)

    def _batches(self) -> Iterator[Events]:
        """Yield the events up to the instant; from memory once `events` was used."""
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

    Nothing is read until a property is used, and then no batch after the instant.

    Args:
        recording: The run.
        time: Seconds since the run began.
        event: Number of the last event.
        iteration: The last iteration.

    Raises:
        BrrtError: More than one is given, or a value is not a number from 0 on.
    """
    return Snapshot(recording, instant(time=time, event=event, iteration=iteration))
