"""Rules about how trees grow: whose turn it is, from where and how far, and what is tried then."""

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import towards
from brrt.events import Kind, Reason, Source, Table
from brrt.replay.text import vector
from brrt.scenario.contract import Contract, Growth
from brrt.verification.context import Context
from brrt.verification.neighbours import NeighbourSearch, nearest
from brrt.verification.retention import SpreadRows
from brrt.verification.rule import IterationRule
from brrt.verification.timeline import aims_at_other_tree, followed, last_where, row_dtype
from brrt.verification.tolerances import CLOSE
from brrt.verification.tree_history import TreeHistory

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST = 5000
"""Extensions that are judged, spread over the log."""

_PAIRS = 2_000_000
"""Distances that are measured to find nearest nodes, in each doubling of a tree, at most."""


class Turns(IterationRule):
    name = "turns"
    promise = "Of two trees, that one grows whose turn it is by the contract."

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.counts, self.before = np.zeros(2, np.int64), -1

    def judge_rows(self, rows: Table, contract: Contract, growth: Growth, *, last: bool) -> None:
        if growth.turn is None:
            return
        chosen = np.flatnonzero(rows["kind"] == Kind.SAMPLE)
        joins = rows["kind"] == Kind.EDGE
        sizes = [self.counts[k] + np.cumsum(joins & (rows["tree"] == k)) for k in (0, 1)]
        samples, start, goal = rows[chosen], sizes[0][chosen], sizes[1][chosen]
        previous = np.append(self.before, samples["tree"])[:-1]
        due = np.where(previous < 0, 0, 1 - previous)
        if growth.turn == "coin":
            stays = samples["why"] == Source.OTHER_TREE
            due = np.where(stays, np.maximum(previous, 0), due)
        elif growth.turn == "smaller":
            due = np.where(start < goal, 0, np.where(goal < start, 1, due))
        self.judge(
            samples, samples["tree"] != due,
            lambda i: f"tree {samples['tree'][i]} grows; it is the turn of tree {due[i]}",
        )  # fmt: skip
        self.counts = np.array([size[-1] for size in sizes])
        self.before = int(samples["tree"][-1]) if len(samples) else self.before


