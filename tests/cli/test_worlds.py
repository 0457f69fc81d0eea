"""`brrt worlds` from the command line: its output describes the world correctly."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from rerun.chunk import RrdReader

from brrt import GENERATORS, BrrtError, McapSink, Memory, Run, Scenario, World, read
from brrt.views.colours import GOAL, START, Colour
from brrt.views.matplotlib.draw_world import plot_world
from brrt.worlds import LOADERS, Grid, load_world, make_world
from tests.conftest import Result, findings_of

Command = Callable[..., Result]

WORLDS = pytest.mark.parametrize(
    "spec", ["circles2d:n=40", "polygons2d:n=60,seed=2", "boxes3d:n=80", "spheres3d"]
)


def hand_made(**changes: Any) -> World:
    """A 2D world with every kind of obstacle, including a rotated grid and a line segment."""
    cells = np.zeros((14, 14), bool)
    cells[3:9, 4], cells[3, 4:8] = True, True
    grid = Grid(cells, np.array([2.0, -2]), 1.0, 0.3)
    parts: dict[str, Any] = {
        "name": "mine",
        "lower": np.zeros(2),
        "upper": np.full(2, 12.0),
        "grid": grid,
        "balls": np.array([[8.0, 3, 1]]),
        "boxes": np.array([[1.0, 7, 4, 8], [5, 7, 5.05, 11]]),
        "polygons": (np.array([[7.0, 7], [11, 7.5], [8, 10]]), np.array([[4.0, 9], [6, 11]])),
        "start": np.array([1.5, 5.5]),
        "goal": np.array([11.0, 2.5]),
    }
    return World(**{**parts, **changes})


# Lists


def test_the_list_begins_with_a_line_for_each(brrt: Command) -> None:
    """An overview, then every parameter; `brrt worlds` without a subcommand prints the same."""
    text = brrt("worlds", "list").out
    assert brrt("worlds").out == text
    lines = text.splitlines()
    names = [line.split()[0] for line in lines if line[:1].isalpha()]
    assert [name for name in names if name in GENERATORS] == 2 * list(GENERATORS)
    for name, generator in GENERATORS.items():
        about = (generator.__doc__ or "").split("\n")[0].split()
        assert sum(about[0] in line for line in lines) >= 2, name
    assert "max_corners" in text
    for name, loader in LOADERS.items():
        assert sum(line.startswith(f"{name} ") for line in lines) >= 1
        assert all(ending in text for ending in loader.endings)


def test_one_generator_alone(brrt: Command) -> None:
    """Only its own parameters, as text and as JSON."""
    text = brrt("worlds", "list", "polygons2d").out
    assert "max_corners" in text
    assert "max_side" not in text
    data = brrt("worlds", "list", "polygons2d", "--json").json
    assert list(data) == ["polygons2d"]
    assert {"name", "default", "unit", "range", "doc"} == set(data["polygons2d"]["params"][0])
    every = brrt("worlds", "list", "--json").json
    assert list(every) == [*GENERATORS, *LOADERS]
    assert every["movingai"]["endings"] == [".map"]
    assert every["scenarios"]["query"]
    assert "bucket" in brrt("worlds", "list", "scenarios").out


# Looking


@WORLDS
def test_what_is_shown_is_true(spec: str, brrt: Command) -> None:
    """Text and JSON agree with the world and with each other."""
    world, seen = make_world(spec), brrt("worlds", "show", spec, "--json").json
    assert seen["world"] == spec
    assert (seen["dim"], seen["balls"]) == (world.dim, len(world.balls))
    assert (seen["boxes"], seen["polygons"]) == (len(world.boxes), len(world.polygons))
    assert world.start is not None
    assert world.goal is not None
    assert (seen["start"], seen["goal"]) == (world.start.tolist(), world.goal.tolist())
    points = np.random.default_rng(9).uniform(world.lower, world.upper, (3000, world.dim))
    free = np.mean([world.obstacle_at(point) is None for point in points])
    assert abs(seen["free"] - free) < 5 * np.sqrt(0.25 / 3000) + 5 * seen["free_error"]
    assert seen["connected"] is True
    text = brrt("worlds", "show", spec)
    assert text.code == 0
    assert "yes, free cells of" in text.out
    (share,) = re.findall(r"free +([0-9.]+) %", text.out)
    assert float(share) == pytest.approx(100 * seen["free"], abs=0.006)
    assert text.err == ""


def test_every_kind_of_obstacle_is_counted(brrt: Command) -> None:
    """Rectangles, line segments and cells are counted separately."""
    hand_made().save("w.json")
    text = brrt("worlds", "show", "w.json").out
    words = " ".join(text.split())
    assert "1 circle, 2 rectangles, 1 polygon, 1 line segment, a grid of 14 x 14 cells" in words
    assert "turned by 0.3 rad, 9 of them blocked" in words
    figures = brrt("worlds", "show", "w.json", "--json").json
    assert figures["segments"] == 1
    assert figures["grid"] == {
        "rows": 14, "columns": 14, "resolution": 1.0, "yaw": 0.3, "blocked": 9
    }  # fmt: skip


def drawing(text: str) -> list[str]:
    """Return the lines within the first frame."""
    lines = text.splitlines()
    top = next(i for i, line in enumerate(lines) if line[:1] in ("┌", "+"))
    width = 1 + min(lines[top].find(end, 1) for end in "┐+" if lines[top].find(end, 1) > 0)
    inside = list[str]()
    for line in lines[top + 1 :]:
        if line[:1] in ("└", "+"):
            return inside
        inside.append(line[1 : width - 1])
    raise AssertionError(text)


@pytest.mark.parametrize("columns", [40, 80, 140])
def test_the_sketch_is_the_world(
    columns: int, brrt: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dark at obstacles, S and G at start and goal, at most as wide as the terminal."""
    world = World("w", np.zeros(2), np.array([20.0, 10]), boxes=np.array([[10.0, 5, 20, 10]]))
    world.save("w.json")
    monkeypatch.setattr(import_module("brrt_cli.console").console(), "_width", columns)
    text = brrt("worlds", "show", "w.json", "--start", "1,9", "--goal", "19,1").out
    lines = drawing(text)
    assert all(len(line) <= columns for line in text.splitlines())
    assert {len(line) for line in lines} == {len(lines[0])}
    rows, width = len(lines), len(lines[0])
    assert 0.8 < width / (4 * rows) < 1.25
    for i, line in enumerate(lines):
        for j, letter in enumerate(line):
            x, y = (j + 0.5) / width * 20, 10 - (i + 0.5) / rows * 10
            if abs(x - 10) > 1 and abs(y - 5) > 1 and letter not in "SG":
                assert (letter == "█") == (x > 10 and y > 5), (x, y, letter)
    places = {mark: (i, line.index(mark)) for i, line in enumerate(lines) for mark in "SG"
              if mark in line}  # fmt: skip
    for mark, (x, y) in {"S": (1, 9), "G": (19, 1)}.items():
        row, column = places[mark]
        assert abs((column + 0.5) / width * 20 - x) < 20 / width
        assert abs(10 - (row + 0.5) / rows * 10 - y) < 10 / rows


