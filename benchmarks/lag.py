"""Measure how far the files lag behind a run at full speed, with busy loops beside it.

    python benchmarks/lag.py [--busy 2] [--seconds 10]

The lag of a file is the time between the last event that the run has handed over and the last one
that the file has, looked at every 10 ms.
"""

import argparse
import sys
import tempfile
import threading
import time
from pathlib import Path
from statistics import median
from subprocess import Popen
from typing import Any

from faults import ENDLESS

from brrt import Events, McapSink, Run
from brrt.formats.background import BackgroundSink
from brrt.views.rerun.sink import RerunSink


class Noting:
    """Notes the time of the last event that a sink has written, in ns; 0 before the first."""

    def __init__(self, sink: Any, method: str) -> None:
        self.sink, self.last, self._write = sink, 0, getattr(sink, method)
        setattr(sink, method, self._note)

    def _note(self, events: Events | None) -> None:
        self._write(events)
        if events is not None and len(events):
            self.last = events.last.t


def measure(folder: Path, seconds: float) -> None:
    """Record for a while and print the lags."""
    run = Run(ENDLESS)
    world = run.problem.world
    files = {
        "mcap": Noting(McapSink(folder / "run.mcap", run.manifest, world), "_write_chunk"),
        "rrd": Noting(RerunSink(run.manifest, world, path=folder / "run.rrd"), "_write"),
    }
    sinks = [BackgroundSink(noting.sink) for noting in files.values()]
    lags = {name: list[float]() for name in files}
    handed, ended = [0], threading.Event()

    def watch() -> None:
        while not ended.wait(0.01):
            for name, noting in files.items():
                lags[name].append(max(0, handed[0] - noting.last) / 1e9)

    watching = threading.Thread(target=watch)
    watching.start()
    began, count = time.monotonic(), 0
    for events in run.events():
        for sink in sinks:
            sink.write(events)
        handed[0], count = events.last.t, count + len(events)
        if time.monotonic() - began > seconds:
            break
    ended.set()
    watching.join()
    print(f"{count / seconds:,.0f} events a second")
    for name, found in lags.items():
        print(f"{name}: lag {max(found):.2f} s at most, {median(found):.2f} s in the median")
    for sink in sinks:
        sink.close(None)


def main() -> None:
    """Measure beside busy loops."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--busy", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    loops = [Popen([sys.executable, "-c", "while True: pass"]) for _ in range(options.busy)]
    try:
        with tempfile.TemporaryDirectory() as name:
            measure(Path(name), options.seconds)
    finally:
        for loop in loops:
            loop.kill()


if __name__ == "__main__":
    main()