class Steering(IterationRule):
    name = "steering"
    promise = "Trees grow straight from the node nearest to the target, by at most a step."
    assumes = ("motions", "samples", "times")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        row = row_dtype(context.dof)
        self.dtype = np.dtype([("target", row), ("result", row)])
        self.kept = SpreadRows(self.dtype, MOST)

    def judge_rows(self, rows: Table, contract: Contract, growth: Growth, *, last: bool) -> None:
        chosen = _extensions(rows, contract, growth)
        chosen = chosen[self.kept.due(len(chosen))]
        pairs = np.zeros(len(chosen), self.dtype)
        pairs["target"], pairs["result"] = rows[chosen], rows[chosen + 1]
        self.kept.keep(pairs)

    def finish(self) -> None:
        super().finish()
        pairs = self.kept.rows()
        stretch = self.context.stretch(pairs["target"])
        for number, (_, contract) in enumerate(self.context.stretches):
            mine = pairs[stretch == number]
            for tree in self.context.trees if len(mine) else ():
                self._judge_tree(tree, contract, mine)

    def _judge_tree(self, tree: TreeHistory, contract: Contract, pairs: Table) -> None:
        """Judge the extensions of a tree."""
        aim = pairs["target"]
        number = np.where(aim["kind"] == Kind.SAMPLE, aim["tree"], 1 - aim["tree"])
        pairs = pairs[number == tree.number]
        if not len(pairs):
            return
        context, done, step = self.context, pairs["result"], contract.step or np.inf
        target, to, origin = self._ends(tree, contract, pairs)
        count = np.searchsorted(tree.edges["seq"], pairs["target"]["seq"], side="right")
        stated = (origin >= 0) & (origin < count)
        reach = context.distance(to, target) + step
        reach[stated] = context.distance(tree.q[origin[stated]], target[stated])
        reach = reach * (1 + CLOSE) + context.tolerance
        search = NeighbourSearch(tree.q, context.distance, target, reach, count, _PAIRS)
        node, least, second = nearest(search)
        limit = least * (1 + CLOSE) + context.tolerance
        tied = second <= limit
        close = stated & (reach <= limit * (1 + CLOSE) + 2 * context.tolerance)
        node = np.where(close, origin, node)
        part = np.minimum(1.0, step / np.maximum(least, 1e-300))
        slices = 1 if contract.growth is None else contract.growth.slices
        part = np.where(done["kind"] == Kind.EDGE, part / slices, part)
        due = tree.q[node] + part[:, None] * towards(context.robot, tree.q[node], target)
        wrong = (node < 0) | (stated & ~close)
        wrong |= ~(context.distance(due, to) <= CLOSE * step + context.tolerance)
        wrong &= ~(tied & ~stated)
        rows = np.flatnonzero(search.searched)
        origin = np.where(stated & ~close, origin, -1)

        def message(i: int) -> str:
            at = rows[i]
            what = f"an extension to {vector(to[at])}"
            if origin[at] >= 0:
                return f"{what} from node {origin[at]}; the nearest is {node[at]}"
            if node[at] < 0:
                return f"{what}, where no step from a node leads"
            return f"{what}; from the nearest node it leads to {vector(due[at])}"

        self.judge(done[rows], wrong[rows], message)

    def _ends(
        self, tree: TreeHistory, contract: Contract, pairs: Table
    ) -> tuple[Floats, Floats, Ints]:
        """Return targets, ends, and the nodes that events state as origins, -1 for none."""
        aim, done = pairs["target"], pairs["result"]
        target = np.array(aim["q"])
        for other in self.context.trees if (aim["kind"] == Kind.REJECT).any() else ():
            theirs = (aim["kind"] == Kind.REJECT) & (aim["tree"] == other.number)
            newest = np.searchsorted(other.edges["seq"], aim["seq"][theirs]) - 1
            target[theirs] = other.q[np.maximum(newest, 0)]
        meets = done["kind"] == Kind.CONNECT
        to = np.where(meets[:, None], target, done["q"])
        origin = np.where(done["kind"] == Kind.EDGE, done["parent"], done["node"]).astype(np.int64)
        origin = np.where(meets & (tree.number == 1), done["parent"], origin)
        if contract.near is not None:  # the parent is chosen later
            near_blocked = (done["kind"] == Kind.REJECT) & (done["why"] == Reason.NEAR_BLOCKED)
            origin[(done["kind"] == Kind.EDGE) | near_blocked] = -1
        return target, to, origin


def _extensions(rows: Table, contract: Contract, growth: Growth) -> Ints:
    """Return the rows that have the target of an extension, followed by its result."""
    now, after = rows[:-1], rows[1:]
    extends = (after["kind"] == Kind.EDGE) & (after["parent"] >= 0)
    extends |= after["kind"] == Kind.REJECT
    if contract.near is None:
        extends |= after["kind"] == Kind.CONNECT
    else:
        extends &= (after["kind"] != Kind.REJECT) | (after["why"] != Reason.LINK_BLOCKED)
    targets = (now["kind"] == Kind.SAMPLE) & (
        (now["tree"] == after["tree"]) | (after["kind"] == Kind.CONNECT)
    )
    if growth.links is not None:
        # The other tree aims at the node that has just been added, or at an older one if none was.
        aims = (now["kind"] == Kind.EDGE) | ((now["kind"] == Kind.REJECT) & (contract.near is None))
        targets |= aims & (after["tree"] == 1 - now["tree"])
    return np.flatnonzero(extends & targets)


