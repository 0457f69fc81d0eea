"""Worlds far from the origin, tiny and huge ones are drawn as the same world of ordinary size."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from brrt import Events, Grid, Recording, Run, Scenario, World, make_world, read
from brrt.events import FIELDS
from brrt.views.rerun import layout
from brrt.views.rerun.drawing import draw_run
from brrt.views.rerun.frame import Frame
from brrt.views.rerun.pair import draw_pair
from brrt.views.rerun.sink import RerunSink
from brrt.views.rerun.stream import new_stream
from tests.conftest import Result, recorded
from tests.support.files import same

MOVES: dict[str, tuple[float, float]] = {
    "as it is": (1, 0),
    "a little away": (1, -150),
    "UTM": (0.2, 3_948_996.5),
    "longitudes": (2e-6, 139.763416),
    "tiny": (2e-7, 0),
    "tiny and far": (1e-7, -3),
    "huge": (1e20, 0),
    "huge and far": (1e20, 7e23),
}
"""How many times larger a world is made, and how far it is moved then."""


def moved(recording: Recording, scale: float, offset: float) -> Recording:
    """Return a run of a point in 2D or 3D as it is in a world that is scaled and moved."""

    def place(points: Any) -> Any:
        return np.asarray(points) * scale + offset

    world, dim = recording.world, recording.world.dim
    balls = world.balls * scale
    balls[:, :dim] += offset
    there = World(
        "moved", place(world.lower), place(world.upper), balls, place(world.boxes),
        place(world.start), place(world.goal), tuple(map(place, world.polygons)),
        y_down=world.y_down,
    )  # fmt: skip
    if world.grid is not None:
        grid = world.grid
        there = replace(
            there, grid=Grid(grid.cells, place(grid.origin), grid.resolution * scale, grid.yaw)
        )
    manifest = replace(
        recording.manifest,
        start=tuple(place(recording.manifest.start)),
        goal=tuple(place(recording.manifest.goal)),
    )
    tables = dict[Any, Any]()
    for kind, table in recording.events().tables.items():
        tables[kind] = table.copy()
        for field in FIELDS[kind]:
            if field.type == "q":
                tables[kind][field.name] = place(table[field.name])
            elif field.type == "q[]":
                for row in range(len(table)):
                    tables[kind][field.name][row] = place(table[field.name][row])
            elif field.name in ("cost", "h"):
                tables[kind][field.name] = table[field.name] * scale
    events = Events(recording.manifest.dof, tables)
    return Recording(manifest, there, lambda: [events])


def drawing(path: Path, world: World) -> dict[tuple[str, str], Any]:
    """Return the coordinates that a file draws, in parts of the world's extent."""
    found: dict[tuple[str, str], list[Any]] = {}
    frame = Frame.of(world)
    origin, extent = frame.points(world.lower), world.extent * frame.scale
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            part = name.rpartition(":")[2]
            if chunk.entity_path.startswith("/world") and part in ("positions", "strips"):
                values = batch.column(name)
                while str(values.type) != "float":
                    values = values.flatten()
                points = values.to_numpy(zero_copy_only=False).reshape(-1, world.dim)
                found.setdefault((chunk.entity_path, part), []).append((points - origin) / extent)
    return {key: np.concatenate(parts) for key, parts in found.items()}


@pytest.fixture(params=["rrt-star in polygons", "rrt-connect in 3D"])
def run(request: pytest.FixtureRequest) -> Recording:
    """A run in a world of ordinary size."""
    planner, _, where = request.param.partition(" in ")
    world = "polygons2d:n=10" if where == "polygons" else "boxes3d:n=20"
    scenario = Scenario(world=world, planner=planner, seed=3, iterations=250, clock="logical")
    made, log = recorded(scenario)
    return Recording(made.manifest, made.problem.world, lambda: [log])


@pytest.mark.parametrize("case", MOVES)
def test_the_drawing_is_the_same(case: str, run: Recording, tmp_path: Path) -> None:
    """Every coordinate is that of the world of ordinary size, to a millionth of the extent."""
    there = moved(run, *MOVES[case])
    draw_run(tmp_path / "a.rrd", run)
    draw_run(tmp_path / "b.rrd", there)
    a, b = drawing(tmp_path / "a.rrd", run.world), drawing(tmp_path / "b.rrd", there.world)
    explanation = ("/world/bounds/label", "positions")
    assert (explanation in b) == bool(Frame.of(there.world).text)
    b.pop(explanation, None)
    assert a.keys() == b.keys()
    assert len(a) > 5
    for key in a:
        np.testing.assert_allclose(b[key], a[key], atol=2e-6, rtol=0, err_msg=str(key))


