"""`brrt view`: what the viewer shows, in a window that nobody sees and in a browser."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlparse

import numpy as np
import pytest
from numpy.typing import NDArray
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from brrt import Events, Kind, McapSink, Run, Scenario, forest, read
from brrt.errors import RecordingError
from brrt.views.colours import GOAL, OBSTACLE, START
from brrt.views.rerun import layout, marker, pair
from brrt.views.rerun.sink import RerunSink
from brrt.views.viewer import control
from brrt.views.viewer import process as viewer_program
from brrt.views.viewer.control import Cursor
from tests.conftest import Result
from tests.support.browser import CHROMIUM, browser
from tests.support.pixels import Frame, frame, near, of_colour, opened

RECORDINGS = Path(__file__).parents[2] / "recordings"
GOLDEN = RECORDINGS / "circles2d-rrt.mcap"
SIZE = (1000, 700)
TREE = layout.tree_style(0)[1]


@cache
def _cannot_run() -> str | None:
    try:
        with control.headless((200, 200)):
            return None
    except RecordingError as error:
        return str(error)


@pytest.fixture
def viewer() -> None:
    """Skip where the viewer cannot run without a window."""
    reason = _cannot_run()
    if reason is not None:
        pytest.skip(reason)


def drawn(source: Path, folder: Path) -> Path:
    """Draw a recording into an .rrd file."""
    recording, path = read(source), folder / f"{source.stem}.rrd"
    sink = RerunSink(recording.manifest, recording.world, path=path)
    for batch in recording.batches():
        sink.write(batch)
    sink.close(recording.result)
    return path


def record(path: Path, **values: object) -> Path:
    """Make a recording."""
    run = Run(Scenario.parse({"world": "circles2d:n=20,seed=2", **values}))
    run.execute([McapSink(path, run.manifest, run.problem.world)])
    return path


# --- the picture against an independent one ---------------------------------------------------


def rasterised(events: Events, where: Frame, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """The edges of the start tree as the fold has them, as pixels."""
    tree = forest(events)[0]
    child = np.flatnonzero(tree.parent >= 0)
    part = np.linspace(0, 1, 400)[:, None, None]
    a, b = tree.q[tree.parent[child], :2], tree.q[child, :2]
    at = where.pixels((a + part * (b - a)).reshape(-1, 2))
    mask = np.zeros(shape, bool)
    mask[at[:, 0], at[:, 1]] = True
    return mask


def tree_pixels(picture: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels of the start tree: its blue, blended at the lines' borders."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    return np.asarray((blue - green > 40) & (blue - red > 60))


def rewired_pixels(picture: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels of edges that were rewired a moment ago; some have changed again since."""
    return of_colour(picture, layout.REWIRED["start"], 70)


