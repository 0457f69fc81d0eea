"""Rules about any log: how it is numbered, what it says of its phases, what lies in bounds."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brrt.events import FIELDS, Events, Kind, Phase, Source, Status, Table
from brrt.replay.checks.bodies import endless
from brrt.replay.checks.case import Case, Tally

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


def numbering(case: Case, tally: Tally) -> None:
    """Events are numbered 0, 1, 2 ..."""
    log = heads(case.events)
    steps = np.diff(log["seq"], prepend=-1)
    tally.look(log, steps != 1, lambda i: f"event {log['seq'][i]} is number {i} of the log")


def times(case: Case, tally: Tally) -> None:
    """Time rises from event to event, and no time is below 0; iterations never fall."""
    log = heads(case.events)
    wrong = np.diff(log["t"], prepend=-1) <= 0
    tally.look(
        log, wrong, lambda i: f"time {log['t'][i]} ns does not follow {_before(log, 't', i)}"
    )
    back = np.diff(log["iteration"], prepend=0) < 0
    tally.look(
        log[back], np.ones(int(back.sum()), bool),
        lambda i: f"iteration {log['iteration'][back][i]} follows a greater one",
    )  # fmt: skip


def _before(log: Table, name: str, i: int) -> str:
    return "the beginning" if i == 0 else f"{log[name][i - 1]}"


def phases(case: Case, tally: Tally) -> None:
    """Planning begins with the first event; each phase ends before the next one begins."""
    running: int | None = None
    for event in case.events[Kind.PHASE]:
        name, status = int(event["name"]), int(event["status"])
        if status == Status.BEGIN:
            wrong = None if running is None else f"{_phase(name)} begins within {_phase(running)}"
            running = name
        else:
            wrong = None if running == name else f"{_phase(name)} ends, but it had not begun"
            running = None
        if name not in set(Phase) or status not in set(Status):
            wrong = f"there is no phase {name} or no status {status}"
        tally.one(event, wrong)
    if running is not None and not case.cut:
        tally.one(None, f"{_phase(running)} does not end")
    first = case.events[Kind.PHASE][:1]
    opens = len(first) and first["name"][0] == Phase.PLAN and first["seq"][0] == 0
    tally.one(None, None if opens else "the log does not open with the beginning of planning")


def _phase(number: int) -> str:
    return f"phase {Phase(number).name.lower() if number in set(Phase) else number}"


def names(case: Case, tally: Tally) -> None:
    """Sources, reasons and stages are among those that there are."""
    for kind, fields in FIELDS.items():
        for field in fields:
            table, choices = case.events[kind], field.choices
            if choices is None or not len(table) or kind is Kind.PHASE:
                continue
            values, name = table[field.name], field.name
            wrong = ~np.isin(values, [int(choice) for choice in choices])
            tally.look(table, np.asarray(wrong), _naming(name, values))


def _naming(name: str, values: NDArray[np.uint8]) -> Callable[[int], str]:
    return lambda i: f"there is no {name} {values[i]}"


def outcome(case: Case, tally: Tally) -> None:
    """A run that says it is solved has a path; one that says there is none has none."""
    ends = case.events[Kind.PHASE][-1:]
    event = ends[0] if len(ends) else None
    wrong = None
    if case.outcome is Status.SOLVED and not case.found:
        wrong = "planning ended as solved, but there is no path"
    elif case.found and case.outcome is not None and case.outcome not in _with_path(case):
        wrong = f"there is a path, but planning ended as {case.outcome.name.lower()}"
    tally.one(event, wrong)


def _with_path(case: Case) -> set[Status]:
    """How planning may end where there is a path: who improves it, or tries again, has a budget."""
    trials = case.manifest.scenario.settings().get("trials", 1)
    if case.contract.near is None and case.known and trials == 1:
        return {Status.SOLVED, Status.INTERRUPTED}
    return set(Status) - {Status.BEGIN} - {s for s in Status if s.name == "NO_PATH"}


def budget(case: Case, tally: Tally) -> None:
    """No more iterations, draws and attempts to smooth than allowed."""
    scenario, events = case.manifest.scenario, case.events
    last = max((int(t["iteration"].max()) for t in events.tables.values() if len(t)), default=0)
    made, begin = 0, 0
    adding = np.unique(events[Kind.EDGE]["iteration"])
    ends = [*(branch.iteration for branch in case.manifest.branches), last]
    for end, (_, ruling) in zip(ends, case.manifest.stretches, strict=True):
        # Where failed draws do not count, only those that add a node do.
        sparing = ruling.settings().get("count_failed") is False
        made += int(((begin < adding) & (adding <= end)).sum()) if sparing else end - begin
        begin = end
    limits = [("iterations", made, scenario.iterations), ("draws", last, scenario.draws)]
    limits.append(("attempts to smooth", len(events[Kind.SHORTCUT]), scenario.shortcuts))
    for what, count, limit in limits:
        over = limit is not None and count > limit
        tally.one(None, f"{count:,} {what}; {limit:,} are allowed" if over else None)


def bounds(case: Case, tally: Tally) -> None:
    """Samples, nodes, cells, moves and waypoints lie in bounds, joint limits and [-pi, pi).

    The last is for angles that wrap: each configuration has one way of being written.
    """
    slack = np.where(endless(case.robot, case.events.dof), 0.0, case.blur)
    low, high = case.lower - slack, case.upper + slack
    high = np.where(endless(case.robot, case.events.dof), np.nextafter(np.pi, 0), high)
    for kind in (Kind.SAMPLE, Kind.EDGE, Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE):
        table = case.events[kind]
        q = np.asarray(table["q"])
        wrong = np.asarray(~((low <= q) & (q <= high)).all(axis=1))
        tally.look(table, wrong, lambda i, k=kind, q=q: f"{k.label} at {text(q[i])}")  # type: ignore[misc]
    for event, path in case.paths:
        out = np.flatnonzero(~((low <= path) & (path <= high)).all(axis=1))
        tally.one(event, f"waypoint {out[0]} at {text(path[out[0]])}" if len(out) else None)


def samples(case: Case, tally: Tally) -> None:
    """Samples of the goal are the goal; the other tree's goal is the start."""
    table = case.events[Kind.SAMPLE]
    goals = table[table["source"] == Source.GOAL]
    q = np.asarray(goals["q"])
    wrong = (q != case.goal).any(axis=1)
    wrong &= (goals["tree"] != 1) | (q != case.start).any(axis=1)
    tally.look(goals, wrong, lambda i: f"sample {text(goals['q'][i])} is not the goal")


def text(q: NDArray[np.float64]) -> str:
    """Write a configuration."""
    return "(" + ", ".join(f"{x:.6g}" for x in np.asarray(q).tolist()) + ")"


RULES = (numbering, times, phases, names, outcome, budget, bounds, samples)
"""All rules of this file; see `brrt.replay.checks`."""
