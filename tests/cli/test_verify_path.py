"""`brrt verify --path`."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brrt import World
from tests.conftest import Result
from tests.support.recordings import GOLDEN

WORLD = World("", np.zeros(2), np.full(2, 10.0), np.array([[5.0, 5, 1]]))
LORRY = (
    '{"schema": "brrt.robot", "version": 1, "kind": "polygon", '
    '"polygons": [[[-1, -0.5], [1, -0.5], [1, 0.5], [-1, 0.5]]]}'
)


@pytest.fixture
def files(brrt: Callable[..., Result]) -> None:
    """A world, a robot and paths, in the folder of the command."""
    WORLD.save("map.json")
    Path("lorry.json").write_text(LORRY)
    Path("around.csv").write_text("x,y,theta\n2,2,0\n8,2,0\n8,8,1.57\n")
    Path("through.csv").write_text("2,5,0\n8,5,0\n8,9.9,0\n")


def test_a_path_that_holds(brrt: Callable[..., Result], files: None) -> None:
    """Its facts within 80 columns, as JSON, and as a picture; exit code 0."""
    command = ("verify", "--path", "around.csv", "--world", "map.json", "--robot", "lorry.json")
    done = brrt(*command, "--start", "2,2,0", "--goal", "8,8,1.57", "--out", "p.png")
    assert (done.code, done.err) == (0, "")
    assert max(map(len, done.out.splitlines())) <= 80
    for text in ("3 waypoints of a polygon", "90 deg in all", "from the bounds, in motion 1",
                 "as given", "the path holds: 2 motions free", "p.png: the picture"):  # fmt: skip
        assert text in done.out, text
    assert Path("p.png").read_bytes().startswith(b"\x89PNG")
    data = brrt(*command, "--json").json
    assert (data["holds"], data["path"], data["world"]) == (True, "around.csv", "map.json")
    assert [each["free"] for each in data["motions"]] == [True, True]


def test_a_path_that_does_not(brrt: Callable[..., Result], files: None) -> None:
    """What it hits and where, what is out of bounds, which end differs; exit code 1."""
    command = ("verify", "--path", "through.csv", "--world", "map.json", "--robot", "lorry.json")
    done = brrt(*command, "--goal", "8,9,0", "--out", "p.svg")
    assert (done.code, done.err) == (1, "")
    assert max(map(len, done.out.splitlines())) <= 80
    for text in ("BLOCKED  ball 0, 16.67 % along, at (3, 5, 0)", "BLOCKED  the bounds, ",
                 "0.9 from the one given", "2 of 2 motions hit something, the goal differs",
                 ):  # fmt: skip
        assert text in done.out, text
    data = brrt(*command, "--json").json
    assert [each["hit"]["obstacle"] for each in data["motions"]] == ["ball 0", "the bounds"]
    assert brrt(*command, "--goal", "8,9,0", "--tolerance", "1").out.count("differs") == 0


def test_many_motions_are_summed_up(brrt: Callable[..., Result], files: None) -> None:
    """Only those that hit are listed, and of those the first."""
    rows = [[2.0, 5.0], [8.0, 5.0]] * 20
    np.savetxt("many.txt", rows)
    out = brrt("verify", "--path", "many.txt", "--world", "map.json").out
    assert out.count("BLOCKED") == 12
    assert "... and 27 more that are blocked" in out
    np.save("free.npy", np.linspace([1, 1], [9, 1], 100))
    out = brrt("verify", "--path", "free.npy", "--world", "map.json").out
    assert len(out.splitlines()) < 12
    np.save("out.npy", np.linspace([11, 1], [11, 9], 20))
    out = brrt("verify", "--path", "out.npy", "--world", "map.json").out
    assert "... and 8 more" in out
    assert "20 coordinates out of bounds or limits" in out


def test_bad_input(brrt: Callable[..., Result], files: None) -> None:
    """One line and exit code 2."""
    alone = ("verify", "--path", "around.csv", "--world", "map.json")
    for command, text in (
        (("verify",), "name a recording, or a path with --path"),
        (("verify", "--path", "around.csv"), "--path needs the world"),
        ((*alone, GOLDEN), "a recording does not go with --path"),
        ((*alone, "--rerun"), "--rerun does not go with --path"),
        (("verify", GOLDEN, "--world", "map.json"), "--world needs --path"),
        ((*alone, "--start", "a,b"), "--start must be numbers like 1,2"),
        ((*alone, "--tolerance", "-1"), "--tolerance must be a number from 0 on"),
        ((*alone, "--out", "p.bmp"), "--out p.bmp: the name must end in .png"),
        (("verify", "--path", "no.csv", "--world", "map.json"), "no.csv: No such file"),
        (("verify", "--path", "through.csv", "--world", "map.json"), "through.csv:1: 3 columns"),
        (("verify", "--path", "around.csv", "--world", "boxes3d"), "no column 'z'"),
    ):
        done = brrt(*command)
        assert (done.code, done.out, done.err.count("\n")) == (2, "", 1), done
        assert text in done.err
