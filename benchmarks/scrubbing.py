"""How long the viewer takes to show another instant of a tree, by the number of edges drawn.

    python benchmarks/scrubbing.py [--edges 10000,50000,100000] [--planner rrt]

It runs without a window; where there is no GPU, a software driver rasterises, and the picture of
a few edges takes most of a second already. So what counts is how the times grow.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from brrt import Kind, Run, Scenario
from brrt.views.rerun.sink import RerunSink
from brrt.views.viewer.control import Cursor, headless, shoot

RUNS: dict[str, dict[str, Any]] = {
    "rrt": {"world": "enclosure2d", "params": {"step": 0.3, "goal_bias": 0}},
    "rrt-star": {"world": "squares2d:n=100"},
}
INSTANTS = (0.9, 0.95, 0.99, 0.93, 0.97)
"""Parts of the run: nearly all edges are in sight at each."""


def grown(planner: str, edges: int, path: Path) -> tuple[int, int]:
    """Draw a tree of so many edges into a file; return how many it has, and its events."""
    run = Run(Scenario(planner=planner, iterations=100 * edges, smooth=False, **RUNS[planner]))
    sink, nodes, events = RerunSink(run.manifest, run.problem.world, path=path), 0, 0
    for batch in run.events():
        sink.write(batch)
        nodes, events = nodes + batch.counts.get(Kind.EDGE, 0), events + len(batch)
        if nodes > edges:
            break
    sink.close(None)
    return nodes - 1, events


def seconds(path: Path, events: int) -> tuple[float, float, list[float]]:
    """Return how long it takes to open a file, to draw it again, and to seek."""
    with headless((1600, 1000)) as client:
        began = time.perf_counter()
        shoot(client, path, Cursor("event", events // 2))
        opened, seeks = time.perf_counter() - began, []
        store = client.get_state().recordings[0].store_id
        for part in INSTANTS:
            began = time.perf_counter()
            client.set_time("event", sequence=int(part * events), recording=store)
            client.take_screenshot()
            seeks.append(time.perf_counter() - began)
        began = time.perf_counter()
        client.take_screenshot()
        return opened, time.perf_counter() - began, seeks


def main() -> None:
    """Measure and print a line for each tree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edges", default="10000,50000,100000")
    parser.add_argument("--planner", choices=RUNS, default="rrt")
    options = parser.parse_args()
    print(
        f"{'edges':>8}  {'MB':>5}  {'open, s':>8}  {'seek, s':>8}  {'most, s':>8}  {'again, s':>8}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for edges in map(int, options.edges.split(",")):
            path = Path(folder, "run.rrd")
            have, events = grown(options.planner, edges, path)
            opened, again, seeks = seconds(path, events)
            times = (opened, statistics.median(seeks), max(seeks), again)
            print(
                f"{have:>8,}  {path.stat().st_size / 1e6:>5.1f}",
                *(f"{each:>8.2f}" for each in times),
                sep="  ",
            )


if __name__ == "__main__":
    main()
