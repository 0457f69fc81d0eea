"""How long it takes to judge a recording, rule by rule, and how much memory.

    python benchmarks/verify.py [--events 1000000] [--planner rrt] [--run FILE] [--folder verify]

For each planner a run of about so many events is recorded, in a folder that is kept, and judged in
a process of its own. Times are those of the processor, so that others who use the machine do not
matter: for reading, for each of the slowest rules, and in all.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

from brrt import McapSink, Run, Scenario, read, verify
from brrt.verification.rule import Rule
from brrt.verification.rules import RULES

# No goal is ever reached by those that would stop at it.
NEVER = {"goal_bias": 0.0, "step": 0.02}
SCENARIOS: dict[str, tuple[float, dict[str, Any]]] = {
    "rrt": (2.0, {"params": NEVER}),
    "rrt-connect": (4.0, {"params": {"step": 0.002}}),
    "rrt-star": (3.0, {"params": {"step": 4.0}}),
    "bi-rrt-star": (6.0, {"params": {"step": 4.0}}),
    "lrta-star": (2.4, {"params": {"cell": 0.01, "max_move": 0.0}}),
    "a-star": (1.0, {"params": {"cell": 0.02, "max_move": 0.0}}),
}
"""For each planner: events that come of an iteration, and what of a scenario is its own."""

SHOWN = 5


def record(planner: str, events: int, folder: Path) -> Path:
    """Record a run, unless the file exists."""
    path = folder / f"{planner}-{events}.mcap"
    if not path.exists():
        rate, own = SCENARIOS[planner]
        scenario = Scenario(
            world="circles2d:n=200,max_radius=2,seed=3", planner=planner, smooth=False,
            iterations=max(1, int(events / rate)), **own,
        )  # fmt: skip
        run = Run(scenario)
        run.execute([McapSink(path, run.manifest, run.problem.world)])
    return path


def timed(rule: type[Rule], spent: Counter[str]) -> type[Rule]:
    """Return a rule that adds up the time that it takes."""

    class Timed(rule):  # type: ignore[valid-type, misc]
        def window(self, *given: Any) -> None:
            began = time.process_time()
            super().window(*given)
            spent[rule.name] += time.process_time() - began  # type: ignore[assignment]

        def finish(self) -> None:
            began = time.process_time()
            super().finish()
            spent[rule.name] += time.process_time() - began  # type: ignore[assignment]

    return Timed


def judge(path: Path) -> dict[str, Any]:
    """Read and judge a recording; return the figures."""
    spent: Counter[str] = Counter()
    recording = read(path)
    began = time.process_time()
    events = sum(map(len, recording.batches()))
    reading = time.process_time() - began
    began, since = time.process_time(), time.perf_counter()
    found = verify(recording, rules=[timed(rule, spent) for rule in RULES])
    return {
        "events": events,
        "reading": reading,
        "took": time.process_time() - began,
        "wall": time.perf_counter() - since,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "broken": [result.rule for result in found.results if result.broken],
        "slowest": spent.most_common(SHOWN),
    }


def main() -> int:
    """Judge each; print a paragraph for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--events", type=int, default=1_000_000)
    parser.add_argument("--planner", choices=SCENARIOS, action="append")
    parser.add_argument("--run", type=Path, help="judge this recording, and print figures in JSON")
    parser.add_argument("--folder", type=Path, default=Path("verify"))
    args = parser.parse_args()
    if args.run is not None:
        print(json.dumps(judge(args.run)))
        return 0
    args.folder.mkdir(parents=True, exist_ok=True)
    bad = False
    for planner in args.planner or SCENARIOS:
        path = record(planner, args.events, args.folder)
        command = [sys.executable, __file__, "--run", str(path)]
        found = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        print(
            f"{planner:12} {found['events']:>11,} events  {found['took']:6.1f} s "
            f"({found['wall']:.1f} s by the clock)  {found['peak']:5.0f} MB  "
            f"{'BROKEN ' + ', '.join(found['broken']) if found['broken'] else 'holds'}"
        )
        slowest = ", ".join(f"{name} {s:.1f}" for name, s in found["slowest"])
        print(f"{'':12} of that reading {found['reading']:.1f}, {slowest}", flush=True)
        bad |= bool(found["broken"])
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
