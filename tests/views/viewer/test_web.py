"""The viewer in the browser: its server is for this machine only, and its page shows the run."""

import signal
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from urllib.parse import parse_qs, urlparse

import numpy as np
import pytest

from brrt import read
from brrt.views.colours import GOAL, OBSTACLE, START
from brrt.views.rerun import layout
from brrt.views.rerun.drawing import draw_into
from brrt.views.rerun.stream import rrd_file
from brrt.views.viewer.process import free_port
from brrt.views.viewer.web import Server
from tests.conftest import Result
from tests.support.browser import CHROMIUM, browser
from tests.support.pixels import frame, near, of_colour, opened
from tests.support.recordings import GOLDEN
from tests.support.viewer import SIZE, on_top, rasterised, tree_pixels
from tests.support.web import ports_of, served

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_web_is_for_this_machine_and_ends_in_order(number: int, tmp_path: Path) -> None:
    """It listens on 127.0.0.1 only; a signal ends it with its child and its file."""
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
    """A taken port is an error if the user chose it; otherwise another port is used."""
    with served(tmp_path, GOLDEN) as (_, first):
        taken = urlparse(first).port
        result = brrt("view", GOLDEN, "--web", "--port", taken)
        assert (result.code, result.out) == (2, "")
        assert result.err.startswith(f"brrt: port {taken} is taken; choose another one")
        free = free_port()
        with served(tmp_path, GOLDEN, "--port", free) as (_, second):
            assert urlparse(second).port == free
        with served(tmp_path, GOLDEN) as (_, third):
            assert urlparse(third).port != taken


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_browser_shows_the_run(tmp_path: Path) -> None:
    """The page shows obstacles, start, goal and the tree where they are in the world."""
    recording = read(GOLDEN)
    # A layout for live runs opens at the end of the run.
    run, manifest = tmp_path / "run.rrd", recording.manifest
    live = layout.blueprint(manifest, recording.world, live=True)
    with rrd_file(run, "run", layout.application(manifest, recording.world), live) as rec:
        draw_into(rec, recording)
    end, last, png = time.monotonic() + 150, b"", b""
    with (
        closing(Server(run)) as server,
        browser(tmp_path / "browser", SIZE, 200) as page,
    ):
        page.visit(server.address)
        while time.monotonic() < end:
            time.sleep(1)
            last, png = png, page.picture()
            # The page's loading screen has the colour of the tree, but not that of the goal.
            if png and png == last and of_colour(opened(png), GOAL, 30).sum() > 20:
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
