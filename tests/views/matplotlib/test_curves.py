"""Curves agree with the metrics of runs."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from brrt import Events, Kind, Memory, Metrics, Recording, metrics, plot
from brrt.events import Stage
from brrt.views.matplotlib import curves
from tests.support.figures import golden


@pytest.mark.parametrize("name", ["circles2d-rrt-star", "boxes3d-bi-rrt-star"])
def test_the_cost_curve_is_the_metrics(name: str) -> None:
    """After each iteration the curve has the cost of the metrics."""
    recording = golden(name)
    ax = plot(recording, Figure().subplots(), what="cost")
    x, y = (np.asarray(values) for values in ax.lines[0].get_data())
    assert ax.lines[0].get_drawstyle() == "steps-post"
    for iteration in range(int(x[0]), int(x[-1])):
        fold = Metrics(recording.manifest)
        fold.write(recording.events().until(iteration=iteration))
        assert y[np.flatnonzero(x <= iteration)[-1]] == fold.as_dict()["path_cost"]
    final = metrics(recording).as_dict()
    assert (x[0], y[0]) == (final["first_path_iteration"], final["first_path_cost"])
    assert (x[-1], y[-1]) == (final["iterations"], final["path_cost"])
    assert ax.lines[2].get_ydata()[0] == final["smoothed_cost"]


def seeds(count: int) -> tuple[list[Recording], list[str]]:
    """Return runs that differ in their seeds and in when their paths were found, and names."""
    base, runs, rng = golden("circles2d-rrt-star"), list[Recording](), np.random.default_rng(5)
    for seed in range(count):
        tables = {kind: table.copy() for kind, table in base.events().tables.items()}
        paths = tables[Kind.PATH]
        paths["cost"] += rng.integers(0, 30)
        kept = np.sort(rng.choice(len(paths) - 1, 5, replace=False))
        tables[Kind.PATH] = paths[kept] if seed else paths[:0]
        scenario = base.manifest.scenario.parse({**base.manifest.scenario.as_dict(), "seed": seed})
        memory = Memory()
        memory.write(Events(2, tables))
        runs.append(memory.recording(replace(base.manifest, scenario=scenario), base.world))
    return runs, [f"s{seed}" for seed in range(count)]


def test_many_seeds_become_a_median_with_quartiles() -> None:
    """At every iteration the line is the median of the costs; no path is infinite."""
    runs, names = seeds(9)
    ax = curves.draw_cost(Figure().subplots(), runs, names)
    (line,) = ax.lines
    x, y = (np.asarray(values) for values in line.get_data())
    for iteration in range(int(x[0]), 300):
        costs = []
        for run in runs:
            paths = run.events()[Kind.PATH]
            before = paths[(paths["iteration"] <= iteration) & (paths["stage"] != Stage.SMOOTHED)]
            costs.append(float(before["cost"][-1]) if len(before) else np.inf)
        assert y[np.flatnonzero(x <= iteration)[-1]] == np.median(costs)
    (band,) = ax.collections
    low, high = band.get_paths()[0].vertices[:, 1].min(), y.min()
    assert low <= high
    assert "9 runs" in line.get_label()


def test_few_runs_are_drawn_one_by_one() -> None:
    """Each has its own colour and name, also one without a path."""
    ax = curves.draw_cost(Figure().subplots(), *seeds(3))
    labels = [line.get_label() for line in ax.lines if not line.get_label().startswith("_")]
    assert labels == ["s0 (no path)", "s1", "s2"]
    assert len({line.get_color() for line in ax.lines}) == 3


def test_time_adds_up() -> None:
    """The times of all iterations add up to the time of planning; shares are of a bin."""
    recording = golden("circles2d-rrt-star")
    axes = Figure().subplots(3, 1)
    curves.draw_time(axes, recording, "run")
    per_iteration, rejected, rate = (ax.patches[0].get_data() for ax in axes)
    widths = np.diff(per_iteration.edges)
    final = metrics(recording).as_dict()
    assert per_iteration.edges[-1] == final["iterations"]
    assert (per_iteration.values * widths).sum() == pytest.approx(
        1e6 * final["plan_time_s"], rel=0.01
    )
    assert np.allclose(rate.values, 1.0)  # a million a second: the clock is logical
    first, last = rejected.edges[10], rejected.edges[11]
    counts = {}
    for kind in (Kind.REJECT, Kind.EDGE):
        rows = recording.events()[kind]["iteration"]
        counts[kind] = ((rows > first) & (rows <= last)).sum()
    share = 100 * counts[Kind.REJECT] / sum(counts.values())
    assert rejected.values[10] == pytest.approx(share)
