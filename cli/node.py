"""`brrt replay --node`: the history of a node of a tree, or of a cell of a lattice."""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from brrt.replay.text import counted, seconds, vector

from .command import whole_number
from .console import print_json, print_pairs

if TYPE_CHECKING:
    from brrt.recording import Limits, Recording
    from brrt.replay.cell_history import CellHistory
    from brrt.replay.node_history import CostChange, NodeHistory, When

_SHOWN = 5
"""Events of a kind that are listed: the first ones, and the last."""

_TREES = {"start": 0, "goal": 1}

Rows = Iterator[tuple[str, str]]


def tree_number(tree: str | None) -> int:
    """Return the number of a tree, given as a number or by what it grows from.

    Raises:
        BrrtError: The text is neither.
    """
    from brrt.errors import BrrtError

    if tree is None:
        return 0
    try:
        number = _TREES[tree] if tree in _TREES else whole_number(tree)
    except ValueError:
        number = -1
    if not 0 <= number < 256:
        raise BrrtError(f"--tree must be start, goal or the number of a tree, not {tree!r}")
    return number


def print_node(
    recording: "Recording", limits: "Limits", node: int, tree: int, *, as_json: bool
) -> None:
    """Print the history of a node, or of a cell, up to an instant.

    Raises:
        BrrtError: The node does not exist.
    """
    from brrt.digits import digits_within
    from brrt.replay.node_history import NodeHistory
    from brrt.replay.snapshot import Snapshot

    found = Snapshot(recording, limits).node(node, tree)
    if as_json:
        print_json(found.as_dict())
        return
    digits = digits_within(*recording.robot().bounds(recording.world))
    rows = _of_node(found, digits) if isinstance(found, NodeHistory) else _of_cell(found, digits)
    print_pairs((name, text, "") for name, text in rows)


def _of_node(h: "NodeHistory", digits: tuple[int, ...]) -> Rows:
    from brrt.replay.node_history import tree_name

    yield "node", f"{h.node:,} of {tree_name(h.tree)} at {vector(h.q, digits)}"
    parent = "the root" if h.born_parent < 0 else f"child of {h.born_parent:,}"
    joined = f"{parent}, cost {h.born_cost:.6g}" if h.born_cost < math.inf else "a vertex"
    yield "added", f"{_when(h.born)}; {joined}"
    if h.sample is not None:
        other = "" if h.sample.tree == h.tree else f" for tree {h.sample.tree}"
        drawn = f"{h.sample.source}{other}, {vector(h.sample.q, digits)}"
        yield "sample", f"event {h.sample.when.event:,}: {drawn}"
    yield from _listed(
        "rewired",
        [
            f"{_when(change.when)}; "
            f"parent {_number(change.old_parent)} -> {_number(change.parent)}, {_costs(change)}"
            for change in h.rewires
        ],
    )
    yield from _listed(
        "ancestors",
        [
            f"{_when(change.when)}; ancestor {change.node:,} "
            f"{'rewired' if change.parent >= 0 else 'lost its parent'}, {_costs(change)}"
            for change in h.follows
        ],
    )
    if h.rewires or h.follows:
        parent = f"child of {h.parent:,}" if h.parent >= 0 else "without a parent"
        yield "now", f"{parent}, {'no cost' if h.cost == math.inf else f'cost {h.cost:.6g}'}"
    if h.removed is not None:
        yield "removed", _when(h.removed)
    yield from _graph(h, digits)
    yield (
        "subtree",
        f"{counted(len(h.children), 'child', 'children')}{_some(h.children)}, "
        + counted(h.descendants, "descendant"),
    )
    yield "from root", _lineage(h.lineage)
    on = [f"waypoint {i} of the {stage} path" for stage, i in h.paths.items()]
    yield "path", ", ".join(on) or "not on a path"
    yield from _rejects(h, digits)


