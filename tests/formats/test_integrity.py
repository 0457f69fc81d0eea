"""Values that no planner can mean, and gaps, are refused as a recording is read."""

from typing import Any

import numpy as np
import pytest

from brrt import BrrtError, Events, Kind, Memory, Run, Scenario
from brrt.formats.integrity import Numbering
from tests.support.files import part


@pytest.fixture(scope="module")
def lrta() -> Events:
    """Give the log of a search."""
    return _log("lrta-star")


@pytest.fixture(scope="module")
def rrt() -> Events:
    """Give the log of a tree planner."""
    return _log("rrt")


def _log(planner: str) -> Events:
    log = Memory()
    Run(Scenario(world="circles2d:n=40", seed=7, planner=planner)).execute([log])
    return log.events()


def _take(events: Events, kind: Kind, name: str, value: Any) -> None:
    """Read a log whose last event of a kind has another value."""
    tables = {each: table.copy() for each, table in events.tables.items()}
    if name == "waypoints":
        tables[kind][name][-1] = value
    else:
        tables[kind][name][-1:] = value
    Numbering().take(Events(events.dof, tables))


def test_logs_of_planners_pass(rrt: Events, lrta: Events) -> None:
    """What planners write is possible; so is an infinite estimate."""
    Numbering().take(rrt)
    Numbering().take(lrta)
    _take(lrta, Kind.HEURISTIC, "h", np.inf)  # a cell without a way out


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (Kind.EDGE, "t", -1),
        (Kind.EDGE, "t", 1 << 61),
        (Kind.SAMPLE, "iteration", -1),
        (Kind.SAMPLE, "source", 4),
        (Kind.PHASE, "status", 7),
        (Kind.EDGE, "parent", -2),
        (Kind.EDGE, "node", 1 << 30),
        (Kind.EDGE, "cost", np.nan),
        (Kind.EDGE, "cost", -np.inf),
        (Kind.SAMPLE, "q", (0.0, np.nan)),
        (Kind.REJECT, "q", (np.inf, 0.0)),
        (Kind.PATH, "waypoints", np.array([[0.0, 0.0], [np.nan, 1.0]])),
        (Kind.PATH, "waypoints", np.empty((0, 2))),
    ],
)
def test_impossible_values(rrt: Events, kind: Kind, name: str, value: Any) -> None:
    """The message names the event, the kind, the field and the value."""
    with pytest.raises(BrrtError, match=rf"^event \S+: {kind.label} has {name} = "):
        _take(rrt, kind, name, value)


def test_impossible_estimate(lrta: Events) -> None:
    """Infinite is an estimate, not a number is none."""
    with pytest.raises(BrrtError, match="heuristic has h = nan"):
        _take(lrta, Kind.HEURISTIC, "h", np.nan)


def test_gaps_and_doubles(rrt: Events) -> None:
    """Every number is there once, in order; a batch that is refused does not count."""
    numbering = Numbering()
    for batch, message in (
        (rrt.until(seq=20), None),
        (part(rrt, 22, 40), "events are missing"),
        (rrt.until(seq=20), "events are missing"),
        (part(rrt, 21, 40), None),
    ):
        if message is None:
            numbering.take(batch)
            continue
        with pytest.raises(BrrtError, match=message):
            numbering.take(batch)
    assert numbering.next == 40
    tables = {kind: np.concatenate([t, t[-1:]]) for kind, t in part(rrt, 40, 60).tables.items()}
    with pytest.raises(BrrtError, match=r"out of order|missing"):
        numbering.take(Events(rrt.dof, tables))