class GoalAttempts(IterationRule):
    name = "goal attempts"
    promise = "Each new node that may be joined to the goal attempts it."
    kind = Kind.EDGE

    def judge_rows(self, rows: Table, contract: Contract, growth: Growth, *, last: bool) -> None:
        if not growth.goal_test:
            return
        context, after = self.context, followed(rows)[1:]
        far = context.distance(rows["q"], context.goal[None])
        tried = (after["kind"] == Kind.REJECT) & (after["why"] == Reason.GOAL_BLOCKED)
        tried &= after["node"] == rows["node"]
        tried |= (after["kind"] == Kind.EDGE) & (after["parent"] == rows["node"])
        tried |= (after["kind"] == Kind.PATH) & (far <= context.claims.goal_tolerance)
        limit = (contract.step or 0.0) * (1 - CLOSE) - context.tolerance
        due = (rows["kind"] == Kind.EDGE) & (contract.line_of_sight | (far < limit))
        over = np.isin(after["kind"], [Kind.SAMPLE, Kind.PHASE, Kind.REJECT, Kind.PATH])
        if last and context.may_be_unfinished:
            over[-1] = False
        nodes, far = rows[due], far[due]
        self.judge(
            nodes, (~tried & over)[due],
            lambda i: f"node {nodes['node'][i]} does not attempt the goal, {far[i]:.9g} away",
        )  # fmt: skip


class LinkAttempts(IterationRule):
    name = "link attempts"
    promise = "Trees aim at each other's newest nodes, and continue towards samples, as stated."

    def judge_rows(self, rows: Table, contract: Contract, growth: Growth, *, last: bool) -> None:
        if growth.links is None:
            return
        if contract.near is None:
            self._judge_order(rows if last else followed(rows), growth)
        elif not (last and self.context.may_be_unfinished):
            self._judge_aims(rows)

    def _judge_order(self, rows: Table, growth: Growth) -> None:
        """Judge what follows each event of trees that do not rewire."""
        now, after = rows[:-1], rows[1:]
        sample = last_where(now["kind"] == Kind.SAMPLE)
        turn, other = now["tree"][sample], 1 - now["tree"][sample]
        edge, reject = now["kind"] == Kind.EDGE, now["kind"] == Kind.REJECT
        aimed = aims_at_other_tree(now)[sample]
        linking = aimed | (now["tree"] == other)
        grown = np.cumsum(edge & ~linking)
        grew = grown > grown[sample]
        reached = (now["q"] == now["q"][sample]).all(axis=1)
        continues = np.where(linking, growth.links == "connect", growth.connects & ~reached) & edge
        ends = (edge | reject) & ~continues
        switches = ends & ~linking & (grew | growth.always_links) & (growth.turn != "coin")
        extends = np.isin(after["kind"], [Kind.EDGE, Kind.REJECT])
        meets = after["kind"] == Kind.CONNECT
        origin = np.where(after["kind"] == Kind.EDGE, after["parent"], after["node"])
        same = extends & (after["tree"] == now["tree"]) & (origin == now["node"])
        right = np.select(
            [now["kind"] == Kind.SAMPLE, continues, switches, ends, now["kind"] == Kind.CONNECT],
            [
                (extends & (after["tree"] == now["tree"])) | (meets & aimed),
                same | (meets & linking),
                (extends & (after["tree"] == other)) | meets,
                np.isin(after["kind"], [Kind.SAMPLE, Kind.PHASE]),
                after["kind"] == Kind.PATH,
            ],
            default=True,
        )
        judged = np.isin(now["kind"], [Kind.SAMPLE, Kind.EDGE, Kind.REJECT, Kind.CONNECT])
        judged &= sample >= 0
        events, turn, kinds = now[judged], turn[judged], after["kind"][judged]
        self.judge(
            events, ~right[judged],
            lambda i: f"a {Kind(kinds[i]).label} must not follow in the turn of tree {turn[i]}",
        )  # fmt: skip

    def _judge_aims(self, rows: Table) -> None:
        """Judge whether the second tree aims at a node that has joined the first one."""
        first, grew, aimed = _iterations(rows)
        samples = rows[first]
        self.judge(
            samples, grew != aimed,
            lambda i: (
                f"tree {samples['tree'][i]} has grown, and the other does not aim at its node"
                if grew[i] else "a tree aims at the other's newest node, which is not new"
            ),
        )  # fmt: skip


