"""`brrt plot`: pictures show what the log says, curves are its figures, and files are the same."""

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import colormaps
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

import brrt
from brrt import BrrtError, Events, Kind, Metrics, Recording, forest, metrics, plot, read
from brrt.events import Stage, table_dtype
from brrt.views.matplotlib import curves, style
from brrt.views.matplotlib.animation import Pace, instants, save_animation
from brrt.views.matplotlib.figure import Look, save_plot
from brrt.views.matplotlib.history import History, Record
from brrt.worlds.free_space import occupied
from tests.conftest import Result

Command = Callable[..., Result]
Floats = NDArray[np.float64]
GOLDEN = Path(__file__).parents[2] / "recordings"


@cache
def golden(name: str) -> Recording:
    """Read a golden recording."""
    return read(GOLDEN / f"{name}.mcap")


@cache
def record(name: str, seq: int | None = None) -> Record:
    """Return a golden run, up to an event."""
    saved = golden(name)
    return Record(name, saved.manifest, saved.world, saved.events().until(seq=seq))


def last_event(events: Events) -> int:
    """Return the number of the last event."""
    return max(int(table["seq"][-1]) for table in events.tables.values())


@dataclass(frozen=True)
class Picture:
    """A picture of a 2D world, and where the world is in it.

    `colours` has shape (height, width, 3); `frame` is the left, right, top and bottom border.
    """

    colours: NDArray[np.int64]
    frame: tuple[int, int, int, int]
    lower: Floats
    upper: Floats

    @classmethod
    def load(cls, data: NDArray[np.int64] | Path, lower: Floats, upper: Floats) -> "Picture":
        """Find the frame of the axes by its colour: no other lines are so long."""
        colours = pixels_of(data) if isinstance(data, Path) else data
        outline = (np.abs(colours - [96, 103, 118]) < 60).all(axis=2)
        columns = np.flatnonzero(outline.mean(axis=0) > 0.5)
        rows = np.flatnonzero(outline.mean(axis=1) > 0.5)
        return cls(colours, (columns[0], columns[-1], rows[0], rows[-1]), lower, upper)

    def pixels(self, points: Floats) -> NDArray[np.int64]:
        """Return the row and column of each point, shape (n, 2)."""
        left, right, top, bottom = self.frame
        part = (points - self.lower) / (self.upper - self.lower)
        at = np.stack([bottom - part[:, 1] * (bottom - top), left + part[:, 0] * (right - left)], 1)
        return at.round().astype(np.int64)

    def near(self, mask: NDArray[np.bool_], points: Floats, reach: int = 1) -> NDArray[np.bool_]:
        """Whether there is a pixel of a mask within reach of each point."""
        return np.asarray(grown(mask, reach)[tuple(self.pixels(points).T)])

    def drawn(self, points: Floats, reach: int) -> NDArray[np.bool_]:
        """Return the pixels within reach of any of the points."""
        mask = np.zeros(self.colours.shape[:2], np.bool_)
        mask[tuple(self.pixels(points).T)] = True
        return grown(mask, reach)

    def inside(self) -> NDArray[np.bool_]:
        """Return the pixels well within the frame."""
        left, right, top, bottom = self.frame
        mask = np.zeros(self.colours.shape[:2], np.bool_)
        mask[top + 4 : bottom - 3, left + 4 : right - 3] = True
        return mask

    @property
    def blue(self) -> NDArray[np.bool_]:
        """Where the start's tree is, its rewired edges among it."""
        red, green, blue = np.moveaxis(self.colours, 2, 0)
        return np.asarray((blue - red > 25) & (blue > green))

    @property
    def red(self) -> NDArray[np.bool_]:
        """Where the goal's tree is."""
        red, green, blue = np.moveaxis(self.colours, 2, 0)
        return np.asarray((red - green > 40) & (green - blue < 25))

    @property
    def gold(self) -> NDArray[np.bool_]:
        """Where paths are, and the mark of the start."""
        _, green, blue = np.moveaxis(self.colours, 2, 0)
        return np.asarray((green - blue > 60) & (self.colours[..., 0] > green))


