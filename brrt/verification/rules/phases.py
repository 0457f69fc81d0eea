"""Rules about the phases of a run: what belongs to them, and how they end."""

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Stage, Status, Table
from brrt.scenario.contract import Contract
from brrt.verification.context import Context
from brrt.verification.rule import ANY_PART, Rule
from brrt.verification.tolerances import CLOSE

_TICK_S = 1e-3
"""A real clock is read at least this often."""

_STRAIGHT = 2
"""Waypoints of a path that no shortcut makes shorter."""

_NONE = -1

Ints = NDArray[np.int64]


def _label(number: int) -> str:
    return f"phase {Phase.label_of(number)}"


class Phases(Rule):
    name = "phases"
    promise = "Planning begins with the first event; each phase ends before the next one begins."

    def finish(self) -> None:
        running, phases = _NONE, self.context.events[Kind.PHASE]
        for event in phases:
            name, status = int(event["name"]), int(event["status"])
            begins, wrong = status == Status.BEGIN, None
            if name not in set(Phase) or status not in set(Status):
                wrong = f"unknown phase {name} or status {status}"
            elif begins and running != _NONE:
                wrong = f"{_label(name)} begins within {_label(running)}"
            elif not begins and running != name:
                wrong = f"{_label(name)} ends but has not begun"
            running = name if begins else _NONE
            self.judge_one(event, wrong)
        if running != _NONE and not self.context.is_cut:
            self.judge_one(None, f"{_label(running)} does not end")
        first = phases[:1]
        opens = len(first) and first["name"][0] == Phase.PLAN and first["seq"][0] == 0
        empty = self.context.is_cut and not self.context.kept.kinds
        wrong = "the log does not begin with the beginning of planning"
        self.judge_one(None, None if opens or empty else wrong)


class PhaseContents(Rule):
    name = "phase contents"
    promise = "Each event is within the phase that it belongs to."

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.running = _NONE
        # Only robots that learn as they go move while they plan.
        self.moves_later = context.has_contract and not context.contract.learns

    def window(self, events: Events, contract: Contract) -> None:
        phases = events[Kind.PHASE]
        begins = phases["status"] == Status.BEGIN
        states = np.append(self.running, np.where(begins, phases["name"].astype(np.int64), _NONE))
        for kind, table in events.tables.items():
            if kind is not Kind.PHASE:
                self._judge(kind, table, states[np.searchsorted(phases["seq"], table["seq"])])
        self.running = int(states[-1])

    def _judge(self, kind: Kind, table: Table, phase: Ints) -> None:
        due = np.full(len(table), int(Phase.PLAN))
        if kind is Kind.SHORTCUT:
            due[:] = Phase.SMOOTH
        elif kind is Kind.PATH:
            due[table["stage"] == Stage.SMOOTHED] = Phase.SMOOTH
        elif kind is Kind.MOVE:
            due = np.where(self.moves_later | (phase != Phase.PLAN), int(Phase.EXECUTE), due)
        self.judge(
            table, phase != due,
            lambda i: (
                f"{kind.label} "
                + (f"within {_label(int(phase[i]))}" if phase[i] >= 0 else "outside of all phases")
            ),
        )  # fmt: skip


class Outcome(Rule):
    name = "outcome"
    promise = "Planning ends as solved exactly if there is a path."

    def finish(self) -> None:
        phases, outcome = self.context.events[Kind.PHASE], self.context.outcome
        ends = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)][-1:]
        found, wrong = self.context.planned_paths, None
        if outcome is Status.SOLVED and not found:
            wrong = "planning ended as solved, but there is no path"
        elif found and outcome is not None and outcome not in self._possible():
            wrong = f"there is a path, but planning ended as {outcome.label}"
        self.judge_one(ends[0] if len(ends) else None, wrong)

    def _possible(self) -> set[Status]:
        """Return how planning may end if there is a path."""
        context = self.context
        lattices = [contract.lattice for _, contract in context.stretches]
        again = any(lattice is not None and lattice.trials > 1 for lattice in lattices)
        stops = context.contract.near is None and context.contract.stops is not False
        if stops and context.has_contract and not again:
            return {Status.SOLVED, Status.INTERRUPTED}
        return set(Status) - {Status.BEGIN, Status.NO_PATH}


