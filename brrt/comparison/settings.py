"""The settings that differ between two runs, and other metadata that does."""

import json
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from brrt.errors import BrrtError
from brrt.recording import Recording
from brrt.scenario.contract import Contract
from brrt.scenario.contracts import contract_of, origins_of, planner_settings
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import UNLIMITED
from brrt.worlds.world import World

_PLAIN = ("planner", "seed", "draws", "time", "smooth", "shortcuts", "execute", "max_move",
          "deadline")  # fmt: skip


class Row(NamedTuple):
    """A named value that differs between two runs; None for a run that does not have it."""

    name: str
    a: Any
    b: Any


def settings_of(a: Recording, b: Recording) -> Iterator[Row]:
    """Yield the settings that differ: everything that decides what a run does.

    Names of files and the clock are not among them.
    """
    both = a.manifest, b.manifest
    ours, theirs = (manifest.scenario for manifest in both)
    for name in _PLAIN:
        yield from _row(name, getattr(ours, name), getattr(theirs, name))
    contracts = _contract(a), _contract(b)
    limits = (
        manifest.scenario.iteration_limit(contract.planner.default_iterations)
        for manifest, contract in zip(both, contracts, strict=True)
    )
    yield from _row("iterations", *("no limit" if n >= UNLIMITED else n for n in limits))
    yield from _branches(*both)
    robots, worlds = list(differing("robot", _robot(a), _robot(b))), list(_worlds(a.world, b.world))
    settings = planner_settings(both[0])[-1], planner_settings(both[1])[-1]
    if ours.planner != theirs.planner or settings[0] != settings[1] or robots or worlds:
        yield from _params(settings, (contracts[0].planner.chosen, contracts[1].planner.chosen))
    yield from robots
    for name in ("start", "goal"):
        yield from _row(name, *(list(getattr(manifest, name)) for manifest in both))
    yield from worlds


def metadata_of(a: Manifest, b: Manifest) -> Iterator[Row]:
    """Yield what differs but does not decide what a run does.

    Names, the clock, claims, versions, the platform.
    """
    for name in ("world", "robot", "clock"):
        yield from _row(name, getattr(a.scenario, name), getattr(b.scenario, name))
    yield from differing("claims", a.claims.as_dict(), b.claims.as_dict())
    yield from differing("", a.made_by, b.made_by)


def differing(prefix: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[Row]:
    """Yield the entries that differ between two tables, with a prefix before each name."""
    for name in dict.fromkeys([*a, *b]):
        yield from _row(f"{prefix} {name}".strip(), a.get(name), b.get(name))


def _contract(run: Recording) -> Contract:
    try:
        return contract_of(run.manifest, run.world)
    except BrrtError:  # start or goal is not free in this world
        return Contract()


def _row(name: str, a: Any, b: Any) -> Iterator[Row]:
    if a != b:
        yield Row(name, a, b)


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
        digits = 17 if all(autos) and len(set(map(_auto, values))) == 1 else 6
        shown = (_auto(v, digits) if auto else v for v, auto in zip(values, autos, strict=True))
        yield Row(f"param {name}", *shown)


def _auto(value: Any, digits: int = 6) -> str:
    return f"auto: {value:.{digits}g}" if isinstance(value, float) else "auto"


def _branches(a: Manifest, b: Manifest) -> Iterator[Row]:
    """Yield from where each run branched; with the changes there if the places are equal."""
    if _changes(a) == _changes(b):
        return
    brief = [", ".join(branch.origin for branch in each.branches) or "none" for each in (a, b)]
    full = ["; ".join(origins_of(each)) or "none" for each in (a, b)]
    yield Row("branched from", *(brief if brief[0] != brief[1] else full))


def _changes(manifest: Manifest) -> list[Any]:
    """Return what a run's branches change, without names of files."""
    settings = planner_settings(manifest)[:-1] if manifest.branches else ()
    pairs = zip(manifest.branches, settings, strict=True)
    return [(branch.iteration, branch.seed, values) for branch, values in pairs]


def _robot(run: Recording) -> dict[str, Any]:
    """Return the robot's definition, resolved in its world."""
    text = run.manifest.robot or run.robot().to_json()
    return {k: v for k, v in json.loads(text).items() if k not in ("schema", "version", "name")}


def _worlds(a: World, b: World) -> Iterator[Row]:
    """Yield how the contents of two worlds differ."""
    for name in ("lower", "upper"):
        yield from _row(f"world {name}", getattr(a, name).tolist(), getattr(b, name).tolist())
    for name in ("balls", "boxes", "polygons"):
        ours, theirs = getattr(a, name), getattr(b, name)
        if len(ours) != len(theirs):
            yield Row(f"world {name}", len(ours), len(theirs))
            continue
        if isinstance(ours, np.ndarray) and ours.shape == theirs.shape:  # there may be millions
            unlike = int((ours != theirs).any(axis=1).sum())
        else:
            unlike = sum(not np.array_equal(p, q) for p, q in zip(ours, theirs, strict=True))
        if unlike:
            yield Row(f"world {name}", len(ours), f"{unlike} of them differ")
    grids = [None if world.grid is None else world.grid.as_json() for world in (a, b)]
    if grids[0] != grids[1]:
        yield Row("world grid", *(_grid(world) for world in (a, b)))


def _grid(world: World) -> str | None:
    if world.grid is None:
        return None
    cells = world.grid.cells
    return f"{cells.shape[0]} x {cells.shape[1]} cells, {int((cells != 0).sum()):,} blocked"
