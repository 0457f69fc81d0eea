"""What recording costs: ours against the stock MCAP writer and reader, side by side in one run.

    python benchmarks/recording.py [--events 1000000] [--repeats 5] [--no-rerun]

Every figure is a median over the repeats; the ratios are what counts, as machines differ.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from brrt.events import Events, Kind
from brrt.formats import McapSink, read_mcap
from brrt.formats.background import BackgroundSink
from brrt.formats.mcap.messages import channel_of, definition
from brrt.recording import Memory, Sink
from brrt.replay.metrics import metrics
from brrt.runs.run import Run
from brrt.scenario.scenario import Scenario

# An obstacle field that the step cannot pass, so that the run makes the events it is asked for.
WORLD = "boxes3d:n=200,size=100,min_side=5,max_side=15"


def timed(work: Callable[[], object]) -> float:
    """Seconds that a call takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def make_run(events: int) -> Run:
    """A 3D run that never finds the goal, of about so many events."""
    scenario = Scenario(
        world=WORLD, params={"goal_bias": 0.0, "step": 0.05}, iterations=events // 2, smooth=False
    )
    return Run(scenario)


def stock_write_seconds(path: Path, run: Run, batches: list[Events]) -> float:
    """Write messages with mcap's own writer, one by one; return how long that alone took."""
    bodies = encoded(run, batches)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start("ros2")
        channels = {}
        for kind in Kind:
            text = definition(kind, run.problem.dof).encode()
            schema = writer.register_schema(f"brrt_msgs/msg/{kind.label}", "ros2msg", text)
            topic = f"/brrt/{kind.label}"
            channels[channel_of(kind)] = writer.register_channel(topic, "cdr", schema)
        began = time.perf_counter()
        for channel, log_time, seq, body in bodies:
            writer.add_message(channels[channel], log_time, body, log_time, seq)
        writer.finish()
        return time.perf_counter() - began


def encoded(run: Run, batches: list[Events]) -> list[tuple[int, int, int, bytes]]:
    """The same messages, encoded beforehand: the stock writer is not charged for that."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "all.mcap"
        sink = McapSink(path, run.manifest, run.problem.world)
        for batch in batches:
            sink.write(batch)
        sink.close({})
        with path.open("rb") as file:
            return [
                (channel.id, message.log_time, message.sequence, message.data)
                for _, channel, message in make_reader(file).iter_messages()
            ]


def plan_seconds(events: int, folder: Path, kinds: tuple[str, ...]) -> tuple[float, int]:
    """Wall clock of a whole run with the given recordings, files closed."""
    run = make_run(events)
    sinks: list[Sink] = []
    if "mcap" in kinds:
        path = folder / "run.mcap"
        sinks.append(BackgroundSink(McapSink(path, run.manifest, run.problem.world)))
    if "rrd" in kinds:
        from brrt.views.rerun.sink import RerunSink  # noqa: PLC0415 - optional here

        path = folder / "run.rrd"
        sinks.append(BackgroundSink(RerunSink(run.manifest, run.problem.world, path=path)))
    began = time.perf_counter()
    metrics = run.execute(sinks)
    return time.perf_counter() - began, int(metrics.as_dict()["events"])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--no-rerun", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        measure(Path(name), options.events, options.repeats, rerun=not options.no_rerun)


def measure(folder: Path, events: int, repeats: int, *, rerun: bool) -> None:
    """Run every comparison and print a line each."""
    run, memory = make_run(events), Memory()
    run.execute([memory])
    count = sum(map(len, memory.batches))

    def ours() -> None:
        sink = McapSink(folder / "ours.mcap", run.manifest, run.problem.world)
        for batch in memory.batches:
            sink.write(batch)
        sink.close(memory.result)

    write_ratios, read_ratios, stock_us = [], [], []
    for _ in range(repeats):
        stock = stock_write_seconds(folder / "stock.mcap", run, memory.batches)
        stock_us.append(stock / count * 1e6)
        mine = timed(ours)
        write_ratios.append(stock / mine)
        stock_read = timed(lambda: count_messages(folder / "ours.mcap"))
        my_read = timed(lambda: metrics(read_mcap(folder / "ours.mcap")))
        read_ratios.append(stock_read / my_read)
        rates = (count / stock, count / mine, count / stock_read, count / my_read)
        print("  events a second: stock write %.0f, ours %.0f; stock read %.0f, ours %.0f" % rates)
    say("write, ours over stock (bar 10)", write_ratios)
    say("replay, ours over stock (bar 20)", read_ratios)

    per_message = statistics.median(stock_us)
    variants: dict[str, tuple[tuple[str, ...], float]] = {"MCAP alone": (("mcap",), 1 / 10)}
    if rerun:
        variants["MCAP and Rerun"] = (("mcap", "rrd"), 1 / 6)
    for label, (kinds, bar) in variants.items():
        added = []
        for _ in range(repeats):
            bare, _ = plan_seconds(events, folder, ())
            with_files, n = plan_seconds(events, folder, kinds)
            added.append((with_files - bare) / n * 1e6)
        cost = statistics.median(added)
        print(
            f"{label}: recording adds {cost:.3f} us an event "
            f"(from {min(added):.3f} to {max(added):.3f}), {cost / per_message:.3f} of the stock "
            f"writer's {per_message:.2f} us a message (bar {bar:.3f})"
        )
    size = (folder / "ours.mcap").stat().st_size
    print(f"{count:,} events; MCAP {size / count:.1f} bytes an event")


def count_messages(path: Path) -> int:
    """Read every message with the stock reader."""
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file).iter_messages())


def say(what: str, ratios: list[float]) -> None:
    """Print a ratio's median and range."""
    middle, low, high = statistics.median(ratios), min(ratios), max(ratios)
    print(f"{what}: {middle:.1f} (from {low:.1f} to {high:.1f})")


if __name__ == "__main__":
    np.seterr(all="raise")
    main()
