"""Curves of runs: the cost of the best path, and the time and outcome of iterations."""

from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.recording import Recording
from brrt.views.matplotlib import style

Floats = NDArray[np.float64]
Against = Literal["time", "iterations"]

FEWEST = 5
"""Runs of different seeds that become a median and quartiles; fewer are drawn one by one."""
_BINS, _WIDE = 60, 20
"""Bins of iterations at most; maximum over median from which on a scale is logarithmic."""
_COUNTED = ((Kind.REJECT,), (Kind.EDGE, Kind.EXPAND), tuple(Kind))
"""Kinds of events that are rejections, additions, and all."""


class Curve(NamedTuple):
    """The cost of the best path over time, as steps.

    Attributes:
        x: Seconds since planning began, or iterations, shape (n,); the last is the end.
        cost: The cost from then on, shape (n,); infinite before the first path.
        first: Index of the first path; None if there is none.
    """

    x: Floats
    cost: Floats
    first: int | None


def cost_curve(recording: Recording, against: Against) -> Curve:
    """Return the cost of the planner's best path so far, until planning ends."""
    events = recording.events()
    began, end, t_column = *_planning(events), "t"
    if against == "iterations":
        began, end, t_column = 0, events.last.iteration, "iteration"
    paths = events[Kind.PATH]
    paths = paths[paths["stage"] != Stage.SMOOTHED]
    scale = 1e9 if against == "time" else 1.0
    x = np.concatenate([[began], paths[t_column], [end]]) - began
    costs = np.concatenate([[np.inf], paths["cost"], paths["cost"][-1:]])
    if not len(paths):
        costs = np.full(2, np.inf)
    return Curve(np.maximum.accumulate(x) / scale, costs, 1 if len(paths) else None)


def draw_cost(
    ax: Any, recordings: Sequence[Recording], names: Sequence[str], against: Against | None = None
) -> Any:
    """Draw the cost of the best path of each run, with a dot at the first path; return the axes.

    Five or more runs that differ in their seeds only become a median with a band of quartiles.

    Args:
        ax: Axes of matplotlib.
        recordings: The runs.
        names: Their names in the legend.
        against: The abscissa: time, or iterations, the default if a clock was logical.

    Raises:
        BrrtError: No run has a path.
    """
    if against is None:
        logical = any(run.manifest.scenario.clock == "logical" for run in recordings)
        against = "iterations" if logical else "time"
    curves = [cost_curve(run, against) for run in recordings]
    if all(curve.first is None for curve in curves):
        some = ", ".join(names[:3])
        raise BrrtError(f"{some}: no path was found, so there is no cost to draw; try --what tree")
    size, unit = 1.0, ""
    if against == "time":
        size, unit = style.unit_of(max(float(curve.x[-1]) for curve in curves))
    colours = iter(style.CURVES * len(recordings))
    for label, which in _groups(recordings):
        mine = [Curve(curves[i].x / size, *curves[i][1:]) for i in which]
        if len(which) >= FEWEST:
            _draw_band(ax, mine, f"{label} ({len(which)} runs)", next(colours))
            continue
        for i, curve in zip(which, mine, strict=True):
            if len(recordings) == 1:
                _draw_single(ax, recordings[i].events(), curve, next(colours))
            else:
                _draw_curve(ax, curve, next(colours), names[i])
    ax.set_xlabel("iteration" if against == "iterations" else f"planning time ({unit})")
    if against == "iterations":
        ax.xaxis.set_major_formatter("{x:,.0f}")
    ax.set_ylabel("cost of the best path")
    style.clean(ax)
    ax.set_xlim(left=0)
    ax.legend()
    return ax


def draw_time(axes: Sequence[Any], recording: Recording, name: str) -> None:
    """Draw over iterations, on three axes: time of each, rejections in per cent, events a second.

    Raises:
        BrrtError: It has no iterations.
    """
    events = recording.events()
    last = events.last.iteration
    if last < 1:
        raise BrrtError(f"{name}: there are no iterations, so there is no time to draw")
    edges = np.linspace(0, last, min(last, _BINS) + 1).astype(np.int64)
    elapsed = np.diff(_times_at(events, edges)) / 1e9
    rejects, added, everything = (_counted(events, edges, kinds) for kinds in _COUNTED)
    with np.errstate(divide="ignore", invalid="ignore"):
        rejected = 100 * rejects / (rejects + added)
        rate = np.where(elapsed > 0, everything / elapsed, np.nan)
    per_iteration, unit = _scaled(elapsed / np.diff(edges))
    rate, many = _in_thousands(rate)
    if recording.manifest.scenario.clock == "logical":
        note = "logical clock: 1 µs an event"
        axes[0].set_title(note, loc="left", color=style.QUIET, pad=4)
    rows = (per_iteration, rejected, rate)
    labels = (f"{unit} / iteration", "rejected (%)", f"{many}events / s")
    for ax, values, label, colour in zip(axes, rows, labels, style.CURVES, strict=False):
        ax.stairs(values, edges, baseline=None, color=colour, linewidth=0.9)
        ax.set_ylabel(label)
        style.clean(ax)
        if ax is axes[0] and _is_wide(values):
            ax.set_yscale("log")
        else:
            ax.set_ylim(bottom=0)
        ax.set_xlim(0, last)
        ax.tick_params(labelbottom=ax is axes[-1])
    axes[1].set_ylim(0, 100)
    axes[-1].set_xlabel("iteration")
    axes[-1].xaxis.set_major_formatter("{x:,.0f}")