def on_top(picture: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels that may hide a tree: paths in yellow and gold, the marks of start and goal."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    path = (red > 120) & (green > 90) & (red - blue > 60)
    return near(path | of_colour(picture, START, 40) | of_colour(picture, GOAL, 40), 2)


@pytest.mark.usefixtures("viewer")
@pytest.mark.parametrize("name", ["circles2d-rrt", "circles2d-rrt-star"])
def test_shows_the_forest_of_each_instant(name: str, tmp_path: Path) -> None:
    """Nearly all of each edge is in the picture, and nearly nothing else has the tree's colour."""
    source = RECORDINGS / f"{name}.mcap"
    recording, run = read(source), drawn(source, tmp_path)
    events = recording.events()
    last = int(events[Kind.EDGE]["seq"][-1])
    shown = []
    with control.headless(SIZE) as client:
        for seq in (last // 4, last // 2, 3 * last // 4):
            picture = opened(control.shoot(client, run, Cursor("event", seq), "World"))
            where = frame(picture, recording.world)
            edges = rasterised(events.until(seq=seq), where, picture.shape[:2])
            tree, hidden = tree_pixels(picture), on_top(picture)
            assert where.bottom - where.top > 0.7 * picture.shape[0]
            seen = edges & ~hidden
            assert seen.sum() > 0.6 * edges.sum()
            missing = seen & ~near(tree | rewired_pixels(picture), 2)
            stray = tree & ~near(edges, 3)
            shown.append((seen.sum(), missing.sum() / seen.sum(), stray.sum() / tree.sum()))
    sizes = [size for size, _, _ in shown]
    assert sizes[0] < sizes[1] < sizes[2]
    for _, missing_part, stray_part in shown:
        assert missing_part < 0.02
        assert stray_part < 0.01


@pytest.mark.usefixtures("viewer")
def test_another_instant_is_another_picture(tmp_path: Path) -> None:
    """The test above would notice a picture that stays behind."""
    recording, run = read(GOLDEN), drawn(GOLDEN, tmp_path)
    last = int(recording.events()[Kind.EDGE]["seq"][-1])
    with control.headless(SIZE) as client:
        picture = opened(control.shoot(client, run, Cursor("event", last // 2), "World"))
    where, tree = frame(picture, recording.world), tree_pixels(picture)
    late = rasterised(recording.events(), where, picture.shape[:2]) & ~on_top(picture)
    assert (late & ~near(tree, 2)).sum() > 0.1 * late.sum()


# --- pictures by the command ------------------------------------------------------------------


@pytest.mark.usefixtures("viewer")
def test_screenshot(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """The picture has its size, is of the instant, and the same the next time."""
    for number, options in enumerate((["--at-iteration", 90], ["--at-iteration", 90], [])):
        name = f"{number}.png"
        result = brrt("view", GOLDEN, "--screenshot", name, "--size", "900x600", *options)
        assert (result.code, result.out, result.err) == (0, f"{name}: written\n", "")
    pictures = [opened((tmp_path / f"{number}.png").read_bytes()) for number in range(3)]
    assert pictures[0].shape == (600, 900, 3)
    # Arrows, notices and legends of the viewer come and fade by the clock; the tree does not.
    assert (pictures[0] != pictures[1]).any(axis=2).mean() < 0.02
    trees = [of_colour(picture[40:, :500], TREE) for picture in pictures]
    assert (trees[0] == trees[1]).all()
    blue = [of_colour(picture, TREE).sum() for picture in pictures]
    assert blue[0] > 500 > blue[2]  # a recording opens at its beginning


@pytest.mark.usefixtures("viewer")  # elsewhere libraries may be missing too
def test_no_driver(brrt: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing can draw, one line says what to install."""
    for name in ("VK_ICD_FILENAMES", "VK_DRIVER_FILES"):
        monkeypatch.setenv(name, "/nowhere")
    result = brrt("view", GOLDEN, "--screenshot", "x.png")
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith("brrt: the Rerun viewer found no graphics driver")
    assert "mesa-vulkan-drivers" in result.err
    assert result.err.count("\n") == 1


# --- live, into a window that stays -------------------------------------------------------------


@contextmanager
def window(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let the viewer that is opened be one that nobody sees, and end it afterwards."""
    program, began = viewer_program.program(), folder / "began"
    assert program is not None
    hidden = folder / "hidden"
    hidden.write_text(
        f"#!/bin/sh\necho $$ >> {began}\necho noise\n"
        f'exec {program} --headless --window-size=1000x700 "$@"\n'
    )
    hidden.chmod(0o755)
    monkeypatch.setenv("DISPLAY", ":nowhere")
    monkeypatch.setattr(viewer_program, "PORT", viewer_program.free_port())
    monkeypatch.setattr(viewer_program, "program", lambda: str(hidden))
    try:
        yield
    finally:
        for number in began.read_text().split() if began.exists() else ():
            os.kill(int(number), signal.SIGTERM)


@pytest.mark.usefixtures("viewer")
def test_runs_share_a_window(
    brrt: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A world, a run in 2D and one in 3D in one window, each with its own layout.

    The window listens on this machine alone, and says nothing in our place.
    """
    psutil = pytest.importorskip("psutil")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with window(tmp_path, monkeypatch):
        for args in (
            ["worlds", "show", "circles2d:n=20,seed=2", "--view"],
            ["plan", "--world", "circles2d:n=20,seed=2", "--no-record", "--view", "--json"],
            ["plan", "--world", "boxes3d:n=60", "--no-record", "--view", "--json"],
        ):
            result = brrt(*args)
            assert (result.code, "noise" in result.out + result.err) == (0, False), result.err
        (number,) = (tmp_path / "began").read_text().split()
        assert set(ports_of(psutil.Process(int(number))).values()) == {"127.0.0.1"}
        client = ViewerClient.connect(viewer_program.address())
        names = {each.store_id.split(":")[1] for each in client.get_state().recordings}
        assert names == {"brrt 2d world 100 x 100", "brrt 2d 100 x 100", "brrt 3d 100 x 100 x 100"}


# --- two runs -----------------------------------------------------------------------------------


def sides(*paths: Path) -> list[pair.Side]:
    """Recordings to put side by side."""
    found = []
    for path in paths:
        recording = read(path)
        found.append(pair.Side(path.name, recording.manifest, recording.world, recording.events()))
    return found


def entities(path: Path) -> set[str]:
    """All entities of a file."""
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def test_two_runs_below_entities_of_their_own(tmp_path: Path) -> None:
    """Everything that one run alone has is there for both, on the same timelines."""
    paths = [record(tmp_path / f"{seed}.mcap", seed=seed) for seed in (1, 2)]
    difference = pair.draw_pair(tmp_path / "pair.rrd", *sides(*paths))
    assert difference is not None
    found = entities(tmp_path / "pair.rrd")
    for letter, path in zip("AB", paths, strict=True):
        alone = {name for name in entities(drawn(path, tmp_path)) if name.startswith("/world")}
        mine = {name.removeprefix(f"/{letter}") for name in found if name.startswith(f"/{letter}/")}
        assert {n for n in mine if "/mark" not in n and n.startswith("/world")} == alone
        assert {"/world/mark", "/world/mark/label", "/run", "/log"} <= mine
    rest = {name for name in found if not name.startswith(("/A", "/B", "/__properties"))}
    assert rest == {"/difference"}
    for chunk in RrdReader(tmp_path / "pair.rrd").stream():
        if chunk.entity_path == "/difference":
            batch = chunk.to_record_batch()
            assert batch.column("event").to_pylist() == [difference.seq]
            assert batch.column("TextLog:text").to_pylist() == [[f"the runs part at {difference}"]]


def test_equal_runs_have_no_mark(tmp_path: Path) -> None:
    """Where nothing differs, nothing is marked."""
    paths = [record(tmp_path / f"{name}.mcap", seed=3) for name in "ab"]
    assert pair.draw_pair(tmp_path / "pair.rrd", *sides(*paths)) is None
    assert not any(
        "/mark" in name or "difference" in name for name in entities(tmp_path / "pair.rrd")
    )


@pytest.mark.parametrize("other", ["squares2d-a-star", "boxes3d-lrta-star", "circles2d-chain"])
def test_any_two_runs(other: str, tmp_path: Path) -> None:
    """Other planners, worlds, dimensions and robots stand side by side too."""
    paths = [GOLDEN, RECORDINGS / f"{other}.mcap"]
    for each in (paths, paths[::-1]):
        assert pair.draw_pair(tmp_path / "pair.rrd", *sides(*each)) is not None


def test_every_kind_of_event_has_a_place(tmp_path: Path) -> None:
    """Whichever event is the first to differ, its place is one of the run."""
    names = ["circles2d-rrt-star", "squares2d-bi-rrt-coin", "boxes3d-lrta-star"]
    met = set()
    for side in sides(*(RECORDINGS / f"{name}.mcap" for name in names)):
        dof = side.manifest.dof
        for kind, table in side.events.tables.items():
            met.add(kind)
            for row in table[[0, len(table) // 2, -1]]:
                place = marker.place_of(side.events, side.manifest, int(row["seq"]))
                assert place.shape == (dof,)
                if "q" in (table.dtype.names or ()):
                    assert (place == row["q"]).all()
    assert {Kind.REWIRE, Kind.CONNECT, Kind.PATH, Kind.SHORTCUT, Kind.HEURISTIC} <= met


def assert_ringed(picture: NDArray[np.int64], where: Frame, q: Any) -> None:
    """A ring stands around a place."""
    at = np.argwhere(of_colour(picture, marker.MARK))
    row, column = where.pixels(np.asarray(q)[None])[0]
    reach = 0.02 * (where.right - where.left)
    far = np.hypot(at[:, 0] - row, at[:, 1] - column)
    on_ring = np.abs(far - reach) < 3
    assert on_ring.sum() > 2 * np.pi * reach  # all around; the rest is the label below it
    assert (at[~on_ring][:, 0] > row + reach).all()


@pytest.mark.usefixtures("viewer")
@pytest.mark.parametrize("ending", ["mcap", "rrd"])
def test_an_event_is_ringed(brrt: Callable[..., Result], tmp_path: Path, ending: str) -> None:
    """Who is sent to an event finds it, in a file that is drawn and in one that is there."""
    recording, run = read(GOLDEN), GOLDEN if ending == "mcap" else drawn(GOLDEN, tmp_path)
    edge = recording.events()[Kind.EDGE][40]
    at = ("--at-event", int(edge["seq"]))
    result = brrt("view", run, "--screenshot", "x.png", "--size", "1400x900", *at)
    assert result.code == 0, result.err
    picture = opened((tmp_path / "x.png").read_bytes())[:, :950]
    assert_ringed(picture, frame(picture, recording.world), edge["q"])


@pytest.mark.usefixtures("viewer")
def test_two_runs_show_where_they_part(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """In each of two views a ring stands around the sample that is the first to differ."""
    paths = [record(tmp_path / f"{seed}.mcap", seed=seed) for seed in (1, 2)]
    result = brrt("view", *paths, "--screenshot", "x.png", "--size", "1400x900")
    assert result.code == 0, result.err
    assert f"{paths[0]} and {paths[1]} part at event 2 (sample): q (" in result.out
    picture = opened((tmp_path / "x.png").read_bytes())
    for number, path in enumerate(paths):
        half = picture[:, 700 * number :][:, :700]
        sample = read(path).events()[Kind.SAMPLE][0]
        assert sample["seq"] == 2
        assert_ringed(half, frame(half[:620], read(path).world), sample["q"])


# --- the browser --------------------------------------------------------------------------------


@contextmanager
def served(folder: Path, *args: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run `brrt view ... --web` until the body ends; hand over the process and its address."""
    command = [sys.executable, "-m", "brrt_cli", "view", *map(str, args), "--web"]
    with subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(folder)},
    ) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert " at http://127.0.0.1:" in line
            yield process, line.split(" at ")[1].strip()
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()
                raise


def ports_of(process: Any) -> dict[int, str]:
    """Where a process listens: ports, and the address of each."""
    found = process.net_connections()
    return {each.laddr.port: each.laddr.ip for each in found if each.status == "LISTEN"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_web_is_for_this_machine_and_ends_in_order(number: int, tmp_path: Path) -> None:
    """It listens on 127.0.0.1 alone; a signal ends it with its child and its file."""
    psutil = pytest.importorskip("psutil")
    with served(tmp_path, GOLDEN) as (process, address):
        (child,) = psutil.Process(process.pid).children(recursive=True)
        ports = ports_of(child)
        assert set(ports.values()) == {"127.0.0.1"}
        url = urlparse(address)
        source = urlparse(parse_qs(url.query)["url"][0])
        assert ports.keys() == {url.port, source.port}
        assert list(tmp_path.glob("brrt-*"))
        process.send_signal(number)
        assert process.wait(20) == 128 + number
    assert not child.is_running()
    assert not list(tmp_path.glob("brrt-*"))


def test_web_ports(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """A port that is taken is an error if the user chose it; otherwise another one is taken."""
    with served(tmp_path, GOLDEN) as (_, first):
        taken = urlparse(first).port
        result = brrt("view", GOLDEN, "--web", "--port", taken)
        assert (result.code, result.out) == (2, "")
        assert result.err.startswith(f"brrt: port {taken} is taken; choose another one")
        free = viewer_program.free_port()
        with served(tmp_path, GOLDEN, "--port", free) as (_, second):
            assert urlparse(second).port == free
        with served(tmp_path, GOLDEN) as (_, third):
            assert urlparse(third).port != taken


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_browser_shows_the_run(tmp_path: Path) -> None:
    """The page shows obstacles, start, goal and the tree where they are in the world."""
    recording = read(GOLDEN)
    # The web viewer opens a recording where it says: at its end, if it follows what comes.
    run = tmp_path / "run.rrd"
    sink = RerunSink(recording.manifest, recording.world, path=run)
    for batch in recording.batches():
        sink.write(batch)
    sink._rec.send_blueprint(layout.blueprint(recording.manifest, recording.world, live=True))
    sink.close(recording.result)
    end, last, png = time.monotonic() + 150, b"", b""
    with (
        served(tmp_path, run) as (_, address),
        browser(tmp_path / "browser", SIZE, 200) as page,
    ):
        page.visit(address)
        while time.monotonic() < end:
            time.sleep(1)
            last, png = png, page.picture()
            if png and png == last and tree_pixels(opened(png)).sum() > 1000:
                break
    picture = opened(png)
    where = frame(picture, recording.world)
    world = recording.world
    inside = np.array([ball[:2] for ball in world.balls if ball[2] > 3])
    rows, columns = where.pixels(inside).T
    assert len(rows) > 10
    dark = of_colour(picture, OBSTACLE, 6)[rows, columns]
    assert dark.mean() > 0.5  # trees and paths cover some
    for q, colour in ((recording.manifest.start, START), (recording.manifest.goal, GOAL)):
        row, column = where.pixels(np.array([q]))[0]
        assert (
            of_colour(picture, colour, 30)[row - 4 : row + 5, column - 4 : column + 5].mean() > 0.7
        )
    edges = rasterised(recording.events(), where, picture.shape[:2]) & ~on_top(picture)
    assert (edges & near(tree_pixels(picture), 2)).sum() > 0.95 * edges.sum()


# --- bad input ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["none.mcap"], "none.mcap: No such file or directory"),
        (["text.mcap"], "text.mcap: not a recording"),
        (["cut.rrd", "--screenshot", "x.png"], "cut.rrd: the file is cut at byte"),
        (["cut.mcap", "--screenshot", "x.png"], "take the problem with --partial"),
        (["a", "b", "c"], "one run, or two side by side, not 3"),
        (["run.mcap", "--screenshot", "no/x.png"], "there is no folder no"),
        (["run.mcap", "--screenshot", "x.jpg"], "must end in .png"),
        (["run.mcap", "--screenshot", "old.png"], "exists already"),
        (["run.mcap", "--web", "--screenshot", "x.png"], "give one of --web and --screenshot"),
        (["run.mcap", "--web", "--at", "1ms"], "the web viewer opens at the start"),
        (["run.mcap", "--port", "9999"], "add --web"),
        (["run.mcap", "--web", "--port", "70000"], "65535"),
        (["run.mcap", "--size", "9x9"], "add --screenshot"),
        (["run.mcap", "--screenshot", "x.png", "--size", "9x9"], "200 to 8192 pixels"),
        (["run.mcap", "--screenshot", "x.png", "--size", "big"], "WIDTHxHEIGHT, as 1600x1000"),
        (["run.mcap", "--screenshot", "x.png", "--at", "soon"], "--at must be a time"),
        (["run.mcap", "--at", "1s", "--at-event", "3"], "give one of --at, --at-event"),
        (["run.mcap", "--at-event", "-1"], "count from 0"),
        (["run.mcap", "--screenshot", "x.png", "--at-event", "99999"], "ends with event 367"),
        (["run.mcap", "--screenshot", "x.png", "--at", "1h"], "--at must be a time"),
        (["run.mcap", "--screenshot", "x.png", "--at", "9s"], "ends at 0.000367 s"),
        ([], "Missing argument"),
    ],
)
def test_bad_input(
    args: list[str],
    message: str,
    brrt: Callable[..., Result],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One line, exit code 2, and nothing is written."""
    (tmp_path / "run.mcap").write_bytes(GOLDEN.read_bytes())
    (tmp_path / "text.mcap").write_text("no recording")
    (tmp_path / "old.png").write_bytes(b"old")
    (tmp_path / "cut.mcap").write_bytes(GOLDEN.read_bytes()[:12_000])
    (tmp_path / "cut.rrd").write_bytes(drawn(GOLDEN, tmp_path).read_bytes()[:9000])
    before = set(tmp_path.iterdir())
    monkeypatch.setenv("DISPLAY", ":nowhere")  # nothing gets as far as opening a window
    result = brrt("view", *args)
    assert (result.code, result.out) == (2, "")
    assert message in result.err
    assert result.err.count("\n") == 1
    assert set(tmp_path.iterdir()) == before


def test_no_display(brrt: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a display, one line names the other ways."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    result = brrt("view", GOLDEN)
    assert (result.code, result.out) == (2, "")
    assert result.err.count("\n") == 1
    assert "--web" in result.err
    assert "--screenshot" in result.err


@pytest.mark.usefixtures("viewer")
def test_partial(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """What is whole of a file that was cut can be put beside another run."""
    long = record(tmp_path / "long.mcap", planner="rrt-star", iterations=10_000).read_bytes()
    cut = tmp_path / "cut.mcap"
    for length in (12_000, len(long) // 2):  # within the first chunk; some are whole
        cut.write_bytes(long[:length])
        for other in ([], [GOLDEN]):
            result = brrt("view", cut, *other, "--partial", "--screenshot", "x.png", "--force")
            assert result.code == 0, result.err
            assert ("; no event is whole" in result.err) == (length == 12_000)
