"""Exports for Foxglove and Lichtblick: after a seek, the last message of each topic is the run."""

import json
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from brrt import (
    BrrtError,
    Events,
    Grid,
    Kind,
    Memory,
    Recording,
    Run,
    Scenario,
    World,
    forest,
    read,
)
from brrt.events import Stage
from brrt.views.colours import heat, tree_style
from brrt.views.foxglove import export as module
from brrt.views.foxglove import interval_topics
from brrt.views.foxglove.draw_world import static_messages
from brrt.views.foxglove.export import export
from brrt.views.foxglove.messages import fits
from brrt.worlds.free_space import occupied
from tests.conftest import recorded
from tests.support.recordings import RECORDINGS

TREES = (
    "boxes3d-bi-rrt-star", "circles2d-rrt-star", "circles2d-chain", "polygons2d-polygon",
    "spheres3d-unsolved", "squares2d-bi-rrt-coin", "circles2d-rrt-connect",
)  # fmt: skip
SEARCHES = ("boxes3d-lrta-star", "squares2d-a-star")
ADD, DELETE = 0, 2
LINES, CUBES, CYLINDER, CUBE, SPHERE, TRIANGLES = 5, 6, 3, 1, 2, 11


@dataclass(frozen=True)
class Shown:
    """An export, decoded by mcap-ros2-support: log time and message, by topic."""

    recording: Recording
    topics: dict[str, list[tuple[int, Any]]]

    def at(self, t: int, prefix: str) -> list[Any]:
        """Return what a viewer has after a seek to a time of the run: last messages, by topic."""
        until = self.recording.manifest.epoch_ns + t
        found = []
        for topic, messages in sorted(self.topics.items()):
            past = [message for at, message in messages if at <= until]
            if topic.startswith(prefix) and past:
                found.append(past[-1])
        return found


def load(path: Path, recording: Recording) -> Shown:
    """Decode an export, every CRC checked."""
    topics = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            topics[channel.topic].append((message.log_time, decoded))
    return Shown(recording, dict(topics))


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Shown]:
    """Export a golden recording, once for all tests."""
    done: dict[str, Shown] = {}

    def get(name: str) -> Shown:
        if name not in done:
            path = tmp_path_factory.mktemp("export") / "viz.mcap"
            recording = read(RECORDINGS / f"{name}.mcap")
            export(recording, path)
            done[name] = load(path, recording)
        return done[name]

    return get


def of(run: Run, log: Events) -> Recording:
    """Make a recording of what was not written to a file."""
    return Recording(run.manifest, run.problem.world, lambda: iter([log]), None)


def times(log: Events) -> list[int]:
    """Draw 100 times of a run; and when each batch of changes begins, and what is around."""
    changes = [log[kind]["t"] for kind in (Kind.EDGE, Kind.REWIRE, Kind.EXPAND, Kind.HEURISTIC)]
    instants = np.unique(np.concatenate(changes))
    borders = instants[:: interval_topics.BATCH]
    drawn = np.random.default_rng(0).integers(0, log.last.t + 1000, 100)
    return np.concatenate([drawn, borders, borders - 1, instants[:5], [log.last.t]]).tolist()  # type: ignore[no-any-return]


def points(marker: Any) -> list[tuple[float, ...]]:
    """Return a marker's points."""
    return [(p.x, p.y, p.z) for p in marker.points]


def segments(markers: list[Any]) -> Counter[tuple[tuple[float, ...], ...]]:
    """Count the lines of markers by their ends, with their direction."""
    found: Counter[tuple[tuple[float, ...], ...]] = Counter()
    for marker in markers:
        ends = points(marker)
        found.update(zip(ends[::2], ends[1::2], strict=True))
    return found


def lines(froms: Any, tos: Any) -> Counter[tuple[tuple[float, ...], ...]]:
    """Count lines between places, shape (n, d) each."""
    space = [np.pad(ends, ((0, 0), (0, 3 - ends.shape[1]))) for ends in (froms, tos)]
    return Counter(zip(*(map(tuple, ends.tolist()) for ends in space), strict=True))


@pytest.mark.parametrize("name", TREES)
def test_a_seek_shows_the_forest(name: str, shown: Callable[[str], Shown]) -> None:
    """At any time, the edges that are drawn are those of the forest then, rewired ones too."""
    given = shown(name)
    log, robot = given.recording.events(), given.recording.manifest.make_robot()
    for t in times(log):
        for number, tree in forest(log.until(t=t)).items():
            places = robot.places(tree.q)
            child = np.flatnonzero(tree.parent >= 0)
            drawn = given.at(t, f"/viz/tree/{tree_style(number)[0]}/")
            assert segments(drawn) == lines(places[tree.parent[child]], places[child]), t
    assert not given.at(-1, "/viz/")


