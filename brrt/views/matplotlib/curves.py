"""Curves of a run, or of several: what the best path costs, and where the time goes."""

from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.views.matplotlib import style
from brrt.views.matplotlib.history import Record

Floats = NDArray[np.float64]
Against = Literal["time", "iterations"]

FEWEST = 5
"""Runs that differ in their seeds alone, from which on their median and quartiles are drawn."""
_BINS, _WILD = 60, 20


class Curve(NamedTuple):
    """The cost of the best path, which holds until the next one is found.

    Attributes:
        x: When, in seconds since planning began, or the iteration; the last is when it ended.
        cost: From then on, shape (n,); infinite before the first path.
        first: Index of the first path.
    """

    x: Floats
    cost: Floats
    first: int | None


def cost_curve(record: Record, against: Against) -> Curve:
    """Return what the best path that the planner had found so far cost, as it planned."""
    began, end, t_column = *_planning(record.events), "t"
    if against == "iterations":
        began, end, t_column = 0, _last_iteration(record.events), "iteration"
    paths = record.events[Kind.PATH]
    paths = paths[paths["stage"] != Stage.SMOOTHED]
    scale = 1e9 if against == "time" else 1.0
    x = np.concatenate([[began], paths[t_column], [end]]) - began
    costs = np.concatenate([[np.inf], paths["cost"], paths["cost"][-1:]])
    if not len(paths):
        costs = np.full(2, np.inf)
    return Curve(np.maximum.accumulate(x) / scale, costs, 1 if len(paths) else None)


def draw_cost(ax: Any, records: Sequence[Record], against: Against | None = None) -> Any:
    """Draw what the best paths cost, and where the first were found; return the axes.

    Runs that differ in their seeds alone become a median with a band of quartiles if they are
    five or more.

    Args:
        ax: Axes of matplotlib.
        records: The runs.
        against: The abscissa; time by default, or iterations where a clock was logical.

    Raises:
        BrrtError: No run has found a path.
    """
    if against is None:
        logical = any(record.manifest.scenario.clock == "logical" for record in records)
        against = "iterations" if logical else "time"
    curves = [cost_curve(record, against) for record in records]
    if all(curve.first is None for curve in curves):
        names = ", ".join(record.name for record in records[:3])
        raise BrrtError(f"{names}: no path was found, so there is no cost to draw; try --what tree")
    size, unit = 1.0, ""
    if against == "time":
        size, unit = style.unit_of(max(float(curve.x[-1]) for curve in curves))
    groups = list(_groups(records))
    colours = iter(style.CURVES * len(records))
    for label, which in groups:
        mine = [Curve(curves[i].x / size, *curves[i][1:]) for i in which]
        if len(which) >= FEWEST:
            _draw_band(ax, mine, f"{label} ({len(which)} runs)", next(colours))
            continue
        for i, curve in zip(which, mine, strict=True):
            _draw_curve(ax, records[i], curve, next(colours), alone=len(records) == 1)
    ax.set_xlabel("iteration" if against == "iterations" else f"planning time ({unit})")
    if against == "iterations":
        ax.xaxis.set_major_formatter("{x:,.0f}")
    ax.set_ylabel("cost of the best path")
    style.clean(ax)
    ax.set_xlim(left=0)
    ax.legend()
    return ax


def draw_time(axes: Sequence[Any], record: Record) -> None:
    """Draw over iterations: the time that each took, rejections in a hundred, events a second.

    Args:
        axes: Three, which share their abscissa.
        record: The run.

    Raises:
        BrrtError: It has no iterations.
    """
    events = record.events
    last = _last_iteration(events)
    if last < 1:
        raise BrrtError(f"{record.name}: there are no iterations, so there is no time to draw")
    edges = np.linspace(0, last, min(last, _BINS) + 1).astype(np.int64)
    elapsed = np.diff(_times_at(events, edges)) / 1e9
    rejects, added, everything = (_counted(events, edges, kinds) for kinds in _COUNTED)
    with np.errstate(divide="ignore", invalid="ignore"):
        rejected = 100 * rejects / (rejects + added)
        pace = np.where(elapsed > 0, everything / elapsed, np.nan)
    per_iteration, unit = _scaled(elapsed / np.diff(edges))
    pace, many = _in_thousands(pace)
    if record.manifest.scenario.clock == "logical":
        note = "logical clock: 1 µs an event"
        axes[0].set_title(note, loc="left", color=style.QUIET, pad=4)
    rows = (per_iteration, rejected, pace)
    labels = (f"{unit} / iteration", "rejected (%)", f"{many}events / s")
    for ax, values, label, colour in zip(axes, rows, labels, style.CURVES, strict=False):
        ax.stairs(values, edges, baseline=None, color=colour, linewidth=0.9)
        ax.set_ylabel(label)
        style.clean(ax)
        if ax is axes[0] and _wild(values):
            ax.set_yscale("log")
        else:
            ax.set_ylim(bottom=0)
        ax.set_xlim(0, last)
        ax.tick_params(labelbottom=ax is axes[-1])
    axes[1].set_ylim(0, 100)
    axes[-1].set_xlabel("iteration")
    axes[-1].xaxis.set_major_formatter("{x:,.0f}")


