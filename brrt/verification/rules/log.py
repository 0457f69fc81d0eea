"""Rules about any log: how it is numbered, what it says of its phases, what lies in bounds."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.collision.bodies import endless
from brrt.events import FIELDS, Events, Kind, Phase, Stage, Status, Table
from brrt.replay.metrics import Metrics
from brrt.verification.context import CLOSE, Context, Windows, waypoints
from brrt.verification.result import RuleResult

_TICK_S = 1e-3
"""A real clock is read so often, at least."""

_ONE_MOTION = 2
"""Waypoints of a path that cannot be shortened."""

_HEAD = np.dtype([("seq", "<i8"), ("t", "<i8"), ("iteration", "<i8")])


def heads(events: Events) -> Table:
    """Number, time and iteration of all events, by number."""
    heads = np.empty(len(events), _HEAD)
    at = 0
    for table in events.tables.values():
        for name in _HEAD.names or ():
            heads[name][at : at + len(table)] = table[name]
        at += len(table)
    return heads[np.argsort(heads["seq"], kind="stable")]


def numbering(context: Context, result: RuleResult) -> Windows:  # noqa: ARG001 - every rule takes both
    """Events are numbered 0, 1, 2 ..."""
    last, count = -1, 0
    while (window := (yield)) is not None:
        log = heads(window)
        steps = np.diff(log["seq"], prepend=last)
        result.look(
            log, steps != 1,
            lambda i, log=log, n=count: f"event {log['seq'][i]} is number {n + i} of the log",  # type: ignore[misc]
        )  # fmt: skip
        last, count = int(log["seq"][-1]), count + len(log)


def times(context: Context, result: RuleResult) -> Windows:  # noqa: ARG001 - every rule takes both
    """Time rises from event to event, and no time is below 0; iterations never fall."""
    t, iteration = -1, 0
    while (window := (yield)) is not None:
        log = heads(window)
        before = np.concatenate([[t], log["t"][:-1]])
        result.look(
            log, log["t"] <= before,
            lambda i, log=log, b=before: (  # type: ignore[misc]
                f"time {log['t'][i]} ns does not follow "
                + ("the beginning" if b[i] < 0 else f"{b[i]}")
            ),
        )  # fmt: skip
        back = log[np.diff(log["iteration"], prepend=iteration) < 0]
        result.look(
            back, np.ones(len(back), bool),
            lambda i, b=back: f"iteration {b['iteration'][i]} follows a greater one",  # type: ignore[misc]
        )  # fmt: skip
        t, iteration = int(log["t"][-1]), int(log["iteration"][-1])


def phases(context: Context, result: RuleResult) -> None:
    """Planning begins with the first event; each phase ends before the next one begins."""
    running: int | None = None
    for event in context.events[Kind.PHASE]:
        name, status = int(event["name"]), int(event["status"])
        if status == Status.BEGIN:
            wrong = None if running is None else f"{_phase(name)} begins within {_phase(running)}"
            running = name
        else:
            wrong = None if running == name else f"{_phase(name)} ends, but it had not begun"
            running = None
        if name not in set(Phase) or status not in set(Status):
            wrong = f"there is no phase {name} or no status {status}"
        result.one(event, wrong)
    if running is not None and not context.cut:
        result.one(None, f"{_phase(running)} does not end")
    first = context.events[Kind.PHASE][:1]
    opens = len(first) and first["name"][0] == Phase.PLAN and first["seq"][0] == 0
    bare = context.cut and not context.kept.count  # cut ahead of its first event: it breaks nothing
    wrong = None if opens or bare else "the log does not open with the beginning of planning"
    result.one(None, wrong)


def _phase(number: int) -> str:
    return f"phase {Phase.label_of(number)}"


def names(context: Context, result: RuleResult) -> Windows:  # noqa: ARG001 - every rule takes both
    """Sources, reasons and stages are among those that there are."""
    while (window := (yield)) is not None:
        for kind, fields in FIELDS.items():
            for field in fields:
                table, choices = window[kind], field.choices
                if choices is None or not len(table) or kind is Kind.PHASE:
                    continue
                values, name = table[field.name], field.name
                wrong = ~np.isin(values, [int(choice) for choice in choices])
                result.look(table, np.asarray(wrong), _naming(name, values))


def _naming(name: str, values: NDArray[np.uint8]) -> Callable[[int], str]:
    return lambda i: f"there is no {name} {values[i]}"


def outcome(context: Context, result: RuleResult) -> None:
    """A run that says it is solved has a path; one that says there is none has none."""
    phases = context.events[Kind.PHASE]
    ends = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)][-1:]
    event, wrong = ends[0] if len(ends) else None, None
    if context.outcome is Status.SOLVED and not context.found:
        wrong = "planning ended as solved, but there is no path"
    elif (
        context.found and context.outcome is not None and context.outcome not in _with_path(context)
    ):
        wrong = f"there is a path, but planning ended as {context.outcome.label}"
    result.one(event, wrong)


def _with_path(context: Context) -> set[Status]:
    """How planning may end where there is a path: who improves it, or tries again, has a budget."""
    lattices = [contract.lattice for _, contract in context.stretches]
    again = any(lattice is not None and lattice.trials > 1 for lattice in lattices)
    stops = context.contract.near is None and context.contract.stops is not False
    if stops and context.known and not again:
        return {Status.SOLVED, Status.INTERRUPTED}
    return set(Status) - {Status.BEGIN} - {s for s in Status if s.name == "NO_PATH"}


def _made(context: Context) -> int:
    """Iterations that count."""
    made, begin = 0, 0
    joins = context.events[Kind.EDGE]["iteration"]
    adding = joins[np.diff(joins, prepend=-1) != 0]
    ends = [
        *(branch.iteration for branch in context.manifest.branches),
        context.kept.last_iteration,
    ]
    for number, end in enumerate(ends):
        # Where failed draws do not count, only those that add a node do.
        growth = context.stretches[min(number, len(context.stretches) - 1)][1].growth
        sparing = growth is not None and not growth.counts_failed
        made += int(((begin < adding) & (adding <= end)).sum()) if sparing else end - begin
        begin = end
    return made


def budget(context: Context, result: RuleResult) -> None:
    """No more iterations, draws and attempts to smooth than allowed."""
    scenario, attempts = context.manifest.scenario, len(context.events[Kind.SHORTCUT])
    limits = [
        ("iterations", _made(context), scenario.iterations),
        ("draws", context.kept.last_iteration, scenario.draws),
        ("attempts to smooth", attempts, scenario.shortcuts),
    ]
    for what, count, limit in limits:
        over = limit is not None and count > limit
        result.one(None, f"{count:,} {what}; {limit:,} are allowed" if over else None)


def endings(context: Context, result: RuleResult) -> None:
    """What is said to have ended a phase did: a budget was used up, a path found, all was done."""
    phases = context.events[Kind.PHASE]
    plan = phases[phases["name"] == Phase.PLAN]
    ends = plan[plan["status"] != Status.BEGIN][-1:]
    if not context.known:
        return
    after = phases[(phases["name"] != Phase.PLAN) & (phases["status"] != Status.BEGIN)]
    for event in after:
        result.one(event, _not_done(context, event))
    if not len(ends):
        return
    scenario, wrong = context.manifest.scenario, None
    if context.outcome is Status.ITERATION_LIMIT:
        wrong = _left(context)
    elif context.outcome is Status.TIME_LIMIT:
        took = int(ends["t"][0] - plan["t"][0]) / 1e9
        if scenario.time is None:
            wrong = "planning ended for want of time, but its time was not limited"
        elif scenario.clock == "real" and took < scenario.time * (1 - CLOSE) - _TICK_S:
            wrong = f"planning ended after {took:.6f} s; it had {scenario.time:g} s"
    elif context.outcome is Status.SOLVED and context.contract.stops is False:
        wrong = "planning ended as solved; it was to go on for a better path"
    result.one(ends[0], wrong or _impossible(context))


def _impossible(context: Context) -> str | None:
    """Say why planning cannot have ended as it is said to have."""
    if context.outcome is Status.NO_PATH and context.contract.lattice is None:
        return "planning ended as if there were no path, which only a search can prove"
    if context.outcome is Status.DONE:
        return "planning is said to be done, which is no way for it to end"
    return None


def _not_done(context: Context, event: np.void) -> str | None:
    """Say why the smoother or the robot cannot have ended as it is said to have."""
    status, name = int(event["status"]), int(event["name"])
    if status == Status.INTERRUPTED:
        return None
    if status != Status.DONE:
        return f"{_phase(name)} can only be done or interrupted"
    attempts, due = len(context.events[Kind.SHORTCUT]), context.manifest.scenario.shortcuts
    left = [len(path) for said, path in context.paths if said["stage"] == Stage.SMOOTHED][-1:]
    if name == Phase.SMOOTH and attempts < due and left and left[0] > _ONE_MOTION:
        return f"{attempts:,} of {due:,} attempts to smooth were made"
    return None


def _left(context: Context) -> str | None:
    """Say what was left of a budget of iterations."""
    scenario, draws = context.manifest.scenario, context.kept.last_iteration
    limit = scenario.iteration_limit(context.contract.planner.default_iterations)
    made = _made(context)
    spent = scenario.draws is not None and draws >= scenario.draws
    # Where failed draws do not count, their number has an end all the same.
    spent |= made < draws and draws >= 1000 * limit
    return None if made >= limit or spent else f"planning made {made:,} of {limit:,} iterations"


def figures(context: Context, result: RuleResult) -> Windows:
    """The figures at a recording's end are those of its events; numbers may be rounded."""
    stated = context.figures
    metrics = None if stated is None else Metrics(context.manifest)
    while (window := (yield)) is not None:
        if metrics is not None:
            metrics.write(window)
    if stated is None or metrics is None:
        return
    for name, figure in metrics.as_dict().items():
        if name in stated:
            wrong = not _same_figure(stated[name], figure)
            said = f"{name} is {stated[name]!r} at its end, {figure!r} by what stands before"
            said = " ".join(said.split())
            result.one(None, f"{said:.160}" if wrong else None)