@pytest.mark.parametrize("name", [*TREES, *SEARCHES])
def test_a_seek_shows_the_paths(name: str, shown: Callable[[str], Shown]) -> None:
    """At any time, the newest path of each stage is drawn, and nothing of one to come."""
    given = shown(name)
    log, robot = given.recording.events(), given.recording.manifest.make_robot()
    for t in [*times(log), *log[Kind.PATH]["t"].tolist()]:
        for stage in Stage:
            past = [row for row in log[Kind.PATH] if row["t"] <= t and row["stage"] == stage]
            drawn = segments(given.at(t, f"/viz/path/{stage.name.lower()}"))
            path = (
                past[-1]["waypoints"] if past else np.empty((0, robot.dof(given.recording.world)))
            )
            places = robot.trail(path)  # curves where the robot turns; see tests/robots
            want = lines(places[:-1], places[1:])
            assert [end[:2] for pair in drawn for end in pair] == [
                end[:2] for pair in want for end in pair
            ]


def test_links_between_trees(shown: Callable[[str], Shown]) -> None:
    """Every link up to a time is drawn."""
    given = shown("boxes3d-bi-rrt-star")
    log = given.recording.events()
    trees = forest(log)
    for t in times(log)[:50]:
        past = log.until(t=t)[Kind.CONNECT]
        ends = trees[0].q[past["node"]], trees[1].q[past["other"]]
        assert segments(given.at(t, "/viz/link/")) == lines(*ends)


@pytest.mark.parametrize("name", SEARCHES)
def test_a_seek_shows_the_cells(name: str, shown: Callable[[str], Shown]) -> None:
    """At any time, each cell seen is drawn once, in the colour of what is known of it then."""
    given = shown(name)
    recording = given.recording
    log, robot = recording.events(), recording.manifest.make_robot()
    start, goal = np.array(recording.manifest.start), np.array(recording.manifest.goal)
    scale = float(robot.distance(start, goal))
    rows = sorted(
        ((row["seq"], kind, row) for kind in (Kind.EXPAND, Kind.HEURISTIC) for row in log[kind]),
        key=lambda row: int(row[0]),
    )
    for t in times(log):
        cells: dict[int, tuple[Any, float]] = {}
        for _, kind, row in rows:
            if row["t"] > t:
                break
            if kind is Kind.HEURISTIC:
                cells[int(row["cell"])] = row["q"], float(row["h"])
            elif int(row["cell"]) not in cells:
                known = row["cost"] if name == "squares2d-a-star" else None
                known = float(robot.distance(row["q"], goal)) if known is None else known
                cells[int(row["cell"])] = row["q"], float(known)
        values = np.array([value for _, value in cells.values()])
        colours = heat(values / (values + scale)).tolist()
        want = Counter(
            (
                *np.asarray(q).tolist(),
                *colour,
            )
            for (q, _), colour in zip(cells.values(), colours, strict=True)
        )
        got: Counter[tuple[float, ...]] = Counter()
        for marker in given.at(t, "/viz/cells/"):
            for place, c in zip(points(marker), marker.colors, strict=True):
                colour = tuple(round(255 * part) for part in (c.r, c.g, c.b))
                got[(*place[: log.dof], *colour)] += 1
        assert got == want, t


def test_a_seek_shows_the_robot_and_its_trace(shown: Callable[[str], Shown]) -> None:
    """At any time the robot is where its newest move went, at the end of its way of each trial."""
    given = shown("boxes3d-lrta-star")
    log = given.recording.events()
    for t in times(log)[:100]:
        at, froms, tos = np.array(given.recording.manifest.start), [], []
        for row in log.until(t=t)[Kind.MOVE]:
            at = np.array(given.recording.manifest.start) if row["step"] == 1 else at
            if (at != row["q"]).any():
                froms.append(at)
                tos.append(row["q"])
            at = row["q"]
        want = lines(np.reshape(froms, (-1, 3)), np.reshape(tos, (-1, 3)))
        assert segments(given.at(t, "/viz/trace/")) == want
        robot = [marker.pose.position for marker in given.at(t, "/viz/robot")]
        if len(log.until(t=t)[Kind.MOVE]):
            assert [[p.x, p.y, p.z] for p in robot] == [np.asarray(at).tolist()]
        else:
            assert not robot


