"""Scenarios: which numbers they take, and which they refuse in one line."""

import json
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

from brrt import BrrtError, Run, Scenario
from brrt.planners import PLANNERS, make_planner
from brrt.robots import ROBOTS
from brrt.scenario.scenario import UNLIMITED
from brrt.settings import MOST, MOST_WHOLE


@pytest.mark.parametrize(
    "given",
    [
        {"seed": np.arange(3)[1]},
        {"iterations": np.int64(300), "draws": np.uint8(9), "shortcuts": np.int16(4)},
        {"time": np.float32(0.5), "max_move": np.float64(2.5), "deadline": np.int64(3)},
        {"smooth": np.bool_(False), "execute": np.bool_(True)},
        {"start": np.array([5.0, 5]), "goal": np.array([90, 90])},
        {"start": (np.float32(5), np.int64(5)), "world": np.str_("empty2d")},
        {"planner": "rrt-star", "params": {"step": np.float32(2.5), "informed": np.bool_(True)}},
        {"planner": "mine", "params": {"weights": np.array([1, 2]), "k": np.int64(3)}},
        {"params": None},
    ],
)
def test_numpy_numbers(given: dict[str, Any]) -> None:
    """Scalars and arrays of numpy are taken, as Python's own."""
    scenario = Scenario(**given)
    values = json.loads(json.dumps(scenario.as_dict()))
    assert Scenario.parse(values) == scenario
    if scenario.planner in PLANNERS:
        json.dumps(Run(scenario).manifest.to_strings())


def test_whole_numbers_of_toml(tmp_path: Path) -> None:
    """TOML writes 1e3 as a float."""
    path = tmp_path / "whole.toml"
    path.write_text("seed = 1e3\niterations = 1e5\nshortcuts = 1e2\n[params]\nslices = 1e1\n")
    scenario = Scenario.load(path)
    assert (scenario.seed, scenario.iterations, scenario.shortcuts) == (1000, 100_000, 100)
    assert make_planner(scenario).as_dict()["slices"] == 10


REFUSED: dict[str, dict[str, Any]] = {
    "seed must be a whole number, not 1.5": {"seed": 1.5},
    "seed must be a whole number, not nan": {"seed": float("nan")},
    "seed must be a whole number, not True": {"seed": np.bool_(True)},
    "iterations must be a whole number, not inf": {"iterations": float("inf")},
    "iterations must be at most": {"iterations": 1e30},
    "shortcuts must be at most": {"shortcuts": UNLIMITED + 1},
    "time must be above 0 seconds, not nan": {"time": np.float32("nan")},
    "time must be at most": {"time": 1e10},
    "deadline must be at most": {"deadline": 1e300},
    "max_move must be above 0, not -1": {"max_move": np.int8(-1)},
    "max_move must be at most": {"max_move": 10**400},
    "params must be a table": {"params": [1]},
    "start must be numbers": {"start": 7},
}


@pytest.mark.parametrize("message", REFUSED)
def test_numbers_that_are_refused(message: str) -> None:
    """One line says which number, and its limit."""
    with pytest.raises(BrrtError, match=message) as raised:
        Scenario(**REFUSED[message])
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("kind", [*PLANNERS, *(f"robot {name}" for name in ROBOTS)])
def test_every_parameter_has_bounds(kind: str) -> None:
    """Numbers that would overflow, or be 0 once squared, are refused; those at the bounds not."""
    settings = ROBOTS[kind.split()[1]] if kind.startswith("robot") else PLANNERS[kind]
    hints = get_type_hints(settings)
    for name, default in settings().as_dict().items():
        if isinstance(default, bool | str) or bool in get_args(hints[name]):
            continue
        for far in (1e151, -1e151, 10**400, -(10**200), "1e30000", float("nan")):
            with pytest.raises(BrrtError, match=f"^{name} must be ") as raised:
                settings.parse(kind, {name: far})
            assert len(str(raised.value)) < 200


def test_bounds_without_a_declaration() -> None:
    """The greatest and the least number are themselves allowed."""
    assert PLANNERS["lrta-star"].parse("", {"trials": MOST_WHOLE}).as_dict()["trials"] == MOST_WHOLE
    for step in (MOST, 1 / MOST):
        run = Run(Scenario(world="empty2d", params={"step": step}, iterations=5))
        assert run.record().result
    with pytest.raises(BrrtError, match="step must be at least 1e-150, not 1e-151"):
        PLANNERS["rrt"].parse("", {"step": 1e-151})
    with pytest.raises(BrrtError, match=r"trials must be at most 9,223,372,036,854,775,807, not"):
        PLANNERS["lrta-star"].parse("", {"trials": "18446744073709551616"})


@pytest.mark.parametrize("value", ["[" * 20_000 + "]" * 20_000, "{a=" * 5000 + "1" + "}" * 5000])
def test_nested_toml(value: str, tmp_path: Path) -> None:
    """Python's parser recurses; that is said in one line."""
    path = tmp_path / "deep.toml"
    path.write_text(f"params = {value}\n")
    with pytest.raises(BrrtError, match=r"deep\.toml: not a scenario: it is nested too deeply"):
        Scenario.load(path)
