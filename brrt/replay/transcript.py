"""A run as plain text that is the same on every machine, so that transcripts can be compared.

Times, versions and folders are left out, and numbers are rounded to six digits.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from brrt.digits import digits_within, join_numbers
from brrt.events import COUNTS, FIELDS, Events, Kind, Phase, Stage, Status, Table
from brrt.recording import Recording
from brrt.replay.fold import feed
from brrt.robots import Robot
from brrt.scenario.contracts import changes_of, planner_settings
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World

Line = tuple[int, str]
"""Iteration and text."""

_LEAST_GAIN = 0.01
"""How much better a path must be than the last one printed; there may be thousands."""


class Transcript:
    """A fold that writes down what happened, in constant memory."""

    def __init__(self, manifest: Manifest, robot: Robot, world: World) -> None:
        self._manifest, self._robot = manifest, robot
        self._digits = digits_within(*robot.bounds(world))
        self._lines: list[Line] = []
        self._counts: Counter[tuple[Kind, int]] = Counter()
        self._path: float | None = None
        self._best = np.inf
        self._skipped: list[Line] = []  # the best path so far if it was left out
        self._nearest = (np.inf, -1, 0)
        self._iteration = 0

    def write(self, events: Events) -> None:
        """Take a batch."""
        marks = [*events[Kind.PHASE], *events[Kind.PATH]]
        marks.sort(key=lambda event: int(event["seq"]))
        first = 0
        for event in marks:
            self._count(events, first, int(event["seq"]))
            first = int(event["seq"])
            if "stage" in event.dtype.names:
                self._add_path(event)
            else:
                self._add_phase(event)
        self._count(events, first, np.iinfo(np.int64).max)
        if len(events):
            self._iteration = max(self._iteration, events.last.iteration)

    def lines(self) -> Iterator[str]:
        """Yield the transcript so far, line by line."""
        yield from self._head()
        lines = [*self._lines, *self._skipped, *self._counted()]
        width = max((len(f"{number:,}") for number, _ in lines), default=1)
        before = None
        for number, text in lines:
            count = "" if number == before else f"{number:,}"
            yield f"{count:>{width}}  {text}"
            before = number

    def _head(self) -> Iterator[str]:
        scenario = self._manifest.scenario
        world, robot = (spec.rsplit("/", 1)[-1] for spec in (scenario.world, scenario.robot))
        yield f"{scenario.planner} · {robot} · {world} · seed {scenario.seed}"
        settings = planner_settings(self._manifest)[-1]
        if settings:
            yield "with " + ", ".join(f"{name} {_text(value)}" for name, value in settings.items())
        ends = (self._manifest.start, self._manifest.goal)
        yield "from {} to {}".format(*(join_numbers(q, self._digits) for q in ends))
        for branch, change in zip(self._manifest.branches, changes_of(self._manifest), strict=True):
            yield f"at iteration {branch.iteration:,} of {branch.file}: {change}"

    def _count(self, events: Events, first: int, end: int) -> None:
        """Count the events with numbers from `first` to `end`."""
        for kind, (*_, choice) in COUNTS.items():
            table = events[kind]
            part = table[np.searchsorted(table["seq"], first) : np.searchsorted(table["seq"], end)]
            if not len(part):
                continue
            values = np.zeros(len(part), int) if choice is None else part[choice].astype(int)
            for value, count in zip(*np.unique(values, return_counts=True), strict=True):
                self._counts[kind, int(value)] += int(count)
            if kind is Kind.EDGE:
                self._approach(part)

    def _approach(self, edges: Table) -> None:
        """Keep the node of the start's tree that is nearest to the goal."""
        mine = edges[edges["tree"] == 0]
        if len(mine):
            far = self._robot.distance(mine["q"], np.array(self._manifest.goal))
            best = int(far.argmin())
            here = (float(far[best]), int(mine["node"][best]), int(mine["iteration"][best]))
            self._nearest = min(self._nearest, here, key=lambda found: found[0])

    def _add_phase(self, event: Any) -> None:
        phase, status = Phase(int(event["name"])), Status(int(event["status"]))
        iteration = int(event["iteration"])
        if status is Status.BEGIN:
            self._lines.append((iteration, f"{phase.label} begins"))
            return
        self._lines += self._skipped
        texts = [text for _, text in self._counted()]
        self._counts.clear()
        self._skipped = []
        texts.append(f"{phase.label} ends: {status.label}")
        if phase is Phase.PLAN and self._path is None:
            texts.append("no path")
            far, node, born = self._nearest
            if np.isfinite(far):
                where = f"node {node:,} of iteration {born:,}, {far:.6g} away from it"
                texts.append(f"nearest to the goal: {where}")
        self._lines += [(iteration, text) for text in texts]

    def _add_path(self, event: Any) -> None:
        stage, cost = Stage(int(event["stage"])), float(event["cost"])
        name = "first path" if self._path is None else f"{stage.label} path"
        text = f"{name}: cost {cost:.6g}, {len(event['waypoints'])} waypoints"
        if self._path is not None and self._path > 0:
            text += f", {100 * (1 - cost / self._path):.2f} % less than the first"
        line = (int(event["iteration"]), text)
        self._path = cost if self._path is None else self._path
        if stage is Stage.IMPROVED and cost > (1 - _LEAST_GAIN) * self._best:
            self._skipped = [line]
            return
        self._best, self._skipped = cost, []
        self._lines.append(line)

    def _counted(self) -> Iterator[Line]:
        """Yield the counts since the phase began."""
        for kind, counted in COUNTS.items():
            found = {value: n for (k, value), n in sorted(self._counts.items()) if k is kind}
            if not found:
                continue
            text, named = counted.text(sum(found.values())), _named(kind, counted.by, found)
            yield self._iteration, f"{text}: {named}" if named else text


def _named(kind: Kind, choice: str | None, found: Mapping[int, int]) -> str:
    """Write how many events there are with each value of a field."""
    if choice is None or (choice == "tree" and len(found) == 1):
        return ""
    if choice in ("accepted", "part"):
        return f"{found.get(1, 0):,} {'free' if choice == 'part' else choice}"
    if choice == "tree":
        return ", ".join(f"{n:,} in tree {tree}" for tree, n in found.items())
    choices = next(field.choices for field in FIELDS[kind] if field.name == choice)
    label: Callable[[int], str] = choices.label_of if choices else str
    return ", ".join(f"{n:,} {label(value)}" for value, n in found.items())


def _text(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return "auto" if value is None else str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def transcript(recording: Recording) -> str:
    """Return a run as plain text without times, the same on every machine."""
    found = Transcript(recording.manifest, recording.robot(), recording.world)
    feed(recording.batches(), [found])
    return "\n".join(found.lines()) + "\n"