@pytest.mark.parametrize("name", ["circles2d-chain", "polygons2d-polygon"])
def test_bodies(name: str, shown: Callable[[str], Shown]) -> None:
    """The body stands at start and goal, and at a node that is at most a batch old."""
    given = shown(name)
    manifest = given.recording.manifest
    log, robot = given.recording.events(), manifest.make_robot()
    for topic, q in (("/viz/start", manifest.start), ("/viz/goal", manifest.goal)):
        (message,) = given.at(0, topic)
        corners = {p[:2] for marker in message.markers for p in points(marker)}
        assert corners == {tuple(v) for part in robot.outline(np.array(q)) for v in part.tolist()}
    for t in times(log):
        edges = log.until(t=t)[Kind.EDGE]
        for number in np.unique(edges["tree"]).tolist():
            mine = edges[edges["tree"] == number]["q"]
            fresh = [
                {tuple(v) for part in robot.outline(q) for v in part.tolist()}
                for q in mine[-interval_topics.BATCH :]
            ]
            drawn = given.at(t, f"/viz/body/{tree_style(number)[0]}")
            assert [{p[:2] for p in points(marker)} in fresh for marker in drawn] in ([], [True])
            assert drawn or len(mine) < interval_topics.BATCH


@pytest.mark.parametrize("name", [*TREES, *SEARCHES])
def test_messages_are_what_panels_draw(name: str, shown: Callable[[str], Shown]) -> None:
    """Times rise, lists have whole items, only what is there is taken away; one still frame."""
    given = shown(name)
    epoch, end = given.recording.manifest.epoch_ns, given.recording.events().last.t
    for topic, messages in given.topics.items():
        at = [time for time, _ in messages]
        assert at == sorted(set(at))
        assert at[0] >= epoch
        assert at[-1] <= epoch + end
        there = False
        for _, message in messages:
            for marker in getattr(message, "markers", [message]):
                assert marker.header.frame_id == "world"
                assert marker.header.stamp.sec == marker.header.stamp.nanosec == 0
                assert marker.color.a > 0
                assert marker.scale.x + marker.scale.z > 0
                assert marker.pose.orientation.w == 1
                count = len(marker.points)
                if marker.action == DELETE:
                    assert there, topic
                    assert not count
                else:
                    assert marker.action == ADD
                if marker.action == ADD and marker.type in (LINES, CUBES, TRIANGLES):
                    assert count
                    assert count % {LINES: 2, CUBES: 1, TRIANGLES: 3}[marker.type] == 0
                    assert len(marker.colors) in (0, count)
                there = marker.action == ADD


def test_streams_declare_channels_before_messages(tmp_path: Path) -> None:
    """A reader that goes from front to end finds each channel before its first message."""
    export(read(RECORDINGS / "circles2d-rrt-star.mcap"), tmp_path / "viz.mcap")
    known, used = set(), set()
    with (tmp_path / "viz.mcap").open("rb") as file:
        for record in StreamReader(file, validate_crcs=True).records:
            kind = type(record).__name__
            if kind == "Channel":
                known.add(record.id)  # type: ignore[attr-defined]
            elif kind == "Message":
                used.add(record.channel_id)  # type: ignore[attr-defined]
                assert used <= known
    assert used == known


@pytest.mark.filterwarnings("ignore:end_time is deprecated")
def test_size_at_20_000_edges(tmp_path: Path) -> None:
    """At most 80 bytes an edge, and after a seek in the indexed file the tree is still exact."""
    scenario = Scenario(
        world="boxes3d:n=60,seed=1", seed=1, params={"step": 1.0, "goal_bias": 0.0},
        iterations=25_000, smooth=False,
    )  # fmt: skip
    run, log = recorded(scenario)
    log = log.until(seq=int(log[Kind.EDGE]["seq"][20_000]))
    path = tmp_path / "viz.mcap"
    export(of(run, log), path)
    assert path.stat().st_size <= 80 * 20_000
    tree = forest(log)[0]
    for t in np.random.default_rng(1).choice(log[Kind.EDGE]["t"], 3).tolist():
        there = np.flatnonzero(log[Kind.EDGE]["t"] <= t)[1:]
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            summary = reader.get_summary()
            assert summary is not None
            drawn = []
            for channel in summary.channels.values():
                if channel.topic.startswith("/viz/tree/"):
                    before = run.manifest.epoch_ns + t + 1
                    past = reader.iter_decoded_messages([channel.topic], None, before, True, True)
                    drawn += [found[3] for found in [next(iter(past), None)] if found is not None]
        assert segments(drawn) == lines(tree.q[tree.parent[there]], tree.q[there])


