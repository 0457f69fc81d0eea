"""Recordings of foreign planners through the command line, whatever is missing in them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brrt import BrrtError, Kind, World, explain, read, record, verify
from brrt.robots.opaque import MOST_NUMBERS
from brrt.views.rerun.drawing import draw_run
from tests.conftest import Result
from tests.support.foreign import FIELD, FOREIGN, recorded

SPACE = World(
    "space", lower=np.zeros(3), upper=np.full(3, 10.0), boxes=np.array([[4.0, 4, 0, 6, 6, 6]])
)
WORLDS = {"no world": None, "field": FIELD, "space": SPACE}

PARTS = ("samples", "edges", "cells", "path")

CASES = [
    *((dof, world, PARTS) for dof in (1, 2, 3, 7, MOST_NUMBERS) for world in WORLDS),
    (1, "no world", ()),
    (7, "space", ()),
    *((7, "no world", (part,)) for part in PARTS),
    (2, "field", ("samples",)),
    (2, "field", ("path",)),
]


def foreign_run(
    path: Path, dof: int, world: str, parts: tuple[str, ...], span: float = 10.0
) -> Path:
    """Record random events of some kinds, up to `span` from 0."""
    rng, start, goal = np.random.default_rng(dof), np.full(dof, 1.0), np.full(dof, 9.0)
    q = rng.uniform(-span, span, (20, dof))
    with record(path, world=WORLDS[world], dof=dof, start=start, goal=goal, planner="mine") as rec:
        if "samples" in parts:
            rec.samples(q)
        if "edges" in parts:
            rec.edge(start)
            rec.edges(q, np.arange(20) // 2)
            rec.rejects(q, np.arange(20))
            rec.rewire(19, 0)
            rec.edge(goal, tree=1)
            rec.connect(3, 0)
        if "cells" in parts:
            rec.expand(0, -1, start, 0.0)
            rec.expand(1, 0, q[0], 1.0)
        if "path" in parts:
            rec.path([start, q[0], goal])
    return path


COMMANDS: list[tuple[str, ...]] = [
    ("replay", "RUN"), ("replay", "RUN", "--json"), ("replay", "RUN", "--text"),
    ("replay", "RUN", "--at-event", "3"), ("replay", "RUN", "--rrd", "run.rrd"),
    ("explain", "RUN"), ("explain", "RUN", "--json"),
    ("plot", "RUN", "--out", "run.png", "--rejects", "5"), ("diff", "RUN", "RUN"),
    ("export", "RUN", "--foxglove", "out.mcap", "--layout", "layout.json"),
    ("recover", "RUN", "--out", "again.mcap"),
]  # fmt: skip


@pytest.mark.parametrize(("dof", "world", "parts"), CASES)
def test_every_command_takes_a_foreign_run(
    dof: int, world: str, parts: tuple[str, ...], brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """Without a traceback; the viewer's drawing too."""
    path = foreign_run(tmp_path / "run.mcap", dof, world, parts)
    for command in COMMANDS:
        done = brrt(*(path if word == "RUN" else word for word in command))
        assert done.code == 0, (command, done.err)
    done = brrt("verify", path)
    assert done.code in (0, 1), done.err
    assert "Traceback" not in done.err
    assert ("proves nothing of a tree" in " ".join(done.out.split())) == (
        not {"edges", "cells"} & set(parts)
    )
    if "edges" in parts:
        assert brrt("replay", path, "--node", "3").code == 0
    draw_run(tmp_path / "view.rrd", read(path), ring=1)


