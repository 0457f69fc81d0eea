"""`brrt.record`: open a recording of a planner that is not brrt's own."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from brrt.errors import BrrtError
from brrt.events import LATEST_NS, Events
from brrt.formats.background import BackgroundSink
from brrt.formats.mcap.sink import McapSink
from brrt.recorder.recorder import Recorder
from brrt.recording import Result, Sink
from brrt.replay.metrics import Metrics
from brrt.robots import Robot
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
    world: World | Path | str,
    start: Any = None,
    goal: Any = None,
    robot: Robot | Path | str = "point",
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
        world: Where it plans: a `World`, a generator's name or a file.
        start: First configuration, shape (dof,); by default the world's own.
        goal: Last configuration, shape (dof,); by default the world's own.
        robot: What moves: a `Robot`, a name with parameters or a file.
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
    place = world if isinstance(world, World) else make_world(str(world))
    body = robot if isinstance(robot, Robot) else None
    scenario = Scenario(
        world=place.name, robot=str(robot) if body is None else body.kind, planner=planner,
        params=params or {}, start=start, goal=goal, seed=seed, iterations=iterations,
        time=time_limit, smooth=False,
    )  # fmt: skip
    query = Query.of(scenario, place, body)
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