def _scaled(seconds: Floats) -> tuple[Floats, str]:
    """Return durations in the unit that suits them, and its name."""
    taken = seconds[seconds > 0]
    size, unit = style.unit_of(float(np.median(taken)) if len(taken) else 1.0)
    return seconds / size, unit


def _wild(values: Floats) -> bool:
    """Whether a few values would leave nothing to see of the others on a scale from 0."""
    taken = values[values > 0]
    return len(taken) > 0 and bool(taken.max() > _WILD * np.median(taken))


def _in_thousands(values: Floats) -> tuple[Floats, str]:
    most = np.nanmax(values, initial=0.0)
    for size, name in ((1e6, "10$^6$ "), (1e3, "10$^3$ ")):
        if most >= size:
            return values / size, name
    return values, ""


_ADDED = (Kind.EDGE, Kind.EXPAND)
_COUNTED = ((Kind.REJECT,), _ADDED, tuple(Kind))


def _draw_curve(ax: Any, record: Record, curve: Curve, colour: Any, *, alone: bool) -> None:
    name = "best so far" if alone else record.name
    if curve.first is None:
        ax.plot([], [], color=colour, label=f"{name} (no path)")
        return
    x, cost = curve.x[curve.first :], curve.cost[curve.first :]
    ax.plot(x, cost, drawstyle="steps-post", color=colour, lw=1.1, label=name)
    first = "first path" if alone else "_"
    ax.plot(x[0], cost[0], "o", ms=3.5, color=colour, mec="white", mew=0.5, label=first)
    smoothed = [p for p in record.events[Kind.PATH] if p["stage"] == Stage.SMOOTHED]
    if alone and smoothed:
        look = {"color": style.SMOOTHED, "mec": "white", "mew": 0.5, "clip_on": False}
        ax.plot(x[-1], smoothed[-1]["cost"], "D", ms=4, label="smoothed", **look)


def _draw_band(ax: Any, curves: Sequence[Curve], label: str, colour: Any) -> None:
    x = np.unique(np.concatenate([curve.x for curve in curves]))
    costs = np.array([c.cost[np.searchsorted(c.x, x, side="right") - 1] for c in curves])
    middle = np.median(costs, axis=0)
    # Quartiles are costs that some run had: between a cost and no path at all lies nothing.
    low, high = np.quantile(costs, [0.25, 0.75], axis=0, method="inverted_cdf")
    top = np.where(np.isfinite(high), high, np.max(costs[np.isfinite(costs)]))
    there = np.isfinite(low)
    ax.fill_between(
        x[there], low[there], top[there], step="post", color=colour, alpha=0.2, linewidth=0
    )
    found = np.isfinite(middle)
    ax.plot(x[found], middle[found], drawstyle="steps-post", color=colour, lw=1.2, label=label)


def _groups(records: Sequence[Record]) -> Iterator[tuple[str, list[int]]]:
    """Yield the runs that differ in their seeds alone, and a name for each lot."""
    found: dict[str, list[int]] = {}
    for i, record in enumerate(records):
        values = record.manifest.scenario.as_dict()
        found.setdefault(repr({**values, "seed": None, "draws": None}), []).append(i)
    for which in found.values():
        scenario = records[which[0]].manifest.scenario
        params = ", ".join(
            f"{name}={str(value).lower()}" for name, value in scenario.params.items()
        )
        yield f"{scenario.planner}{' ' if params else ''}{params}", which


def _planning(events: Events) -> tuple[int, int]:
    """Return when planning began and when it ended, in ns; the last event's time if it did not."""
    phases = events[Kind.PHASE]
    mine = phases[phases["name"] == Phase.PLAN]
    begins, ends = mine[mine["status"] == Status.BEGIN], mine[mine["status"] != Status.BEGIN]
    began = int(begins["t"][0]) if len(begins) else 0
    return began, int(ends["t"][0]) if len(ends) else events.last.t


def _last_iteration(events: Events) -> int:
    return events.last.iteration


def _of_planning(events: Events) -> Events:
    """Leave out what comes after planning: it counts to the last iteration, and takes time."""
    phases = events[Kind.PHASE]
    ended = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)]
    return events.until(seq=int(ended["seq"][0])) if len(ended) else events


def _times_at(events: Events, iterations: NDArray[np.int64]) -> Floats:
    """Return when each iteration's last event happened, in ns, shape (n,)."""
    tables = [t for t in _of_planning(events).tables.values() if len(t)]
    count = np.concatenate([table["iteration"] for table in tables])
    t = np.concatenate([table["t"] for table in tables])
    order = np.lexsort((t, count))
    count, t = count[order], t[order]
    at = np.searchsorted(count, iterations, side="right") - 1
    began = float(_planning(events)[0])
    return np.where(at >= 0, t[np.maximum(at, 0)].astype(np.float64), began)


def _counted(events: Events, edges: NDArray[np.int64], kinds: Sequence[Kind]) -> Floats:
    """Count events of some kinds between iterations, behind the first and up to the second."""
    part = _of_planning(events)
    behind = sum(np.searchsorted(part[kind]["iteration"], edges, side="right") for kind in kinds)
    return np.diff(np.asarray(behind, np.float64))
