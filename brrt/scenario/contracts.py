"""The contracts and settings of a recorded run, with the registered planner where it states none.

Recordings made before contracts were written, and those of other tools, state none; the planner
registered under their name does. This is the only place where the reading wing reaches planners:
by name, because an import statement would bring numba into it. Where planners cannot be imported,
such a recording has no contract. Only brrt's own planners are asked, and never a plug-in's: its
recordings state their contract, and a name in a file must not import somebody's code.
"""

import importlib
import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

from brrt.errors import BrrtError
from brrt.scenario.contract import Contract
from brrt.scenario.manifest import Manifest
from brrt.scenario.query import Query
from brrt.scenario.scenario import Scenario
from brrt.worlds.world import World

_FORMER_STEP: Mapping[str, float] = {"rrt-star": 0.2, "bi-rrt-star": 0.2}
"""Default step, as a part of the world's longest side, of recordings that state no contract."""

_FORMER_SETTINGS: Mapping[str, Mapping[str, Any]] = {
    planner: {"cell": 0.5, "diagonals": False, "max_move": 1.0}
    for planner in ("a-star", "lrta-star")
}
"""Defaults of recordings that state no contract, where today's depend on the world."""


def as_planned(manifest: Manifest, world: World) -> tuple[Scenario, ...]:
    """Return the scenario of each of a run's `stretches` with the settings that were in use.

    A manifest keeps only the given parameters. The others are those of the contract, or, of a
    recording that states none, the defaults of its time; today's may differ.
    """
    pairs = zip(manifest.stretches, manifest.contracts, strict=True)
    return tuple(_as_planned(scenario, contract, world) for (_, scenario), contract in pairs)


def _as_planned(scenario: Scenario, contract: Contract | None, world: World) -> Scenario:
    if contract is None:
        used = dict(_FORMER_SETTINGS.get(scenario.planner, {}))
        if scenario.planner in _FORMER_STEP:
            used["step"] = _FORMER_STEP[scenario.planner] * world.extent
    else:
        used = {**contract.planner.settings, **contract.planner.chosen}
    if used.get("connect_distance") == used.get("step"):
        used.pop("connect_distance", None)  # it follows the step, which a branch may change
    used |= {name: value for name, value in scenario.params.items() if value is not None}
    return replace(scenario, params=used)


def contracts_of(manifest: Manifest, world: World) -> tuple[Contract | None, ...]:
    """Return the contract of each of a run's `stretches`; None where there is none.

    Raises:
        BrrtError: A contract is needed that the manifest does not state, and the manifest's query
            is not free in the world or a parameter is wrong.
    """
    if None not in manifest.contracts:
        return manifest.contracts
    known = registered_contracts(manifest, world)
    pairs = zip(manifest.contracts, known, strict=True)
    return tuple(own if stated is None else stated for stated, own in pairs)


def contract_of(manifest: Manifest, world: World) -> Contract:
    """Return the contract that a run ended with, an empty one if there is none."""
    return contracts_of(manifest, world)[-1] or Contract()


def registered_contracts(manifest: Manifest, world: World) -> tuple[Contract | None, ...]:
    """Return what the registered planner states for each of a run's `stretches`.

    By its own defaults for a run that states a contract, so that another default shows; as planned
    for one that states none, and for branches, which keep the settings of a run that another
    version may have made. None where no planner of that name is registered, or planners cannot be
    imported.

    Raises:
        BrrtError: The manifest's query is not free in the world, or a parameter is wrong.
    """
    given = [_registered(scenario) for _, scenario in manifest.stretches]
    if None in given:
        return (None,) * len(given)
    query = Query.recorded(manifest, world)
    used = given
    if manifest.contract is None or manifest.branches:
        used = [_registered(scenario) for scenario in as_planned(manifest, world)]
    return tuple(
        _planners().state_contract(planner, query, own)
        for planner, own in zip(used, given, strict=True)
    )


