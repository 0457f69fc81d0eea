"""Registries: names are known without importing, every entry is of its type, plug-ins join."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import brrt as api
from brrt import registry
from brrt.errors import BrrtError
from brrt.planners import PLANNERS
from brrt.planners.base.planner import Planner
from brrt.registry import PluginWarning, Registry
from brrt.robots import ROBOTS, Robot, robot_from_json
from brrt.settings import Settings
from brrt.verification.rules import REGISTERED, RULES
from brrt.worlds import GENERATORS, LOADERS, load_world
from brrt.worlds.generators.generator import Generator
from brrt.worlds.loaders.loader import Loader
from tests.conftest import Result

LISTING = """
import sys
from brrt.worlds import GENERATORS, LOADERS, World
assert "maze2d" in GENERATORS and "nothing" not in LOADERS
assert len(list(GENERATORS)) == len(GENERATORS) > 20
World.from_json(World("w", [0, 0], [1, 1]).to_json())
heavy = ("brrt.worlds.generators", "brrt.worlds.loaders", "yaml", "PIL", "shapely", "numba")
print([name for name in heavy if name in sys.modules])
"""

THEIRS = {
    "theirs.py": """
from brrt import Planner
class Mine(Planner):
    "Gives up."
class Other:
    pass
""",
    "theirs_raises.py": "raise SystemExit('no\\nway')",
    "theirs_robot.py": """
from dataclasses import dataclass
from typing import ClassVar
from brrt import Polygon
@dataclass(frozen=True, slots=True, eq=False)
class Truck(Polygon):
    kind: ClassVar[str] = "truck"
class Renamed(Truck):
    pass
""",
    "theirs_rule.py": """
from brrt.verification.rule import Rule
class Fails(Rule):
    name, promise = "fails", "Nothing."
    def window(self, events, contract):
        1 / 0
class FailsAtOnce(Rule):
    name, promise = "fails at once", "Nothing."
    def __init__(self, context):
        1 / 0
""",
    "theirs_loader.py": """
from brrt import World
from brrt.worlds.loaders.loader import Loader
class Squares(Loader):
    endings = (".json", ".squares")
    @classmethod
    def recognises(cls, head):
        return head.startswith(b"squares")
    def read(self, path, query, /):
        return World("squares", [0, 0], [1, 1])
""",
    "theirs-2.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: theirs\nVersion: 2.0\n",
    "theirs-2.0.dist-info/entry_points.txt": """
[brrt.planners]
mine = theirs:Mine
rrt = theirs:Mine
missing = nowhere:Mine
raises = theirs_raises:Mine
wrong = theirs:Other
[brrt.robots]
truck = theirs_robot:Truck
renamed = theirs_robot:Renamed
[brrt.rules]
fails = theirs_rule:Fails
fails at once = theirs_rule:FailsAtOnce
[brrt.loaders]
squares = theirs_loader:Squares
""",
    "zoo-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: zoo\nVersion: 1.0\n",
    "zoo-1.0.dist-info/entry_points.txt": "[brrt.planners]\nmine = theirs:Other\n",
}
BROKEN = {
    "rrt": "brrt has one of this name",
    "mine": "of package zoo 1.0 is left out: theirs 2.0 has one of this name",
    "missing": "importing nowhere:Mine raises ModuleNotFoundError",
    "raises": "raises SystemExit('no\\nway')",
    "wrong": "theirs:Other must be a subclass of brrt.planners.base.planner.Planner",
}


@pytest.fixture
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a package of plug-ins, most of which are broken; on the path in this test."""
    folder = tmp_path / "site"
    for name, text in THEIRS.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(registry, "_reported", set())
    monkeypatch.setattr(registry, "_report", registry._warn)
    every = (PLANNERS, ROBOTS, GENERATORS, LOADERS, REGISTERED)
    for each in every:
        monkeypatch.setattr(each, "_plugins", None)
        monkeypatch.setattr(each, "_loaded", {})
    yield folder
    for name in THEIRS:
        sys.modules.pop(name.removesuffix(".py"), None)


