"""A recording that was read: the manifest, the world, and the events in order."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from brrt.events import Events, Kind
from brrt.replay.metrics import Metrics
from brrt.replay.snapshot import Snapshot, check_limits, instant
from brrt.replay.transcript import transcript
from brrt.robots import Robot
from brrt.scenario.manifest import Manifest
from brrt.verification import Finding, check
from brrt.worlds.world import World


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Recording:
    """A recording on disk; its events are read anew by each call of `batches`.

    Attributes:
        manifest: What the run was.
        world: The world it ran in.
        batches: Call it for the events, in batches, in order.
        result: The figures that the writer found at the end; None if it did not get there.
        counts: Events of each kind, as the end of the file has them; None if it does not.
        name: Of the file, without its folder.
    """

    manifest: Manifest
    world: World
    batches: Callable[[], Iterator[Events]]
    result: Mapping[str, Any] | None
    counts: Mapping[Kind, int] | None = None
    name: str = ""

    def __repr__(self) -> str:
        scenario, result = self.manifest.scenario, self.result
        end = "no figures at its end"
        if result is not None:
            end = f"{result.get('events')} events, {result.get('status')}"
        run = f"{scenario.planner} in {scenario.world}, seed {scenario.seed}"
        return f"<Recording {self.name or 'in memory'}: {run}; {end}>"

    def events(self) -> Events:
        """Return the whole log at once."""
        return Events.concat(self.manifest.dof, self.batches())

    def at(
        self,
        *,
        time: float | None = None,
        event: int | None = None,
        iteration: int | None = None,
    ) -> Snapshot:
        """Return the run as it stood at an instant, as `brrt replay --at` has it; or at its end.

        Nothing is read until something of it is asked for, and then no further than the instant.

        Args:
            time: Seconds since the run began.
            event: After this event.
            iteration: After this iteration.

        Raises:
            BrrtError: More than one is given, or it is no number from 0 on.
        """
        limits = instant(time=time, event=event, iteration=iteration)
        return Snapshot(self.manifest, self.world, self.batches, limits, self.name)

    def robot(self) -> Robot:
        """Make the robot as it was, settled in the world."""
        return self.manifest.make_robot().resolved(self.world)

    def text(self) -> str:
        """Tell the run in plain text, without times: the same on every machine."""
        return transcript(self.manifest, self.robot(), self.batches())

    def show(self, *, width: int = 1200, height: int = 700) -> Any:
        """Show the run in a notebook: the cell's last value, or `display` of it.

        Args:
            width: Of the viewer, in pixels.
            height: Of the viewer.

        Returns:
            Rerun's viewer where rerun-notebook is installed, and otherwise a figure of matplotlib.

        Raises:
            BrrtError: Neither is installed.
        """
        try:
            import rerun_notebook  # noqa: F401, PLC0415 - an extra that brings much of Jupyter
        except ImportError:
            return self.plot().figure
        from rerun.notebook import Viewer  # noqa: PLC0415 - costs half a second

        from brrt.views.rerun.sink import RerunSink  # noqa: PLC0415 - stands above this file

        viewer = Viewer(width=width, height=height, use_global_recording=False)
        sink = RerunSink(self.manifest, self.world, embed=viewer)
        for batch in self.batches():
            sink.write(batch)
        sink.close(whole=self.result is not None)
        return viewer

    def metrics(self) -> Metrics:
        """Fold the events into the run's figures."""
        metrics = Metrics(self.manifest)
        for batch in self.batches():
            metrics.write(batch)
        return metrics

    def plot(
        self, ax: Any = None, *, what: str = "tree", rejects: int = 0, **until: int | None
    ) -> Any:
        """Draw the run by matplotlib into axes, new ones by default; return the axes.

        Args:
            ax: Axes, with projection "3d" for the tree in a world in 3D.
            what: "tree", or "cost" for that of the best path.
            rejects: How many of the newest rejected extensions are drawn.
            until: The instant, as `Events.until` takes it; the end by default.

        Raises:
            BrrtError: matplotlib is missing, the axes are of no use, or there is no path.
        """
        from brrt.views.matplotlib.figure import plot  # noqa: PLC0415 - matplotlib is an extra
        from brrt.views.matplotlib.history import Record  # noqa: PLC0415

        check_limits(until, "ax", "what", "rejects")
        events = self.events().until(**until)
        record = Record(self.manifest.scenario.planner, self.manifest, self.world, events)
        return plot(record, ax, what=what, rejects=rejects)

    def check(self) -> list[Finding]:
        """Hold the run to what its planner promises; return what it breaks."""
        return check(self.manifest, self.world, self.events(), figures=self.result)
