"""What recording costs the caller of `brrt.record`, beside other recorders.

    python benchmarks/record.py [--events 200000]

Processor time of the calling thread for each event: one by one, and in arrays; then what the same
edges cost as lines by Rerun's `rr.log`, as JSON by `log` of a channel of foxglove-sdk (if it is
installed: pip install foxglove-sdk), and as JSON by the stock mcap writer. The last row is a call
of `brrt.log` while no recording is open. Times are medians of five rounds.
"""

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from mcap.writer import Writer

from brrt import Recorder, World, log, record

ROUNDS = 5
Q = np.random.default_rng(0).uniform(1, 9, (100_000, 2))


def world() -> World:
    """Return an empty world."""
    low, high, start, goal = (np.full(2, value) for value in (0.0, 10.0, 1.0, 9.0))
    return World("open", lower=low, upper=high, start=start, goal=goal)


def cost(n: int, work: Callable[[Recorder], None], path: Path) -> tuple[float, float]:
    """Return the caller's time for an event, and the time to the closed file, in ns."""
    caller, whole = [], []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        with record(path, world=world()) as rec:
            rec.edge([1.0, 1.0])
            before = time.thread_time()
            work(rec)
            caller.append((time.thread_time() - before) / n * 1e9)
        whole.append((time.perf_counter() - began) / n * 1e9)
    return statistics.median(caller), statistics.median(whole)


def one_by_one(n: int, length: float | None) -> Callable[[Recorder], None]:
    """Record edges with numbers, and costs if none is given, that the recorder adds."""
    points = Q[:n].tolist() * (n // len(Q) + 1)

    def work(rec: Recorder) -> None:
        for q in points[:n]:
            rec.edge(q, 0, cost=length)

    return work


def samples(n: int) -> Callable[[Recorder], None]:
    """Record samples one by one."""
    points = Q[:n].tolist() * (n // len(Q) + 1)

    def work(rec: Recorder) -> None:
        for q in points[:n]:
            rec.sample(q)

    return work


def in_arrays(n: int, size: int) -> Callable[[Recorder], None]:
    """Record edges in arrays of a size, with costs."""
    part, parent, length = Q[:size], np.zeros(size, np.int64), np.ones(size)

    def work(rec: Recorder) -> None:
        for _ in range(n // size):
            rec.edges(part, parent, cost=length)

    return work


def by_rerun(path: Path) -> tuple[Callable[[int, list[float]], None], Callable[[], None]]:
    """Return what logs an edge to a file of Rerun, and what closes the file."""
    stream = rr.RecordingStream("brrt_benchmark")
    stream.save(path)

    def add(i: int, q: list[float]) -> None:
        stream.set_time("event", sequence=i)
        stream.log("edge", rr.LineStrips2D([[(1.0, 1.0), q]]))

    return add, stream.flush


def by_foxglove(path: Path) -> tuple[Callable[[int, list[float]], None], Callable[[], None]]:
    """Return what logs an edge to a file of foxglove-sdk, and what closes the file."""
    foxglove = import_module("foxglove")
    writer = foxglove.open_mcap(str(path), allow_overwrite=True)
    channel = foxglove.Channel(f"/{path.stem}", message_encoding="json")

    def add(i: int, q: list[float]) -> None:
        channel.log({"node": i, "parent": 0, "cost": 1.0, "q": q}, log_time=i)

    def close() -> None:
        channel.close()
        writer.close()

    return add, close


def by_mcap(path: Path) -> tuple[Callable[[int, list[float]], None], Callable[[], None]]:
    """Return what writes an edge by the stock mcap writer, and what closes the file."""
    file = path.open("wb")
    writer = Writer(file)
    writer.start()
    schema = writer.register_schema("edge", "jsonschema", b"{}")
    channel = writer.register_channel("/edge", "json", schema)

    def add(i: int, q: list[float]) -> None:
        data = json.dumps({"node": i, "parent": 0, "cost": 1.0, "q": q}).encode()
        writer.add_message(channel, log_time=i, publish_time=i, data=data)

    def close() -> None:
        writer.finish()
        file.close()

    return add, close


OTHERS = {
    "rr.log, a line strip": (by_rerun, ".rrd"),
    "foxglove Channel.log, JSON": (by_foxglove, ".mcap"),
    "stock mcap writer, JSON": (by_mcap, ".mcap"),
}


def cost_of_other(n: int, make: Callable[[Path], Any], path: Path) -> tuple[float, float]:
    """Return the caller's time for an edge, and the time to the closed file, in ns."""
    caller, whole = [], []
    for number in range(ROUNDS):
        began = time.perf_counter()
        add, close = make(path.with_stem(f"edges{number}"))
        before = time.thread_time()
        for i, q in enumerate(Q[:n].tolist()):
            add(i, q)
        caller.append((time.thread_time() - before) / n * 1e9)
        close()
        whole.append((time.perf_counter() - began) / n * 1e9)
    return statistics.median(caller), statistics.median(whole)


def unheard(n: int) -> float:
    """Return the time for a call of `brrt.log` while no recording is open, in ns."""
    q, times = [1.0, 2.0], []
    for _ in range(ROUNDS):
        before = time.thread_time()
        for _ in range(n):
            log.edge(q, 0)
        times.append((time.thread_time() - before) / n * 1e9)
    return statistics.median(times)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--events", type=int, default=200_000)
    n = parser.parse_args().events
    cases = {"samples one by one": samples(n), "edges one by one": one_by_one(n, 1.0)}
    cases["edges, costs worked out"] = one_by_one(n, None)
    for size in (100, 1000, 10_000):
        cases[f"edges in arrays of {size:,}"] = in_arrays(n, size)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        print(f"{'ns an event':28}{'caller':>10}{'closed file':>13}")
        for name, work in cases.items():
            caller, whole = cost(n, work, path)
            print(f"{name:28}{caller:10.0f}{whole:13.0f}")
        for name, (make, suffix) in OTHERS.items():
            try:
                caller, whole = cost_of_other(min(n, len(Q)), make, path.with_suffix(suffix))
            except ModuleNotFoundError as error:
                print(f"{name:28}{f'no {error.name}':>10}")
                continue
            print(f"{name:28}{caller:10.0f}{whole:13.0f}")
    print(f"{'brrt.log.edge, none open':28}{unheard(n):10.0f}")


if __name__ == "__main__":
    main()
