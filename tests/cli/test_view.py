"""`brrt view`: pictures by the command, its messages, and one line for bad input."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brrt import Kind, read
from brrt.views.colours import RING, tree_style
from brrt.views.rerun.sink import RerunSink
from tests.conftest import Result
from tests.support.pixels import Frame, frame, of_colour, opened
from tests.support.recordings import GOLDEN, record

TREE = tree_style(0)[1]


def rerun_file(folder: Path) -> Path:
    """Write the golden recording to an .rrd file."""
    recording, path = read(GOLDEN), folder / f"{GOLDEN.stem}.rrd"
    sink = RerunSink(recording.manifest, recording.world, path=path)
    for batch in recording.batches():
        sink.write(batch)
    sink.close(recording.result)
    return path


@pytest.mark.slow
@pytest.mark.usefixtures("viewer")
def test_screenshot(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """The picture has the size, is of the instant, and is the same the next time."""
    for number, options in enumerate((["--at-iteration", 90], ["--at-iteration", 90], [])):
        name = f"{number}.png"
        result = brrt("view", GOLDEN, "--screenshot", name, "--size", "900x600", *options)
        assert (result.code, result.out, result.err) == (0, f"{name}: written\n", "")
    pictures = [opened((tmp_path / f"{number}.png").read_bytes()) for number in range(3)]
    assert pictures[0].shape == (600, 900, 3)
    # Arrows, notices and legends of the viewer fade with time; the tree does not.
    assert (pictures[0] != pictures[1]).any(axis=2).mean() < 0.02
    trees = [of_colour(picture[40:, :500], TREE) for picture in pictures]
    assert (trees[0] == trees[1]).all()
    blue = [of_colour(picture, TREE).sum() for picture in pictures]
    assert blue[0] > 500
    assert blue[2] > 500  # without an instant a recording opens at its end, not at its beginning


@pytest.mark.slow
@pytest.mark.usefixtures("viewer")  # elsewhere libraries may be missing too
def test_no_driver(brrt: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a driver, one line names what to install."""
    for name in ("VK_ICD_FILENAMES", "VK_DRIVER_FILES"):
        monkeypatch.setenv(name, "/nowhere")
    result = brrt("view", GOLDEN, "--screenshot", "x.png")
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith("brrt: the Rerun viewer found no graphics driver")
    assert "mesa-vulkan-drivers" in result.err
    assert result.err.count("\n") == 1


def assert_ringed(picture: NDArray[np.int64], where: Frame, q: Any) -> None:
    """Check that a ring is around a configuration."""
    at = np.argwhere(of_colour(picture, RING))
    row, column = where.pixels(np.asarray(q)[None])[0]
    reach = 0.02 * (where.right - where.left)
    far = np.hypot(at[:, 0] - row, at[:, 1] - column)
    on_ring = np.abs(far - reach) < 3
    assert on_ring.sum() > 2 * np.pi * reach  # all around; the rest is the label below it
    assert (at[~on_ring][:, 0] > row + reach).all()


@pytest.mark.slow
@pytest.mark.usefixtures("viewer")
@pytest.mark.parametrize("ending", ["mcap", "rrd"])
def test_an_event_is_ringed(brrt: Callable[..., Result], tmp_path: Path, ending: str) -> None:
    """The place of the event has a ring, for both formats."""
    recording, run = read(GOLDEN), GOLDEN if ending == "mcap" else rerun_file(tmp_path)
    edge = recording.events()[Kind.EDGE][40]
    at = ("--at-event", int(edge["seq"]))
    result = brrt("view", run, "--screenshot", "x.png", "--size", "1400x900", *at)
    assert result.code == 0, result.err
    picture = opened((tmp_path / "x.png").read_bytes())[:, :950]
    assert_ringed(picture, frame(picture, recording.world), edge["q"])


@pytest.mark.slow
@pytest.mark.usefixtures("viewer")
def test_two_runs_show_where_they_part(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """In each of two views the sample that is the first to differ has a ring."""
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


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["none.mcap"], "none.mcap: No such file or directory"),
        (["text.mcap"], "text.mcap: not a recording"),
        (["cut.rrd", "--screenshot", "x.png"], "cut.rrd: is cut; replay the .mcap of the run"),
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
    (tmp_path / "cut.rrd").write_bytes(rerun_file(tmp_path).read_bytes()[:9000])
    before = set(tmp_path.iterdir())
    monkeypatch.setenv("DISPLAY", ":nowhere")  # no window opens
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


@pytest.mark.slow
@pytest.mark.usefixtures("viewer")
def test_partial(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """The whole part of a cut file can be shown, also beside another run."""
    long = record(tmp_path / "long.mcap", planner="rrt-star", iterations=10_000).read_bytes()
    cut = tmp_path / "cut.mcap"
    for length in (12_000, len(long) // 2):  # within the first chunk; some are whole
        cut.write_bytes(long[:length])
        for other in ([], [GOLDEN]):
            result = brrt("view", cut, *other, "--screenshot", "x.png", "--force")
            assert result.code == 0, result.err
            assert ("; no event is whole" in result.err) == (length == 12_000)
