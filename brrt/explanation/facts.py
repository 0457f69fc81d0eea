"""All that an explanation knows: figures, each computed from the recording."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Reason, Source
from brrt.explanation.clearance import Narrow, Way, Ways
from brrt.explanation.gather import FAILED, Gather
from brrt.explanation.places import Blocker, Coverage, Gap, Places, Spot
from brrt.replay.snapshot import Snapshot
from brrt.robots import Robot
from brrt.scenario.contract import Contract
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario

Floats = NDArray[np.float64]

TENTHS = 10


@dataclass(frozen=True, slots=True)
class Tenth:
    """A tenth of the run, by iterations.

    Attributes:
        last: Its last iteration.
        accepted: Share of the extensions that added a node, or of the expansions that were of
            cells not expanded before; None where there were none.
        us: Microseconds an iteration; None where nobody measured.
        nearest: How near to the goal anything had come by its end; None where nothing had.
    """

    last: int
    accepted: float | None
    us: float | None
    nearest: float | None


@dataclass(frozen=True, slots=True)
class Approach:
    """How near to the goal the run came.

    Attributes:
        far: Distance from there, in the robot's metric.
        start: How far the start is.
        q: The nearest node, or cell.
        node: Its number.
        iteration: When it was reached.
        since: Share of the iterations that came after it.
        hit: What is on the straight way from it to the goal; None where nothing is.
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
    """Draws of the goal, and tries to join it.

    Attributes:
        drawn: Samples that were the goal.
        failed: Of those, how many were rejected.
        blocked: Tries to join the goal to the newest node that were blocked.
        blockers: What was in the way of both.
    """

    drawn: int
    failed: int
    blocked: int
    blockers: list[Blocker]


@dataclass(frozen=True, slots=True)
class Progress:
    """The paths that the planner found, in the order in which it did.

    Attributes:
        paths: How many.
        first: Iteration of the first.
        first_cost: Its cost.
        best: Iteration of the last, which is the best where a planner improves its path.
        best_cost: Its cost.
        half_cost: What the path cost after half of the iterations; None before the first.
    """

    paths: int
    first: int
    first_cost: float
    best: int
    best_cost: float
    half_cost: float | None


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known of a run.

    Attributes:
        manifest: The run's.
        file: The recording, as the command line takes it; empty where it is in no file.
        ended: Whether the recording is told to its end, and not to an instant before.
        contract: What its planner promises, as its step; empty if it is not known.
        sides: Those of the world's bounds.
        figures: Those that `brrt replay --json` prints.
        tenths: The run's course.
        trees: Numbers of the trees.
        accepted: Extensions that added a node, or first expansions of cells.
        failed: Extensions that added none, or further expansions of cells.
        reasons: Rejections by reason, most frequent first.
        blockers: What turned extensions down.
        spot: Where most were turned down.
        goals: What came of heading for the goal.
        approach: How near to it the run came.
        gap: How near two trees came to each other.
        coverage: How much of the free space was reached.
        way: Whether there is one from start to goal, and how wide it is.
        progress: The paths.
        cells: What a search on a lattice did; empty for others.
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
    way: Way
    progress: Progress | None
    cells: dict[str, Any]

    @property
    def scenario(self) -> Scenario:
        """What was run."""
        return self.manifest.scenario

    @property
    def extent(self) -> float:
        """The longest side of the world's bounds."""
        return max(self.sides)

    @property
    def narrow(self) -> Narrow | None:
        """The narrowest place on the widest way, where one was found."""
        return self.way.narrow

    @property
    def cut(self) -> bool:
        """Whether planning neither ended nor was it asked how it stood before its end."""
        return self.figures["status"] == "running" and self.ended

    @property
    def acceptance(self) -> float | None:
        """Share of the extensions that added a node."""
        tried = self.accepted + self.failed
        return self.accepted / tried if tried else None

    def as_dict(self) -> dict[str, Any]:
        """Return all but the manifest as plain numbers, texts, lists and dicts."""
        plain = asdict(self)
        for name in ("manifest", "file", "ended"):
            del plain[name]
        way = plain.pop("way")
        way["way"] = way.pop("reason")
        return {**plain, **way, "extent": self.extent, "acceptance": self.acceptance}


