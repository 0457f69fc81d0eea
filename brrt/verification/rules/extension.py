"""Rules about how trees grow: whose turn it is, from where and how far, and what is tried then."""

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import towards
from brrt.events import Kind, Reason, Source, Table
from brrt.scenario.contract import Contract, Growth
from brrt.verification.context import CLOSE, Context, TreeHistory, Windows
from brrt.verification.neighbours import Neighbours, nearest
from brrt.verification.result import RuleResult
from brrt.verification.retention import Thinned
from brrt.verification.rules.log import text
from brrt.verification.timeline import followed, heads_for_other, last_where, script_dtype

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST = 5000
"""Of more extensions than this, so many are looked at, evenly spread over the log."""

_PAIRS = 2_000_000
"""Distances that are measured to look for nearest nodes, in each doubling of a tree, at most."""


def turns(context: Context, result: RuleResult) -> Windows:
    """Of two trees the one grows whose turn it is."""
    counts, before = np.zeros(2, np.int64), -1
    while True:
        window = yield
        lines, growth = context.scripts.of(window), context.ruling(window).growth
        if growth is not None and growth.turn is not None and len(lines):
            chosen = np.flatnonzero(lines["kind"] == Kind.SAMPLE)
            edge = lines["kind"] == Kind.EDGE
            sizes = [counts[k] + np.cumsum(edge & (lines["tree"] == k)) for k in (0, 1)]
            samples, ours, theirs = lines[chosen], sizes[0][chosen], sizes[1][chosen]
            previous = np.concatenate([[before], samples["tree"]])[:-1]
            due = np.where(previous < 0, 0, 1 - previous)
            if growth.turn == "coin":
                kept = samples["why"] == Source.OTHER_TREE
                due = np.where(kept, np.maximum(previous, 0), due)
            elif growth.turn == "smaller":
                due = np.where(ours < theirs, 0, np.where(theirs < ours, 1, due))
            result.look(
                samples, samples["tree"] != due,
                lambda i, s=samples, d=due: f"tree {s['tree'][i]} grows; it is tree {d[i]}'s turn",  # type: ignore[misc]
            )  # fmt: skip
            counts += [int(size[-1]) - n for size, n in zip(sizes, counts, strict=True)]
            before = int(samples["tree"][-1]) if len(samples) else before
        if window is None:
            return


def steering(context: Context, result: RuleResult) -> Windows:
    """Trees grow from the node nearest to what they head for, straight, and by at most a step.

    Of more than 5,000 extensions so many are looked at; in trees of millions of nodes fewer.
    """
    dtype = np.dtype([("aim", script_dtype(context.dof)), ("done", script_dtype(context.dof))])
    kept = Thinned(dtype, MOST)
    while True:
        window = yield
        lines, contract = context.scripts.of(window), context.ruling(window)
        if contract.growth is not None and len(lines):
            rows = _aimed(contract, lines)
            rows = rows[kept.due(len(rows))]
            pairs = np.zeros(len(rows), dtype)
            pairs["aim"], pairs["done"] = lines[rows], lines[rows + 1]
            kept.keep(pairs)
        if window is None:
            break
    pairs = kept.rows()
    for number, (_, contract) in enumerate(context.stretches):
        mine = pairs[context.stretch(pairs["aim"]) == number]
        for tree in context.trees if len(mine) else ():
            _look_steered(context, result, contract, tree, mine)


def _aimed(contract: Contract, lines: Table) -> Ints:
    """Lines that say what a tree heads for, where the next one says what came of that."""
    now, after = lines[:-1], lines[1:]
    moved = ((after["kind"] == Kind.EDGE) & (after["parent"] >= 0)) | (after["kind"] == Kind.REJECT)
    if contract.near is None:
        moved |= after["kind"] == Kind.CONNECT
    else:
        moved &= (after["kind"] != Kind.REJECT) | (after["why"] != Reason.LINK_BLOCKED)
    aimed = (now["kind"] == Kind.SAMPLE) & (
        (now["tree"] == after["tree"]) | (after["kind"] == Kind.CONNECT)
    )
    if contract.growth is not None and contract.growth.links is not None:
        # Where the other tree goes on, it heads for the node that has just been added.
        aimed |= (now["kind"] == Kind.EDGE) & (after["tree"] == 1 - now["tree"])
        # It may do so where none was added, and head for an older one.
        failed = (now["kind"] == Kind.REJECT) & (contract.near is None)
        aimed |= failed & (after["tree"] == 1 - now["tree"])
    return np.flatnonzero(moved & aimed)


