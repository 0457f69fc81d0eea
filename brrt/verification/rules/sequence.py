"""Rules about the order in which things are told: phases, iterations, and what follows what."""

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Phase, Reason, Source, Stage, Status, Table
from brrt.scenario.contract import Contract
from brrt.verification.context import Context, Windows
from brrt.verification.result import RuleResult
from brrt.verification.rules.log import heads
from brrt.verification.timeline import followed, last_where, numbered

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_NEW_NODE = (Reason.COLLISION, Reason.NO_PROGRESS, Reason.NO_GAIN)
"""Why no node joins a tree."""

_NOWHERE = -1


def phase_contents(context: Context, result: RuleResult) -> Windows:
    """What is told within a phase belongs to it, and nothing is told between phases."""
    running, lattice = _NOWHERE, context.contract.lattice
    # Who plans without a robot that moves meanwhile moves only along a path that stands.
    strict = context.known and (lattice is None or lattice.lookahead is None)
    while (window := (yield)) is not None:
        phases = window[Kind.PHASE]
        begins = phases["status"] == Status.BEGIN
        states = np.append(running, np.where(begins, phases["name"].astype(np.int64), _NOWHERE))
        for kind, table in window.tables.items():
            if kind is Kind.PHASE or not len(table):
                continue
            now = states[np.searchsorted(phases["seq"], table["seq"])]
            due = np.full(len(table), int(Phase.PLAN))
            if kind is Kind.SHORTCUT:
                due[:] = Phase.SMOOTH
            elif kind is Kind.PATH:
                due[table["stage"] == Stage.SMOOTHED] = Phase.SMOOTH
            elif kind is Kind.MOVE:
                due = np.where(strict | (now != Phase.PLAN), int(Phase.EXECUTE), due)
            result.look(
                table, now != due,
                lambda i, k=kind, now=now: f"{k.label} {_within(int(now[i]))}",  # type: ignore[misc]
            )  # fmt: skip
        running = int(states[-1])


def _within(phase: int) -> str:
    names = {int(p): p.label for p in Phase}
    return f"within phase {names.get(phase, phase)}" if phase >= 0 else "outside of all phases"


def iterations(context: Context, result: RuleResult) -> Windows:
    """Events count iterations: draws, or cells that A* expands, or moves where a robot learns."""
    contract, begun, before = context.contract, 0, 0
    counted = None
    if contract.growth is not None:
        counted = Kind.SAMPLE
    elif contract.lattice is not None:
        counted = Kind.EXPAND if contract.lattice.lookahead is None else Kind.MOVE
    while (window := (yield)) is not None:
        if counted is None:
            continue
        log, begins = heads(window), np.sort(window[counted]["seq"])
        due = begun + np.searchsorted(begins, log["seq"], side="right")
        off = log["iteration"] - due
        # Where some are missing, all later ones are off by as many: that is told once.
        wrong = (off != 0) & (off != np.append(before, off[:-1]))
        result.look(
            log, wrong,
            lambda i, t=log, d=due: (  # type: ignore[misc]
                f"an event of iteration {t['iteration'][i]:,}; the log counts {d[i]:,} by then"
            ),
        )  # fmt: skip
        begun, before = begun + len(begins), int(off[-1])


def told_once(context: Context, result: RuleResult) -> Windows:
    """No rejection, rewire or link is told twice in an iteration."""
    while (window := (yield)) is not None:
        for kind in (Kind.REJECT, Kind.REWIRE, Kind.CONNECT) if context.known else ():
            table = window[kind]
            keys = _contents(kind, table)
            again = np.ones(len(table), bool)
            again[np.unique(keys, return_index=True)[1]] = False
            result.look(table, again, lambda _, k=kind: f"the same {k.label} as before")  # type: ignore[misc]


def _contents(kind: Kind, table: Table) -> NDArray[np.uint64]:
    """One number for what an event says, equal where events say the same."""
    names = {
        Kind.REJECT: ("iteration", "tree", "node", "reason"),
        Kind.REWIRE: ("iteration", "tree", "node", "parent"),
        Kind.CONNECT: ("iteration", "node", "other"),
    }[kind]
    parts = [np.asarray(table[name]) for name in names]
    return numbered(parts, np.asarray(table["q"]) if kind is Kind.REJECT else None)


def extensions(context: Context, result: RuleResult) -> Windows:
    """Each sample is followed by what came of it, and by what that leads to, without gaps.

    Of planners whose trees head for each other's newest node without rewiring, `link tries` says
    so.
    """
    while True:
        window = yield
        lines, contract = context.scripts.of(window), context.ruling(window)
        growth = contract.growth
        if growth is not None and len(lines) > 1 and not _links_only(contract):
            lines = lines if window is None else followed(lines)
            right = _star_follows(lines) if contract.near is not None else _rrt_follows(lines)
            begun = np.maximum.accumulate(lines["kind"][:-1] == Kind.SAMPLE)
            result.look(
                lines[:-1], begun & ~right,
                lambda i, n=lines: (  # type: ignore[misc]
                    f"{_act(n[i])} is followed by {_act(n[i + 1])}, which does not come of it"
                ),
            )  # fmt: skip
            if contract.near is None:
                _look_slices(context, result, growth.slices, lines, ended=window is not None)
        if window is None:
            return