def _graph(h: "NodeHistory", digits: tuple[int, ...]) -> Rows:
    """Yield the links of a node, and the checked motions."""
    if h.links:
        there = [link.other for link in h.links if link.gone is None]
        yield "links", f"{len(there):,} of {len(h.links):,} are there{_some(there)}"
        lines = [
            f"{_when(link.when)}; to {link.other:,}, cost {link.cost:.6g}"
            + ("" if link.gone is None else f"; gone at event {link.gone.event:,}")
            for link in h.links
        ]
        yield from _listed("", lines)
    if h.checks:
        free = sum(each.part == 1 for each in h.checks)
        yield "checks", f"{counted(len(h.checks), 'motion')}, {free:,} free"
        lines = [
            f"{_when(each.when)}; from {_number(each.node)} to {_number(each.other)} at "
            f"{vector(each.q, digits)}: {'free' if each.part == 1 else f'{each.part:.3g} of it'}"
            for each in h.checks
        ]
        yield from _listed("", lines)


def _number(node: int) -> str:
    return f"{node:,}" if node >= 0 else "none"


def _costs(change: "CostChange") -> str:
    costs = (change.before, change.after)
    before, after = ("none" if cost == math.inf else f"{cost:.6g}" for cost in costs)
    return f"cost {before} -> {after}"


def _rejects(h: "NodeHistory", digits: tuple[int, ...]) -> Rows:
    if not h.rejects:
        yield "rejected", "no extensions from this node"
        return
    extensions = counted(len(h.rejects), "extension")
    yield "rejected", f"{extensions} from this node: {_counts(h.reasons())}"
    if h.hits():
        yield "", f"obstacles: {_counts(h.hits())}"
    lines = [
        f"{_when(each.when)}; {each.reason} towards {vector(each.q, digits)}"
        + (f", {each.hit}" if each.hit else "")
        for each in h.rejects
    ]
    yield from _listed("", lines)


def _of_cell(h: "CellHistory", digits: tuple[int, ...]) -> Rows:
    yield "cell", f"{h.cell:,} at {vector(h.q, digits)}, {h.distance:.6g} from the goal"
    yield "expanded", counted(len(h.looks), "time")
    yield from _listed(
        "",
        [
            f"{_when(look.when)}; "
            + ("first cell of the search" if look.parent < 0 else f"from cell {look.parent:,}")
            + f", cost {look.cost:.6g}"
            for look in h.looks
        ],
    )
    yield "estimate", f"{h.estimate:.6g}, raised {counted(len(h.lessons), 'time')}"
    yield from _listed(
        "",
        [
            f"{_when(lesson.when)}; {lesson.before:.6g} -> {lesson.after:.6g}"
            for lesson in h.lessons
        ],
    )
    yield "entered", counted(len(h.visits), "time")
    yield from _listed("", [_when(visit) for visit in h.visits])
    if h.rejects:
        yield "rejected", f"motions from this cell: {_counts(h.rejects)}"


def _listed(name: str, lines: list[str]) -> Rows:
    """Yield the first lines and the last one."""
    shown = lines if len(lines) <= _SHOWN else lines[: _SHOWN - 1]
    for i, line in enumerate(shown):
        yield ("" if i else name), line
    if len(shown) < len(lines):
        left = len(lines) - len(shown)
        yield "", f"... {left:,} more, the last: {lines[-1]}"


def _when(when: "When") -> str:
    return f"event {when.event:,}, iteration {when.iteration:,}, {seconds(when.time_s)}"


def _some(numbers: list[int]) -> str:
    if not numbers:
        return ""
    more = " ..." if len(numbers) > _SHOWN else ""
    return " (" + ", ".join(f"{n:,}" for n in numbers[:_SHOWN]) + more + ")"


def _counts(found: Mapping[str, Any]) -> str:
    """Write how many there are of each, the most frequent first; of many, only those."""
    parts = [f"{name} {n:,}" for name, n in list(found.items())[:_SHOWN]]
    rest = len(found) - len(parts)
    return ", ".join(parts) + (f" and {rest:,} others" if rest else "")


def _lineage(lineage: list[int]) -> str:
    """Write the nodes from the root on; of many, the first and the last."""
    ends = lineage if len(lineage) <= 2 * _SHOWN else lineage[:_SHOWN] + lineage[-_SHOWN:]
    texts = [f"{node:,}" for node in ends]
    if len(ends) < len(lineage):
        texts.insert(_SHOWN, f"... {len(lineage) - len(ends):,} more ...")
    return f"{counted(len(lineage) - 1, 'edge')}: {' - '.join(texts)}"
