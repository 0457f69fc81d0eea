"""What is drawn of each planner: exactly what the events say, as they say it, within bounds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from brrt import Events, Kind, McapSink, Memory, Run, Scenario, Sink, forest, read
from brrt.events import Reason, Table, table_dtype
from brrt.views.rerun import draw_world, layout, sink
from brrt.views.rerun.draw import decimate, pages, paths
from brrt.views.rerun.sink import RerunSink
from tests.conftest import result_of

SQUARES = "squares2d:n=30,seed=3"
PLANNERS: dict[str, dict[str, Any]] = {
    "rrt": {},
    "rrt-connect": {},
    "bi-rrt": {},
    "rrt-star": {"iterations": 2000},
    "bi-rrt-star": {"iterations": 1000},
    "lrta-star": {"params": {"epsilon": 2.0, "lookahead": 3, "trials": 2}},
    "a-star": {"params": {"epsilon": 2.0}},
}


@pytest.fixture(autouse=True)
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw batch by batch, as a slow planner has it: what is gathered is one batch too."""
    monkeypatch.setattr(sink, "_GATHERED", 1)


def scenario(planner: str, **values: Any) -> Scenario:
    """A run in the plane."""
    given: dict[str, Any] = {"world": SQUARES, "seed": 1, **PLANNERS[planner], **values}
    return Scenario(planner=planner, **given)


def record(path: Path, given: Scenario, *, batch: int = 500) -> Events:
    """Record a run, and return its events."""
    run, memory = Run(given, batch=batch), Memory()
    run.execute([RerunSink(run.manifest, run.problem.world, path=path), memory])
    return memory.events()


def rows_of(path: Path, prefix: str, ending: str) -> dict[str, list[tuple[int, Any]]]:
    """Rows of a component by entity: `seq` and value."""
    found: dict[str, list[tuple[int, Any]]] = {}
    for chunk in RrdReader(path).stream():
        if not chunk.entity_path.startswith(prefix) or chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.endswith(ending):
                rows = zip(
                    batch.column("event").to_pylist(),
                    batch.column(name).to_pylist(),
                    strict=True,
                )
                found.setdefault(chunk.entity_path, []).extend(rows)
    return found


def rows(path: Path, entity: str, ending: str) -> list[tuple[int, Any]]:
    """Rows of one entity."""
    return rows_of(path, entity, ending).get(entity, [])


def as_set(lines: Any) -> set[tuple[float, ...]]:
    """Lines, shape (n, 2, dim), without their order."""
    return set(map(tuple, np.array(lines, np.float32).reshape(len(lines), -1).tolist()))


def shown(found: dict[str, list[tuple[int, Any]]], seq: int) -> list[Any]:
    """What a viewer shows of pages with the cursor at an event: the newest row of each."""
    items: list[Any] = []
    for page in found.values():
        up_to_now = [value for at, value in page if at <= seq]
        items += up_to_now[-1] if up_to_now else []
    return items


def edges_of(events: Events, tree: int = 0) -> NDArray[np.float32]:
    """Edges of a tree as it stands, shape (n, 2, dim)."""
    found = forest(events)[tree]
    children = np.flatnonzero(found.parent >= 0)
    return np.stack([found.q[found.parent[children]], found.q[children]], axis=1).astype("f4")