def _links_only(contract: Contract) -> bool:
    return (
        contract.near is None and contract.growth is not None and contract.growth.links is not None
    )


def _act(line: np.void) -> str:
    """Say what a line of a script is."""
    kind, why = Kind(line["kind"]), int(line["why"])
    names = {Kind.REJECT: Reason, Kind.SAMPLE: Source}.get(kind)
    return f"{kind.label} ({names.label_of(why)})" if names else kind.label


def _rrt_follows(lines: Table) -> Flags:
    """Whether each line may be followed by the next one, where one tree grows from its nearest."""
    now, after = lines[:-1], lines[1:]
    same = after["tree"] == now["tree"]
    edge, reject = after["kind"] == Kind.EDGE, after["kind"] == Kind.REJECT
    failed = reject & np.isin(after["why"], _NEW_NODE)
    tried = reject & (after["why"] == Reason.GOAL_BLOCKED) & (after["node"] == now["node"])
    child = edge & (after["parent"] == now["node"])
    rests = np.isin(after["kind"], [Kind.SAMPLE, Kind.PHASE])
    told = after["kind"] == Kind.PATH
    return np.asarray(
        np.select(
            [now["kind"] == Kind.SAMPLE, now["kind"] == Kind.EDGE, now["kind"] == Kind.REJECT],
            [same & (edge | failed), (same & (child | tried)) | rests | told, rests],
            default=True,
        )
    )


def _look_slices(
    context: Context, result: RuleResult, slices: int, lines: Table, *, ended: bool
) -> None:
    """See that each extension that was made is as many nodes as a step is cut into."""
    sample, edge = lines["kind"] == Kind.SAMPLE, lines["kind"] == Kind.EDGE
    first = np.flatnonzero(sample)
    # The last line of a script that is followed is a sample; a log that is cut may end anywhere.
    last = len(first) - int(ended or context.cut)
    if not len(first) or not last:
        return
    made = np.add.reduceat(edge.astype(np.int64), first)[:last]
    if ((made == 0) | (made == slices)).all():
        result.examined += last
        return
    newest = np.append(first[1:], len(lines))[:last] - 1
    # The last edge of a run may be the one to the goal, with a path and the end after it.
    at = last_where(edge)[newest]
    to_goal = (np.asarray(lines["q"])[np.maximum(at, 0)] == context.goal).all(axis=1)
    some = lines[first[:last]]
    wrong = (made != 0) & (made != slices) & ~((made == slices + 1) & to_goal)
    result.look(some, wrong, lambda i: f"{made[i]} nodes come of a sample; {slices} are due")


def _star_follows(lines: Table) -> Flags:
    """The same where trees rewire, and the other one of two heads for the new node."""
    now, after = lines[:-1], lines[1:]
    sample = last_where(lines["kind"] == Kind.SAMPLE)[:-1]
    turn = now["tree"][np.maximum(sample, 0)]
    two = bool((lines["tree"] == 1).any())
    # Where the extension that is under way has added its node, and which.
    joined = np.stack(
        [last_where((now["kind"] == Kind.EDGE) & (now["tree"] == tree)) for tree in (0, 1)]
    )
    row = joined[np.clip(now["tree"], 0, 1), np.arange(len(now))]
    grown = row > sample
    node = now["node"][np.maximum(row, 0)]
    why, kind = after["why"], after["kind"]
    edge, reject = kind == Kind.EDGE, kind == Kind.REJECT
    near = reject & (why == Reason.NEAR_BLOCKED)
    begins = edge | near | (reject & np.isin(why, _NEW_NODE))
    same, other = after["tree"] == now["tree"], after["tree"] == 1 - now["tree"]
    here = (after["q"] == now["q"]).all(axis=1)
    rewires = same & (
        (near & (after["node"] == node)) | ((kind == Kind.REWIRE) & (after["parent"] == node))
    )
    rests = np.isin(kind, [Kind.SAMPLE, Kind.PHASE, Kind.PATH])
    links = (kind == Kind.CONNECT) | (reject & (why == Reason.LINK_BLOCKED))
    ours = now["tree"] == turn
    done = np.where(two & ours & grown, begins & other, rests | (links & ~ours))
    looks = (now["kind"] == Kind.REJECT) & (now["why"] == Reason.NEAR_BLOCKED)
    linked = (now["kind"] == Kind.CONNECT) | (
        (now["kind"] == Kind.REJECT) & (now["why"] == Reason.LINK_BLOCKED)
    )
    return np.asarray(
        np.select(
            [
                now["kind"] == Kind.SAMPLE, linked, looks & ~grown, now["kind"] == Kind.PATH,
                looks | np.isin(now["kind"], [Kind.EDGE, Kind.REWIRE]), now["kind"] == Kind.REJECT,
            ],
            [
                same & begins, rests, same & here & (near | edge),
                np.isin(kind, [Kind.SAMPLE, Kind.PHASE]), rewires | done, done & ~grown,
            ],
            default=True,
        )
    )  # fmt: skip


RULES = (phase_contents, iterations, told_once, extensions)
"""All rules of this file; see `brrt.verification`."""
