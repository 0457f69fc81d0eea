"""Rules about a robot that moves: step by step, on a lattice or along its path."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import towards
from brrt.events import Kind, Phase, Status, Table
from brrt.verification.context import CLOSE, Context
from brrt.verification.result import RuleResult
from brrt.verification.rules.log import text

Floats = NDArray[np.float64]


def _from(context: Context) -> tuple[Table, Floats, Floats, NDArray[np.bool_]]:
    """All moves, where each begins and ends, shape (n, dof), and which are the first of a trial."""
    table = context.events[Kind.MOVE]
    q = np.asarray(table["q"])
    first = np.ones(len(table), bool)
    first[1:] = np.diff(table["trial"]) != 0
    before = np.concatenate([q[:1], q[:-1]])
    before[first] = context.start
    return table, before, q, first


def moves(context: Context, result: RuleResult) -> None:
    """Trials count 0, 1, 2 ..., and the moves of each 1, 2, 3 ..."""
    table, _, _, first = _from(context)
    trial = np.cumsum(first) - 1
    starts = np.flatnonzero(first)
    step = np.arange(len(table)) - (starts[trial] if len(table) else 0) + 1
    wrong = (table["trial"] != trial) | (table["step"] != step)
    result.look(
        table, wrong,
        lambda i: (
            f"step {table['step'][i]} of trial {table['trial'][i]}, "
            f"where step {step[i]} of trial {trial[i]} is due"
        ),
    )  # fmt: skip


def move_costs(context: Context, result: RuleResult) -> None:
    """A move's cost is that of the one before it and its own length."""
    table, before, q, first = _from(context)
    stated = np.asarray(table["cost"])
    previous = np.concatenate([[0.0], stated])[:-1]
    cost = np.where(first, 0.0, previous) + context.distance(before, q)
    result.look(
        table, ~context.same(stated, cost),
        lambda i: f"said to cost {stated[i]:.12g} so far; it costs {cost[i]:.12g}",
    )  # fmt: skip


def move_lengths(context: Context, result: RuleResult) -> None:
    """No move is longer than allowed."""
    table, before, q, _ = _from(context)
    length = context.distance(before, q)
    most = _longest(context, table)
    result.look(
        table, ~context.at_most(length, most),
        lambda i: f"a move of {length[i]:.12g}; the limit is {most[i]:.12g}",
    )  # fmt: skip


def _executed(context: Context, table: Table) -> NDArray[np.bool_]:
    """Which moves follow a path that stands, in a phase of its own."""
    phases = context.events[Kind.PHASE]
    begins = phases["seq"][(phases["name"] == Phase.EXECUTE) & (phases["status"] == Status.BEGIN)]
    first = int(begins[0]) if len(begins) else 1 << 62
    return np.asarray(table["seq"] > first) & (table["cell"] < 0)


def _longest(context: Context, table: Table) -> Floats:
    """Longest move allowed, for each."""
    most = np.full(len(table), np.inf)
    lattice = context.contract.lattice
    if lattice is not None:
        diagonal = lattice.epsilon * (np.sqrt(context.world.dim) if lattice.diagonals else 1.0)
        most[:] = max(lattice.max_move, diagonal)
    most[_executed(context, table)] = context.manifest.scenario.max_move
    return most


def moves_free(context: Context, result: RuleResult) -> None:
    """Every move is free of obstacles."""
    table, before, q, _ = _from(context)
    context.look_free(result, table, before, q, "move")


def arrival(context: Context, result: RuleResult) -> None:
    """Where the robot has done what it was to do, its last move ends at the goal."""
    table, phases = context.events[Kind.MOVE], context.events[Kind.PHASE]
    done = ((phases["name"] == Phase.EXECUTE) & (phases["status"] == Status.DONE)).any()
    stopped = (phases["status"][-1:] == Status.INTERRUPTED).any()
    solved = context.outcome is Status.SOLVED and (len(table) or context.contract.learns)
    if context.cut or stopped or not (done or solved):
        return
    last = np.asarray(table["q"][-1]) if len(table) else context.start
    there, event = (last == context.goal).all(), table[-1] if len(table) else None
    result.one(event, None if there else f"the last move ends at {text(last)}, not at the goal")