def test_the_world_as_it_is_drawn() -> None:
    """Obstacles of every kind are moved and scaled; ordinary worlds are left as they are."""
    world = make_world("squares2d:n=3,seed=1")
    assert Frame.of(world).drawn is world
    cells = np.eye(3, dtype=bool)
    far = World(
        "far", np.array([1e6, 2e6]), np.array([1e6, 2e6]) + 1e-3,
        balls=np.array([[1e6 + 5e-4, 2e6, 1e-4]]),
        boxes=np.array([[1e6, 2e6, 1e6 + 5e-4, 2e6 + 2.5e-4]]),
        polygons=(np.array([[1e6, 2e6], [1e6 + 1e-3, 2e6], [1e6, 2e6 + 1e-3]]),),
        grid=Grid(cells, np.array([1e6, 2e6]), 2e-4, 0.5), y_down=True,
    )  # fmt: skip
    frame = Frame.of(far)
    drawn = frame.drawn
    np.testing.assert_allclose(drawn.lower, 0)
    np.testing.assert_allclose(drawn.upper, 1, atol=1e-5)
    np.testing.assert_allclose(drawn.balls, [[0.5, 0, 0.1]], atol=1e-5)
    np.testing.assert_allclose(drawn.boxes, [[0, 0, 0.5, 0.25]], atol=1e-5)
    np.testing.assert_allclose(drawn.polygons[0], [[0, 0], [1, 0], [0, 1]], atol=1e-5)
    assert drawn.grid is not None
    np.testing.assert_allclose(drawn.grid.origin, 0)
    assert drawn.grid.resolution == pytest.approx(0.2)
    assert (drawn.grid.yaw, drawn.y_down) == (0.5, True)
    assert frame.text == "0, 0 here is 1000000, 2000000; 1 here is 0.001"


@pytest.mark.parametrize(
    "robot", ["polygon:length=4,width=2", "chain:links=3,length=15,base_x=5000050,base_y=5000050"]
)
def test_bodies_of_robots(robot: str, tmp_path: Path) -> None:
    """Bodies are drawn where their configurations are."""
    origin, chain = np.full(2, 5e6), robot.startswith("chain")
    World("far", origin, origin + 100, start=origin + 20, goal=origin + 80).save(
        tmp_path / "far.json"
    )
    scenario = Scenario(
        world=str(tmp_path / "far.json"), planner="rrt-connect", robot=robot, seed=1, iterations=50,
        start=(0.1, 0.2, 0.3) if chain else None, goal=(1.0, 0.5, 0.2) if chain else None,
    )  # fmt: skip
    run = Run(scenario)
    recording = run.record()
    draw_run(tmp_path / "x.rrd", recording)
    drawn = drawing(tmp_path / "x.rrd", recording.world)
    body = drawn["/world/start/body", "strips"]
    outline = recording.robot().outline(np.array(recording.manifest.start))
    corners = (np.concatenate([np.concatenate([part, part[:1]]) for part in outline]) - 5e6) / 100
    np.testing.assert_allclose(body, corners, atol=1e-6)
    for points in drawn.values():
        assert (np.abs(points[np.isfinite(points).all(axis=1)] - 0.5) < 1).all()


def test_the_view_explains_its_coordinates(run: Recording, tmp_path: Path) -> None:
    """The panel of the run and the world say what 0 and 1 are; two runs of a world say the same."""
    there = moved(run, *MOVES["longitudes"])
    zero = ", ".join("0" * run.world.dim)
    text = f"{zero} here is {', '.join(['139.763416'] * run.world.dim)}; 1 here is 0.0001"
    assert f"| coordinates | {text} |" in layout.document(
        there.manifest, None, Frame.of(there.world).text
    )
    assert "coordinates" not in layout.document(run.manifest, None, Frame.of(run.world).text)
    draw_pair(tmp_path / "pair.rrd", there, there)
    labels = dict[str, Any]()
    for chunk in RrdReader(tmp_path / "pair.rrd").stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path.endswith("/bounds/label"):
            (name,) = (name for name in batch.schema.names if name.endswith(":labels"))
            labels[chunk.entity_path] = batch.column(name).to_pylist()
    assert labels == {f"/{letter}/world/bounds/label": [[text]] for letter in "AB"}


def test_events_are_exact(run: Recording, tmp_path: Path) -> None:
    """The events beside the drawing are float64, and not moved."""
    there = moved(run, *MOVES["UTM"])
    sink = RerunSink(there.manifest, there.world, path=tmp_path / "x.rrd")
    sink.write(there.events())
    sink.close(None)
    assert same(read(tmp_path / "x.rrd").events(), there.events())


def test_rerun_accepts_the_names(capfd: pytest.CaptureFixture[str], run: Recording) -> None:
    """No name of an application makes Rerun warn, which it does on stderr, in colour."""
    for case in MOVES.values():
        for scale in (1, 1 / 3, 0.1 + 0.2, 1.5e7):
            there = moved(run, case[0] * scale, case[1])
            name = layout.application(there.manifest, replace(there.world, y_down=True))
            new_stream("x", name).disconnect()
    assert capfd.readouterr().err == ""


def test_commands_print_no_warning(
    brrt: Callable[..., Result], capfd: pytest.CaptureFixture[str]
) -> None:
    """A map whose corner and sides are no whole numbers is drawn without a warning."""
    World(
        "map",
        np.array([-1.3, -0.65]),
        np.array([1.35, 0.7]),
        start=np.zeros(2),
        goal=np.ones(2) / 2,
    ).save("w.json")
    assert brrt("plan", "--world", "w.json", "--rrd", "x.rrd").code in (0, 1)
    assert brrt("worlds", "show", "w.json", "--rrd", "w.rrd").code == 0
    assert "WARN" not in capfd.readouterr().err