@pytest.mark.parametrize("spec", ["circles2d:n=9", "squares2d:n=9", "polygons2d:n=7", "maze2d"])
def test_flat_worlds_are_filled(spec: str, tmp_path: Path) -> None:
    """A point is in a triangle, a disc or a blocked cell if and only if it is in an obstacle."""
    run, log = recorded(Scenario(world=spec, iterations=1, smooth=False))
    world = run.problem.world
    export(of(run, log), tmp_path / "viz.mcap")
    given = load(tmp_path / "viz.mcap", of(run, log))
    ((message,), maps) = given.at(0, "/viz/world"), given.at(0, "/viz/map")
    tries = np.random.default_rng(0).uniform(world.lower, world.upper, (2000, 2))
    hit = np.zeros(len(tries), bool)
    for marker in message.markers:
        if marker.type == CYLINDER:
            middle = marker.pose.position.x, marker.pose.position.y
            assert marker.scale.x == marker.scale.y
            hit |= np.hypot(*(tries - middle).T) <= marker.scale.x / 2
        if marker.type == TRIANGLES:
            for triangle in np.array(points(marker))[:, :2].reshape(-1, 3, 2):
                edge = np.roll(triangle, -1, axis=0) - triangle
                away = tries[:, None] - triangle
                hit |= (edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0] >= 0).all(axis=1)
    for grid in maps:
        hit |= blocked(grid, tries)
    assert (hit == occupied(world, tries)).all()


def blocked(message: Any, tries: Any) -> Any:
    """Tell which points lie in blocked cells, as nav_msgs defines its maps."""
    info = message.info
    turn = 2 * np.arctan2(info.origin.orientation.z, info.origin.orientation.w)
    away = tries - (info.origin.position.x, info.origin.position.y)
    x = away @ (np.cos(turn), np.sin(turn)) / info.resolution
    y = away @ (-np.sin(turn), np.cos(turn)) / info.resolution
    inside = (x >= 0) & (y >= 0) & (x < info.width) & (y < info.height)
    cells = np.array(message.data, np.int8).reshape(info.height, info.width)
    hit = np.zeros(len(tries), bool)
    hit[inside] = cells[y[inside].astype(int), x[inside].astype(int)] == 100
    return hit


def test_turned_map(tmp_path: Path) -> None:
    """An occupancy grid keeps its cells, its place and its turn; what it leaves out is blocked."""
    run, log = recorded(Scenario(world="circles2d:n=0", iterations=1, smooth=False))
    cells = np.random.default_rng(2).random((13, 29)) < 0.3
    world = World.of_grid("turned", Grid(cells, np.array([3.0, -2.0]), 0.5, 0.4))
    recording = replace(of(run, log), world=world)
    export(recording, tmp_path / "viz.mcap", layout_path=tmp_path / "l.json")
    (message,) = load(tmp_path / "viz.mcap", recording).at(0, "/viz/map")
    tries = np.random.default_rng(3).uniform(world.lower, world.upper, (1000, 2))
    assert world.grid is not None
    at = world.grid.to_cells(tries)
    within = ((at >= 0) & (at < cells.shape[::-1])).all(axis=1)
    assert (blocked(message, tries)[within] == world.grid.covers(tries[within])).all()
    panel = json.loads((tmp_path / "l.json").read_text())["configById"]["3D!brrt"]
    assert panel["topics"]["/viz/map"]["colorMode"] == "custom"


@pytest.mark.parametrize("spec", ["boxes3d:n=9", "spheres3d:n=9"])
def test_deep_worlds(spec: str, tmp_path: Path) -> None:
    """Each box is a cube and each ball a sphere of its size."""
    run, log = recorded(Scenario(world=spec, iterations=1, smooth=False))
    world = run.problem.world
    export(of(run, log), tmp_path / "viz.mcap")
    (message,) = load(tmp_path / "viz.mcap", of(run, log)).at(0, "/viz/world")
    got = [
        [m.type, *(getattr(part, axis) for part in (m.pose.position, m.scale) for axis in "xyz")]
        for m in message.markers
        if m.type in (CUBE, SPHERE)
    ]
    low, high = world.boxes[:, :3], world.boxes[:, 3:]
    want = [[CUBE, *row] for row in np.hstack([(low + high) / 2, high - low]).tolist()]
    want += [[SPHERE, *ball[:3], *[2 * ball[3]] * 3] for ball in world.balls.tolist()]
    assert got == want


