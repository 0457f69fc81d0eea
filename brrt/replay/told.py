"""What two runs were told: settings that differ, and versions that do."""

import json
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from brrt.manifest import Manifest
from brrt.scenario import MOST, Scenario
from brrt.worlds.world import World

_PLAIN = ("planner", "seed", "draws", "time", "smooth", "shortcuts", "execute", "max_move",
          "deadline")  # fmt: skip
_SHAPES = ("lower", "upper", "balls", "boxes")


class Row(NamedTuple):
    """A thing that both runs have; None where one of them has it not.

    Attributes:
        name: What it is.
        a: In the first run.
        b: In the second.
    """

    name: str
    a: Any
    b: Any


def settings_of(a: Manifest, a_world: World, b: Manifest, b_world: World) -> Iterator[Row]:
    """Yield the settings that differ, those that decide what a run does.

    Names of files and the clock are not among them.

    Args:
        a: Manifest of the first run.
        a_world: Its world.
        b: Manifest of the second run.
        b_world: Its world.
    """
    ours, theirs = a.scenario, b.scenario
    for name in _PLAIN:
        yield from _row(name, getattr(ours, name), getattr(theirs, name))
    limits = (each.make_stop().iterations for each in (ours, theirs))
    yield from _row("iterations", *("no limit" if n >= MOST else n for n in limits))
    yield from _row("branches", *(_branches(each) for each in (a, b)))
    yield from rows_of("param", *(_settings(each) for each in (ours, theirs)))
    yield from rows_of("robot", _robot(a, a_world), _robot(b, b_world))
    yield from _row("start", list(a.start), list(b.start))
    yield from _row("goal", list(a.goal), list(b.goal))
    yield from _worlds(a_world, b_world)


def versions_of(a: Manifest, b: Manifest) -> Iterator[Row]:
    """Yield what differs and leaves the run the same: names, clock, versions and platform."""
    for name in ("world", "robot", "clock"):
        yield from _row(name, getattr(a.scenario, name), getattr(b.scenario, name))
    yield from rows_of("", a.made_by, b.made_by)


def _row(name: str, a: Any, b: Any) -> Iterator[Row]:
    if a != b:
        yield Row(name, a, b)


def rows_of(prefix: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[Row]:
    """Yield what differs in two tables of named values, with a word ahead of each name."""
    for name in dict.fromkeys([*a, *b]):
        yield from _row(f"{prefix} {name}".strip(), a.get(name), b.get(name))


def _settings(scenario: Scenario) -> dict[str, Any]:
    """Return the planner's settings, as the command line takes them where the planner decides."""
    return {k: "auto" if v is None else v for k, v in scenario.settings().items()}


def _branches(manifest: Manifest) -> str:
    """Say where the settings changed on the way, and whether the seed did as well."""
    turns = (
        f"{branch.iteration:,}" + ("" if branch.seed is None else f" with seed {branch.seed}")
        for branch in manifest.branches
    )
    return ", ".join(turns) or "none"


def _robot(manifest: Manifest, world: World) -> dict[str, Any]:
    """Return the robot's definition, settled in its world."""
    text = manifest.robot or manifest.make_robot().settled(world).to_json()
    return {k: v for k, v in json.loads(text).items() if k not in ("schema", "version", "name")}


def _worlds(a: World, b: World) -> Iterator[Row]:
    """Say how the contents of two worlds differ."""
    for name in _SHAPES:
        yield from _arrays(name, getattr(a, name), getattr(b, name))
    if len(a.polygons) != len(b.polygons):
        yield Row("world polygons", len(a.polygons), len(b.polygons))
    else:
        pairs = zip(a.polygons, b.polygons, strict=True)
        other = sum(not np.array_equal(p, q) for p, q in pairs)
        if other:
            yield Row("world polygons", len(a.polygons), f"{other} of them other ones")
    grids = [None if world.grid is None else world.grid.as_json() for world in (a, b)]
    if grids[0] != grids[1]:
        yield Row("world grid", *(_grid(world) for world in (a, b)))


def _arrays(name: str, a: Any, b: Any) -> Iterator[Row]:
    if name in ("lower", "upper"):
        yield from _row(f"world {name}", a.tolist(), b.tolist())
    elif len(a) != len(b):
        yield Row(f"world {name}", len(a), len(b))
    elif len(a) and not np.array_equal(a, b):
        same = a.shape == b.shape
        other = int((a != b).any(axis=1).sum()) if same else len(a)
        yield Row(f"world {name}", len(a), f"{other} of them other ones")


def _grid(world: World) -> str | None:
    if world.grid is None:
        return None
    cells = world.grid.cells
    return f"{cells.shape[0]} x {cells.shape[1]} cells, {int((cells != 0).sum()):,} blocked"
