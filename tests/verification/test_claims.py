"""Claims of foreign recordings: what rules leave out by them, and what they find all the same."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from brrt import BrrtError, Claims, Contract, Kind, Manifest, read, record, verify
from brrt.verification.rules import RULES
from tests.support.cases import Case
from tests.support.foreign import FIELD, FOREIGN, case_of, recorded

Edit = Callable[[Case], Case]


@cache
def foreign(name: str) -> Case:
    """A recording of a foreign planner."""
    with TemporaryDirectory() as folder:
        return case_of(recorded(name, Path(folder) / "run.mcap"))


def claiming(case: Case, **claims: Any) -> Case:
    """Change what a recording claims; nothing without claims."""
    changed = replace(case.manifest.claims, **claims) if claims else Claims()
    return replace(case, manifest=replace(case.manifest, claims=changed))


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_planners_have_no_findings(name: str) -> None:
    """By their claims; each rule that is left out for one is named, with the claim."""
    case = foreign(name)
    found = verify(case.recording())
    assert found.findings == []
    stated = {f"the recording claims {k}: {v}" for k, v in case.manifest.claims.stated().items()}
    stated = {reason for reason in stated if "goal_tolerance" not in reason}
    assert stated == {reason for reason in found.not_judged if "claims" in reason}
    assert not stated or "all" not in str(found).splitlines()[-1]


def ball_on_motion(case: Case) -> Case:
    """Put a ball on the middle of an edge that no path has, away from its ends."""
    edges, path = case.log[Kind.EDGE], np.asarray(case.log[Kind.PATH]["waypoints"][-1])
    leaves = np.setdiff1d(edges["node"], edges["parent"])
    off = [i for i in leaves if not (edges["q"][i] == path).all(axis=1).any()]
    ends = np.array([[edges["q"][edges["parent"][i]], edges["q"][i]] for i in off])[:, :, :2]
    middle = ends.mean(axis=1)
    corners = np.concatenate([np.asarray(edges["q"])[:, :2], path[:, :2]])
    far = [np.hypot(*(corners - point).T).min() for point in middle]
    return case.with_ball(middle[int(np.argmax(far))])


def ball_on_path(case: Case) -> Case:
    """Put a ball on a motion of the last path."""
    path = np.asarray(case.log[Kind.PATH]["waypoints"][-1])
    return case.with_ball((path[1, :2] + path[2, :2]) / 2)


def ball_on_waypoint(case: Case) -> Case:
    """Put a ball on a waypoint of the last path."""
    return case.with_ball(np.asarray(case.log[Kind.PATH]["waypoints"][-1])[2, :2])


def ending(far: float) -> Edit:
    """Let the path end somewhere else, at a node that is added to the tree."""

    def edit(case: Case) -> Case:
        path = np.array(case.log[Kind.PATH]["waypoints"][0])
        path[-1] += (path[-2] - path[-1]) * (far / np.linalg.norm(path[-2] - path[-1]))
        length = np.hypot(*np.diff(path, axis=0).T).sum()
        return case.edit(Kind.PATH, 0, waypoints=path, cost=length)

    return edit


def dearer_rewire(case: Case) -> Case:
    """Give a node that has no children a parent through which it costs more."""
    edges = case.log[Kind.EDGE]
    leaf = int(np.setdiff1d(edges["node"], [*edges["parent"], *case.log[Kind.REWIRE]["node"]])[-1])
    q, root = edges["q"][leaf], edges["q"][0]
    far = np.hypot(*(np.asarray(edges["q"]) - q).T)
    parent = int(np.argmax(np.where(edges["node"] == leaf, 0, far)))
    assert (root != q).any()
    return claiming(case.add(Kind.REWIRE, node=leaf, parent=parent, cost=99.0), edges="assumed",
                    **case.manifest.claims.stated())  # fmt: skip


def circle(case: Case) -> Case:
    """Rewire the root to one of its descendants."""
    return case.add(Kind.REWIRE, node=0, parent=1, cost=0.0)


def dearer(row: int) -> Edit:
    """Change the cost of an edge."""
    return lambda case: case.shift(Kind.EDGE, row, "cost", 0.5)


def same(case: Case) -> Case:
    """Change nothing."""
    return case


def dropped(case: Case) -> Case:
    """Leave out some samples."""
    for row in (30, 20, 10):
        case = case.drop(Kind.SAMPLE, row)
    return claiming(case, samples="none")


ACCUSED_WITHOUT: list[tuple[str, str, Edit, str]] = [
    ("motions", "hybrid-a-star", ball_on_motion, "edges free"),
    ("costs", "hybrid-a-star", dearer(100), "edge costs"),
    ("costs", "hybrid-a-star", same, "path costs"),
    ("edges", "lazy", same, "edges free"),
    ("goal_tolerance", "fmt-star", lambda c: claiming(ending(0.4)(c), goal_tolerance=0.5),
     "path ends"),
    ("goal_tolerance", "hybrid-a-star", same, "path ends"),
    ("times", "bit-star", dearer_rewire, "rewires gain"),
    ("samples", "silent", same, "iterations"),
    ("samples", "rrt", dropped, "iterations"),
]  # fmt: skip
"""A claim, a recording that it holds for, how that is doctored, and a rule that finds something
without the claim."""

ACCUSED_ALL_THE_SAME: list[tuple[str, str, Edit, str]] = [
    ("motions", "hybrid-a-star", ball_on_waypoint, "configurations free"),
    ("motions", "hybrid-a-star", lambda c: claiming(c, costs="length").edit(Kind.EDGE, 50, cost=0),
     "edge costs"),
    ("costs", "hybrid-a-star", lambda c: c.edit(Kind.EDGE, 100, parent=-1), "roots"),
    ("costs", "hybrid-a-star", lambda c: c.add(Kind.REWIRE, node=9, parent=0, cost=999.0),
     "rewires gain"),
    ("edges", "lazy", ball_on_path, "paths free"),
    ("goal_tolerance", "fmt-star", lambda c: claiming(ending(0.6)(c), goal_tolerance=0.5),
     "path ends"),
    ("times", "bit-star", circle, "rewires"),
    ("times", "bit-star", ball_on_path, "edges free"),
    ("samples", "silent", lambda c: c.with_stated(step=0.5), "edge lengths"),
]  # fmt: skip
"""The same, and a rule that finds something in spite of the claim."""


def found_by(case: Case, rule: str) -> bool:
    """Whether a rule finds something."""
    return rule in case.broken()


@pytest.mark.parametrize(("claim", "name", "edit", "rule"), ACCUSED_WITHOUT)
def test_without_the_claim_a_rule_would_accuse(
    claim: str, name: str, edit: Edit, rule: str
) -> None:
    """With it, the rule finds nothing."""
    case = edit(foreign(name))
    assert claim in case.manifest.claims.stated()
    assert not found_by(case, rule)
    default = getattr(Claims(), claim)
    assert found_by(claiming(case, **{claim: default}), rule)


@pytest.mark.parametrize(("claim", "name", "edit", "rule"), ACCUSED_ALL_THE_SAME)
def test_with_the_claim_other_rules_accuse(claim: str, name: str, edit: Edit, rule: str) -> None:
    """A claim excuses what it says and no more."""
    assert not found_by(foreign(name), rule)
    case = edit(foreign(name))
    assert claim in case.manifest.claims.stated()
    assert found_by(case, rule)


def test_each_claim_is_tried_in_both_ways() -> None:
    """Also those that are added."""
    names = set(Claims().as_dict())
    assert {claim for claim, *_ in ACCUSED_WITHOUT} == names
    assert {claim for claim, *_ in ACCUSED_ALL_THE_SAME} == names
    assert {name for rule in RULES for name in rule.assumes} <= names | {"collisions", "bounds"}


def test_a_foreign_contract_is_held_against_the_planner() -> None:
    """As that of a registered planner."""
    assert foreign("rrt").broken() == set()
    assert found_by(foreign("rrt").with_stated(step=1.0), "edge lengths")
    assert found_by(foreign("rrt").with_stated(stops=False), "endings")


def test_claims_are_kept(tmp_path: Path) -> None:
    """In the manifest; recordings that claim nothing have the defaults, and no entry."""
    stated = {"motions": "own", "goal_tolerance": 0.25}
    with record(tmp_path / "a.mcap", world=FIELD, claims=stated):
        pass
    with record(tmp_path / "b.mcap", world=FIELD, claims=Claims()):
        pass
    claims = read(tmp_path / "a.mcap").manifest.claims
    assert claims == Claims(motions="own", goal_tolerance=0.25)
    assert claims.stated() == stated
    plain = read(tmp_path / "b.mcap").manifest
    assert plain.claims == Claims()
    assert "claims" not in plain.to_strings()


WRONG: list[tuple[Any, str]] = [
    ({"motion": "own"}, "unknown parameter of claims 'motion'"),
    ({"motions": "curved"}, "unknown value of motions 'curved'"),
    ({"goal_tolerance": -1}, "goal_tolerance must be at least 0"),
    ({"goal_tolerance": "near"}, "goal_tolerance must be a number"),
    ({"goal_tolerance": float("nan")}, "goal_tolerance must be a finite number"),
    ({"edges": None}, "unknown value of edges 'None'"),
    (["motions"], "claims must be a table of names and values"),
    (Contract(), "claims must be a table of names and values"),
]


@pytest.mark.parametrize(("claims", "message"), WRONG)
def test_wrong_claims_are_errors_at_the_call(claims: Any, message: str, tmp_path: Path) -> None:
    """In one line, before the file is written."""
    with pytest.raises(BrrtError, match=message) as caught:
        record(tmp_path / "x.mcap", world=FIELD, claims=claims)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "x.mcap").exists()


def test_damaged_claims_are_an_error() -> None:
    """Also those of a newer brrt."""
    texts = foreign("lazy").manifest.to_strings()
    for damaged in ('{"edges": 1}', "[1]", '{"weather": "fine"}', "{"):
        with pytest.raises(BrrtError, match="the manifest is damaged"):
            Manifest.from_strings({**texts, "claims": damaged})