def contract_differences(manifest: Manifest, world: World) -> list[str] | None:
    """Say where stated contracts and claims differ from those of the registered planner.

    A foreign planner may have a registered one's name and any claims; its contract does not say
    that it is registered.

    Returns:
        A sentence for each difference; None where there are no two contracts to compare.

    Raises:
        BrrtError: The manifest's query is not free in the world, or a parameter is wrong.
    """
    if not any(manifest.contracts):
        return None
    pairs = zip(manifest.contracts, registered_contracts(manifest, world), strict=True)
    known = [(stated, own) for stated, own in pairs if stated is not None and own is not None]
    found = [
        f"{name} is {ours[name]} in the contract; the registered planner states {theirs[name]}"
        for ours, theirs in ([_promises(contract) for contract in pair] for pair in known)
        for name in ours.keys() | theirs.keys()
        if not _equal(ours[name], theirs[name])
    ]
    if any(stated.planner.registered for stated, _ in known):
        found += [
            f"the recording claims {name}: {value}; the registered planner claims nothing"
            for name, value in manifest.claims.stated().items()
        ]
    return sorted(found) if known else None


def _promises(contract: Contract) -> defaultdict[str, Any]:
    """Return what rules judge by, by name."""
    parts = asdict(contract)
    about = parts.pop("planner")
    parts |= {"settings": about["settings"], "default_iterations": about["default_iterations"]}
    found: defaultdict[str, Any] = defaultdict(lambda: None)
    for name, value in parts.items():
        nested = value if isinstance(value, dict) else {"": value}
        found |= {f"{name} {field}".strip(): number for field, number in nested.items()}
    return found


def _equal(a: Any, b: Any) -> bool:
    """Whether values are equal; numbers may be rounded."""
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=1e-9)
    return bool(a == b)


def planner_settings(manifest: Manifest) -> tuple[Mapping[str, Any], ...]:
    """Return all settings of the planner in each of a run's `stretches`, None for automatic ones.

    Where those of one stretch are not known, the given parameters are returned for all.

    Raises:
        BrrtError: A parameter is wrong.
    """
    found: list[Mapping[str, Any]] = []
    for (_, scenario), contract in zip(manifest.stretches, manifest.contracts, strict=True):
        planner = _registered(scenario) if contract is None else None
        if contract is not None:
            found.append(contract.planner.settings or scenario.params)
        elif planner is not None:
            former = _FORMER_SETTINGS.get(scenario.planner, {})
            found.append({**planner.as_dict(), **former, **scenario.params})
        else:
            return tuple(scenario.params for _, scenario in manifest.stretches)
    return tuple(found)


def changes_of(manifest: Manifest) -> tuple[str, ...]:
    """Return what changed at each branch of a run, in words."""
    if not manifest.branches:
        return ()
    scenarios = [scenario for _, scenario in manifest.stretches]
    rows = [
        {**scenario.as_dict(), **settings}
        for scenario, settings in zip(scenarios, planner_settings(manifest), strict=True)
    ]
    found = []
    for branch, (before, now) in zip(manifest.branches, pairwise(rows), strict=True):
        names = now.keys() - {"params", "seed", "start", "goal", "draws"}
        changed = [name for name in sorted(names) if now[name] != before.get(name)]
        parts = [f"{name} {_text(now[name])}, was {_text(before.get(name))}" for name in changed]
        parts += [] if branch.seed is None else [f"draws from seed {branch.seed}"]
        found.append("; ".join(parts) or "all as before")
    return tuple(found)


def origins_of(manifest: Manifest) -> tuple[str, ...]:
    """Return for each branch of a run what it continues, from where, and what changed there."""
    pairs = zip(manifest.branches, changes_of(manifest), strict=True)
    return tuple(f"{branch.origin}: {change}" for branch, change in pairs)


def _text(value: Any) -> str:
    """Write a setting; None stands for one that the planner chooses."""
    if isinstance(value, bool):
        return str(value).lower()
    return "auto" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def _planners() -> Any:
    """Return the package of the planners; None where it cannot be imported."""
    try:
        return importlib.import_module("brrt.planners")
    except ImportError:
        return None


def _registered(scenario: Scenario) -> Any:
    """Return brrt's own planner with a scenario's settings; None where there is none."""
    planners = _planners()
    if planners is None or scenario.planner not in planners.PLANNERS.own:
        return None
    try:
        return planners.make_planner(scenario)
    except BrrtError as error:
        raise BrrtError(f"the manifest is damaged: {error}") from None