def facts(moment: Snapshot, file: str, robot: Robot, gather: Gather) -> Facts:
    """Compute everything.

    Args:
        moment: The run as it stood.
        file: The recording, as the command line takes it; empty where it is in no file.
        robot: What moves, settled in the world.
        gather: What the log says.
    """
    manifest, world = moment.recording.manifest, moment.recording.world
    places = Places(world, robot, gather)
    start, goal = np.array(manifest.start), np.array(manifest.goal)
    figures = gather.metrics.as_dict()
    rejects = gather.rejects.rows()
    ends = gather.origins(rejects), np.asarray(rejects["q"])
    contract = contract_of(manifest, world)
    return Facts(
        manifest=manifest,
        file=file,
        ended=not moment.limits,
        contract=contract,
        sides=(world.upper - world.lower).tolist(),
        figures=figures,
        tenths=_tenths(gather, figures["iterations"], manifest.scenario.clock == "logical"),
        trees=gather.trees,
        accepted=int(gather.spans.sums[:, 0].sum()),
        failed=int(gather.spans.sums[:, 1].sum()),
        reasons={Reason.label_of(reason): n for reason, n in gather.reasons.most_common()},
        blockers=places.blockers(*ends),
        spot=places.spot(*ends),
        goals=_goals(gather, places),
        approach=_approach(gather, places, start, goal, robot, figures["iterations"]),
        gap=places.gap() if not figures["solved"] else None,
        coverage=places.coverage(*_reached(gather), figures["iterations"]),
        way=_way(Ways(world, robot, gather), start, goal, contract, solved=figures["solved"]),
        progress=_progress(gather, figures["iterations"]),
        cells=gather.cells.as_dict(),
    )


def _way(ways: Ways, start: Floats, goal: Floats, contract: Contract, *, solved: bool) -> Way:
    way = ways.find(start, goal, contract.step)
    # That there is one is proven by a run that took it.
    return replace(way, connected=True) if solved else way


def _tenths(gather: Gather, last: int, logical: bool) -> list[Tenth]:
    spans = gather.spans
    used = last // spans.length + 1
    ends = np.unique(np.linspace(0, used, TENTHS + 1).astype(np.int64))
    t = np.maximum.accumulate(spans.t)
    nearest = np.minimum.accumulate(spans.nearest)
    found = []
    for first, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        good, bad = spans.sums[first:end].sum(axis=0).tolist()
        before = int(t[first - 1]) if first else int(spans.began)
        iterations = min(end * spans.length - 1, last) - max(first * spans.length - 1, 0)
        us = (int(t[end - 1]) - before) / 1e3 / max(iterations, 1)
        near = float(nearest[end - 1])
        found.append(
            Tenth(
                min(end * spans.length - 1, last),
                good / (good + bad) if good + bad else None,
                None if logical else us,
                near if np.isfinite(near) else None,
            )
        )
    return found


def _goals(gather: Gather, places: Places) -> Goals | None:
    drawn = gather.drawn[int(Source.GOAL)]
    blocked = gather.reasons[int(Reason.GOAL_BLOCKED)]
    if not drawn and not blocked:
        return None
    rows = gather.goal_rejects.rows()
    found = places.blockers(gather.origins(rows), np.asarray(rows["q"]))
    return Goals(drawn, gather.goal_failed, blocked, found)


def _approach(
    gather: Gather, places: Places, start: Floats, goal: Floats, robot: Robot, last: int
) -> Approach | None:
    near = gather.nearest
    if near is None:
        return None
    hit = places.in_the_way(np.array(near.q), goal) if near.far > 0 else None
    far, since = float(robot.distance(start, goal)), (last - near.iteration) / max(last, 1)
    return Approach(near.far, far, near.q, near.node, near.iteration, since, hit)


def _reached(gather: Gather) -> tuple[Floats, NDArray[np.int64]]:
    """Return what was reached by any tree, and when; of cells the time is not kept."""
    if not gather.trees:
        q = gather.cells.q
        return q, np.zeros(len(q), np.int64)
    return (
        np.concatenate([gather.nodes(tree) for tree in gather.trees]),
        np.concatenate([gather.iterations(tree) for tree in gather.trees]),
    )


def _progress(gather: Gather, last: int) -> Progress | None:
    paths = gather.paths
    if not paths:
        return None
    half = [cost for iteration, _, cost in paths if iteration <= last / 2]
    (first, _, first_cost), (best, _, best_cost) = paths[0], paths[-1]
    return Progress(len(paths), first, first_cost, best, best_cost, half[-1] if half else None)


__all__ = ["FAILED", "Facts", "Tenth", "facts"]