def grown(mask: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Return a mask and what is within reach of it, in steps to a side or across."""
    for _ in range(reach):
        mask = mask | np.roll(mask, 1, 0) | np.roll(mask, -1, 0)
        mask = mask | np.roll(mask, 1, 1) | np.roll(mask, -1, 1)
    return mask


def pixels_of(path: Path) -> NDArray[np.int64]:
    """Return the colours of a picture file, shape (height, width, 3)."""
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB")).astype(np.int64)


def along(lines: Floats) -> Floats:
    """Return points on lines, shape (n, 2, 2), so many that pixels between them are few."""
    part = np.linspace(0, 1, 80)[:, None, None]
    points = lines[:, 0] + (lines[:, 1] - lines[:, 0]) * part
    return np.asarray(points.reshape(-1, 2))


def edges_of(events: Events, number: int) -> Floats:
    """Return the edges of a tree by the fold that replay uses, shape (n, 2, 2)."""
    tree = forest(events)[number]
    child = np.flatnonzero(tree.parent >= 0)
    return np.stack([tree.q[tree.parent[child]], tree.q[child]], axis=1)


def picture_of(brrt: Command, name: str, *options: object) -> Picture:
    """Draw a golden recording's tree by the command line."""
    done = brrt("plot", GOLDEN / f"{name}.mcap", "--what", "tree", "--out", "x.png", "--force",
                "--dpi", 150, *options)  # fmt: skip
    assert done.code == 0, done.err
    world = golden(name).world
    return Picture.load(Path("x.png"), world.lower, world.upper)


# Trees


@pytest.mark.parametrize("name", ["circles2d-rrt", "circles2d-rrt-star", "squares2d-bi-rrt-coin"])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_the_picture_is_the_forest_at_that_instant(name: str, share: float, brrt: Command) -> None:
    """Each edge is drawn where it is, in its tree's colour, and nothing else has that colour."""
    log = golden(name).events()
    seq = int(share * last_event(log))
    picture = picture_of(brrt, name, "--at-event", seq)
    part = log.until(seq=seq)
    paths = [np.asarray(row["waypoints"]) for row in part[Kind.PATH][-2:]]
    marks = [np.array([golden(name).manifest.start, golden(name).manifest.goal])]
    lines = [np.stack([path[:-1], path[1:]], axis=1) for path in paths]
    over = picture.drawn(np.concatenate([*map(along, lines), *marks]), 7)
    for number, colour in {0: picture.blue, 1: picture.red}.items():
        if number not in forest(part):
            assert not (colour & picture.inside() & ~over).any()
            continue
        points = along(edges_of(part, number))
        bare = ~over[tuple(picture.pixels(points).T)]
        assert picture.near(colour, points[bare]).mean() > 0.97
        strange = colour & picture.inside() & ~over & ~picture.drawn(points, 3)
        assert strange.sum() <= 0.01 * colour.sum()


def test_a_tree_that_rewires_is_drawn_as_it_was_then(brrt: Command) -> None:
    """Edges that were rewired later are there before, and gone afterwards."""
    log = golden("circles2d-rrt-star").events()
    last = last_event(log)
    early = int(0.4 * last)
    before, after = edges_of(log.until(seq=early), 0), edges_of(log, 0)
    staying = {tuple(edge.ravel()) for edge in after}
    gone = along(np.array([edge for edge in before if tuple(edge.ravel()) not in staying]))
    first, then = (
        picture_of(brrt, "circles2d-rrt-star", "--at-event", seq) for seq in (early, last)
    )
    paths = [np.asarray(row["waypoints"]) for row in log[Kind.PATH][-2:]]
    lines = [np.stack([path[:-1], path[1:]], axis=1) for path in paths]
    others = then.drawn(np.concatenate([along(after), *map(along, lines)]), 3)
    alone = gone[~others[tuple(then.pixels(gone).T)]]
    assert len(alone) > 100
    assert first.near(first.blue, alone).mean() > 0.95
    assert then.near(then.blue, alone).mean() < 0.05


def test_paths_are_drawn_in_gold(brrt: Command) -> None:
    """All along the path as the planner found it, and along what shortcuts made of it."""
    log = golden("circles2d-rrt").events()
    picture = picture_of(brrt, "circles2d-rrt")
    for row in log[Kind.PATH]:
        path = np.asarray(row["waypoints"])
        points = along(np.stack([path[:-1], path[1:]], axis=1))
        assert picture.near(picture.gold, points).mean() > 0.9
    early = picture_of(brrt, "circles2d-rrt", "--at-iteration", 60)
    assert (early.gold & early.inside()).sum() < 0.1 * (picture.gold & picture.inside()).sum()


@pytest.mark.parametrize("name", ["circles2d-rrt", "squares2d-a-star", "polygons2d-polygon"])
def test_dark_is_what_is_covered(name: str, brrt: Command) -> None:
    """Before the first edge, a pixel is dark if and only if an obstacle covers its middle."""
    picture = picture_of(brrt, name, "--at-event", 0)
    rows, columns = np.nonzero(picture.inside())
    left, right, top, bottom = picture.frame
    part = np.stack([(columns - left) / (right - left), (bottom - rows) / (bottom - top)], axis=1)
    world = golden(name).world
    hit = occupied(world, world.lower + part * (world.upper - world.lower))
    dark = (picture.colours[rows, columns] < 100).all(axis=1)
    assert abs(dark.mean() - hit.mean()) < 0.01
    assert (dark == hit).mean() > 0.98


def test_rejected_extensions_are_the_newest_ones(brrt: Command) -> None:
    """From the node that they left to where they wanted to go; none unless asked for."""
    log = golden("circles2d-rrt").events()
    tree, rows = forest(log)[0], log[Kind.REJECT][-12:]
    expected = np.stack([tree.q[rows["node"]], rows["q"]], axis=1)
    history = History(record("circles2d-rrt"))
    assert np.array_equal(history.rejects(history.last, 12), expected)
    without, shown = (
        picture_of(brrt, "circles2d-rrt", "--rejects", count).colours for count in (0, 12)
    )
    assert (without != shown).any()


@pytest.mark.parametrize("name", ["polygons2d-polygon", "circles2d-chain"])
def test_bodies_stand_at_both_ends_and_along_the_path(name: str, brrt: Command) -> None:
    """The outline at the start is orange, at the goal green, and ghosts are golden."""
    saved = golden(name)
    robot = saved.robot()
    before, after = picture_of(brrt, name, "--at-event", 0), picture_of(brrt, name)
    reds = (before.colours[..., 0] - before.colours[..., 2]) > 40
    greens = (before.colours[..., 1] - before.colours[..., 0]) > 40
    for q, colour in ((saved.manifest.start, reds), (saved.manifest.goal, greens)):
        for part in robot.outline(np.array(q)):
            points = along(np.stack([part, np.roll(part, -1, axis=0)], axis=1))
            assert before.near(colour, points).mean() > 0.9
    path = np.asarray(saved.events()[Kind.PATH][-1]["waypoints"])
    for q in robot.along(path, 10):
        for part in robot.outline(q):
            points = along(np.stack([part, np.roll(part, -1, axis=0)], axis=1))
            assert after.near(after.gold, points, 2).mean() > 0.5


@pytest.mark.parametrize("name", ["boxes3d-lrta-star", "squares2d-a-star"])
def test_cells_have_the_values_of_a_plain_fold(name: str) -> None:
    """Estimates as they were last raised, the distance before; costs as last found."""
    saved, history = golden(name), History(record(name))
    log, goal = saved.events(), np.array(saved.manifest.goal)
    for seq in np.linspace(0, history.last, 7).astype(int).tolist():
        part, values, places = log.until(seq=seq), dict[int, float](), dict[int, Any]()
        for row in part[Kind.EXPAND]:
            places.setdefault(int(row["cell"]), row["q"])
            if name == "squares2d-a-star":
                values[int(row["cell"])] = float(row["cost"])
            else:
                values.setdefault(int(row["cell"]), float(np.linalg.norm(row["q"] - goal)))
        for row in part[Kind.HEURISTIC]:
            if int(row["cell"]) in values:
                values[int(row["cell"])] = float(row["h"])
        where, found = history.cells(seq)
        assert np.array_equal(where, np.array(list(places.values())).reshape(-1, len(goal)))
        assert np.allclose(found, [values[cell] for cell in places], rtol=1e-12)


def test_cells_are_coloured_by_their_value(brrt: Command) -> None:
    """The middle of a cell that nothing hides has the colour that the scale gives its cost."""
    saved = golden("squares2d-a-star")
    log, picture = saved.events(), picture_of(brrt, "squares2d-a-star", "--at-iteration", 150)
    rows = log.until(iteration=150)[Kind.EXPAND]
    at = tuple(picture.pixels(rows["q"]).T)
    expected = 255 * colormaps[style.HEAT](rows["cost"] / rows["cost"].max())[:, :3]
    seen = picture.inside()[at]
    assert seen.mean() > 0.8  # cells reach beyond the bounds
    assert (np.abs(picture.colours[at] - expected)[seen].max(axis=1) < 12).mean() > 0.9


@pytest.mark.parametrize("name", ["boxes3d-bi-rrt-star", "spheres3d-unsolved"])
def test_a_picture_in_3d_shows_trees_and_ends(name: str, brrt: Command) -> None:
    """Blue, red where the goal has a tree, orange and green; another camera, another picture."""
    shots = []
    for azimuth in (-62, 10):
        done = brrt("plot", GOLDEN / f"{name}.mcap", "--what", "tree", "--out", "x.png", "--force",
                    "--dpi", 120, "--azimuth", azimuth)  # fmt: skip
        assert done.code == 0, done.err
        shots.append(pixels_of(Path("x.png")))
    colours = shots[0].reshape(-1, 3)
    red, green, blue = colours.T
    assert (blue - red > 60).sum() > 200
    goal_tree = (red - green > 100) & (abs(green - blue) < 25)
    assert (goal_tree.sum() > 200) == (name == "boxes3d-bi-rrt-star")
    for wanted in (style.START, style.GOAL):
        assert (np.abs(colours - 255 * np.array(wanted)) < 12).all(axis=1).sum() > 20
    assert shots[0].shape != shots[1].shape or (shots[0] != shots[1]).any()


def test_paths_in_the_midst_of_smoothing() -> None:
    """Shortcuts cut the path one after another, and end where the log says."""
    for name in ("circles2d-rrt", "squares2d-intermediate", "circles2d-chain"):
        history, log = History(record(name)), golden(name).events()
        raw, smoothed = log[Kind.PATH]
        assert history.paths(int(raw["seq"]) - 1) == (None, None)
        for cut in log[Kind.SHORTCUT][:: 1 + len(log[Kind.SHORTCUT]) // 7]:
            paths = history.paths(int(cut["seq"]))
            best = paths.short or paths.raw
            assert best is not None
            assert best[1] == pytest.approx(cut["cost"], rel=1e-9)
        paths = history.paths(int(smoothed["seq"]) - 1)
        assert paths.short is not None
        assert np.array_equal(paths.short[0], smoothed["waypoints"])


# Curves


@pytest.mark.parametrize("name", ["circles2d-rrt-star", "boxes3d-bi-rrt-star"])
def test_the_cost_curve_is_the_metrics(name: str) -> None:
    """After each iteration the curve stands where the figures do."""
    saved = golden(name)
    log = saved.events()
    ax = plot(saved, Figure().subplots(), what="cost")
    x, y = (np.asarray(values) for values in ax.lines[0].get_data())
    assert ax.lines[0].get_drawstyle() == "steps-post"
    for iteration in range(int(x[0]), int(x[-1])):
        metrics = Metrics(saved.manifest)
        metrics.write(log.until(iteration=iteration))
        assert y[np.flatnonzero(x <= iteration)[-1]] == metrics.as_dict()["path_cost"]
    figures = brrt.metrics(saved).as_dict()
    assert (x[0], y[0]) == (figures["first_path_iteration"], figures["first_path_cost"])
    assert (x[-1], y[-1]) == (figures["iterations"], figures["path_cost"])
    assert ax.lines[2].get_ydata()[0] == figures["smoothed_cost"]


def seeds(count: int) -> list[Record]:
    """Return runs that differ in their seeds and in when their paths were found."""
    base = record("circles2d-rrt-star")
    made, rng = [], np.random.default_rng(5)
    for seed in range(count):
        tables = {kind: table.copy() for kind, table in base.events.tables.items()}
        paths = tables[Kind.PATH]
        paths["cost"] += rng.integers(0, 30)
        kept = np.sort(rng.choice(len(paths) - 1, 5, replace=False))
        tables[Kind.PATH] = paths[kept] if seed else paths[:0]
        scenario = base.manifest.scenario.parse({**base.manifest.scenario.as_dict(), "seed": seed})
        manifest = type(base.manifest)(
            scenario, base.manifest.start, base.manifest.goal, 2, 2, 0, {}, base.manifest.robot
        )
        made.append(Record(f"s{seed}", manifest, base.world, Events(2, tables)))
    return made


def test_many_seeds_become_a_median_with_quartiles() -> None:
    """At every iteration the line is the median of what the runs had; no path is infinite."""
    runs = seeds(9)
    ax = curves.draw_cost(Figure().subplots(), runs)
    (line,) = ax.lines
    x, y = (np.asarray(values) for values in line.get_data())
    for iteration in range(int(x[0]), 300):
        costs = []
        for run in runs:
            paths = run.events[Kind.PATH]
            before = paths[(paths["iteration"] <= iteration) & (paths["stage"] != Stage.SMOOTHED)]
            costs.append(float(before["cost"][-1]) if len(before) else np.inf)
        assert y[np.flatnonzero(x <= iteration)[-1]] == np.median(costs)
    (band,) = ax.collections
    low, high = band.get_paths()[0].vertices[:, 1].min(), y.min()
    assert low <= high
    assert "9 runs" in line.get_label()


def test_few_runs_are_drawn_one_by_one() -> None:
    """Each with its own colour and name; one that found nothing is named too."""
    ax = curves.draw_cost(Figure().subplots(), seeds(3))
    labels = [line.get_label() for line in ax.lines if not line.get_label().startswith("_")]
    assert labels == ["s0 (no path)", "s1", "s2"]
    assert len({line.get_color() for line in ax.lines}) == 3


def test_time_adds_up() -> None:
    """Time per iteration, over all iterations, is the time of planning; shares are of a bin."""
    run = record("circles2d-rrt-star")
    axes = Figure().subplots(3, 1)
    curves.draw_time(axes, run)
    per_iteration, rejected, pace = (ax.patches[0].get_data() for ax in axes)
    widths = np.diff(per_iteration.edges)
    figures = metrics(golden("circles2d-rrt-star")).as_dict()
    assert per_iteration.edges[-1] == figures["iterations"]
    assert (per_iteration.values * widths).sum() == pytest.approx(
        1e6 * figures["plan_time_s"], rel=0.01
    )
    assert np.allclose(pace.values, 1.0)  # a million a second: the clock is logical
    first, last = rejected.edges[10], rejected.edges[11]
    counts = {}
    for kind in (Kind.REJECT, Kind.EDGE):
        rows = run.events[kind]["iteration"]
        counts[kind] = ((rows > first) & (rows <= last)).sum()
    share = 100 * counts[Kind.REJECT] / sum(counts.values())
    assert rejected.values[10] == pytest.approx(share)


# Files


@pytest.mark.parametrize(
    ("ending", "begin"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")]
)
def test_pictures_are_the_same_every_time(ending: str, begin: bytes, tmp_path: Path) -> None:
    """All panels, byte by byte, in the width that was asked for."""
    files = [tmp_path / f"{i}{ending}" for i in range(2)]
    for file in files:
        look = Look(width=5, dpi=80)
        save_plot([record("circles2d-rrt-star")], file, ("tree", "cost", "time"), look)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert files[0].read_bytes().startswith(begin)
    assert sorted(tmp_path.iterdir()) == files
    if ending == ".png":
        assert pixels_of(files[0]).shape[1] == 400


def test_the_default_has_the_cost_where_the_planner_improves(brrt: Command) -> None:
    """Such a picture is as wide as a page, another as wide as a column."""
    for name, width in (("circles2d-rrt", 3.3), ("circles2d-rrt-star", 6.9)):
        assert brrt("plot", GOLDEN / f"{name}.mcap", "--out", f"{name}.png", "--dpi", 50).code == 0
        assert pixels_of(Path(f"{name}.png")).shape[1] == int(50 * width)


def test_both_kinds_of_recording_give_the_same_picture(brrt: Command) -> None:
    """From MCAP and from Rerun."""
    source = GOLDEN / "squares2d-bi-rrt-coin.mcap"
    assert brrt("replay", source, "--rrd", "r.rrd").code == 0
    for number, run in enumerate((source, "r.rrd")):
        assert brrt("plot", run, "--out", f"{number}.png", "--dpi", 60).code == 0
    assert Path("0.png").read_bytes() == Path("1.png").read_bytes()


def test_many_edges_make_a_small_file(tmp_path: Path) -> None:
    """A tree of 30,000 edges is an image within a vector file."""
    rng, n = np.random.default_rng(1), 30_000
    base = record("circles2d-rrt")
    edges = np.zeros(n, table_dtype(Kind.EDGE, 2))
    edges["seq"] = edges["iteration"] = edges["node"] = np.arange(n)
    edges["parent"] = np.maximum(np.arange(n) - rng.integers(1, 50, n), -1)
    edges["parent"][0] = -1
    edges["parent"][1:] = np.maximum(edges["parent"][1:], 0)
    edges["q"] = rng.uniform(0, 100, (n, 2))
    big = Record("big", base.manifest, base.world, Events(2, {Kind.EDGE: edges}))
    save_plot([big], tmp_path / "big.svg", ("tree",), Look(dpi=100))
    assert (tmp_path / "big.svg").stat().st_size < 1_000_000


def test_axes_of_ones_own() -> None:
    """They are returned; those of no use are refused; a run may be cut."""
    ax = Figure().subplots()
    assert plot(golden("circles2d-rrt"), ax, seq=50) is ax
    assert "iteration" in ax.get_title(loc="left")
    with pytest.raises(BrrtError, match="the world is 3D"):
        plot(golden("boxes3d-lrta-star"), Figure().subplots())
    with pytest.raises(BrrtError, match="unknown panel 'tre'; did you mean 'tree'"):
        plot(golden("circles2d-rrt"), ax, what="tre")


# Animations


def frames_of(path: Path) -> tuple[list[NDArray[np.int64]], list[float]]:
    """Return the frames of a gif, and how long each stays, in ms."""
    frames, times = [], []
    with Image.open(path) as film:
        for number in range(getattr(film, "n_frames", 1)):
            film.seek(number)
            frames.append(np.asarray(film.convert("RGB")).astype(np.int64))
            times.append(float(film.info["duration"]))
    return frames, times


def test_the_tree_grows(tmp_path: Path) -> None:
    """From no blue at all, frame by frame, to the last picture, which stays a while."""
    told: list[tuple[int, int]] = []
    files = [tmp_path / f"{i}.gif" for i in range(2)]
    for file in files:
        save_animation(
            record("circles2d-rrt"), file, Look(dpi=90), Pace(2, 15),
            lambda done, total: told.append((done, total)),
        )  # fmt: skip
    assert files[0].read_bytes() == files[1].read_bytes()
    assert told == 2 * [(done, 30) for done in range(1, 31)]
    frames, times = frames_of(files[0])
    assert 20 <= len(frames) <= 30  # equal ones next to each other become one
    assert sum(times) == pytest.approx(3500, abs=10)
    assert times[-1] >= 1500
    world = golden("circles2d-rrt").world
    blues = []
    for frame in frames:
        picture = Picture.load(frame, world.lower, world.upper)
        blues.append(int((picture.blue & picture.inside()).sum()))
    assert blues[0] == 0
    growing = blues[: 5 * len(blues) // 6]  # afterwards paths cover some of the tree
    assert all(b >= 0.97 * a for a, b in pairwise(growing))
    assert growing[-1] > 4 * max(growing[len(growing) // 3], 1)
    points = along(edges_of(golden("circles2d-rrt").events(), 0))
    assert picture.near(picture.blue | picture.gold, points, 2).mean() > 0.9


@pytest.mark.parametrize("name", ["boxes3d-lrta-star", "boxes3d-bi-rrt-star", "circles2d-chain"])
def test_the_last_frame_is_the_picture(name: str, tmp_path: Path) -> None:
    """Drawn a frame at a time, the run ends as it is drawn at once, trees in 3D included."""
    pace = Pace(0.5, 10)
    save_animation(record(name), tmp_path / "x.gif", Look(dpi=60), pace)
    whole = frames_of(tmp_path / "x.gif")[0]
    assert all((a != b).any() for a, b in pairwise(whole))
    save_animation(record(name), tmp_path / "y.gif", Look(dpi=60), Pace(0.1, 10))
    last = frames_of(tmp_path / "y.gif")[0][-1]
    assert np.array_equal(whole[-1], last)


@pytest.mark.parametrize("name", ["squares2d-bi-rrt-coin", "boxes3d-lrta-star"])
def test_every_frame_has_the_legend(name: str, tmp_path: Path) -> None:
    """What comes late is named from the first frame on, in its colour, and nothing else changes."""
    save_animation(record(name), tmp_path / "x.gif", Look(dpi=100), Pace(0.5, 10))
    frames = np.array(frames_of(tmp_path / "x.gif")[0])
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
    """None goes back, the first come slowly, and together they last as long as they should."""
    history = History(record("circles2d-rrt"))
    seqs, times = instants(history, Pace(seconds, fps))
    assert len(seqs) == len(times)
    assert seqs[0] == 0
    assert seqs[-1] == history.last
    assert (np.diff(seqs) >= 0).all()
    assert sum(times) == pytest.approx(seconds + 1.5)
    assert len(seqs) < 8 or seqs[len(seqs) // 4] <= history.last / 6


def test_a_gif_that_would_be_large_loses_frames(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It keeps its time and its end."""
    monkeypatch.setattr("brrt.views.matplotlib.animation._MOST_BYTES", 90_000)
    for name in ("large", "small"):
        save_animation(record("circles2d-rrt"), tmp_path / f"{name}.gif", Look(dpi=60), Pace(4, 15))
        monkeypatch.setattr("brrt.views.matplotlib.animation._MOST_BYTES", 60_000)
    large, small = (frames_of(tmp_path / f"{name}.gif") for name in ("large", "small"))
    assert (tmp_path / "small.gif").stat().st_size <= 60_000
    assert len(small[0]) < len(large[0])
    assert sum(small[1]) == sum(large[1])
    assert np.array_equal(small[0][-1], large[0][-1])


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not on the PATH")
def test_mp4(brrt: Command) -> None:
    """It is a film, the same every time."""
    for name in ("a.mp4", "b.mp4"):
        args = ("--out", name, "--seconds", 0.5, "--dpi", 60)
        assert brrt("plot", GOLDEN / "circles2d-rrt.mcap", *args).code == 0
    assert Path("a.mp4").read_bytes() == Path("b.mp4").read_bytes()
    assert Path("a.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize("body", [None, "echo no such codec >&2; exit 3", "cat >/dev/null; exit 4"])
def test_ffmpeg_that_is_missing_or_fails(
    body: str | None, brrt: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """One line that says so and what to do, and nothing is left behind."""
    folder = tmp_path / "bin"
    folder.mkdir()
    if body is not None:
        (folder / "ffmpeg").write_text(f"#!/bin/sh\nPATH=/bin:/usr/bin\n{body}\n")
        (folder / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    done = brrt("plot", GOLDEN / "circles2d-rrt.mcap", "--out", "x.mp4", "--seconds", 0.5)
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "write a .gif" in done.err
    assert body is None or ("no such codec" in done.err or "exit code 4" in done.err)
    assert [path.name for path in tmp_path.iterdir()] == ["bin"]


# Bad input


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
    done = brrt("plot", GOLDEN / "circles2d-rrt.mcap", *args)
    assert (done.code, done.out) == (2, "")
    assert done.err.count("\n") == 1, done.err
    assert message in done.err
    assert not list(Path().iterdir())


def test_several_runs_share_their_costs_alone(brrt: Command) -> None:
    """Their trees do not fit into one picture; files that exist stay unless one says so."""
    runs = [GOLDEN / "circles2d-rrt.mcap", GOLDEN / "circles2d-rrt-star.mcap"]
    done = brrt("plot", *runs, "--what", "tree", "--out", "x.png")
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert brrt("plot", *runs, "--out", "x.svg").code == 0
    assert "exists already" in brrt("plot", *runs, "--out", "x.svg").err


def test_a_cut_recording_is_drawn_as_far_as_it_is_whole(brrt: Command) -> None:
    """Only if the user says so."""
    data = (GOLDEN / "circles2d-chain.mcap").read_bytes()
    Path("cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    done = brrt("plot", "cut.mcap", "--out", "x.png")
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "--partial" in done.err
    assert brrt("plot", "cut.mcap", "--out", "x.png", "--partial", "--dpi", 50).code == 0
    assert Path("x.png").exists()


def test_without_matplotlib(brrt: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line that says what to install."""
    for name in [n for n in sys.modules if n.partition(".")[0] == "matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    done = brrt("plot", GOLDEN / "circles2d-rrt.mcap", "--out", "x.png")
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "pip install 'brrt[plot]'" in done.err