def test_run_without_events(tmp_path: Path) -> None:
    """Of a run that was cut before its first event there is the scene."""
    run, _ = recorded(Scenario(world="circles2d", iterations=1))
    recording = of(run, Events(2, {}))
    assert export(recording, tmp_path / "viz.mcap") == 3
    assert load(tmp_path / "viz.mcap", recording).topics.keys() == {
        "/viz/world", "/viz/start", "/viz/goal",
    }  # fmt: skip


def test_changes_at_one_instant_appear_at_once(tmp_path: Path) -> None:
    """Events with the same time make one message of a topic, with the last one's state."""
    run, memory = Run(Scenario(world="circles2d:n=5", planner="rrt-star", iterations=60)), Memory()
    run.execute([memory])
    log = memory.events()
    tables = {kind: table.copy() for kind, table in log.tables.items()}
    for table in tables.values():
        table["t"] = table["t"] // 200_000 * 200_000
    coarse = Events(log.dof, tables)
    export(of(run, coarse), tmp_path / "viz.mcap")
    given = load(tmp_path / "viz.mcap", of(run, coarse))
    for t in np.unique(coarse[Kind.EDGE]["t"]).tolist():
        tree = forest(coarse.until(t=t))[0]
        child = np.flatnonzero(tree.parent >= 0)
        want = lines(tree.q[tree.parent[child]], tree.q[child])
        assert segments(given.at(t, "/viz/tree/start/")) == want


def test_failures_leave_no_file(tmp_path: Path) -> None:
    """A log that does not hold together, or a folder that is not there, is one line and no file."""
    run, log = recorded(Scenario(world="circles2d:n=5", iterations=50))
    edges = log[Kind.EDGE].copy()
    edges["parent"][3] = 99
    with pytest.raises(BrrtError, match=r"there is no node 99"):
        export(of(run, Events(2, {Kind.EDGE: edges})), tmp_path / "viz.mcap")
    with pytest.raises(BrrtError, match=r"cannot write .*No such file"):
        export(of(run, log), tmp_path / "nowhere" / "viz.mcap")
    with pytest.raises(BrrtError, match=r"cannot write .*No such file"):
        export(of(run, log), tmp_path / "viz.mcap", layout_path=tmp_path / "nowhere" / "l.json")
    assert not list(tmp_path.iterdir())


def test_progress_rises_to_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Long work says how far it is, and small chunks show the same."""
    monkeypatch.setattr(module, "_CHUNK", 10_000)
    parts: list[float] = []
    recording = read(RECORDINGS / "circles2d-rrt-star.mcap")
    export(recording, tmp_path / "viz.mcap", progress=parts.append)
    assert len(parts) > 5
    assert parts == sorted(parts)
    assert 0 <= parts[0] < 0.5 < parts[-1] <= 1
    small = load(tmp_path / "viz.mcap", recording)
    assert segments(small.at(recording.events().last.t, "/viz/tree/"))


def test_places_far_from_the_origin_are_exact(tmp_path: Path) -> None:
    """Nodes, which are 1e-5 degrees apart, are where the events say, the start among them."""
    lower = np.array([139.763416, 35.6785133])
    far = World("far", lower, lower + 2e-4, start=lower + 1e-5, goal=lower + 1.8e-4)
    far.save(tmp_path / "far.json")
    scenario = Scenario(world=str(tmp_path / "far.json"), planner="rrt-star", iterations=100)
    run, log = recorded(scenario)
    export(of(run, log), tmp_path / "viz.mcap")
    given = load(tmp_path / "viz.mcap", of(run, log))
    nodes = {
        point[:2] for marker in given.at(log.last.t, "/viz/tree/start") for point in points(marker)
    }
    assert nodes == set(map(tuple, log[Kind.EDGE]["q"].tolist()))
    start = given.at(log.last.t, "/viz/start")[0].markers[0].pose.position
    assert (start.x, start.y) == run.manifest.start
    assert (start.x, start.y) in nodes


@pytest.mark.parametrize("resolution", [0.05, 1e-50, 1e60])
def test_grids_whose_edge_is_no_float32(resolution: float, tmp_path: Path) -> None:
    """A map is a message if its cells are right there, otherwise triangles."""
    grid = Grid(np.eye(4, dtype=bool), np.zeros(2), resolution)
    world = World.of_grid("grid", grid, start=np.array([2.5, 0.5]) * resolution)
    run, _ = recorded(Scenario(world="circles2d:n=3", iterations=5))
    assert fits(grid) == (resolution == 0.05)
    topics = {topic for topic, *_ in static_messages(run.manifest, world)}
    assert ("/viz/map" in topics) == fits(grid)
