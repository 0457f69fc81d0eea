"""The experiments of examples/, planner against planner: the table of examples/README.md.

    python benchmarks/experiments.py [--seeds 30]

Each line is one planner on one experiment, over the seeds: how many were solved, and the medians
of iterations, of extensions tried (each asks for one motion check), of the time to plan, and of
those solved the cost and motions of the path before and after smoothing. The speed-up is the
standard RRT's figure on the same experiment over the planner's own. Nothing is recorded.
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

from brrt import Run, Scenario

EXAMPLES = Path(__file__).parents[1] / "examples"

STANDARD = ("rrt", {"step": 1.0, "goal_bias": 0.1})
EXTEND = ("bi-rrt", {"step": 1.0})
CONNECT = ("bi-rrt", {"step": 1.0, "grow": "connect", "link": "connect"})
RRT_CONNECT = ("rrt-connect", {"step": 1.0})

ROBOTS = ("house-easy", "house-hard", "arm-easy", "arm-hard")


@dataclass(frozen=True, slots=True)
class Row:
    """What a planner did on an experiment, seed by seed."""

    name: str
    planner: str
    figures: list[dict[str, Any]]

    @property
    def solved(self) -> list[dict[str, Any]]:
        """The runs that found a path."""
        return [each for each in self.figures if each["solved"]]

    @property
    def iterations(self) -> float:
        """Median iterations, of failures too."""
        return float(median(each["iterations"] for each in self.figures))

    @property
    def extensions(self) -> float:
        """Median extensions, of failures too: each becomes a node or is rejected."""
        return float(median(each["nodes"] + each["rejects"] for each in self.figures))

    @property
    def ms(self) -> float:
        """Median time to plan, of failures too."""
        return 1e3 * float(median(each["plan_time_s"] for each in self.figures))

    def cost(self, stage: str) -> float:
        """Median cost of the paths; `stage` is `path` or `smoothed`."""
        return float(median(each[f"{stage}_cost"] for each in self.solved))

    def motions(self, stage: str) -> float:
        """Median number of motions of the paths."""
        key = "path" if stage == "path" else "smoothed_path"
        return float(median(len(each[key]) - 1 for each in self.solved))


def measure(name: str, planner: str, params: Mapping[str, Any], seeds: int) -> Row:
    """Run one planner on the world and the query of a scenario file."""
    base = Scenario.load(EXAMPLES / f"{name}.toml")
    scenarios = (replace(base, planner=planner, params=params, seed=seed) for seed in range(seeds))
    return Row(name, label(planner, params), [Run(s).execute().as_dict() for s in scenarios])


def label(planner: str, params: Mapping[str, Any]) -> str:
    """Name a planner and its variant."""
    grow = params.get("grow", "extend")
    return f"{planner}, {grow}" if planner == "bi-rrt" else planner


def rows(seeds: int) -> Iterator[tuple[Row, Row | None]]:
    """Measure everything; with each row comes the one of the standard planner, if there is one."""
    for name in ROBOTS:
        standard = measure(name, *STANDARD, seeds)
        yield standard, None
        for planner, params in (CONNECT, EXTEND, RRT_CONNECT):
            yield measure(name, planner, params, seeds), standard
    for name in ("arm-unreachable", "circles", "squares"):
        scenario = Scenario.load(EXAMPLES / f"{name}.toml")
        yield measure(name, scenario.planner, scenario.params, seeds), None


def line(row: Row, standard: Row | None) -> str:
    """Write a row of the table."""
    cells = [row.name, row.planner, f"{len(row.solved)}/{len(row.figures)}"]
    cells += [f"{row.iterations:,.0f}", f"{row.extensions:,.0f}", f"{row.ms:.2f}"]
    for stage in ("path", "smoothed"):
        known = row.solved and row.solved[0][f"{stage}_cost"] is not None
        cells.append(f"{row.cost(stage):.1f} / {row.motions(stage):.0f}" if known else "")
    if standard is None:
        cells.append("")
    else:
        factors = (
            standard.iterations / row.iterations,
            standard.extensions / row.extensions,
            standard.ms / row.ms,
        )
        cells.append(" / ".join(f"{factor:.1f}" for factor in factors))
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=30)
    seeds = parser.parse_args().seeds
    print(
        "| experiment | planner | solved | iterations | extensions | ms | path: cost / motions "
        "| smoothed | speed-up: iterations / extensions / time |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for row, standard in rows(seeds):
        print(line(row, standard), flush=True)


if __name__ == "__main__":
    main()
