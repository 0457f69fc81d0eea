"""Worlds and robots whose squares would underflow or overflow are refused in one line."""

import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from brrt import BrrtError, Metrics, Run, Scenario, World, make_robot
from brrt.worlds import GENERATORS, make_world
from brrt.worlds.arrays import GREATEST, LEAST
from tests.support.world_files import PGM, YAML, refused

TINY = "1e-170"
BOUNDS = {"lower": [0, 0], "upper": [1, 1]}
FILES: dict[str, str] = {
    "bounds.json": json.dumps({"lower": [0, 0], "upper": [1e-170, 1]}),
    "balls.json": json.dumps({**BOUNDS, "balls": [[0.5, 0.5, 1e-170]]}),
    "polygons.json": json.dumps({**BOUNDS, "polygons": [[[0, 0], [1e-120, 0], [0, 1e-120]]]}),
    "segment.json": json.dumps({**BOUNDS, "polygons": [[[0, 0], [1e-170, 0]]]}),
    "map.yaml": YAML.replace("image.pgm", "map.pgm").replace("0.5", TINY),
    "site.geojson": json.dumps(
        {"type": "Polygon", "coordinates": [[[0, 0], [1e-170, 0], [0, 1e-170], [0, 0]]]}
    ),
    "blocks.txt": "boundary 0 0 0 1 1 1e-170\n",
    "circles.txt": "1 0 0 1e-170\n",
}


@pytest.mark.parametrize("name", [*FILES, "picture.png:resolution=1e-170"])
def test_tiny_worlds_in_files(name: str, tmp_path: Path) -> None:
    """Each file format refuses a world whose squares underflow in one line."""
    for file, text in FILES.items():
        head = '{"schema": "brrt.world", "version": 1, ' if file.endswith(".json") else text[:1]
        (tmp_path / file).write_text(head + text[1:])
    (tmp_path / "map.pgm").write_bytes(PGM)
    Image.fromarray(np.zeros((2, 2), np.uint8)).save(tmp_path / "picture.png")
    with warnings.catch_warnings(action="error"):
        message = refused(lambda: make_world(f"{tmp_path}/{name}"))
    assert re.search(r" must be at least 1e-100, not \d\S*e-[123]\d\d; choose", message)


@pytest.mark.parametrize("value", ["5e-324", "1e-320", TINY, "1e-101", "1e101", "1e308"])
@pytest.mark.parametrize("name", list(GENERATORS))
def test_parameters_out_of_bounds(name: str, value: str) -> None:
    """Each length of a generator is refused without a warning, or harmless."""
    generator = GENERATORS[name]
    lengths = [row["name"] for row in generator.describe() if row["range"].startswith("> 0")]
    with warnings.catch_warnings(action="error"):
        for length in lengths:
            message = refused(lambda at=length: make_world(f"{name}:{at}={value}"))  # type: ignore[misc]
            assert message.startswith(f"{length} ")


@pytest.mark.parametrize(
    "robot", ["polygon:length=1e-170", "polygon:width=1e-320", "chain:length=1e-170",
              "chain:width=1e-170"],
)  # fmt: skip
def test_tiny_robots(robot: str) -> None:
    """A robot's lengths are refused too."""
    world = make_world("empty2d")
    with pytest.raises(BrrtError, match=r"at least 1e-1\d\d, not"):
        make_robot(robot).resolved(world)


@pytest.mark.parametrize("kind", ["polygon", "chain"])
def test_robots_in_files(kind: str, tmp_path: Path) -> None:
    """Vertices and offsets as well."""
    tiny: Any = [[0, 0], [1e-170, 0], [0, 1e-170]]
    data = {"schema": "brrt.robot", "version": 1, "kind": kind, "polygons": [tiny]}
    if kind == "chain":
        del data["polygons"]
        data |= {"base": [0, 0], "joints": [{"offset": [1e200, 0], "link": [[0, 0], [1, 0]]}]}
    path = tmp_path / "robot.json"
    path.write_text(json.dumps(data))
    message = refused(lambda: make_robot(str(path)))
    assert "must be at least 1e-100" in message or "must be 2 finite numbers" in message


@pytest.mark.parametrize("size", [LEAST, GREATEST / 2])
@pytest.mark.parametrize("world", ["empty2d", "empty3d"])
@pytest.mark.parametrize("planner", ["rrt", "rrt-connect", "rrt-star"])
def test_the_least_and_greatest_world_work(size: float, world: str, planner: str) -> None:
    """At the bounds themselves a path has the length that it has in a world of side 1."""
    found: list[Metrics] = []
    for side in (size, 1.0):
        run = Run(Scenario(world=f"{world}:size={side!r}", planner=planner, iterations=3000))
        found.append(run.execute([]))
    costs = [m.as_dict()["path_cost"] for m in found]
    assert costs[0] / size == pytest.approx(costs[1])


def test_python_worlds() -> None:
    """Worlds made in Python."""
    assert refused(lambda: World("w", np.zeros(2), np.full(2, 1e-170))) == (
        "world: sides of the bounds must be at least 1e-100, not 1e-170; choose a smaller unit"
    )