def _look_steered(
    context: Context, result: RuleResult, contract: Contract, tree: TreeHistory, pairs: Table
) -> None:
    """Hold the extensions of a tree to what is due."""
    aim, done, step = pairs["aim"], pairs["done"], contract.step or np.inf
    slices = 1 if contract.growth is None else contract.growth.slices
    number = np.where(aim["kind"] == Kind.SAMPLE, aim["tree"], 1 - aim["tree"])
    mine = number == tree.number
    aim, done = aim[mine], done[mine]
    q, target, to = np.asarray(tree.edges["q"]), np.array(aim["q"]), np.asarray(done["q"])
    if not len(aim):
        return
    for other in context.trees if (aim["kind"] == Kind.REJECT).any() else ():
        theirs = (aim["kind"] == Kind.REJECT) & (aim["tree"] == other.number)
        newest = np.searchsorted(other.edges["seq"], aim["seq"][theirs]) - 1
        target[theirs] = np.asarray(other.edges["q"])[np.maximum(newest, 0)]
    meets = done["kind"] == Kind.CONNECT
    to = np.where(meets[:, None], target, to)
    origin = np.where(done["kind"] == Kind.EDGE, done["parent"], done["node"]).astype(np.int64)
    origin = np.where(meets & (tree.number == 1), done["parent"], origin)
    if contract.near is not None:
        # The parent is chosen later, so where the extension came from is not said.
        near_blocked = (done["kind"] == Kind.REJECT) & (done["why"] == Reason.NEAR_BLOCKED)
        origin[(done["kind"] == Kind.EDGE) | near_blocked] = -1
    count = np.searchsorted(tree.edges["seq"], aim["seq"], side="right")
    said = (origin >= 0) & (origin < count)
    reach = context.distance(to, target) + step
    reach[said] = context.distance(q[origin[said]], target[said])
    reach = reach * (1 + CLOSE) + context.blur
    near = Neighbours(q, context.distance, target, reach, count, _PAIRS)
    node, least, second = nearest(near)
    tied = second <= least * (1 + CLOSE) + context.blur
    close = said & (reach <= (least * (1 + CLOSE) + context.blur) * (1 + CLOSE) + 2 * context.blur)
    node = np.where(close, origin, node)
    part = np.minimum(1.0, step / np.maximum(least, 1e-300))
    part = np.where(done["kind"] == Kind.EDGE, part / slices, part)
    due = q[node] + part[:, None] * towards(context.robot, q[node], target)
    off = context.distance(due, to)
    wrong = (node < 0) | (said & ~close) | ~(off <= CLOSE * step + context.blur)
    wrong &= ~(tied & ~said)
    rows = np.flatnonzero(near.looked)
    origin = np.where(said & ~close, origin, -1)
    result.look(done[rows], wrong[rows], lambda i: _astray(to, due, node, origin, int(rows[i])))


def _astray(to: Floats, due: Floats, node: Ints, origin: Ints, i: int) -> str:
    if origin[i] >= 0:
        return f"an extension to {text(to[i])} from node {origin[i]}; the nearest is {node[i]}"
    if node[i] < 0:
        return f"an extension to {text(to[i])}, to where no node leads"
    return f"an extension to {text(to[i])}; from the nearest node it leads to {text(due[i])}"


