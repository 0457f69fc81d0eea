"""Planners: one file and one line here adds one."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from brrt.errors import BrrtError, unknown
from brrt.planners.a_star import AStar
from brrt.planners.base.planner import Planner, StatesContract
from brrt.planners.base.stop import Stop
from brrt.planners.bi_rrt import BiRRT
from brrt.planners.bi_rrt_star import BiRRTStar
from brrt.planners.lrta_star import LRTAStar
from brrt.planners.rrt import RRT
from brrt.planners.rrt_connect import RRTConnect
from brrt.planners.rrt_star import RRTStar
from brrt.registry import Registry
from brrt.scenario.contract import Contract, PlannerInfo
from brrt.scenario.query import Query
from brrt.scenario.scenario import Scenario

PLANNERS: Registry[type[Planner]] = Registry(
    {
        "rrt": "brrt.planners.rrt:RRT",
        "rrt-connect": "brrt.planners.rrt_connect:RRTConnect",
        "bi-rrt": "brrt.planners.bi_rrt:BiRRT",
        "rrt-star": "brrt.planners.rrt_star:RRTStar",
        "bi-rrt-star": "brrt.planners.bi_rrt_star:BiRRTStar",
        "lrta-star": "brrt.planners.lrta_star:LRTAStar",
        "a-star": "brrt.planners.a_star:AStar",
    },
    group="brrt.planners",
    base="brrt.planners.base.planner:Planner",
)


def make_planner(scenario: Scenario) -> Planner:
    """Make a scenario's planner with its settings.

    Raises:
        BrrtError: No planner has this name, or a parameter is unknown or out of range.
    """
    name = scenario.planner
    if name not in PLANNERS:
        raise unknown("planner", name, PLANNERS)
    return PLANNERS[name].parse(f"planner {name}", scenario.params)


def check_params(scenario: Scenario) -> Scenario:
    """Return the scenario with its parameters in the types of the planner's settings.

    Parameters of a planner that is not registered stay as they are.

    Raises:
        BrrtError: A parameter is unknown or out of range.
    """
    if scenario.planner not in PLANNERS:
        return scenario
    settings = make_planner(scenario).as_dict()
    return replace(scenario, params={name: settings[name] for name in scenario.params})


def load_scenario(path: Path) -> Scenario:
    """Read a scenario from a TOML file and check its parameters.

    Raises:
        BrrtError: The file cannot be read or is not a scenario, or a parameter is wrong.
    """
    scenario = Scenario.load(path)
    try:
        return check_params(scenario)
    except BrrtError as error:
        raise BrrtError(f"{path}: {error}") from None


def state_contract(planner: Any, query: Query, given: Planner | None = None) -> Contract | None:
    """Return a planner's contract, with its settings; None for an object that states none.

    Args:
        planner: The planner.
        query: What it solves.
        given: The planner with only the given settings, where the others are those of a
            recording: what it leaves automatic counts as chosen.

    Raises:
        BrrtError: What the planner's method `contract` returns is not a contract.
    """
    if not isinstance(planner, StatesContract):
        return None
    contract: Any = planner.contract(query)
    if not isinstance(contract, Contract):
        kind = type(contract).__name__
        raise BrrtError(f"contract() of a planner must return a brrt.Contract, not {kind}")
    if not isinstance(planner, Planner):
        return contract
    settings, near = planner.as_dict(), contract.near
    automatic = [] if given is None else [k for k, v in given.as_dict().items() if v is None]
    recorded = {name: settings[name] for name in automatic if settings[name] is not None}
    settings |= dict.fromkeys(automatic)
    lengths = {
        "step": contract.step,
        "gamma": None if near is None else near.gamma,
        "connect_distance": contract.link,
    }
    if contract.lattice is not None:
        lattice = contract.lattice.as_dict()
        lengths |= {name: lattice[name] for name in ("cell", "diagonals", "max_move")}
    about = PlannerInfo(
        registered=PLANNERS.has_imported(type(planner)),
        default_iterations=planner.default_iterations,
        bidirectional=planner.bidirectional,
        first_path=planner.first_path,
        continuous=planner.continuous,
        settings=settings,
        chosen=recorded
        | {k: v for k, v in lengths.items() if v is not None and settings.get(k, 0) is None},
        greatest=planner.greatest_values(),
        fixed_params=planner.fixed_params,
    )
    return replace(contract, planner=about)


def make_stop(scenario: Scenario) -> Stop:
    """Make a scenario's budget."""
    planner = PLANNERS.get(scenario.planner, Planner)
    limit = scenario.iteration_limit(planner.default_iterations)
    return Stop(iterations=limit, draws=scenario.draws, time_s=scenario.time)


__all__ = [
    "PLANNERS",
    "RRT",
    "AStar",
    "BiRRT",
    "BiRRTStar",
    "Contract",
    "LRTAStar",
    "Planner",
    "RRTConnect",
    "RRTStar",
    "check_params",
    "load_scenario",
    "make_planner",
    "make_stop",
    "state_contract",
]