def paths_walked(context: Context, result: RuleResult) -> None:
    """Of a robot that learns as it goes, each trial is a path: where it went, told on arrival."""
    lattice, table = context.contract.lattice, context.events[Kind.MOVE]
    if lattice is None or lattice.lookahead is None:
        return
    for trial, (event, path) in enumerate(context.found):
        mine = table[table["trial"] == trial]
        way = np.concatenate([context.start[None], np.asarray(mine["q"])])
        wrong = None if np.array_equal(way, path) else f"not where the robot went in trial {trial}"
        if len(mine) and mine["seq"][-1] > event["seq"]:
            wrong = f"trial {trial} goes on after its path was told"
        elif len(mine) and mine["cell"][-1] < 0 and mine["seq"][-1] + 1 != event["seq"]:
            wrong = f"trial {trial} had arrived before, with event {mine['seq'][-1]}"
        result.one(event, wrong)
    untold = table[table["trial"] > len(context.found)]
    result.look(
        untold[:1], np.ones(len(untold[:1]), bool),
        lambda i: f"trial {untold['trial'][i]} begins; {len(context.found)} before it arrived",
    )  # fmt: skip
    if context.outcome is Status.SOLVED and len(context.found) < lattice.trials:
        result.one(None, f"{len(context.found)} of {lattice.trials} trials arrived")


def moves_along_path(context: Context, result: RuleResult) -> None:
    """A robot that executes a path moves along it, forwards, and cuts no corner."""
    table, before, q, _ = _from(context)
    chosen = _executed(context, table)
    if not chosen.any():
        return
    if not context.paths:
        result.one(table[chosen][0], "a move without a path")
        return
    path = _Polyline(context, context.paths[-1][1])
    at = 0.0
    for event, a, b in zip(table[chosen], before[chosen], q[chosen], strict=True):
        if (a == context.start).all():
            at = 0.0
        on = path.along(b, at)
        length = float(context.distance(a[None], b[None])[0])
        wrong = None
        if on is None:
            wrong = f"{text(b)} is not ahead on the path"
        elif abs(on - at - length) > CLOSE * path.length + context.blur:
            wrong = f"{text(b)} lies {on - at:.12g} ahead on the path, but {length:.12g} away"
        at = at if on is None else on
        result.one(event, wrong)


class _Polyline:
    """A path, to find places on."""

    def __init__(self, context: Context, path: Floats) -> None:
        self.context, self.path = context, path
        self.steps = towards(context.robot, path[:-1], path[1:])
        self.ends = np.concatenate([[0.0], np.cumsum(context.distance(path[:-1], path[1:]))])
        self.length = float(self.ends[-1])

    def along(self, q: Floats, least: float) -> float | None:
        """Say how far along the path a place is, `least` or farther; None where it is not."""
        slack = CLOSE * self.length + self.context.blur
        for i, (begin, end) in enumerate(pairwise(map(float, self.ends))):
            if end < least - slack:
                continue
            offset = towards(self.context.robot, self.path[i][None], q[None])[0]
            square = float(self.steps[i] @ self.steps[i])
            part = min(max(float(offset @ self.steps[i]) / square, 0.0), 1.0) if square else 0.0
            apart = np.abs(offset - part * self.steps[i]).max()
            at = float(begin + part * (end - begin))
            if apart <= slack and at >= least - slack:
                return max(at, least)
        return None


RULES = (
    moves, move_costs, move_lengths, moves_free, arrival, paths_walked, moves_along_path,
)  # fmt: skip
"""All rules of this file; see `brrt.verification`."""