@pytest.mark.parametrize(("planner", "number"), [("rrt-star", 0), ("bi-rrt-star", 1)])
def test_pages_are_the_tree(planner: str, number: int, tmp_path: Path) -> None:
    """Whenever pages are logged they hold the tree as it stands, and in the end all of it."""
    path = tmp_path / "run.rrd"
    log = record(path, scenario(planner))
    found = rows_of(path, f"/world/tree/{layout.tree_style(number)[0]}_pages/", ":strips")
    instants = sorted({at for page in found.values() for at, _ in page})
    assert len(instants) > 100
    for seq in [*instants[:40], *instants[40 :: len(instants) // 20], len(log)]:
        drawn = shown(found, seq)
        wanted = edges_of(log.until(seq=seq), number)
        assert len(drawn) == len(wanted)
        assert as_set(drawn) == as_set(wanted)


def test_pages_lag_little(tmp_path: Path) -> None:
    """The picture is never far behind, and pages stay in proportion to the changes."""
    path = tmp_path / "run.rrd"
    log = record(path, scenario("rrt-star"))
    found = rows_of(path, "/world/tree/start_pages/", ":strips")
    changed = np.sort(np.concatenate([log[Kind.EDGE]["seq"], log[Kind.REWIRE]["seq"]]))
    instants = sorted({at for page in found.values() for at, _ in page})
    unseen = np.diff(np.searchsorted(changed, instants, "right"), prepend=0)
    assert unseen.max() <= 0.06 * len(changed)
    logged = sum(len(value) for page in found.values() for _, value in page)
    assert logged <= (pages._PER_CHANGE + 1) * len(changed)
    assert len(found) <= pages._MOST_PAGES


def test_pages_grow_when_there_are_too_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Full pages take twice as much, and nothing stays behind where it was."""
    monkeypatch.setattr(pages, "_MOST_PAGES", 4)
    monkeypatch.setattr(pages, "_FIRST_SIZE", 16)
    path = tmp_path / "run.rrd"
    log = record(path, scenario("rrt-star"))
    found = rows_of(path, "/world/tree/start_pages/", ":strips")
    assert len(found) == 4
    instants = sorted({at for page in found.values() for at, _ in page})
    for seq in instants[:: len(instants) // 30]:
        assert as_set(shown(found, seq)) == as_set(edges_of(log.until(seq=seq)))


def chain_then_rewires() -> list[Events]:
    """A tree that grows in two batches, and is rewired in a third."""
    edges = np.zeros(100, table_dtype(Kind.EDGE, 2))
    edges["seq"] = edges["node"] = edges["iteration"] = np.arange(100)
    edges["parent"] = edges["node"] - 1
    edges["q"] = np.random.default_rng(0).random((100, 2))
    rewires = np.zeros(2, table_dtype(Kind.REWIRE, 2))
    rewires["seq"] = rewires["iteration"] = [100, 101]
    rewires["node"], rewires["parent"] = [50, 70], 0
    tables: list[dict[Kind, Table]]
    tables = [{Kind.EDGE: edges[:40]}, {Kind.EDGE: edges[40:]}, {Kind.REWIRE: rewires}]
    return [Events(2, table) for table in tables]


def test_tree_that_is_rewired_late(tmp_path: Path) -> None:
    """What has grown gives way to pages at the first rewired edge, and not before."""
    run, path, batches = Run(scenario("rrt")), tmp_path / "run.rrd", chain_then_rewires()
    sink = RerunSink(run.manifest, run.problem.world, path=path)
    for batch in batches:
        sink.write(batch)
    sink.close(result_of(run.manifest, *batches))
    log = Events.concat(2, batches)
    grown = [line for _, row in rows(path, "/world/tree/start", ":strips") for line in row]
    assert as_set(grown) == as_set(edges_of(log.until(seq=99)))
    ((at, (scale,)),) = rows(path, "/world/tree/start", ":scale")
    assert (at, max(scale)) == (100, pytest.approx(1e-6))
    found = rows_of(path, "/world/tree/start_pages/", ":strips")
    assert min(seq for page in found.values() for seq, _ in page) == 100
    for seq in (100, 101):
        assert as_set(shown(found, seq)) == as_set(edges_of(log.until(seq=seq)))


def test_trees_that_never_rewire_just_grow(tmp_path: Path) -> None:
    """Both trees of a bidirectional planner are drawn row by row, and their link once."""
    path = tmp_path / "run.rrd"
    log = record(path, scenario("bi-rrt"))
    for number, name in enumerate(("start", "goal")):
        lines = [line for _, row in rows(path, f"/world/tree/{name}", ":strips") for line in row]
        assert as_set(lines) == as_set(edges_of(log, number))
    assert not rows_of(path, "/world/tree/start_pages", "")
    (link,), trees = log[Kind.CONNECT], forest(log)
    ((at, (line,)),) = rows(path, "/world/link", ":strips")
    assert at == link["seq"]
    ends = trees[0].q[link["node"]], trees[1].q[link["other"]]
    assert np.array_equal(line, np.array(ends, np.float32))


def test_rewired_edges_light_up(tmp_path: Path) -> None:
    """Each rewired edge is drawn in its time; the layout lets it fade."""
    path = tmp_path / "run.rrd"
    log = record(path, scenario("rrt-star"))
    rewires, q = log[Kind.REWIRE], log[Kind.EDGE]["q"]
    lines = [line for _, row in rows(path, "/world/rewired/start", ":strips") for line in row]
    assert len(rewires) < decimate.IN_FULL
    wanted = np.stack([q[rewires["parent"]], q[rewires["node"]]], axis=1)
    assert np.array_equal(lines, wanted.astype(np.float32))


def test_improved_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Improved paths are drawn where they are clearly better, or the last of a batch."""
    path = tmp_path / "run.rrd"
    log = record(path, scenario("rrt-star"))
    costs = log[Kind.PATH]["cost"][log[Kind.PATH]["stage"] == 2]
    drawn = rows(path, "/world/path/improved", ":strips")
    assert 1 < len(drawn) <= len(costs)
    last = log[Kind.PATH][log[Kind.PATH]["stage"] == 2][-1]
    assert np.array_equal(drawn[-1][1][0], last["waypoints"].astype(np.float32))
    plotted = [value for _, (value,) in rows(path, "/series/cost", ":scalars")]
    assert set(costs) <= set(plotted)
    monkeypatch.setattr(paths, "_LEAST_GAIN", 0.5)
    record(path, scenario("rrt-star"), batch=100_000)
    assert len(rows(path, "/world/path/improved", ":strips")) < 5


@pytest.mark.parametrize("planner", ["lrta-star", "a-star"])
def test_cells(planner: str, tmp_path: Path) -> None:
    """Each cell that was expanded shows, in the colour of what is known of it."""
    path = tmp_path / "run.rrd"
    log = record(path, scenario(planner))
    expands = log[Kind.EXPAND]
    wanted = {tuple(q) for q in expands["q"].astype(np.float32).tolist()}
    if planner == "a-star":
        dots = [dot for _, row in rows(path, "/world/cells/expanded", ":positions") for dot in row]
        assert len(dots) == len(expands)
        ways = [line for _, row in rows(path, "/world/cells/search", ":strips") for line in row]
        assert len(ways) == len(expands)
    else:
        wanted |= {tuple(q) for q in log[Kind.HEURISTIC]["q"].astype(np.float32).tolist()}
        found = rows_of(path, "/world/cells/learnt/", ":positions")
        dots = shown(found, len(log))
        assert len(dots) == len(wanted)
        hues = shown(rows_of(path, "/world/cells/learnt/", ":colors"), len(log))
        goal, start = np.array(read(path).manifest.goal), np.array(read(path).manifest.start)
        known = {tuple(e["q"].astype("f4")): np.hypot(*(e["q"] - goal)) for e in expands}
        known |= {tuple(e["q"].astype("f4")): e["h"] for e in log[Kind.HEURISTIC]}
        h = np.array([known[tuple(np.array(dot, "f4"))] for dot in dots])
        assert np.array_equal(hues, layout.heat(h / (h + np.hypot(*(goal - start)))))
    assert {tuple(dot) for dot in dots} == wanted


def test_moves(tmp_path: Path) -> None:
    """The trace has every move of every trial, and the robot is where it moved to."""
    path = tmp_path / "run.rrd"
    log = record(path, scenario("lrta-star"))
    moves = log[Kind.MOVE]
    assert moves["trial"].max() == 1
    lines = np.array([line for _, row in rows(path, "/world/trace", ":strips") for line in row])
    assert np.array_equal(lines[:, 1], moves["q"].astype(np.float32))
    start = np.array(read(path).manifest.start, np.float32)
    again = moves["step"] == 1
    assert np.array_equal(lines[again, 0], [start, start])
    assert np.array_equal(lines[1:, 0][~again[1:]], lines[:-1, 1][~again[1:]])
    halves = rows(path, layout.CELL_ENTITY, ":half_sizes")
    assert [half for _, (half,) in halves] == [[1.0, 1.0]] * len(moves)
    for entity, name in (
        ("/world/robot", ":positions"), (layout.TAIL_ENTITY, ":positions"),
        (layout.CELL_ENTITY, ":centers"),
    ):  # fmt: skip
        places = rows(path, entity, name)
        assert [at for at, _ in places] == moves["seq"].tolist()
        assert np.array_equal([place for _, (place,) in places], moves["q"].astype(np.float32))


def test_search_in_space(tmp_path: Path) -> None:
    """One can look through what was searched: there is a cell in each part of it, and no more."""
    path, world = tmp_path / "run.rrd", "boxes3d:size=30,n=5,min_side=2,max_side=4,seed=2"
    log = record(path, Scenario(planner="a-star", world=world, params={"epsilon": 0.75}))
    dots = np.array(
        [dot for _, row in rows(path, layout.CELLS_ENTITY, ":positions") for dot in row]
    )
    cells = log[Kind.EXPAND]["q"]

    def parts(places: NDArray[Any]) -> list[tuple[int, ...]]:
        steps = (places.astype("f4") * (20 / np.full(3, 30.0))).astype(int)
        return list(map(tuple, np.minimum(steps, 19).tolist()))

    assert len(set(parts(dots))) == len(dots) < len(cells) / 3
    assert set(parts(dots)) == set(parts(cells))
    assert {tuple(dot) for dot in dots} <= {tuple(q) for q in cells.astype("f4").tolist()}
    assert not rows(path, layout.SEARCH_ENTITY, ":strips")


sides = st.floats(1e-3, 1e3)


@settings(max_examples=30)
@given(st.lists(st.tuples(sides, sides), min_size=1, max_size=4), st.integers(0, 99))
def test_boxes_are_filled(sizes: list[tuple[float, float]], seed: int) -> None:
    """Thick lines cover all of a box, whatever its shape, and nothing outside."""
    upper = np.array(sizes)
    fill = draw_world._filled_boxes(0 * upper, upper)
    centres, halves, radii = (
        np.array(part.as_arrow_array().to_pylist())  # type: ignore[union-attr]
        for part in (fill.centers, fill.half_sizes, fill.radii)
    )
    assert (halves > 0).all()  # Rerun draws nothing else
    rng = np.random.default_rng(seed)
    for corner in upper:
        mine = (np.abs(centres - corner / 2) < 1e-6 * corner).all(axis=1) & (radii > 0)
        points = corner * np.concatenate([rng.random((200, 2)), [[0.5, 0.5]]])
        away = np.abs(points[:, None] - corner / 2) - halves[mine]
        # The distance to a rectangle's outline, from outside and from inside.
        far = np.where(
            (away > 0).any(axis=-1), np.hypot(*np.maximum(away, 0).T).T, -away.max(axis=-1)
        )
        assert (far < radii[mine]).any(axis=1).mean() > 0.99  # not the last of the corners
        assert (far[-1] < radii[mine]).any()
        assert (halves[mine] + radii[mine, None] < 1.000001 * corner / 2).all()


def test_body(tmp_path: Path) -> None:
    """A robot with a body shows it at its ends, along the path, and where it moves."""
    path = tmp_path / "run.rrd"
    given = scenario("rrt", robot="polygon", world="squares2d:n=8,seed=3", execute=True)
    log = record(path, given)
    bodies = rows(path, "/world/path/bodies", ":strips")
    assert [at for at, _ in bodies] == log[Kind.PATH]["seq"].tolist()
    assert all(0 < len(row) <= 30 for _, row in bodies)
    moved = rows(path, "/world/robot/body", ":strips")
    assert len(moved) == len(log[Kind.MOVE])
    robot = read(path).manifest.make_robot()
    (outline,) = robot.outline(log[Kind.MOVE]["q"][-1])
    assert np.array_equal(moved[-1][1][0][:-1], outline.astype(np.float32))
    assert len(rows(path, "/world/newest/start", ":strips")) > 5


@pytest.mark.parametrize("planner", PLANNERS)
def test_round_trip_of_every_planner(planner: str, tmp_path: Path) -> None:
    """Both formats give back the same log, and the picture takes its place within bounds."""
    run = Run(scenario(planner, execute=True))
    files = [tmp_path / "run.mcap", tmp_path / "run.rrd"]
    sinks: list[Sink] = [
        McapSink(files[0], run.manifest, run.problem.world),
        RerunSink(run.manifest, run.problem.world, path=files[1]),
    ]
    run.execute(sinks)
    a, b = (read(path).events() for path in files)
    assert a.tables.keys() == b.tables.keys()
    for kind, table in a.tables.items():
        for name in table.dtype.names or ():
            assert all(map(np.array_equal, table[name], b[kind][name]))
    # An empty recording takes 350 kB, most of it the layout.
    assert files[1].stat().st_size <= 400_000 + 160 * len(b)


@pytest.mark.parametrize("planner", ["rrt", "bi-rrt-star", "a-star"])
def test_plots_of_effort(planner: str, tmp_path: Path) -> None:
    """Shares of what became of the extensions are whole; times of iterations add up."""
    path = tmp_path / "run.rrd"
    events = record(path, scenario(planner, smooth=False))
    last = {}
    for entity, values in rows_of(path, "/series/extensions/", ":scalars").items():
        last[entity.rsplit("/", 1)[-1]] = max(values)
    added = len(events[Kind.EDGE]) + len(events[Kind.EXPAND])
    rejects = events[Kind.REJECT]
    for name, (seq, (share,)) in last.items():
        tried = sum(
            int((events[kind]["seq"] <= seq).sum())
            for kind in (Kind.EDGE, Kind.EXPAND, Kind.REJECT)
        )
        count = added if name == "accepted" else sum(rejects["reason"] == Reason[name.upper()])
        assert share == pytest.approx(100 * count / tried)
    paces = rows(path, "/series/pace", ":scalars")
    steps = events[Kind.SAMPLE] if len(events[Kind.SAMPLE]) else events[Kind.EXPAND]
    at = np.searchsorted(steps["seq"], [seq for seq, _ in paces])
    made = np.diff(steps["iteration"][at].astype(int), prepend=0)
    spent = np.array([value for _, (value,) in paces]) @ made
    assert spent == pytest.approx(int(steps["t"][-1]) / 1e3)


def test_same_picture_from_a_file(tmp_path: Path) -> None:
    """Drawn from an MCAP file in other batches, a run gives the same picture in the end."""
    live, again, file = (tmp_path / name for name in ("live.rrd", "again.rrd", "run.mcap"))
    run = Run(scenario("rrt-star"), batch=300)
    world = run.problem.world
    run.execute([RerunSink(run.manifest, world, path=live), McapSink(file, run.manifest, world)])
    recording = read(file)
    sink = RerunSink(recording.manifest, recording.world, path=again)
    for batch in recording.batches():
        sink.write(batch)
    sink.close(recording.result)
    pictures = [rows_of(path, "/world/tree/start_pages/", ":strips") for path in (live, again)]
    for seq in (10**9, 5000):
        assert len(shown(pictures[0], seq)) > 100
    assert as_set(shown(pictures[0], 10**9)) == as_set(shown(pictures[1], 10**9))