@pytest.mark.parametrize(
    ("dof", "world"), [(7, "field"), (7, "space"), (3, "no world"), (1, "field")]
)
def test_places_beyond_the_world(
    dof: int, world: str, brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """Numbers of an unknown robot are no positions: they may be anything."""
    path = foreign_run(tmp_path / "run.mcap", dof, world, PARTS, span=1e6)
    for command in COMMANDS:
        done = brrt(*(path if word == "RUN" else word for word in command))
        assert done.code == 0, (command, done.err)
    draw_run(tmp_path / "view.rrd", read(path))


@pytest.mark.parametrize("name", FOREIGN)
def test_every_command_takes_a_foreign_planner(
    name: str, brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """And verify finds nothing, and does not say that all rules hold."""
    path = recorded(name, tmp_path / "run.mcap")
    for command in COMMANDS:
        done = brrt(*(path if word == "RUN" else word for word in command))
        assert done.code == 0, (command, done.err)
    done = brrt("verify", path)
    assert done.code == 0
    assert ("all" in done.out.splitlines()[-1]) == (name == "rrt")
    draw_run(tmp_path / "view.rrd", read(path))


def test_what_is_not_known_is_left_out(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Neither blockers nor clearance nor coverage of a robot that is not known."""
    for dof, world, why in ((7, "space", "robot"), (3, "no world", "world")):
        path = foreign_run(tmp_path / "run.mcap", dof, world, PARTS)
        said = brrt("explain", path).out
        assert "opaque:numbers=" in said
        assert not {"clearance", "blocked", "region"} & set(said.split())
        found = explain(read(path)).facts
        assert found.blockers == []
        assert found.coverage is None
        assert found.clearance.connected is None
        names = verify(read(path)).not_judged[f"the {why} is not known"]
        assert {"bounds", "edges free", "rewires free", "links free", "paths free"} <= set(names)


def test_bounds_without_a_world_come_from_the_data(tmp_path: Path) -> None:
    """Around all that is drawn; the recorded ones hold start and goal alone."""
    path = foreign_run(tmp_path / "run.mcap", 3, "no world", ("edges",), span=50.0)
    recording = read(path)
    q = recording.events()[Kind.EDGE]["q"]
    assert not recording.world.bounded
    assert (recording.world.lower < q.min(axis=0)).all()
    assert (recording.world.upper > q.max(axis=0)).all()
    assert (recording.world.upper - recording.world.lower < 120).all()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert not read(path, partial=True).world.bounded


def test_the_robot_follows_from_what_is_given(tmp_path: Path) -> None:
    """A point where a configuration is a position in the world."""
    path, ends = tmp_path / "run.mcap", {"start": [1.0, 1.0], "goal": [2.0, 2.0]}
    for given, kind, dof in (
        ({"world": FIELD}, "point", 2),
        ({"world": FIELD, "start": [1.0] * 6, "goal": [2.0] * 6}, "opaque", 6),
        (ends, "opaque", 2),
        ({**ends, "dof": 2}, "opaque", 2),
    ):
        record(path, **given).close()
        manifest = read(path).manifest
        assert (manifest.make_robot().kind, manifest.dof) == (kind, dof)


WRONG = [
    ({}, "start must be given: there is no world that has one"),
    ({"start": [1.0]}, "goal must be given"),
    ({"dof": 0, "start": [], "goal": []}, "numbers must be at least 1, not 0"),
    ({"dof": 33, "start": [0.0] * 33, "goal": [0.0] * 33}, "numbers must be at most 32, not 33"),
    ({"dof": 2.5, "world": FIELD}, "numbers must be a whole number"),
    ({"dof": 3, "start": [1.0], "goal": [1.0]}, r"start must have the shape \(n, 3\)"),
    ({"dof": 3, "robot": "point", "world": FIELD}, "dof must be 2 for robot point, not 3"),
    ({"robot": "point", "start": [1.0], "goal": [1.0]}, "robot point needs a world"),
    ({"dof": 3, "world": FIELD}, "has no start of its own"),
]


@pytest.mark.parametrize(("given", "message"), WRONG)
def test_too_little_or_too_much(given: dict[str, object], message: str, tmp_path: Path) -> None:
    """One line says what to give."""
    with pytest.raises(BrrtError, match=message):
        record(tmp_path / "run.mcap", **given)  # type: ignore[arg-type]


def test_an_unknown_robot_cannot_plan(brrt: Callable[..., Result]) -> None:
    """Planning needs what is not known; reading does not."""
    done = brrt("plan", "--robot", "opaque:numbers=2", "--iterations", "5", "--start", "1,1",
                "--goal", "2,2", "--out", "x.mcap")  # fmt: skip
    assert done.code == 2
    assert "opaque" in done.err
    assert len(done.err.splitlines()) == 1
