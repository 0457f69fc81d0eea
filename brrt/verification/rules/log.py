"""Rules about any recording: how events are numbered, what they name, and what lies in bounds."""

import math
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.collision.bodies import wrapping_angles
from brrt.events import FIELDS, Events, Kind, Table
from brrt.replay.metrics import Metrics
from brrt.replay.text import vector
from brrt.scenario.contract import Contract
from brrt.scenario.contracts import contract_differences
from brrt.scenario.manifest import Manifest
from brrt.verification.context import Context, waypoints
from brrt.verification.rule import Rule
from brrt.verification.tolerances import CLOSE

_HEAD = np.dtype([("seq", "<i8"), ("t", "<i8"), ("iteration", "<i8")])


def heads(events: Events) -> Table:
    """Return number, time and iteration of all events, by number."""
    heads = np.empty(len(events), _HEAD)
    first = 0
    for table in events.tables.values():
        for name in _HEAD.names or ():
            heads[name][first : first + len(table)] = table[name]
        first += len(table)
    return heads[np.argsort(heads["seq"], kind="stable")]


class Numbering(Rule):
    name = "numbering"
    promise = "Events are numbered 0, 1, 2 ..."
    last, count = -1, 0

    def window(self, events: Events, contract: Contract) -> None:
        log, count = heads(events), self.count
        steps = np.diff(log["seq"], prepend=self.last)
        self.judge(
            log, steps != 1,
            lambda i: f"event {log['seq'][i]} is at position {count + i} of the log",
        )  # fmt: skip
        self.last, self.count = int(log["seq"][-1]), count + len(log)


class Times(Rule):
    name = "times"
    promise = "Times rise from event to event, from 0 on; iterations never fall."
    t, iteration = -1, 0

    def window(self, events: Events, contract: Contract) -> None:
        log = heads(events)
        before = np.append(self.t, log["t"][:-1])
        self.judge(
            log, log["t"] <= before,
            lambda i: (
                f"time {log['t'][i]} ns "
                + ("is below 0" if before[i] < 0 else f"does not follow {before[i]} ns")
            ),
        )  # fmt: skip
        falls = log[np.diff(log["iteration"], prepend=self.iteration) < 0]
        self.judge(
            falls, np.ones(len(falls), bool),
            lambda i: f"iteration {falls['iteration'][i]} follows a greater one",
        )  # fmt: skip
        self.t, self.iteration = int(log["t"][-1]), int(log["iteration"][-1])


class Names(Rule):
    name = "names"
    promise = "Sources, reasons and stages are known ones."

    def window(self, events: Events, contract: Contract) -> None:
        for kind, table in events.tables.items():
            for field in FIELDS[kind]:
                if field.choices is not None and kind is not Kind.PHASE:
                    self._judge(table, field.name, [int(choice) for choice in field.choices])

    def _judge(self, table: Table, name: str, known: list[int]) -> None:
        values = table[name]
        self.judge(table, ~np.isin(values, known), lambda i: f"unknown {name} {values[i]}")


class StoredMetrics(Rule):
    name = "metrics"
    promise = "The metrics at the recording's end are those of its events, within rounding."
    of_end = True

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.metrics = Metrics(context.manifest) if context.result else None

    def window(self, events: Events, contract: Contract) -> None:
        if self.metrics is not None:
            self.metrics.write(events)

    def finish(self) -> None:
        stored = self.context.result or {}
        for name, value in self.metrics.as_dict().items() if self.metrics else ():
            if name in stored:
                said = f"{name} is {stored[name]!r} at the end, {value!r} by the events"
                equal = _equal(stored[name], value)
                self.judge_one(None, None if equal else f"{' '.join(said.split()):.160}")


def _equal(a: Any, b: Any) -> bool:
    """Whether metrics are equal; numbers may be rounded."""
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(_equal, a, b))
    if isinstance(a, float) or isinstance(b, float):
        try:
            return math.isclose(a, b, rel_tol=CLOSE)
        except TypeError:
            return False
    return type(a) is type(b) and bool(a == b)


class Bounds(Rule):
    name = "bounds"
    promise = (
        "Samples, nodes, cells, moves and waypoints are within bounds and joint limits, "
        "angles that wrap in [-pi, pi)."
    )
    assumes = ("bounds",)

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        # Each configuration has one way to be written, so angles that wrap get no tolerance.
        wraps = wrapping_angles(context.robot, context.dof)
        slack = np.where(wraps, 0.0, context.tolerance)
        self.low = context.lower - slack
        self.high = np.where(wraps, np.nextafter(np.pi, 0), context.upper + slack)

    def window(self, events: Events, contract: Contract) -> None:
        for kind in (Kind.SAMPLE, Kind.EDGE, Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE, Kind.VERTEX):
            self._judge(kind, events[kind])
        for event in events[Kind.PATH]:
            path = waypoints(event, self.context.dof)
            out = np.flatnonzero(~self._inside(path))
            wrong = f"waypoint {out[0]} at {vector(path[out[0]])}" if len(out) else None
            self.judge_one(event, wrong)

    def _judge(self, kind: Kind, table: Table) -> None:
        q = np.asarray(table["q"])
        self.judge(table, ~self._inside(q), lambda i: f"{kind.label} at {vector(q[i])}")

    def _inside(self, q: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray(((self.low <= q) & (q <= self.high)).all(axis=1))


class StatedContract(Rule):
    name = "contract"
    promise = "The contract is that of the registered planner, for the same version of brrt."

    def finish(self) -> None:
        differences = contract_differences(self.context.manifest, self.context.world)
        if differences is None or not same_version(self.context.manifest):
            return
        self.judge_one(None, differences[0] if differences else None)
        for difference in differences[1:]:
            self.result.add_finding(None, difference)


def same_version(manifest: Manifest) -> bool:
    """Return whether this version of brrt made the recording; others may have other defaults."""
    return manifest.made_by.get("brrt") == version("brrt")


RULES = (Numbering, Times, Names, StoredMetrics, Bounds, StatedContract)
