"""Pictures of runs show the trees, cells, paths and bodies of the log at the instant."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib import colormaps

from brrt import Kind, forest
from brrt.views.matplotlib import style
from brrt.worlds.free_space import occupied
from tests.support.figures import (
    Command,
    along,
    along_hull,
    along_path,
    edges_of,
    golden,
    last_event,
    newest_paths,
    picture_of,
)
from tests.support.pixels import opened
from tests.support.recordings import RECORDINGS


@pytest.mark.parametrize("name", ["circles2d-rrt", "circles2d-rrt-star", "squares2d-bi-rrt-coin"])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_the_picture_is_the_forest_at_that_instant(name: str, share: float, brrt: Command) -> None:
    """Each edge is drawn in its tree's colour, and nothing else has that colour."""
    manifest, log = golden(name).manifest, golden(name).events()
    seq = int(share * last_event(log))
    picture, part = picture_of(brrt, name, "--at-event", seq), log.until(seq=seq)
    ends = np.array([manifest.start, manifest.goal])
    over = picture.around(np.concatenate([newest_paths(part), ends]), 7)
    for number, colour in {0: picture.blue, 1: picture.red}.items():
        if number not in forest(part):
            assert not (colour & picture.inside() & ~over).any()
            continue
        points = along(edges_of(part, number))
        bare = ~over[tuple(picture.frame.pixels(points).T)]
        assert picture.near(colour, points[bare]).mean() > 0.97
        stray = colour & picture.inside() & ~over & ~picture.around(points, 3)
        assert stray.sum() <= 0.01 * colour.sum()


def test_a_tree_that_rewires_is_drawn_as_it_was_then(brrt: Command) -> None:
    """Edges that were rewired later are drawn before, and not afterwards."""
    log = golden("circles2d-rrt-star").events()
    last = last_event(log)
    early = int(0.4 * last)
    before, after = edges_of(log.until(seq=early), 0), edges_of(log, 0)
    staying = {tuple(edge.ravel()) for edge in after}
    gone = along(np.array([edge for edge in before if tuple(edge.ravel()) not in staying]))
    first, then = (
        picture_of(brrt, "circles2d-rrt-star", "--at-event", seq) for seq in (early, last)
    )
    others = then.around(np.concatenate([along(after), newest_paths(log)]), 3)
    alone = gone[~others[tuple(then.frame.pixels(gone).T)]]
    assert len(alone) > 100
    assert first.near(first.blue, alone).mean() > 0.95
    assert then.near(then.blue, alone).mean() < 0.05


def test_paths_are_drawn_in_gold(brrt: Command) -> None:
    """The planner's path and the smoothed one are drawn; before them there is none."""
    picture = picture_of(brrt, "circles2d-rrt")
    for row in golden("circles2d-rrt").events()[Kind.PATH]:
        points = along_path(np.asarray(row["waypoints"]))
        assert picture.near(picture.gold, points).mean() > 0.9
    early = picture_of(brrt, "circles2d-rrt", "--at-iteration", 60)
    assert (early.gold & early.inside()).sum() < 0.1 * (picture.gold & picture.inside()).sum()


@pytest.mark.parametrize("name", ["circles2d-rrt", "squares2d-a-star", "polygons2d-polygon"])
def test_obstacles_are_dark(name: str, brrt: Command) -> None:
    """Before the first edge, a pixel is dark if and only if an obstacle covers its centre."""
    picture, world = picture_of(brrt, name, "--at-event", 0), golden(name).world
    rows, columns = np.nonzero(picture.inside())
    where = picture.frame
    part = np.stack(
        [
            (columns - where.left) / (where.right - where.left),
            (where.bottom - rows) / (where.bottom - where.top),
        ],
        axis=1,
    )
    hit = occupied(world, world.lower + part * (world.upper - world.lower))
    dark = (picture.colours[rows, columns] < 100).all(axis=1)
    assert abs(dark.mean() - hit.mean()) < 0.01
    assert (dark == hit).mean() > 0.98


def test_rejected_extensions_are_drawn_on_request(brrt: Command) -> None:
    """Without --rejects there are none."""
    without, shown = (
        picture_of(brrt, "circles2d-rrt", "--rejects", count).colours for count in (0, 12)
    )
    assert (without != shown).any()


@pytest.mark.parametrize("name", ["polygons2d-polygon", "circles2d-chain"])
def test_bodies_stand_at_both_ends_and_along_the_path(name: str, brrt: Command) -> None:
    """The outline at the start is orange, at the goal green, along the path golden."""
    recording = golden(name)
    robot = recording.robot()
    before, after = picture_of(brrt, name, "--at-event", 0), picture_of(brrt, name)
    reds = (before.colours[..., 0] - before.colours[..., 2]) > 40
    greens = (before.colours[..., 1] - before.colours[..., 0]) > 40
    for q, colour in ((recording.manifest.start, reds), (recording.manifest.goal, greens)):
        for part in robot.outline(np.array(q)):
            assert before.near(colour, along_hull(part)).mean() > 0.9
    path = np.asarray(recording.events()[Kind.PATH][-1]["waypoints"])
    for q in robot.along(path, 10):
        for part in robot.outline(q):
            assert after.near(after.gold, along_hull(part), 2).mean() > 0.5


def test_cells_are_coloured_by_their_value(brrt: Command) -> None:
    """The centre of a visible cell has the colour of its cost on the scale."""
    log = golden("squares2d-a-star").events()
    picture = picture_of(brrt, "squares2d-a-star", "--at-iteration", 150)
    rows = log.until(iteration=150)[Kind.EXPAND]
    at = tuple(picture.frame.pixels(rows["q"]).T)
    expected = 255 * colormaps[style.HEAT](rows["cost"] / rows["cost"].max())[:, :3]
    seen = picture.inside()[at]
    assert seen.mean() > 0.8  # cells reach beyond the bounds
    assert (np.abs(picture.colours[at] - expected)[seen].max(axis=1) < 12).mean() > 0.9


@pytest.mark.parametrize("name", ["boxes3d-bi-rrt-star", "spheres3d-unsolved"])
def test_a_picture_in_3d_shows_trees_and_ends(name: str, brrt: Command) -> None:
    """Trees, start and goal have their colours; another camera gives another picture."""
    shots = []
    for azimuth in (-62, 10):
        done = brrt("plot", RECORDINGS / f"{name}.mcap", "--what", "tree", "--out", "x.png",
                    "--force", "--dpi", 120, "--azimuth", azimuth)  # fmt: skip
        assert done.code == 0, done.err
        shots.append(opened(Path("x.png").read_bytes()))
    colours = shots[0].reshape(-1, 3)
    red, green, blue = colours.T
    assert (blue - red > 60).sum() > 200
    goal_tree = (red - green > 100) & (abs(green - blue) < 25)
    assert (goal_tree.sum() > 200) == (name == "boxes3d-bi-rrt-star")
    for wanted in (style.START, style.GOAL):
        assert (np.abs(colours - 255 * np.array(wanted)) < 12).all(axis=1).sum() > 20
    assert shots[0].shape != shots[1].shape or (shots[0] != shots[1]).any()
