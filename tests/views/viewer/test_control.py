"""The viewer, without a window, shows the run at each instant."""

from pathlib import Path

import pytest

from brrt import Kind, read
from brrt.views.rerun.drawing import draw_run
from brrt.views.viewer.control import Cursor, headless, shoot
from tests.support.pixels import frame, near, opened
from tests.support.recordings import GOLDEN, RECORDINGS
from tests.support.viewer import SIZE, on_top, rasterised, rewired_pixels, tree_pixels

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("viewer")]


@pytest.mark.parametrize("name", ["circles2d-rrt", "circles2d-rrt-star"])
def test_shows_the_forest_of_each_instant(name: str, tmp_path: Path) -> None:
    """Nearly all of each edge is in the picture, and hardly anything else has its colour."""
    recording, run = read(RECORDINGS / f"{name}.mcap"), tmp_path / "run.rrd"
    draw_run(run, recording)
    events = recording.events()
    last = int(events[Kind.EDGE]["seq"][-1])
    shown = []
    with headless(SIZE) as client:
        for seq in (last // 4, last // 2, 3 * last // 4):
            picture = opened(shoot(client, run, Cursor("event", seq), "World"))
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


def test_another_instant_is_another_picture(tmp_path: Path) -> None:
    """The test above notices a picture of another instant."""
    recording, run = read(GOLDEN), tmp_path / "run.rrd"
    draw_run(run, recording)
    last = int(recording.events()[Kind.EDGE]["seq"][-1])
    with headless(SIZE) as client:
        picture = opened(shoot(client, run, Cursor("event", last // 2), "World"))
    where, tree = frame(picture, recording.world), tree_pixels(picture)
    late = rasterised(recording.events(), where, picture.shape[:2]) & ~on_top(picture)
    assert (late & ~near(tree, 2)).sum() > 0.1 * late.sum()