def _same_figure(a: Any, b: Any) -> bool:
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(_same_figure, a, b))
    if isinstance(a, float) or isinstance(b, float):
        try:
            return math.isclose(a, b, rel_tol=CLOSE)
        except TypeError:
            return False
    return type(a) is type(b) and bool(a == b)


def bounds(context: Context, result: RuleResult) -> Windows:
    """Samples, nodes, cells, moves and waypoints lie in bounds, joint limits and [-pi, pi).

    The last is for angles that wrap: each configuration has one way of being written.
    """
    turns = endless(context.robot, context.dof)
    slack = np.where(turns, 0.0, context.blur)
    low = context.lower - slack
    high = np.where(turns, np.nextafter(np.pi, 0), context.upper + slack)
    while (window := (yield)) is not None:
        for kind in (Kind.SAMPLE, Kind.EDGE, Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE):
            table = window[kind]
            q = np.asarray(table["q"])
            wrong = np.asarray(~((low <= q) & (q <= high)).all(axis=1))
            result.look(table, wrong, lambda i, k=kind, q=q: f"{k.label} at {text(q[i])}")  # type: ignore[misc]
        for event in window[Kind.PATH]:
            path = waypoints(event, context.dof)
            out = np.flatnonzero(~((low <= path) & (path <= high)).all(axis=1))
            result.one(event, f"waypoint {out[0]} at {text(path[out[0]])}" if len(out) else None)


def text(q: NDArray[np.float64]) -> str:
    """Write a configuration."""
    return "(" + ", ".join(f"{x:.6g}" for x in np.asarray(q).tolist()) + ")"


RULES = (numbering, times, phases, names, outcome, budget, endings, figures, bounds)
"""All rules of this file; see `brrt.verification`."""
