"""What two runs were told: settings that differ, and versions that do."""

import json
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from brrt.errors import BrrtError
from brrt.scenario.contract import Contract
from brrt.scenario.contracts import contract_of, origins_of, planner_settings
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import MOST
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
    contracts = _contract(a, a_world), _contract(b, b_world)
    limits = (
        each.iteration_limit(contract.planner.default_iterations)
        for each, contract in zip((ours, theirs), contracts, strict=True)
    )
    yield from _row("iterations", *("no limit" if n >= MOST else n for n in limits))
    yield from _branches(a, b)
    robots = list(rows_of("robot", _robot(a, a_world), _robot(b, b_world)))
    worlds = list(_worlds(a_world, b_world))
    settings = planner_settings(a)[-1], planner_settings(b)[-1]
    if ours.planner != theirs.planner or settings[0] != settings[1] or robots or worlds:
        yield from _params(settings, (contracts[0].planner.chosen, contracts[1].planner.chosen))
    yield from robots
    yield from _row("start", list(a.start), list(b.start))
    yield from _row("goal", list(a.goal), list(b.goal))
    yield from worlds


def _contract(manifest: Manifest, world: World) -> Contract:
    try:
        return contract_of(manifest, world)
    except BrrtError:  # start or goal is not free in this world
        return Contract()


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


def _params(
    given: tuple[Mapping[str, Any], Mapping[str, Any]],
    chosen: tuple[Mapping[str, float], Mapping[str, float]],
) -> Iterator[Row]:
    """Yield the planner's settings that differ; of automatic ones the values that it chose."""
    for name in dict.fromkeys([*given[0], *given[1]]):
        pairs = zip(given, chosen, strict=True)
        values = [auto.get(name, own.get(name)) for own, auto in pairs]
        if values[0] == values[1]:
            continue
        autos = [name in own and own[name] is None for own in given]
        alike = len({_auto(value) for value in values}) == 1
        digits = 17 if all(autos) and alike else 6
        yield Row(
            f"param {name}",
            *(_auto(v, digits) if auto else v for v, auto in zip(values, autos, strict=True)),
        )


def _auto(value: Any, digits: int = 6) -> str:
    return f"auto: {value:.{digits}g}" if isinstance(value, float) else "auto"


def _branches(a: Manifest, b: Manifest) -> Iterator[Row]:
    """Say from what each run branched; also what changed there, where it was not the same."""
    brief = [", ".join(turn.origin for turn in each.branches) or "none" for each in (a, b)]
    full = ["; ".join(origins_of(each)) or "none" for each in (a, b)]
    if _turns(a) != _turns(b):
        yield Row("branched from", *(brief if brief[0] != brief[1] else full))


def _turns(manifest: Manifest) -> list[Any]:
    """Return what decides a run whose settings changed on the way; names of files do not."""
    settings = planner_settings(manifest)[:-1] if manifest.branches else ()
    pairs = zip(manifest.branches, settings, strict=True)
    return [(branch.iteration, branch.seed, values) for branch, values in pairs]


def _robot(manifest: Manifest, world: World) -> dict[str, Any]:
    """Return the robot's definition, settled in its world."""
    text = manifest.robot or manifest.make_robot().resolved(world).to_json()
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
