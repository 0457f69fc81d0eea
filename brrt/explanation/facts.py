"""The facts of an explanation: metrics and places, each computed from the recording."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from brrt.digits import digits_within
from brrt.events import Reason, Source
from brrt.explanation.clearance import Clearance, ClearanceSearch, Narrow
from brrt.explanation.places import PLACE_DIGITS, Blocker, Coverage, Gap, Places, Spot
from brrt.explanation.summary import RunSummary
from brrt.replay.snapshot import Snapshot
from brrt.scenario.contract import Contract
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario
from brrt.worlds.arrays import Floats, Ints

_TENTHS = 10


@dataclass(frozen=True, slots=True)
class Tenth:
    """A tenth of the run, by iterations.

    Attributes:
        last: Its last iteration.
        accepted: Share of the extensions that added a node or a link, or of the expansions that
            were the first of their cells; None without any.
        us: Microseconds per iteration; None without a real clock.
        nearest: Least distance to the goal by its end; None without a node or cell.
    """

    last: int
    accepted: float | None
    us: float | None
    nearest: float | None


@dataclass(frozen=True, slots=True)
class Approach:
    """The node, or cell, nearest to the goal.

    Attributes:
        far: Its distance to the goal, in the robot's metric.
        start: The start's distance to the goal.
        q: Its configuration.
        node: Its number.
        iteration: When it was added.
        since: Share of the iterations that came after it.
        hit: The obstacle on the straight motion from it to the goal; None if that is free.
    """

    far: float
    start: float
    q: list[float]
    node: int
    iteration: int
    since: float
    hit: str | None


@dataclass(frozen=True, slots=True)
class Goals:
    """Samples of the goal, and motions to it.

    Attributes:
        drawn: Samples that were the goal.
        failed: Those of them that were rejected.
        blocked: Motions from the newest node to the goal that were blocked.
        blockers: The obstacles that blocked both.
    """

    drawn: int
    failed: int
    blocked: int
    blockers: list[Blocker]


@dataclass(frozen=True, slots=True)
class Progress:
    """The paths that the planner found, in order.

    Attributes:
        paths: How many there are.
        first: Iteration of the first.
        first_cost: Its cost.
        best: Iteration of the last, which is the best of a planner that improves its path.
        best_cost: Its cost.
        half_cost: Cost of the path after half of the iterations; None without one by then.
    """

    paths: int
    first: int
    first_cost: float
    best: int
    best_cost: float
    half_cost: float | None


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known of a run; facts of a class of their own are described there.

    Attributes:
        file: The recording's file, as commands name it; empty for a run in memory.
        ended: Whether the facts are those of the recording's end, not of an earlier instant.
        contract: What the planner promises; empty if it is not known.
        sides: Sides of the world's bounds.
        figures: The metrics, as `brrt replay --json` prints them.
        trees: Numbers of the trees.
        accepted: Extensions that added a node or a link, or first expansions of cells.
        failed: Extensions that added none, or further expansions of cells.
        reasons: Rejections by reason, most frequent first.
        gap: How close two trees came.
        cells: Sums over the cells of a lattice search; empty for other planners.
        digits: Significant digits of each coordinate in texts, by the number of coordinates.
    """

    manifest: Manifest
    file: str
    ended: bool
    contract: Contract
    sides: list[float]
    figures: dict[str, Any]
    tenths: list[Tenth]
    trees: list[int]
    accepted: int
    failed: int
    reasons: dict[str, int]
    blockers: list[Blocker]
    spot: Spot | None
    goals: Goals | None
    approach: Approach | None
    gap: Gap | None
    coverage: Coverage | None
    clearance: Clearance
    progress: Progress | None
    cells: dict[str, Any]
    digits: dict[int, tuple[int, ...]]

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.manifest.scenario

    @property
    def extent(self) -> float:
        """The longest side of the world's bounds."""
        return max(self.sides)

    @property
    def narrow(self) -> Narrow | None:
        """The narrowest place on the widest path, if one was found."""
        return self.clearance.narrow

    @property
    def cut(self) -> bool:
        """Whether the recording ends within planning."""
        return self.figures["status"] == "running" and self.ended

    @property
    def acceptance(self) -> float | None:
        """Share of the extensions that added a node."""
        tried = self.accepted + self.failed
        return self.accepted / tried if tried else None

    def as_dict(self) -> dict[str, Any]:
        """Return all but the manifest as plain numbers, texts, lists and dicts."""
        plain = asdict(self)
        for name in ("manifest", "file", "ended", "digits"):
            del plain[name]
        clearance = plain.pop("clearance")
        clearance["way"] = clearance.pop("reason")
        return {**plain, **clearance, "extent": self.extent, "acceptance": self.acceptance}


