"""Animations end with the picture of the whole run, and frames go from its first event on."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image

from brrt.views.matplotlib import style
from brrt.views.matplotlib.animation import frame_times, save_animation
from brrt.views.matplotlib.figure import FigureOptions
from brrt.views.matplotlib.playback import Playback
from tests.support.figures import Picture, along, edges_of, golden


def film(
    path: Path, name: str, dpi: int, seconds: float, fps: float = 10
) -> tuple[list[NDArray[np.int64]], list[float]]:
    """Animate a golden run; return the frames, and the duration of each in ms."""
    options = FigureOptions(dpi=dpi)
    save_animation(golden(name), path, options, seconds=seconds, fps=fps)
    frames, times = [], []
    with Image.open(path) as images:
        for number in range(getattr(images, "n_frames", 1)):
            images.seek(number)
            frames.append(np.asarray(images.convert("RGB")).astype(np.int64))
            times.append(float(images.info["duration"]))
    return frames, times


def test_the_tree_grows(tmp_path: Path) -> None:
    """It grows frame by frame up to the last one, which lasts longer; the file is reproducible."""
    frames, times = film(tmp_path / "0.gif", "circles2d-rrt", 90, 2, 15)
    done: list[tuple[int, int]] = []
    save_animation(
        golden("circles2d-rrt"), tmp_path / "1.gif", FigureOptions(dpi=90), seconds=2, fps=15,
        progress=lambda *counts: done.append(counts),
    )  # fmt: skip
    assert (tmp_path / "0.gif").read_bytes() == (tmp_path / "1.gif").read_bytes()
    assert done == [(number, 30) for number in range(1, 31)]
    assert 20 <= len(frames) <= 30  # equal frames side by side become one
    assert sum(times) == pytest.approx(3500, abs=10)
    assert times[-1] >= 1500
    blues = []
    for frame in frames:
        picture = Picture.of(frame, golden("circles2d-rrt").world)
        blues.append(int((picture.blue & picture.inside()).sum()))
    assert blues[0] == 0
    growing = blues[: 5 * len(blues) // 6]  # afterwards paths cover some of the tree
    assert all(b >= 0.97 * a for a, b in pairwise(growing))
    assert growing[-1] > 4 * max(growing[len(growing) // 3], 1)
    points = along(edges_of(golden("circles2d-rrt").events(), 0))
    assert picture.near(picture.blue | picture.gold, points, 2).mean() > 0.9


@pytest.mark.parametrize("name", ["boxes3d-lrta-star", "boxes3d-bi-rrt-star", "circles2d-chain"])
def test_the_last_frame_is_the_picture(name: str, tmp_path: Path) -> None:
    """Drawn frame by frame, the run ends as it is drawn at once."""
    whole = film(tmp_path / "x.gif", name, 60, 0.5)[0]
    assert all((a != b).any() for a, b in pairwise(whole))
    assert np.array_equal(whole[-1], film(tmp_path / "y.gif", name, 60, 0.1)[0][-1])


@pytest.mark.parametrize("name", ["squares2d-bi-rrt-coin", "boxes3d-lrta-star"])
def test_every_frame_has_the_legend(name: str, tmp_path: Path) -> None:
    """The first frame already names what comes later, in its colour."""
    frames = np.array(film(tmp_path / "x.gif", name, 100, 0.5)[0])
    below = frames[:, -30:]
    assert (below == below[0]).all()
    trees = [style.tree_style(number)[1] for number in (0, 1)] if "rrt" in name else [style.ROBOT]
    for colour in (*trees, style.START, style.GOAL, style.SMOOTHED):
        far = np.abs(below[0] - 255 * np.array(colour)).max(axis=-1)
        assert (far < 12).sum() >= 8, colour
    if "lrta" in name:
        heat = 255 * colormaps[style.HEAT](np.linspace(0, 1, 9))[:, None, :3]
        scale = frames[0, -90:-30].reshape(-1, 3)
        faint = 255 - (255 - heat) * 0.75
        assert (np.abs(scale - faint).max(axis=-1).min(axis=1) < 12).all()


@given(seconds=st.floats(0.5, 20), fps=st.floats(1, 60))
def test_frames_go_from_the_first_event_to_the_last(seconds: float, fps: float) -> None:
    """Their order is that of the log, the first events come slowly, and durations add up."""
    playback = Playback(golden("circles2d-rrt"))
    seqs, durations = frame_times(playback, seconds, fps)
    assert len(seqs) == len(durations)
    assert (seqs[0], seqs[-1]) == (0, playback.last)
    assert (np.diff(seqs) >= 0).all()
    assert sum(durations) == pytest.approx(seconds + 1.5)
    assert len(seqs) < 8 or seqs[len(seqs) // 4] <= playback.last / 6


def test_a_large_gif_loses_frames(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its duration and its last frame stay."""
    made = []
    for most in (90_000, 60_000):
        monkeypatch.setattr("brrt.views.matplotlib.animation._MOST_BYTES", most)
        made.append(film(tmp_path / f"{most}.gif", "circles2d-rrt", 60, 4, 15))
    (large, large_times), (small, small_times) = made
    assert (tmp_path / "60000.gif").stat().st_size <= 60_000
    assert len(small) < len(large)
    assert sum(small_times) == sum(large_times)
    assert np.array_equal(small[-1], large[-1])