def test_a_thin_line_is_seen(brrt: Command) -> None:
    """A line segment is visible from side to side."""
    line = np.array([[0.0, 3], [10, 8.3]])
    World("line", np.zeros(2), np.full(2, 10.0), polygons=(line,)).save("w.json")
    columns = zip(*drawing(brrt("worlds", "show", "w.json").out), strict=True)
    assert all(set(column) > {" "} for column in columns)


def test_a_world_in_3d_is_seen_from_two_sides(brrt: Command) -> None:
    """A tall post is dark from above; from the side it is a bar."""
    post = np.array([[4.0, 4, 0, 6, 6, 10]])
    World("post", np.zeros(3), np.full(3, 10.0), boxes=post).save("w.json")
    text = brrt("worlds", "show", "w.json").out
    above = drawing(text)
    assert above[len(above) // 2][len(above[0]) // 2] == "█"
    assert not any(above[0].strip())
    beside = [line.split("│")[3] for line in text.splitlines() if line.count("│") == 4]
    assert all(line.strip() and line[0] == line[-1] == " " for line in beside)


def test_a_pipe_gets_the_sketch_without_colours(shell: Command) -> None:
    """Output to a pipe has block characters but no escape codes."""
    done = shell("worlds", "show", "polygons2d:n=20")
    assert done.code == 0, done.err
    assert "█" in done.out
    assert "\x1b" not in done.out


def test_a_terminal_that_has_ascii_alone_gets_letters(tmp_path: Path) -> None:
    """Only characters of the terminal's encoding are used."""
    env = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "60"}
    done = subprocess.run(
        [sys.executable, "-m", "brrt_cli", "worlds", "show", "polygons2d:n=20"],
        capture_output=True, check=False, env=env, cwd=tmp_path, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    text = done.stdout.decode("ascii")
    assert "####" in text
    assert all(len(line) <= 60 for line in text.splitlines())


def test_ways_are_told_as_they_are(brrt: Command) -> None:
    """Yes, no and unknown; the reason names a start within an obstacle."""
    wall = np.array([[5.0, -1, 5.1, 11]])
    World("wall", np.zeros(2), np.full(2, 10.0), boxes=wall).save("w.json")
    ends = ("--start", "1,1", "--goal", "9,9")
    assert "connected" not in brrt("worlds", "show", "w.json").out
    seen = brrt("worlds", "show", "w.json", "--json", *ends).json
    assert seen["connected"] is None
    assert seen["cell"] == pytest.approx(10 / 1024)
    assert "unknown, no free cells of" in brrt("worlds", "show", "w.json", *ends).out
    inside = brrt("worlds", "show", "w.json", "--start", "5.05,5", "--goal", "9,9")
    assert "no, the start touches box 0" in inside.out


# Pictures


def seen_at(pixels: NDArray[np.uint8], colour: Colour) -> NDArray[np.float64]:
    """Return column and row of a marker: the mean of the pixels of its colour."""
    rows, columns = np.nonzero((np.abs(pixels.astype(int) - colour) < 40).all(axis=2))
    assert len(rows) > 20, colour
    return np.array([columns.mean(), rows.mean()])


@pytest.mark.parametrize(
    "world",
    [
        make_world("circles2d:n=40"),
        make_world("polygons2d:n=60,seed=2"),
        make_world("squares2d:n=40"),
        hand_made(),
        hand_made(upper=np.array([30.0, 12])),
    ],
    ids=["circles", "polygons", "squares", "hand-made", "long"],
)
def test_a_picture_shows_what_is_blocked(world: World, brrt: Command) -> None:
    """With the markers as reference points, dark pixels are blocked points."""
    world.save("w.json")
    assert world.start is not None
    assert world.goal is not None
    done = brrt("worlds", "show", "w.json", "--out", "w.png")
    assert done.code == 0, done.err
    pixels = np.asarray(Image.open("w.png").convert("RGB"))
    ends = np.array([seen_at(pixels, START), seen_at(pixels, GOAL)])
    scale = (ends[1] - ends[0]) / (world.goal - world.start)
    assert scale[0] == pytest.approx(-scale[1], rel=0.02)
    # Not at the edge: the frame, a point wide, lies there.
    margin = 0.01 * world.extent
    points = np.random.default_rng(0).uniform(world.lower + margin, world.upper - margin, (3000, 2))
    at = np.round(ends[0] + (points - world.start) * scale).astype(int)
    dark = pixels[at[:, 1], at[:, 0]].sum(axis=1) < 3 * 128
    blocked = np.array([world.obstacle_at(point) is not None for point in points])
    assert (dark != blocked).mean() < 0.02
    assert dark.mean() == pytest.approx(1 - brrt("worlds", "show", "w.json", "--json").json["free"],
                                        abs=0.03)  # fmt: skip


def test_a_picture_in_3d_has_obstacles_and_both_ends(brrt: Command) -> None:
    """More boxes give more grey; start and goal are visible through them."""
    shares = []
    for n in (10, 150):
        assert brrt("worlds", "show", f"boxes3d:n={n}", "--out", "w.png", "--force").code == 0
        pixels = np.asarray(Image.open("w.png").convert("RGB")).astype(int)
        assert (
            seen_at(pixels.astype(np.uint8), START)[0] < seen_at(pixels.astype(np.uint8), GOAL)[0]
        )
        shares.append((pixels.max(axis=2) < 200).mean())
    assert 0.01 < shares[0] < shares[1] / 3


@pytest.mark.parametrize(("ending", "begin"), [("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_other_kinds_of_picture(ending: str, begin: bytes, brrt: Command) -> None:
    """Files have the right magic bytes and are equal each time."""
    for name in ("a", "b"):
        brrt("worlds", "show", "circles2d", "--out", f"{name}.{ending}")
    assert Path(f"a.{ending}").read_bytes().startswith(begin)
    assert Path(f"a.{ending}").read_bytes() == Path(f"b.{ending}").read_bytes()


def test_without_matplotlib_one_line_says_so(
    brrt: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Matplotlib is optional; everything else works without it."""
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    done = brrt("worlds", "show", "circles2d", "--out", "w.png")
    assert_refused(done, "pip install 'brrt[plot]'")
    assert not list(Path().iterdir())
    assert brrt("worlds", "show", "circles2d").code == 0


def test_a_rerun_file_holds_the_world(brrt: Command) -> None:
    """The file has obstacles and markers, and nothing of a run."""
    hand_made().save("w.json")
    assert brrt("worlds", "show", "w.json", "--rrd", "w.rrd").code == 0
    entities = {chunk.entity_path for chunk in RrdReader("w.rrd").stream()}
    for part in ("bounds", "start", "goal", "obstacles/balls", "obstacles/boxes",
                 "obstacles/polygons", "obstacles/grid"):  # fmt: skip
        assert f"/world/{part}" in entities
    assert not any(entity.startswith(("/ev", "/brrt", "/series")) for entity in entities)
    assert_refused(brrt("replay", "w.rrd"), "not a recording of brrt")


def test_rerun_draws_worlds_beyond_its_numbers(brrt: Command) -> None:
    """Rerun draws in single precision; worlds have double precision, and are scaled."""
    World("far", np.zeros(2), np.full(2, 1e90)).save("w.json")
    assert brrt("worlds", "show", "w.json", "--rrd", "w.rrd").code == 0
    assert Path("w.rrd").exists()


# Saving


@WORLDS
def test_a_world_that_was_made_is_the_same_world(spec: str, brrt: Command) -> None:
    """The saved world is equal bit by bit, and so is planning in it."""
    done = brrt("worlds", "make", spec, "--out", "w.json")
    assert done.code == 0
    assert "--world w.json" in done.out
    one, other = make_world(spec), load_world("w.json")
    for name in ("lower", "upper", "start", "goal", "balls", "boxes"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()
    assert all((a == b).all() for a, b in zip(one.polygons, other.polygons, strict=True))
    made, generated = (
        brrt("plan", "--world", world, "--no-record", "--json").json for world in ("w.json", spec)
    )
    assert made["path"] == generated["path"]


def test_ends_that_are_given_are_saved(brrt: Command) -> None:
    """Given ends are saved, and generators keep them free."""
    brrt(
        "worlds", "make", "circles2d:n=90", "--start", "50,50", "--goal", "10,90", "--out", "w.json"
    )
    world = load_world("w.json")
    assert world.start is not None
    assert world.start.tolist() == [50, 50]
    assert world.obstacle_at([50, 50]) is None
    assert brrt("plan", "--world", "w.json", "--no-record").code == 0


def test_a_file_is_never_half_written(brrt: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """If writing fails, the old file remains and no other file is left."""
    brrt("worlds", "make", "circles2d", "--out", "w.json")
    before = Path("w.json").read_bytes()

    def full(path: Path, text: str, *_: object) -> int:
        path.write_bytes(text[:100].encode())
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    done = brrt("worlds", "make", "circles2d:n=3", "--out", "w.json", "--force")
    assert_refused(done, "cannot write w.json: No space left on device")
    assert [path.name for path in Path().iterdir()] == ["w.json"]
    assert Path("w.json").read_bytes() == before


def test_names_are_printed_as_they_are(brrt: Command) -> None:
    """Brackets are not interpreted as markup, and long names are not wrapped."""
    name = "[bold]" + 100 * "x"
    done = brrt("worlds", "make", "circles2d", "--out", f"{name}.json")
    assert done.out.count(f"{name}.json") == 2
    done = brrt("worlds", "show", f"{name}.json", "--out", f"{name}.png", "--rrd", f"{name}.rrd")
    assert f"{name}.png: the picture" in done.out
    assert done.out.count(f"{name}.rrd") == 2


# Bad input


def assert_refused(done: Result, *words: str) -> None:
    """Bad input gives one line on stderr and exit code 2."""
    assert done.code == 2, (done.out, done.err)
    assert done.out == ""
    assert len(done.err.splitlines()) == 1, done.err
    for word in words:
        assert word in done.err


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("show",), ("WORLD",)),
        (("show", "circels2d"), ("did you mean 'circles2d'",)),
        (("show", "missing.json"), ("missing.json", "o such file")),
        (("show", "circles2d:n=x"), ("n must be a whole number",)),
        (("show", "circles2d", "--start", "1,x"), ("--start", "1,x")),
        (("show", "circles2d", "--goal", "1,2,3"), ("goal", "2 numbers")),
        (("show", "circles2d", "--start", "nan,2"), ("start", "finite")),
        (("show", "circles2d", "--out", "w.gif"), ("--out w.gif", ".png or .svg or .pdf")),
        (("show", "circles2d", "--out", "no/w.png"), ("there is no folder no",)),
        (("show", "circles2d", "--rrd", "w.json"), ("--rrd w.json", ".rrd")),
        (("make", "circles2d"), ("--out",)),
        (("make", "circles2d", "--out", "w.txt"), ("--out w.txt", ".json")),
        (("make", "nothing", "--out", "w.json"), ("unknown world 'nothing'",)),
        (("list", "labyrinth"), ("unknown world 'labyrinth'",)),
        (("draw", "circles2d"), ("draw",)),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_bad_input_is_one_line(
    args: tuple[str, ...], words: tuple[str, ...], brrt: Command
) -> None:
    """Nothing is written without --force."""
    assert_refused(brrt("worlds", *args), *words)
    assert not list(Path().iterdir())


def test_files_are_not_overwritten_unasked(brrt: Command) -> None:
    """With --force, existing files are replaced."""
    for command in (
        ("make", "circles2d", "--out", "w.json"),
        ("show", "circles2d", "--out", "w.png"),
        ("show", "circles2d", "--rrd", "w.rrd"),
    ):
        assert brrt("worlds", *command).code == 0
        assert_refused(brrt("worlds", *command), "exists already")
        assert brrt("worlds", *command, "--force").code == 0


# Python


def test_a_world_made_by_hand_is_planned_in(tmp_path: Path) -> None:
    """Obstacles may be lists; the recording contains the world, and verification passes."""
    world = hand_made(name="my world")
    run = Run(Scenario(seed=3, iterations=20_000), world=world)
    memory, sink = Memory(), McapSink(tmp_path / "run.mcap", run.manifest, run.problem.world)
    metrics = run.execute([memory, sink])
    assert metrics.solved
    assert metrics.as_dict()["world"] == "my world"
    saved = read(tmp_path / "run.mcap")
    assert saved.world.to_json() == world.to_json()
    assert findings_of(saved.manifest, saved.world, memory.events()) == []


def test_a_world_is_described_in_a_line() -> None:
    """Worlds with many obstacles have a repr of one line."""
    text = repr(make_world("boxes3d:n=10000,max_side=3"))
    assert text == (
        "<World 'boxes3d:n=10000,max_side=3'; 0, 0, 0 to 100, 100, 100; 10000 boxes; "
        "start 5, 5, 5; goal 95, 95, 95>"
    )
    assert "14 x 14 cells" in repr(hand_made())


def test_a_plot_is_put_where_it_is_asked_for() -> None:
    """`plot_world` draws into given or new axes; a 3D world needs 3D axes."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    _, axes = plt.subplots(1, 2)
    assert plot_world(make_world("circles2d"), axes[1]) is axes[1]
    assert axes[1].get_xlim() == (0, 100)
    assert not axes[0].collections
    spheres = make_world("spheres3d:n=3")
    assert plot_world(spheres).name == "3d"
    with pytest.raises(BrrtError, match="projection"):
        plot_world(spheres, axes[0])
    plt.close("all")


@pytest.mark.parametrize("kind", ["balls", "boxes"])
def test_a_picture_of_very_many_obstacles(kind: str) -> None:
    """It has the largest, and says of how many; a million would take all memory."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    n, rng = 50_000, np.random.default_rng(1)
    centres, radii = rng.uniform(1, 9, (n, 3)), np.linspace(0.01, 0.02, n)
    balls = np.concatenate([centres, radii[:, None]], axis=1)
    boxes = np.concatenate([centres - radii[:, None], centres + radii[:, None]], axis=1)
    shape: dict[str, Any] = {"balls": balls} if kind == "balls" else {"boxes": boxes}
    axes = plot_world(World("many", np.zeros(3), np.full(3, 10.0), **shape))
    (text,) = (text.get_text() for text in axes.texts)
    faces = len(axes.collections[0].get_facecolor())
    assert text == f"the largest {200_000 // (32 if kind == 'balls' else 6):,} of 50,000 obstacles"
    assert 199_000 < faces <= 200_000
    plt.close("all")


def test_notes_are_said_and_not_saved(
    brrt: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Each command that makes the world prints its notes on stderr; --json includes them."""
    lines = ["boundary 0 0 0 10 10 10", "block 1 1 1 2 2 12"]
    (tmp_path / "map.txt").write_text("\n".join(lines))
    noted = load_world("map.txt").notes
    if not noted:
        pytest.skip("no loader notes this yet")
    ends = ("--start", "5,5,5", "--goal", "9,9,9")
    for command in (("worlds", "show"), ("plan", "--no-record", "--world")):
        done = brrt(*command, "map.txt", *ends, "--json")
        assert done.err.splitlines() == [f"brrt: {line}" for line in noted]
        json.loads(done.out)