def goal_tries(context: Context, result: RuleResult) -> Windows:
    """Each new node that the goal may be joined to tries it."""
    while True:
        window = yield
        lines, contract = context.scripts.of(window), context.ruling(window)
        growth = contract.growth
        if growth is not None and growth.goal_test and len(lines):
            after = followed(lines)[1:]
            far = context.distance(np.asarray(lines["q"]), context.goal[None])
            tried = (after["kind"] == Kind.REJECT) & (after["why"] == Reason.GOAL_BLOCKED)
            tried &= after["node"] == lines["node"]
            tried |= (after["kind"] == Kind.EDGE) & (after["parent"] == lines["node"])
            tried |= (after["kind"] == Kind.PATH) & (far == 0)
            limit = (contract.step or 0.0) * (1 - CLOSE) - context.blur
            due = (lines["kind"] == Kind.EDGE) & (contract.line_of_sight | (far < limit))
            over = np.isin(after["kind"], [Kind.SAMPLE, Kind.PHASE, Kind.REJECT, Kind.PATH])
            if window is None and context.cut:
                over[-1] = False
            some = lines[due]
            result.look(
                some, (~tried & over)[due],
                lambda i, f=far[due], s=some: (  # type: ignore[misc]
                    f"node {s['node'][i]} is {f[i]:.9g} from the goal and does not try it"
                ),
            )  # fmt: skip
        if window is None:
            return


def link_tries(context: Context, result: RuleResult) -> Windows:
    """Trees head for each other's newest nodes, and go on towards samples, as it was chosen."""
    while True:
        window = yield
        lines, contract = context.scripts.of(window), context.ruling(window)
        growth = contract.growth
        if growth is not None and growth.links is not None and len(lines):
            if contract.near is None:
                _look_acts(result, growth, lines if window is None else followed(lines))
            elif not (window is None and context.cut):
                _look_headed(result, lines)
        if window is None:
            return


def _look_acts(result: RuleResult, growth: Growth, lines: Table) -> None:
    """Hold each act to what has to follow it."""
    now, after = lines[:-1], lines[1:]
    sample = last_where(now["kind"] == Kind.SAMPLE)
    begun = sample >= 0
    tree, other = now["tree"][sample], 1 - now["tree"][sample]
    edge, reject = now["kind"] == Kind.EDGE, now["kind"] == Kind.REJECT
    tossed = heads_for_other(now)[sample]
    linking = tossed | (now["tree"] == other)
    grown = np.cumsum(edge & ~linking)
    grew = grown > grown[sample]
    reached = (now["q"] == now["q"][sample]).all(axis=1)
    goes_on = np.where(linking, growth.links == "connect", growth.connects & ~reached) & edge
    ends = (edge | reject) & ~goes_on
    heads = ends & ~linking & (grew | growth.always_links) & (growth.turn != "coin")
    moves = np.isin(after["kind"], [Kind.EDGE, Kind.REJECT])
    meets = after["kind"] == Kind.CONNECT
    origin = np.where(after["kind"] == Kind.EDGE, after["parent"], after["node"])
    same = moves & (after["tree"] == now["tree"]) & (origin == now["node"])
    right = np.select(
        [now["kind"] == Kind.SAMPLE, goes_on, heads, ends, now["kind"] == Kind.CONNECT],
        [
            (moves & (after["tree"] == now["tree"])) | (meets & tossed),
            same | (meets & linking),
            (moves & (after["tree"] == other)) | meets,
            np.isin(after["kind"], [Kind.SAMPLE, Kind.PHASE]),
            after["kind"] == Kind.PATH,
        ],
        default=True,
    )
    acts = begun & np.isin(now["kind"], [Kind.SAMPLE, Kind.EDGE, Kind.REJECT, Kind.CONNECT])
    some, wrong, turn, kinds = now[acts], ~right[acts], tree[acts], after["kind"][acts]
    result.look(
        some, wrong,
        lambda i: (
            f"what follows in tree {turn[i]}'s turn, {Kind(kinds[i]).label}, is not due"
        ),
    )  # fmt: skip