def facts(snapshot: Snapshot, file: str) -> Facts:
    """Compute all facts, in one pass over the events; for `file`, see `Facts`.

    Raises:
        BrrtError: The manifest does not fit its world.
    """
    run, robot = snapshot.recording, snapshot.recording.robot()
    manifest, world = run.manifest, run.world
    summary = RunSummary(manifest, robot)
    snapshot.feed(summary)
    places = Places(world, robot, summary)
    start, goal = np.array(manifest.start), np.array(manifest.goal)
    figures = summary.metrics.as_dict()
    last, solved = figures["iterations"], figures["solved"]
    motions = summary.motions(summary.rejects)
    contract = contract_of(manifest, world)
    proven = solved and not robot.opaque
    clearance = ClearanceSearch(world, robot, summary).find(start, goal, contract.step)
    return Facts(
        manifest=manifest,
        file=file,
        ended=not snapshot.limits,
        contract=contract,
        sides=(world.upper - world.lower).tolist(),
        figures=figures,
        tenths=_tenths(summary, last, logical=manifest.scenario.clock == "logical"),
        trees=summary.trees,
        accepted=int(summary.bins.sums[:, 0].sum()),
        failed=int(summary.bins.sums[:, 1].sum()),
        reasons={Reason.label_of(reason): n for reason, n in summary.reasons.most_common()},
        blockers=places.blockers(*motions),
        spot=places.spot(*motions),
        goals=_goals(summary, places),
        approach=_approach(summary, places, goal, float(robot.distance(start, goal)), last),
        gap=None if solved else places.gap(),
        coverage=places.coverage(*_reached(summary), last),
        # The path of a solved run proves that there is one.
        clearance=replace(clearance, connected=True) if proven else clearance,
        progress=_progress(summary.paths, last),
        cells=summary.cells.as_dict(),
        digits={
            manifest.dof: digits_within(*robot.bounds(world), PLACE_DIGITS),
            world.dim: digits_within(world.lower, world.upper, PLACE_DIGITS),
        },
    )


def _tenths(summary: RunSummary, last: int, *, logical: bool) -> list[Tenth]:
    bins = summary.bins
    used = last // bins.length + 1
    ends = np.unique(np.linspace(0, used, _TENTHS + 1).astype(np.int64))
    t = np.maximum.accumulate(bins.t)
    nearest = np.minimum.accumulate(bins.nearest)
    found = []
    for first, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        accepted, failed = bins.sums[first:end].sum(axis=0).tolist()
        before = int(t[first - 1]) if first else int(bins.began)
        final = min(end * bins.length - 1, last)
        iterations = final - max(first * bins.length - 1, 0)
        us = (int(t[end - 1]) - before) / 1e3 / max(iterations, 1)
        near = float(nearest[end - 1])
        found.append(
            Tenth(
                last=final,
                accepted=accepted / (accepted + failed) if accepted + failed else None,
                us=None if logical else us,
                nearest=near if np.isfinite(near) else None,
            )
        )
    return found


def _goals(summary: RunSummary, places: Places) -> Goals | None:
    drawn = summary.drawn[int(Source.GOAL)]
    blocked = summary.reasons[int(Reason.GOAL_BLOCKED)]
    if not drawn and not blocked:
        return None
    blockers = places.blockers(*summary.motions(summary.goal_rejects))
    return Goals(drawn, summary.goal_failed, blocked, blockers)


def _approach(
    summary: RunSummary, places: Places, goal: Floats, start: float, last: int
) -> Approach | None:
    if summary.nearest is None:
        return None
    far, q, node, iteration = summary.nearest
    hit = places.hit(np.array(q), goal) if far > 0 else None
    since = (last - iteration) / max(last, 1)
    return Approach(far, start, q, node, iteration, since, hit)


def _reached(summary: RunSummary) -> tuple[Floats, Ints]:
    """Return what the trees reached, and in which iterations; 0 for cells, which keep none."""
    if not summary.trees:
        q = summary.cells.q
        return q, np.zeros(len(q), np.int64)
    return (
        np.concatenate([summary.nodes(tree) for tree in summary.trees]),
        np.concatenate([summary.iterations(tree) for tree in summary.trees]),
    )


def _progress(paths: list[tuple[int, float]], last: int) -> Progress | None:
    if not paths:
        return None
    half = [cost for iteration, cost in paths if iteration <= last / 2]
    return Progress(len(paths), *paths[0], *paths[-1], half[-1] if half else None)