class Budget(Rule):
    name = "budget"
    promise = "There are no more iterations, draws and shortcut attempts than allowed."

    def finish(self) -> None:
        scenario, attempts = self.context.manifest.scenario, self.context.events[Kind.SHORTCUT]
        limits = [
            ("iterations", _iterations(self.context), scenario.iterations),
            ("draws", self.context.kept.last_iteration, scenario.draws),
            ("shortcut attempts", len(attempts), scenario.shortcuts),
        ]
        for what, count, limit in limits:
            over = limit is not None and count > limit
            self.judge_one(None, f"{count:,} {what}; {limit:,} are allowed" if over else None)


def _iterations(context: Context) -> int:
    """Count the iterations that a budget counts."""
    count, begin = 0, 0
    joins = context.events[Kind.EDGE]["iteration"]
    joined = joins[np.diff(joins, prepend=-1) != 0]
    branches = [branch.iteration for branch in context.manifest.branches]
    for number, end in enumerate([*branches, context.kept.last_iteration]):
        growth = context.stretches[min(number, len(context.stretches) - 1)][1].growth
        # Where failed draws do not count, only those that add a node do.
        adding = growth is not None and not growth.counts_failed
        count += int(((begin < joined) & (joined <= end)).sum()) if adding else end - begin
        begin = end
    return count


class Endings(Rule):
    name = "endings"
    promise = "Phases end for the stated reason: a limit reached, a path found, or all done."
    needs = ANY_PART
    of_end = True

    def finish(self) -> None:
        phases = self.context.events[Kind.PHASE]
        ends = phases[phases["status"] != Status.BEGIN]
        for event in ends[ends["name"] != Phase.PLAN]:
            self.judge_one(event, self._wrong_end(event))
        plan = ends[ends["name"] == Phase.PLAN]
        if len(plan):
            begins = phases[phases["name"] == Phase.PLAN]
            self.judge_one(plan[-1], self._wrong_plan(int(plan["t"][-1] - begins["t"][0]) / 1e9))

    def _wrong_plan(self, took: float) -> str | None:
        """Return why planning cannot have ended as stated, after so many seconds."""
        outcome, contract = self.context.outcome, self.context.contract
        scenario = self.context.manifest.scenario
        if outcome is Status.ITERATION_LIMIT:
            return self._iterations_left()
        if outcome is Status.TIME_LIMIT:
            if scenario.time is None:
                return "planning ended at a time limit, but there is none"
            early = scenario.clock == "real" and took < scenario.time * (1 - CLOSE) - _TICK_S
            return f"planning ended after {took:.6f} s of {scenario.time:g} s" if early else None
        if outcome is Status.SOLVED and contract.stops is False:
            return "planning ended as solved; by contract it improves its path to the end"
        if outcome is Status.NO_PATH and contract.lattice is None:
            return "planning ended as having no path, which only a search can prove"
        if outcome is Status.DONE:
            return "planning ended as done, a status of other phases"
        return None

    def _wrong_end(self, event: np.void) -> str | None:
        """Return why the smoother or the robot cannot have ended as stated."""
        status, name = int(event["status"]), int(event["name"])
        if status == Status.INTERRUPTED:
            return None
        if status != Status.DONE:
            return f"{_label(name)} can only end as done or interrupted"
        made = len(self.context.events[Kind.SHORTCUT])
        due = self.context.manifest.scenario.shortcuts
        left = [len(q) for path, q in self.context.paths if path["stage"] == Stage.SMOOTHED][-1:]
        if name == Phase.SMOOTH and made < due and left and left[0] > _STRAIGHT:
            return f"only {made:,} of {due:,} shortcut attempts were made"
        return None

    def _iterations_left(self) -> str | None:
        """Return what is left of the budget of iterations, if that matters."""
        context = self.context
        scenario, draws = context.manifest.scenario, context.kept.last_iteration
        if scenario.iterations is None and not context.contract.planner.registered:
            return None  # the limit is not stated
        limit = scenario.iteration_limit(context.contract.planner.default_iterations)
        made = _iterations(context)
        # Where failed draws do not count, they are limited all the same.
        spent = scenario.draws is not None and draws >= scenario.draws
        spent |= made < draws and draws >= 1000 * limit
        done = made >= limit or spent
        return None if done else f"planning ended after {made:,} of {limit:,} iterations"


RULES = (Phases, PhaseContents, Outcome, Budget, Endings)