def _headed(lines: Table) -> tuple[Ints, Flags, Flags]:
    """Where iterations begin; whether the tree whose turn it is grew, and the other one headed."""
    sample = lines["kind"] == Kind.SAMPLE
    first = np.flatnonzero(sample)
    if not len(first):
        return first, np.empty(0, bool), np.empty(0, bool)
    turn = lines["tree"][np.maximum(last_where(sample), 0)]
    edge = lines["kind"] == Kind.EDGE
    moves = edge | (
        (lines["kind"] == Kind.REJECT)
        & np.isin(lines["why"], [Reason.COLLISION, Reason.NO_PROGRESS, Reason.NO_GAIN])
    )
    grew = np.add.reduceat((edge & (lines["tree"] == turn)).astype(np.int64), first) > 0
    headed = np.add.reduceat((moves & (lines["tree"] != turn)).astype(np.int64), first) > 0
    return first, grew, headed


def _look_headed(result: RuleResult, lines: Table) -> None:
    """Where a node has joined a tree, the other one must head for it in the same iteration."""
    first, grew, headed = _headed(lines)
    some = lines[first]
    result.look(
        some, grew != headed,
        lambda i: (
            f"tree {some['tree'][i]} has grown, and the other does not head for its node"
            if grew[i] else "a tree heads for the other's newest node, which is not new"
        ),
    )  # fmt: skip


def meetings(context: Context, result: RuleResult) -> Windows:
    """Trees are joined at their newest nodes, whenever these are close enough and it is free."""
    newest = np.zeros(2, script_dtype(context.dof))
    newest["seq"] = -1
    while True:
        window = yield
        lines, contract = context.scripts.of(window), context.ruling(window)
        if contract.near is None or contract.growth is None or contract.link is None:
            lines = lines[:0]
        if window is None and context.cut and len(lines):
            lines = lines[: last_where(lines["kind"] == Kind.SAMPLE)[-1]]
        if len(lines):
            both = np.concatenate([newest, lines])
            pair = [_newest(both, k) for k in (0, 1)]
            _look_met(context, result, contract.link or 0.0, both, pair)
            newest = np.stack([both[rows[-1]] for rows in pair])
        if window is None:
            return


def _newest(lines: Table, tree: int) -> Ints:
    """For each line the one by which the tree's newest node joined; two are there for a start."""
    joins = (lines["kind"] == Kind.EDGE) & (lines["tree"] == tree)
    return np.maximum(last_where(joins), tree)


def _look_met(
    context: Context, result: RuleResult, link: float, lines: Table, pair: list[Ints]
) -> None:
    """Hold each iteration's end to the newest nodes as they are then."""
    first, _, headed = _headed(lines)
    ends = np.append(first[1:], len(lines))[: len(first)] - 1
    start, goal = (lines[rows[ends]] for rows in pair)
    far = context.distance(np.asarray(start["q"]), np.asarray(goal["q"]))
    due = headed & (far < link * (1 - CLOSE) - context.blur)
    blocked = (lines["kind"] == Kind.REJECT) & (lines["why"] == Reason.LINK_BLOCKED)
    met = (lines["kind"] == Kind.CONNECT) | blocked
    told = np.add.reduceat(met.astype(np.int64), first) > 0 if len(first) else due
    some = lines[first]
    result.look(
        some, due & ~told,
        lambda i: f"the newest nodes are {far[i]:.9g} apart, and nobody tries to join them",
    )  # fmt: skip
    at = np.flatnonzero(blocked)
    tries, newest = lines[at], [lines[rows[at]] for rows in pair]
    wrong = (tries["tree"] != 0) | (tries["node"] != newest[0]["node"])
    wrong |= (tries["q"] != newest[1]["q"]).any(axis=1)
    result.look(
        tries, np.asarray(wrong),
        lambda i: f"a link from node {tries['node'][i]} to {text(tries['q'][i])}, not the newest",
    )  # fmt: skip
    at = np.flatnonzero(lines["kind"] == Kind.CONNECT)
    links = lines[at]
    wrong = links["node"] != lines["node"][pair[0][at]]
    wrong |= links["parent"] != lines["node"][pair[1][at]]
    result.look(
        links, np.asarray(wrong),
        lambda i: f"nodes {links['node'][i]} and {links['parent'][i]} are not the newest",
    )  # fmt: skip


RULES = (turns, steering, goal_tries, link_tries, meetings)
"""All rules of this file; see `brrt.verification`."""
