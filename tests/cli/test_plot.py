"""`brrt plot`: its files, and one line for bad input."""

import shutil
import sys
from pathlib import Path

import pytest

from tests.support.figures import Command
from tests.support.pixels import opened
from tests.support.recordings import GOLDEN, RECORDINGS


def test_the_default_has_the_cost_where_the_planner_improves(brrt: Command) -> None:
    """Such a figure is as wide as a page, another as wide as a column."""
    for name, width in (("circles2d-rrt", 3.3), ("circles2d-rrt-star", 6.9)):
        run = RECORDINGS / f"{name}.mcap"
        assert brrt("plot", run, "--out", f"{name}.png", "--dpi", 50).code == 0
        assert opened(Path(f"{name}.png").read_bytes()).shape[1] == int(50 * width)


def test_both_formats_give_the_same_figure(brrt: Command) -> None:
    """MCAP and Rerun files do."""
    source = RECORDINGS / "squares2d-bi-rrt-coin.mcap"
    assert brrt("replay", source, "--rrd", "r.rrd").code == 0
    for number, run in enumerate((source, "r.rrd")):
        assert brrt("plot", run, "--out", f"{number}.png", "--dpi", 60).code == 0
    assert Path("0.png").read_bytes() == Path("1.png").read_bytes()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not on the PATH")
def test_mp4(brrt: Command) -> None:
    """It is a film, the same every time."""
    for name in ("a.mp4", "b.mp4"):
        assert brrt("plot", GOLDEN, "--out", name, "--seconds", 0.5, "--dpi", 60).code == 0
    assert Path("a.mp4").read_bytes() == Path("b.mp4").read_bytes()
    assert Path("a.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize("body", [None, "echo no such codec >&2; exit 3", "cat >/dev/null; exit 4"])
def test_ffmpeg_that_is_missing_or_fails(
    body: str | None, brrt: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """One line says so and what to do, and no file is left."""
    folder = tmp_path / "bin"
    folder.mkdir()
    if body is not None:
        (folder / "ffmpeg").write_text(f"#!/bin/sh\nPATH=/bin:/usr/bin\n{body}\n")
        (folder / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    done = brrt("plot", GOLDEN, "--out", "x.mp4", "--seconds", 0.5)
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "write a .gif" in done.err
    assert body is None or ("no such codec" in done.err or "exit code 4" in done.err)
    assert [path.name for path in tmp_path.iterdir()] == ["bin"]


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--out", "x.jpg"], "the name must end in .png or .svg or .pdf or .gif or .mp4"),
        (["--out", "no/x.png"], "there is no folder no"),
        (["--out", "x.png", "--what", "tre"], "did you mean 'tree'?"),
        (["--out", "x.png", "--against", "nodes"], "must be time or iterations"),
        (["--out", "x.png", "--at", "5", "--at-event", "3"], "give one of"),
        (["--out", "x.png", "--at", "soon"], "--at must be a time"),
        (["--out", "x.png", "--width", "0"], "--width"),
        (["--out", "x.png", "--what", "time", "--at-event", "0"], "there are no iterations"),
        (["--out", "x.png", "--what", "cost", "--at-event", "9"], "no path was found"),
        (["--out", "x.gif", "--what", "cost"], "shows the tree of one run"),
        (["--out", "x.gif", "--width", "30"], "pixels are too many"),
    ],
)
def test_bad_input_is_one_line(args: list[str], message: str, brrt: Command) -> None:
    """It names what is wrong, and no file is left."""
    done = brrt("plot", GOLDEN, *args)
    assert (done.code, done.out) == (2, "")
    assert done.err.count("\n") == 1, done.err
    assert message in done.err
    assert not list(Path().iterdir())


def test_several_runs_share_their_costs_only(brrt: Command) -> None:
    """Their trees do not share a figure; existing files stay without --force."""
    runs = [GOLDEN, RECORDINGS / "circles2d-rrt-star.mcap"]
    done = brrt("plot", *runs, "--what", "tree", "--out", "x.png")
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert brrt("plot", *runs, "--out", "x.svg").code == 0
    assert "exists already" in brrt("plot", *runs, "--out", "x.svg").err


def test_a_cut_recording_is_drawn_as_far_as_it_is_whole(brrt: Command) -> None:
    """One line on stderr reports the cut."""
    data = (RECORDINGS / "circles2d-chain.mcap").read_bytes()
    Path("cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    done = brrt("plot", "cut.mcap", "--out", "x.png", "--dpi", 50)
    assert (done.code, done.err.count("\n")) == (0, 1)
    assert "the end of the run is missing" in done.err
    assert Path("x.png").exists()


def test_without_matplotlib(brrt: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line names what to install."""
    for name in [n for n in sys.modules if n.partition(".")[0] == "matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    done = brrt("plot", GOLDEN, "--out", "x.png")
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "pip install 'brrt[plot]'" in done.err