def test_listing_names_and_reading_a_world_imports_no_generator() -> None:
    """In a new process."""
    done = subprocess.run(
        [sys.executable, "-c", LISTING], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(
    ("entries", "base"),
    [(GENERATORS, Generator), (LOADERS, Loader), (PLANNERS, Planner), (ROBOTS, Robot)],
)
def test_every_entry_exists(entries: Registry[type[Settings]], base: type[Settings]) -> None:
    """Each is a concrete class with a name of its own."""
    classes = list(entries.own.values())
    assert all(issubclass(each, base) for each in classes)
    assert all(each().describe() is not None for each in classes)
    assert len({each.__name__ for each in classes}) == len(entries.own)
    assert tuple(REGISTERED.own.values()) == RULES


def test_unknown_names() -> None:
    """A registry is a mapping: unknown names raise KeyError, get returns the default."""
    with pytest.raises(KeyError):
        GENERATORS["nothing"]
    assert GENERATORS.get("nothing") is None


def test_own_names_never_look_at_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a look-up nor a test of a name."""
    for each in (PLANNERS, ROBOTS, GENERATORS, LOADERS):
        monkeypatch.setattr(each, "_plugins", None)
    monkeypatch.setattr(registry, "entry_points", lambda **_: pytest.fail("packages are searched"))
    run = api.Run(api.Scenario(world="empty2d", iterations=10))
    api.metrics(run.record())
    assert PLANNERS["rrt"] is api.RRT
    assert "polygon" in ROBOTS
    assert PLANNERS.package("rrt") == "brrt"


def test_names_are_known_before_anything_is_imported(theirs: Path) -> None:
    """Also those of broken plug-ins; asked for by name, these say what is wrong."""
    with pytest.warns(PluginWarning, match="has one of this name"):
        assert {"mine", "missing"} <= set(PLANNERS)
    assert "theirs" not in sys.modules
    assert PLANNERS["mine"].__doc__ == "Gives up."
    assert PLANNERS["rrt"] is api.RRT
    assert PLANNERS.package("mine") == "theirs 2.0"
    for name in ("missing", "raises", "wrong"):
        with pytest.raises(BrrtError) as caught:
            PLANNERS[name]
        assert f"brrt.planners '{name}' of package theirs 2.0 is left out: " in str(caught.value)
        assert BROKEN[name] in str(caught.value)


def test_lists_name_each_broken_plugin_once(theirs: Path, brrt: Callable[..., Result]) -> None:
    """The working ones are listed with their package, brrt's own as before."""
    found = brrt("planners", "--json")
    assert found.code == 0
    assert found.json["mine"]["package"] == "theirs 2.0"
    assert found.json["rrt"]["package"] == "brrt"
    assert list(found.json) == [*PLANNERS.own, "mine"]
    lines = found.err.splitlines()
    assert len(lines) == len(BROKEN)
    for name, why in BROKEN.items():
        assert sum(f"'{name}'" in line and why in line for line in lines) == 1, name
    assert "mine  Gives up. (from theirs 2.0)" in brrt("planners", "mine").out
    assert brrt("planners", "raises").code == 2


def test_a_robot_is_known_by_its_kind(theirs: Path) -> None:
    """It plans as what it extends; a recording of it names it, and no other plug-in."""
    run = api.Run(api.Scenario(world="empty2d", robot="truck:length=3", iterations=50))
    recording = run.record()
    assert type(recording.robot()).__name__ == "Truck"
    assert api.verify(recording, rules=RULES).holds
    with pytest.raises(BrrtError, match="the attribute kind of theirs_robot:Renamed must be 'ren"):
        ROBOTS["renamed"]


def test_a_recording_without_its_robots_package(theirs: Path) -> None:
    """It says what to install."""
    text = ROBOTS["truck"]().to_json().replace("truck", "crane")
    with pytest.raises(BrrtError, match=r"unknown kind of robot 'crane'.*install its package"):
        robot_from_json(text)


def test_a_recording_imports_no_planner_of_a_plugin(theirs: Path) -> None:
    """Whatever planner it names: its contract is in the file, or there is none."""
    path = theirs / "run.mcap"
    with api.record(path, world="empty2d", planner="mine") as rec:
        rec.edge([5, 5])
    found = api.verify(api.read(path), rules=RULES)
    assert found.holds
    assert not found.has_contract
    assert "theirs" not in sys.modules


def test_a_rule_that_fails_is_left_out(theirs: Path) -> None:
    """The others judge."""
    run = api.Run(api.Scenario(world="empty2d", iterations=10))
    with pytest.warns(PluginWarning) as told:
        found = api.verify(run.record())
    assert sorted(str(each.message).partition(" of ")[0] for each in told) == [
        "rule 'fails at once'", "rule 'fails'",
    ]  # fmt: skip
    assert found.holds
    assert found.not_judged["the rule itself fails"] == ["fails"]
    assert {result.rule for result in found.results} >= {rule.name for rule in RULES}


def test_loaders_of_plugins_come_last(theirs: Path) -> None:
    """They read files that no loader of brrt recognises, and suffixes that none has."""
    own = theirs / "own.json"
    api.World("own", np.zeros(2), np.ones(2)).save(own)
    assert load_world(own).name == str(own)
    for name in ("theirs.json", "theirs.squares"):
        (theirs / name).write_text("squares")
        assert load_world(theirs / name).name == "squares"
