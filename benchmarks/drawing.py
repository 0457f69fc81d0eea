"""The cost of drawing: a Rerun file with the drawing, against one with the bare events.

    python benchmarks/drawing.py [--events 200000] [--repeats 5]

The bare file has the same columns, sent in the same batches by `send_columns`, and nothing else.
Processor time counts all threads; on a busy machine it is the better measure.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from brrt import Events, Memory, Run, Scenario
from brrt.events import FIELDS
from brrt.formats.rrd.columns import to_arrow
from brrt.views.rerun.sink import RerunSink

RUNS: dict[str, dict[str, Any]] = {
    "rrt, 2D": {"world": "enclosure2d", "params": {"step": 0.3, "goal_bias": 0}},
    "rrt, 3D": {"world": "boxes3d:n=200", "params": {"step": 1.0, "goal_bias": 0}},
    "rrt-star, 2D": {"world": "squares2d:n=100", "planner": "rrt-star"},
    "bi-rrt-star, 2D": {"world": "squares2d:n=100", "planner": "bi-rrt-star"},
}
"""Runs that use their whole budget."""


def recorded(settings: dict[str, Any], events: int) -> tuple[Run, list[Events]]:
    """Plan until there are enough events; return the run and its batches."""
    run, log = Run(Scenario(**settings, iterations=events, smooth=False)), Memory()
    count = 0
    for batch in run.events():
        log.write(batch)
        count += len(batch)
        if count >= events:
            break
    return run, log.batches


def drawn(run: Run, batches: list[Events], path: Path) -> None:
    """Write the file with the drawing."""
    sink = RerunSink(run.manifest, run.problem.world, path=path)
    for batch in batches:
        sink.write(batch)
    sink.close({})


def bare(run: Run, batches: list[Events], path: Path) -> None:
    """Write the bare events."""
    rec: Any = rr.RecordingStream("bare", recording_id=str(run.manifest.epoch_ns))
    rr.set_log_time_enabled(False, recording=rec)
    rec.save(path)
    for batch in batches:
        for kind, table in batch.tables.items():
            times = [
                rr.TimeColumn("iteration", sequence=np.ascontiguousarray(table["iteration"])),
                rr.TimeColumn("event", sequence=np.ascontiguousarray(table["seq"])),
                rr.TimeColumn("t", duration=table["t"].astype("m8[ns]")),
            ]
            values = {field.name: to_arrow(field, table[field.name]) for field in FIELDS[kind]}
            columns = rr.DynamicArchetype.columns(kind.label, components=values)
            rec.send_columns(f"/ev/{kind.label}", times, columns)
        rec.flush()
    rec.disconnect()


def seconds(write: Callable[[Run, list[Events], Path], None], *args: Any) -> tuple[float, float]:
    """Return the wall time and the processor time of writing a file."""
    began, busy = time.perf_counter(), time.process_time()
    write(*args)
    return time.perf_counter() - began, time.process_time() - busy


def main() -> None:
    """Measure and print a line for each run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, default=200_000)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    print(
        f"{'':16}{'events':>8}  {'bytes an event':>18}  {'seconds':>20}  {'processor seconds':>20}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for name, settings in RUNS.items():
            run, batches = recorded(settings, options.events)
            count, paths = sum(map(len, batches)), [Path(folder, f) for f in ("a.rrd", "b.rrd")]
            times = np.full((options.repeats, 2, 2), np.inf)
            for repeat in times:
                for i, write in enumerate((drawn, bare)):
                    repeat[i] = seconds(write, run, batches, paths[i])
            size = [path.stat().st_size / count for path in paths]
            pairs = [size, *times.min(axis=0).T]
            texts = [f"{a:.3g} / {b:.3g} = {a / b:.2f}" for a, b in pairs]
            print(f"{name:16}{count:>8,}  {texts[0]:>18}  {texts[1]:>20}  {texts[2]:>20}")


if __name__ == "__main__":
    main()
