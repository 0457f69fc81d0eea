"""What recording costs the caller of `brrt.record`, beside the stock mcap writer.

    python benchmarks/record.py [--events 200000]

Processor time of the calling thread for each event: one by one, and in arrays. The stock writer
writes the same edges as JSON, on the calling thread. The last row is a call of `brrt.log` while no
recording is open. Times are medians of five rounds.
"""

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
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


def one_by_one(n: int) -> Callable[[Recorder], None]:
    """Record edges with numbers and costs that the recorder adds."""
    points = Q[:n].tolist() * (n // len(Q) + 1)

    def work(rec: Recorder) -> None:
        for q in points[:n]:
            rec.edge(q, 0)

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


def stock(n: int, path: Path) -> float:
    """Return the time for an edge that mcap's own writer writes, in ns."""
    times = []
    for _ in range(ROUNDS):
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start()
            schema = writer.register_schema("edge", "jsonschema", b"{}")
            channel = writer.register_channel("/edge", "json", schema)
            before = time.thread_time()
            for i, q in enumerate(Q[:n].tolist()):
                data = json.dumps({"node": i, "parent": 0, "cost": 1.0, "q": q}).encode()
                writer.add_message(channel, log_time=i, publish_time=i, data=data)
            times.append((time.thread_time() - before) / n * 1e9)
            writer.finish()
    return statistics.median(times)


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
    cases = {"samples one by one": samples(n), "edges one by one": one_by_one(n)}
    for size in (100, 1000, 10_000):
        cases[f"edges in arrays of {size:,}"] = in_arrays(n, size)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        print(f"{'ns an event':28}{'caller':>10}{'closed file':>13}")
        for name, work in cases.items():
            caller, whole = cost(n, work, path)
            print(f"{name:28}{caller:10.0f}{whole:13.0f}")
        print(f"{'stock mcap writer, JSON':28}{stock(min(n, len(Q)), path):10.0f}")
    print(f"{'brrt.log.edge, none open':28}{unheard(n):10.0f}")


if __name__ == "__main__":
    main()
