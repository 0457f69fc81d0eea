"""Golden runs: small recordings that today's runs are compared with."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from brrt.errors import BrrtError
from brrt.events import Events
from brrt.files import make_folder_of, replacing
from brrt.formats import McapSink, read
from brrt.planners import load_scenario
from brrt.recording import Recording
from brrt.replay.metrics import Metrics, metrics
from brrt.runs.reproduce import ReproducedRun
from brrt.runs.run import Run
from brrt.scenario.scenario import Scenario
from brrt.testing.seed_metrics import check_repeatable

TICK_NS = 1000
"""Time between two events on the logical clock."""

Source = Scenario | Run | Recording | Path | str
"""Something to run, or a recording; or the name of a scenario file (.toml) or a recording."""


def record(source: Source) -> Recording:
    """Return a recording on the logical clock, so that equal runs give equal files.

    Raises:
        BrrtError: The source is something else, cannot be run or read, or has a time limit.
    """
    given: Any = source
    if isinstance(given, Path | str):
        path = Path(given)
        given = load_scenario(path) if path.suffix == ".toml" else read(path)
    if isinstance(given, Scenario):
        check_repeatable(given)
        given = Run(replace(given, clock="logical"))
    if isinstance(given, Run):
        check_repeatable(given.manifest.scenario)
        given = given.record()
    if not isinstance(given, Recording):
        kinds = "a Scenario, a Run, a Recording or a file"
        raise BrrtError(f"give {kinds} to compare with, not {given!r}")
    return _on_logical_clock(given)


def reproduced(path: Path) -> Run:
    """Return a run of a golden run's own scenario, in its world.

    Raises:
        BrrtError: The file cannot be read, or its planner is not registered.
    """
    recording = read(path)
    try:
        return ReproducedRun(recording)
    except BrrtError as error:
        raise BrrtError(f"{path}: {error}; or give brrt_golden the run as well") from None


def save(recording: Recording, path: Path) -> None:
    """Write a recording; an existing file is replaced once the new one is complete.

    Raises:
        BrrtError: The file cannot be written.
    """
    make_folder_of(path)
    with replacing(path) as unfinished, ExitStack() as stack:
        sink = McapSink(unfinished, recording.manifest, recording.world)
        stack.callback(sink.close, None)
        found = Metrics(recording.manifest)
        for batch in recording.batches():
            sink.write(batch)
            found.write(batch)
        stack.pop_all()
        sink.close(found.as_dict())


def _on_logical_clock(recording: Recording) -> Recording:
    """Return a recording whose event n happens at n us."""
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
    # The metrics of the result contain times of the real clock.
    return replace(retimed, result=metrics(retimed).as_dict())