def _iterations(rows: Table) -> tuple[Ints, Flags, Flags]:
    """Return where iterations begin, whether a node joined, and whether the other tree aimed."""
    sample = rows["kind"] == Kind.SAMPLE
    first = np.flatnonzero(sample)
    if not len(first):
        return first, np.empty(0, bool), np.empty(0, bool)
    turn = rows["tree"][np.maximum(last_where(sample), 0)]
    edge = rows["kind"] == Kind.EDGE
    extends = edge | (
        (rows["kind"] == Kind.REJECT)
        & np.isin(rows["why"], [Reason.COLLISION, Reason.NO_PROGRESS, Reason.NO_GAIN])
    )
    grew = np.add.reduceat((edge & (rows["tree"] == turn)).astype(np.int64), first) > 0
    aimed = np.add.reduceat((extends & (rows["tree"] != turn)).astype(np.int64), first) > 0
    return first, grew, aimed


class Meetings(IterationRule):
    name = "meetings"
    promise = "Trees are joined at their newest nodes if these are close and the link is free."
    kind = None

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.newest = np.zeros(2, row_dtype(context.dof))
        self.newest["seq"] = -1

    def judge_rows(self, rows: Table, contract: Contract, growth: Growth, *, last: bool) -> None:
        if contract.near is None or contract.link is None:
            return
        if last and self.context.may_be_unfinished:
            rows = rows[: last_where(rows["kind"] == Kind.SAMPLE)[-1]]
        if len(rows):
            rows = np.concatenate([self.newest, rows])
            newest = [_newest(rows, tree) for tree in (0, 1)]
            self._judge_attempts(rows, newest, contract.link)
            self._judge_links(rows, newest, contract.link)
            self.newest = np.stack([rows[of_rows[-1]] for of_rows in newest])

    def _judge_attempts(self, rows: Table, newest: list[Ints], link: float) -> None:
        """Judge the end of each iteration by the newest nodes at that moment."""
        context = self.context
        first, _, aimed = _iterations(rows)
        ends = np.append(first[1:], len(rows))[: len(first)] - 1
        start, goal = (rows[of_rows[ends]] for of_rows in newest)
        far = context.distance(start["q"], goal["q"])
        due = aimed & (far < link * (1 - CLOSE) - context.tolerance)
        tried = ((rows["kind"] == Kind.CONNECT) | _link_blocked(rows)).astype(np.int64)
        done = np.add.reduceat(tried, first) > 0 if len(first) else due
        self.judge(
            rows[first], due & ~done,
            lambda i: f"the newest nodes are {far[i]:.9g} apart, and no link is attempted",
        )  # fmt: skip

    def _judge_links(self, rows: Table, newest: list[Ints], link: float) -> None:
        """Judge whether links, and attempts, are between the newest nodes, which are close."""
        at = np.flatnonzero(_link_blocked(rows))
        tries, start, goal = rows[at], rows[newest[0][at]], rows[newest[1][at]]
        wrong = (tries["tree"] != 0) | (tries["node"] != start["node"])
        wrong |= (tries["q"] != goal["q"]).any(axis=1)
        self.judge(
            tries, np.asarray(wrong),
            lambda i: f"a link from node {tries['node'][i]} to {vector(tries['q'][i])}, not newest",
        )  # fmt: skip
        far = self.context.distance(start["q"], tries["q"])
        self.judge(
            tries, ~wrong & ~self.context.at_most(far, link),
            lambda i: f"an attempt to link nodes {far[i]:.9g} apart; the limit is {link:.9g}",
        )  # fmt: skip
        at = np.flatnonzero(rows["kind"] == Kind.CONNECT)
        links = rows[at]
        wrong = links["node"] != rows["node"][newest[0][at]]
        wrong |= links["parent"] != rows["node"][newest[1][at]]
        self.judge(
            links, np.asarray(wrong),
            lambda i: f"nodes {links['node'][i]} and {links['parent'][i]} are not the newest",
        )  # fmt: skip


def _newest(rows: Table, tree: int) -> Ints:
    """Return for each row that of a tree's newest node; the first two stand for those before."""
    joins = (rows["kind"] == Kind.EDGE) & (rows["tree"] == tree)
    return np.maximum(last_where(joins), tree)


def _link_blocked(rows: Table) -> Flags:
    return np.asarray((rows["kind"] == Kind.REJECT) & (rows["why"] == Reason.LINK_BLOCKED))


RULES = (Turns, Steering, GoalAttempts, LinkAttempts, Meetings)