def _scaled(seconds: Floats) -> tuple[Floats, str]:
    """Return durations in a unit that fits their median, and the unit."""
    taken = seconds[seconds > 0]
    size, unit = style.unit_of(float(np.median(taken)) if len(taken) else 1.0)
    return seconds / size, unit


def _is_wide(values: Floats) -> bool:
    """Return whether most values would be invisible on a linear scale."""
    taken = values[values > 0]
    return len(taken) > 0 and bool(taken.max() > _WIDE * np.median(taken))


def _in_thousands(values: Floats) -> tuple[Floats, str]:
    most = np.nanmax(values, initial=0.0)
    for size, name in ((1e6, "10$^6$ "), (1e3, "10$^3$ ")):
        if most >= size:
            return values / size, name
    return values, ""


def _draw_curve(ax: Any, curve: Curve, colour: Any, name: str, first: str = "_") -> None:
    """Draw a curve and a dot at the first path, with names for the legend."""
    name = style.literal(name)
    if curve.first is None:
        ax.plot([], [], color=colour, label=f"{name} (no path)")
        return
    x, cost = curve.x[curve.first :], curve.cost[curve.first :]
    ax.plot(x, cost, drawstyle="steps-post", color=colour, lw=1.1, label=name)
    ax.plot(x[0], cost[0], "o", ms=3.5, color=colour, mec="white", mew=0.5, label=first)


def _draw_single(ax: Any, events: Events, curve: Curve, colour: Any) -> None:
    """Draw the curve of the only run, and the cost of its smoothed path."""
    _draw_curve(ax, curve, colour, "best so far", "first path")
    smoothed = [path for path in events[Kind.PATH] if path["stage"] == Stage.SMOOTHED]
    if smoothed:
        looks = {"color": style.SMOOTHED, "mec": "white", "mew": 0.5, "clip_on": False}
        ax.plot(curve.x[-1], smoothed[-1]["cost"], "D", ms=4, label="smoothed", **looks)


def _draw_band(ax: Any, curves: Sequence[Curve], label: str, colour: Any) -> None:
    x = np.unique(np.concatenate([curve.x for curve in curves]))
    costs = np.array([c.cost[np.searchsorted(c.x, x, side="right") - 1] for c in curves])
    middle = np.median(costs, axis=0)
    # Each quartile is the cost of a run: one cannot interpolate between a cost and no path.
    low, high = np.quantile(costs, [0.25, 0.75], axis=0, method="inverted_cdf")
    top = np.where(np.isfinite(high), high, np.max(costs[np.isfinite(costs)]))
    some = np.isfinite(low)
    ax.fill_between(
        x[some], low[some], top[some], step="post", color=colour, alpha=0.2, linewidth=0
    )
    found = np.isfinite(middle)
    name = style.literal(label)
    ax.plot(x[found], middle[found], drawstyle="steps-post", color=colour, lw=1.2, label=name)


def _groups(recordings: Sequence[Recording]) -> Iterator[tuple[str, list[int]]]:
    """Yield groups of runs that differ in their seeds only: a name and their indices."""
    found: dict[str, list[int]] = {}
    for i, recording in enumerate(recordings):
        values = recording.manifest.scenario.as_dict()
        found.setdefault(repr({**values, "seed": None, "draws": None}), []).append(i)
    for which in found.values():
        scenario = recordings[which[0]].manifest.scenario
        params = ", ".join(
            f"{name}={str(value).lower()}" for name, value in scenario.params.items()
        )
        yield f"{scenario.planner}{' ' if params else ''}{params}", which


def _planning(events: Events) -> tuple[int, int]:
    """Return when planning began and when it ended, in ns; if it did not, the last event's time."""
    phases = events[Kind.PHASE]
    mine = phases[phases["name"] == Phase.PLAN]
    begins, ends = mine[mine["status"] == Status.BEGIN], mine[mine["status"] != Status.BEGIN]
    began = int(begins["t"][0]) if len(begins) else 0
    return began, int(ends["t"][0]) if len(ends) else events.last.t


def _of_planning(events: Events) -> Events:
    """Return the events up to the end of planning; later ones belong to the last iteration."""
    phases = events[Kind.PHASE]
    ended = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)]
    return events.until(seq=int(ended["seq"][0])) if len(ended) else events


def _times_at(events: Events, iterations: NDArray[np.int64]) -> Floats:
    """Return the time of the last event of each iteration, in ns, shape (n,)."""
    tables = [t for t in _of_planning(events).tables.values() if len(t)]
    count = np.concatenate([table["iteration"] for table in tables])
    t = np.concatenate([table["t"] for table in tables])
    order = np.lexsort((t, count))
    count, t = count[order], t[order]
    at = np.searchsorted(count, iterations, side="right") - 1
    began = float(_planning(events)[0])
    return np.where(at >= 0, t[np.maximum(at, 0)].astype(np.float64), began)


def _counted(events: Events, edges: NDArray[np.int64], kinds: Sequence[Kind]) -> Floats:
    """Return the number of events of some kinds in bins of iterations, (edge, next edge]."""
    part = _of_planning(events)
    counts = sum(np.searchsorted(part[kind]["iteration"], edges, side="right") for kind in kinds)
    return np.diff(np.asarray(counts, np.float64))
