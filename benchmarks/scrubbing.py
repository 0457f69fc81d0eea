"""The time that the viewer takes to show another instant of a tree, by the number of drawn edges.

    python benchmarks/scrubbing.py [--edges 10000,50000,100000] [--planner rrt]

It runs without a window. Without a GPU, a software driver takes most of a second even for a few
edges, so the growth of the times is what counts.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from brrt import Kind, Memory, Run, Scenario
from brrt.views.rerun.drawing import draw_run
from brrt.views.viewer.control import Cursor, headless, shoot

RUNS: dict[str, dict[str, Any]] = {
    "rrt": {"world": "enclosure2d", "params": {"step": 0.3, "goal_bias": 0}},
    "rrt-star": {"world": "squares2d:n=100"},
}
INSTANTS = (0.9, 0.95, 0.99, 0.93, 0.97)
"""Parts of the run; at each, nearly all edges are visible."""


def grown(planner: str, edges: int, path: Path) -> tuple[int, int]:
    """Draw a tree of at least so many edges into a file; return the number of edges and events."""
    run = Run(Scenario(planner=planner, iterations=100 * edges, smooth=False, **RUNS[planner]))
    memory, nodes = Memory(), 0
    for batch in run.events():
        memory.write(batch)
        nodes += batch.counts.get(Kind.EDGE, 0)
        if nodes > edges:
            break
    draw_run(path, memory.recording(run.manifest, run.problem.world))
    return nodes - 1, sum(map(len, memory.batches))


def seconds(path: Path, events: int) -> tuple[float, float, list[float]]:
    """Return the times to open a file, to draw it again, and to seek."""
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
