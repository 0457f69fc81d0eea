"""`brrt.record`: open a recording of a planner that is not brrt's own."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from brrt.errors import BrrtError
from brrt.events import LATEST_NS, Events
from brrt.formats.background import BackgroundSink
from brrt.formats.mcap.sink import McapSink
from brrt.recorder.recorder import Recorder
from brrt.recorder.values import configurations
from brrt.recording import Result, Sink
from brrt.replay.metrics import Metrics
from brrt.robots import Arm, Opaque, Robot, make_robot
from brrt.robots.robot import Floats
from brrt.scenario.claims import Claims
from brrt.scenario.contract import Contract
from brrt.scenario.manifest import Manifest, made_by
from brrt.scenario.query import Query
from brrt.scenario.scenario import Scenario
from brrt.worlds import World, make_world


class _MeasuredSink:
    """Folds the metrics on the thread that writes, and closes the sink with them."""

    def __init__(self, sink: Sink, manifest: Manifest) -> None:
        self._sink, self._metrics = sink, Metrics(manifest)

    def write(self, events: Events) -> None:
        """Take a batch."""
        if len(events):
            self._metrics.write(events)
        self._sink.write(events)

    def close(self, result: Result | None) -> None:
        """Close the sink with the metrics, unless the recording failed."""
        self._sink.close(None if result is None else self._metrics.as_dict())


def record(
    path: Path | str,
    *,
    world: World | Path | str | None = None,
    start: Any = None,
    goal: Any = None,
    robot: Robot | Path | str | None = None,
    dof: int | None = None,
    planner: str = "external",
    params: Mapping[str, Any] | None = None,
    seed: int = 0,
    iterations: int | None = None,
    time_limit: float | None = None,
    contract: Contract | None = None,
    claims: Claims | Mapping[str, Any] | None = None,
    clock: Callable[[], int] | None = None,
) -> Recorder:
    """Open a recording of a planner; use it in a `with` statement, or call `close`.

    Args:
        path: The .mcap file; it is overwritten.
        world: Where it plans: a `World`, a generator's name or a file. None if it is not known:
            then neither is the robot, and nothing can be said of collisions and bounds.
        start: First configuration, shape (dof,); by default the world's own.
        goal: Last configuration, shape (dof,); by default the world's own.
        robot: What moves: a `Robot`, a name with parameters or a file. By default a point where a
            configuration is a position in the world, and else a robot that is not known.
        dof: Numbers in a configuration, 1 to 32; by default those of the robot, or of the start.
        planner: The planner's name. A recording under the name of a registered planner without a
            contract of its own is judged by that planner's.
        params: Its parameters, for readers.
        seed: Of its random draws, for readers.
        iterations: Its limit of iterations, for readers.
        time_limit: Its limit of time in s, for readers.
        contract: What it promises; `brrt.verify` judges by it.
        claims: How the log is made, such as `{"motions": "own"}`; see `brrt.Claims`. `brrt.verify`
            leaves out what this excludes.
        clock: Returns the time of the next event in ns since the run began, for converters of
            other logs; by default the time is measured.

    Raises:
        BrrtError: Start or goal is not free, a value is wrong, or the file cannot be written.
    """
    if Path(path).suffix != ".mcap":
        raise BrrtError(f"{path}: name a file that ends in .mcap")
    place, body = _problem(world, robot, dof, start, goal)
    scenario = Scenario(
        world=place.name, robot=_spec(body), planner=planner,
        params=params or {}, start=start, goal=goal, seed=seed, iterations=iterations,
        time=time_limit, smooth=False,
    )  # fmt: skip
    query = Query.of(scenario, place, body if isinstance(body, Robot) else None)
    if dof not in (None, query.dof):
        raise BrrtError(f"dof must be {query.dof} for robot {scenario.robot}, not {dof!r:.60}")
    manifest = Manifest(
        scenario=scenario,
        start=tuple(query.start.tolist()),
        goal=tuple(query.goal.tolist()),
        dim=place.dim,
        dof=query.dof,
        epoch_ns=min(max(time.time_ns(), 0), LATEST_NS),
        made_by=made_by(),
        robot=query.robot.to_json(),
        contract=contract,
        claims=Claims.of(claims),
    )
    sink = BackgroundSink(_MeasuredSink(McapSink(path, manifest, place), manifest), Path(path))
    return Recorder(sink, query, clock)


def _spec(robot: Robot | str) -> str:
    """Return the specification of a robot for the scenario."""
    if isinstance(robot, Opaque):
        return f"{robot.kind}:numbers={robot.numbers}"
    return robot if isinstance(robot, str) else robot.kind


def _problem(
    world: World | Path | str | None,
    robot: Robot | Path | str | None,
    dof: int | None,
    start: Any,
    goal: Any,
) -> tuple[World, Robot | str]:
    """Return the world, and the robot or its name.

    Raises:
        BrrtError: Too little is given, or something that does not fit.
    """
    place = world if world is None or isinstance(world, World) else make_world(str(world))
    body = robot if robot is None or isinstance(robot, Robot) else str(robot)
    if place is not None and body is not None:
        return place, body
    if body is not None:
        arm = make_robot(body) if isinstance(body, str) else body
        if not isinstance(arm, Arm):
            raise BrrtError(f"robot {robot!s:.60} needs a world; without one give dof alone")
        ends = np.concatenate(_ends(start, goal, len(arm.moving)))
        # Readers replace these bounds by those of the whole log.
        return World.unknown(np.concatenate(arm.skeleton(ends))), body
    if dof is None:
        dof = np.size(start) if start is not None or place is None else place.dim
    if place is not None:
        return place, "point" if dof == place.dim else Opaque.parse("dof", {"numbers": dof})
    unknown = Opaque.parse("robot opaque", {"numbers": dof, "drawn": 2 if dof < 3 else 3})
    return World.unknown(unknown.places(np.concatenate(_ends(start, goal, dof)))), unknown


def _ends(start: Any, goal: Any, dof: int) -> list[Floats]:
    """Check start and goal where there is no world that has them, shape (1, dof) each.

    Raises:
        BrrtError: One is missing, or has the wrong size.
    """
    ends = {"start": start, "goal": goal}
    for name, q in ends.items():
        if q is None:
            raise BrrtError(f"{name} must be given: there is no world that has one")
    return [configurations(name, [q], dof) for name, q in ends.items()]
