"""Recordings that break rules about trees."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from brrt import Kind, forest
from brrt.scenario.contract import Near
from tests.support.cases import (
    FREE,
    LENGTHS,
    Case,
    Doctored,
    check_found,
    doctored,
    leaf,
    leaf_edge,
    on,
    on_body,
    posed,
    shifted,
)


def on_edge(case: Case) -> Case:
    """Put a ball into the middle of a leaf's edge."""
    edges = case.log[Kind.EDGE]
    edge = edges[leaf(case)]
    return case.with_ball((edge["q"] + edges["q"][edge["parent"]]) / 2)


def dearer_edge(case: Case) -> Case:
    """State a cost that is off by a millionth."""
    return case.shift(Kind.EDGE, leaf(case), "cost", 1e-6)


def rewired(case: Case, node: int, parent: int, more: float = 0.0) -> Case:
    """Add a rewire whose cost is off by `more`."""
    q = case.log[Kind.EDGE]["q"]
    cost = forest(case.log)[0].cost[parent] + float(np.linalg.norm(q[node] - q[parent])) + more
    return case.add(Kind.REWIRE, tree=0, node=node, parent=parent, cost=cost)


def dearer_rewire(case: Case) -> Case:
    """Add a rewire to a parent that is near and reached, but raises the node's cost."""
    q = case.log[Kind.EDGE]["q"]
    apart = np.linalg.norm(q[:, None] - q, axis=2)
    for node, parent in np.argwhere((apart > 0) & (apart < 12)).tolist():
        other = rewired(case, node, parent)
        if other.broken() == {"rewires gain"}:
            return other
    raise AssertionError


def on_rewire(case: Case) -> Case:
    """Put a ball into the edge of a rewire that nothing else runs along."""
    q = case.log[Kind.EDGE]["q"]
    for rewire in case.log[Kind.REWIRE]:
        other = case.with_ball((q[rewire["node"]] + q[rewire["parent"]]) / 2)
        if other.broken() == {"rewires free"}:
            return other
    raise AssertionError


def body_hit(case: Case) -> Case:
    """Put a tiny ball into the last part of the body, in the middle of a leaf's edge."""
    row = leaf(case)
    edges, robot = case.log[Kind.EDGE], case.manifest.make_robot().resolved(case.world)
    a, b = edges["q"][edges["parent"][row]], edges["q"][row]
    return case.with_ball(robot.outline(robot.interpolate(a, b, 0.5))[-1].mean(axis=0))


def emptied(case: Case) -> Case:
    """Remove all obstacles, so that only the bounds are in the way."""
    return replace(case, world=replace(case.world, balls=np.empty((0, 3))))


def on_link(case: Case) -> Case:
    """Put a tiny ball on a link."""
    link = case.log[Kind.CONNECT][0]
    ends = [
        edges["q"][edges["tree"] == tree][int(link[name])]
        for tree, name in ((0, "node"), (1, "other"))
        for edges in [case.log[Kind.EDGE]]
    ]
    return case.with_ball((ends[0] + ends[1]) / 2)


DOCTORED: list[Doctored] = [
    ("nodes", "", on("rrt", leaf_edge(parent=10**6)), set()),
    ("nodes", "", on("rrt", leaf_edge(node=10**6)), set()),
    ("roots", "", on("rrt", leaf_edge(parent=-1, cost=0.0)), set()),
    ("roots", "", on("star", lambda c: c.edit(Kind.EDGE, 0, parent=0)), {"nodes"}),
    ("edge lengths", "", on("rrt", lambda c: c.judged_by(step=4.9)), {"steering"}),
    ("edge costs", "", on("rrt", dearer_edge), set()),
    ("edges free", "", on("rrt", on_edge), set()),
    ("edges free", "hits ball", on_body("polygon", body_hit), FREE),
    ("edges free", "hits ball", on_body("chain", body_hit), FREE),
    ("edges free", "hits", on_body("polygon", posed(None, 1.0)), LENGTHS),
    ("edges free", "hits the bounds", on_body("polygon", lambda c: posed(1.0, 50.0,
     0.0)(emptied(c))), LENGTHS | {"rejections", "shortcuts"}),
    ("edges free", "hits the robot itself", on_body("chain", posed(0.0, 2.9, 2.9)), LENGTHS),
    ("rewires", "", on("star", lambda c: c.add(Kind.REWIRE, node=leaf(c), parent=leaf(c))), set()),
    ("rewires", "", on("star", lambda c: c.add(Kind.REWIRE, node=leaf(c), parent=10**6)), set()),
    ("rewires", "", on("star", lambda c: c.add(Kind.REWIRE, node=-7, parent=0)), set()),
    ("rewires", "", on("star", lambda c: c.add(Kind.REWIRE, tree=9, node=0, parent=0)), set()),
    ("rewire costs", "", on("star", lambda c: rewired(c, leaf(c),
     int(c.log[Kind.EDGE]["parent"][leaf(c)]), 1e-6)), set()),
    ("rewires gain", "", on("star", dearer_rewire), set()),
    ("rewires near", "", on("star", lambda c: c.judged_by(near=Near(1.0, 1.0, 2))), set()),
    ("rewires free", "", on("star", on_rewire), set()),
    ("link costs", "", on("pair", shifted(Kind.CONNECT, "cost", 0, 1e-6)), set()),
    ("links free", "hits ball", on("pair", on_link), {"paths free"}),
    ("links", "", on("pair", lambda c: c.judged_by(link=0.01)), set()),
    ("links", "", on("pair", lambda c: c.edit(Kind.CONNECT, 0, other=10**6)), {"paths in trees"}),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
