"""Golden runs: kept as small recordings, and held against what is planned today."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from brrt.errors import BrrtError, RecordingError
from brrt.events import Events, Kind
from brrt.files import replacing
from brrt.formats import McapSink, read
from brrt.planners import PLANNERS, load_scenario
from brrt.recording import Memory, Recording
from brrt.replay.metrics import Metrics, metrics
from brrt.runs.reproduce import ReproducedRun
from brrt.runs.run import Run
from brrt.scenario.scenario import Scenario

TICK_NS = 1000
"""Between two events by the logical clock."""

Source = Scenario | Run | Recording | Path | str
"""A scenario or a run to be made, or one that was recorded: by brrt, or as MCAP by anybody."""


def fresh(source: Source) -> Recording:
    """Make the run, or read it; by the logical clock, so that equal runs give equal files.

    Args:
        source: What to run; or a recording; or the name of a scenario (.toml) or recording.

    Raises:
        BrrtError: It is of no use, or its budget is a time, so that no two runs of it are alike.
    """
    given: Any = source
    if isinstance(given, Path | str):
        path = Path(given)
        given = load_scenario(path) if path.suffix == ".toml" else read(path)
    if isinstance(given, Scenario):
        _check_budget(given)
        given = Run(replace(given, clock="logical"))
    if isinstance(given, Run):
        given = _made(given)
    if not isinstance(given, Recording):
        kinds = "a Scenario, a Run, a Recording or a file"
        raise BrrtError(f"give {kinds} to compare with, not {given!r}")
    return _by_logical_clock(given)


def _made(run: Run) -> Recording:
    _check_budget(run.manifest.scenario)
    log = Memory()
    result = run.execute([log]).as_dict()
    counts = {kind: sum(batch.counts.get(kind, 0) for batch in log.batches) for kind in Kind}
    return Recording(
        run.manifest,
        run.problem.world,
        lambda: iter(log.batches),
        result,
        {kind: count for kind, count in counts.items() if count},
    )


def again(path: Path) -> Run:
    """Return the run that makes a golden one anew, in the world that it has kept.

    Raises:
        BrrtError: The file cannot be read, or its planner is not one of brrt's.
    """
    kept = read(path)
    planner = kept.manifest.scenario.planner
    if planner not in PLANNERS:
        raise BrrtError(f"{path}: planner {planner} is not brrt's own; give the run as well")
    return ReproducedRun(kept)


def save(recording: Recording, path: Path) -> None:
    """Write a recording; the name is that of a whole file, the old one or the new one.

    Raises:
        RecordingError: It cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror or error}") from None
    with replacing(path) as unfinished, ExitStack() as stack:
        sink = McapSink(unfinished, recording.manifest, recording.world)
        stack.callback(sink.close, None)
        found = Metrics(recording.manifest)
        for batch in recording.batches():
            sink.write(batch)
            found.write(batch)
        stack.pop_all()
        sink.close(found.as_dict())


def _check_budget(scenario: Scenario) -> None:
    if scenario.time is not None:
        raise BrrtError(
            "a budget of time ends each run elsewhere; give a golden run iterations and no time"
        )


def _by_logical_clock(recording: Recording) -> Recording:
    """Return a recording whose event n happened at n us."""
    scenario = recording.manifest.scenario
    if scenario.clock == "logical":
        return recording
    manifest = replace(recording.manifest, scenario=replace(scenario, clock="logical"), epoch_ns=0)

    def batches() -> Iterator[Events]:
        for batch in recording.batches():
            tables = {kind: table.copy() for kind, table in batch.tables.items()}
            for table in tables.values():
                table["t"] = TICK_NS * table["seq"]
            yield Events(batch.dof, tables)

    retimed = replace(recording, manifest=manifest, batches=batches)
    if recording.result is None:
        return retimed
    # The figures that the writer found hold times of the real clock.
    return replace(retimed, result=metrics(retimed).as_dict())
