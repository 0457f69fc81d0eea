"""Recordings keep the settings that their planner had, whatever is the default today."""

from dataclasses import replace
from importlib.metadata import version
from typing import Any

import pytest

from brrt import BrrtError, Recording, Run, Scenario, reproduce, verify
from brrt.planners import make_planner, state_contract
from brrt.runs.branch import BranchedRun
from brrt.scenario.contract import Contract
from brrt.scenario.contracts import (
    as_planned,
    changes_of,
    contract_differences,
    contract_of,
    planner_settings,
)
from brrt.scenario.manifest import Manifest

DENSE = Scenario(
    world="circles2d:n=200,seed=1", planner="rrt-star", iterations=400, seed=3, smooth=False
)
STARS = ("rrt-star", "bi-rrt-star")


def former(planner: str, *, stated: bool) -> Recording:
    """Record with a step of 20 % of the world, which was the default; with its contract or none."""
    run = Run(replace(DENSE, planner=planner, params={"step": 20.0}))
    recording = run.record()
    scenario = replace(run.manifest.scenario, params={})
    contract = state_contract(make_planner(run.manifest.scenario), run.problem)
    assert contract is not None
    about = contract.planner
    chosen = {"step": 20.0, **about.chosen}
    settings = {**about.settings, "step": None}
    contract = replace(contract, planner=replace(about, settings=settings, chosen=chosen))
    manifest = replace(
        recording.manifest,
        scenario=scenario,
        contract=contract if stated else None,
        made_by={**recording.manifest.made_by, "brrt": "0.0.9"},
    )
    return replace(recording, manifest=manifest)


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("planner", STARS)
def test_a_step_that_is_not_the_default_today(planner: str, *, stated: bool) -> None:
    """Such a recording is planned again and judged by its own step."""
    recording = former(planner, stated=stated)
    today = Run(recording.manifest.scenario).manifest.contract or Contract()
    assert today.step is not None
    assert today.step < 15
    assert reproduce(recording).equal
    assert verify(recording).holds
    assert contract_of(recording.manifest, recording.world).step == 20
    about = contract_of(recording.manifest, recording.world).planner
    assert (about.settings["step"], about.chosen["step"]) == (None, 20.0)
    differences = contract_differences(recording.manifest, recording.world) or []
    assert any(each.startswith("step is 20.0") for each in differences) is stated


@pytest.mark.parametrize("planner", STARS)
def test_another_default_of_the_same_version(planner: str) -> None:
    """Such a contract is not that of the registered planner, which verify finds."""
    recording = former(planner, stated=True)
    made_by = {**recording.manifest.made_by, "brrt": version("brrt")}
    recording = replace(recording, manifest=replace(recording.manifest, made_by=made_by))
    found = [each.message for each in verify(recording).findings if each.rule == "contract"]
    assert any(message.startswith("step is 20.0 in the contract") for message in found)


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("planner", STARS)
def test_its_branches(planner: str, *, stated: bool) -> None:
    """They keep the step unless they change it, and links as long as the step follow it."""
    recording = former(planner, stated=stated)
    for params, step in (({"gamma": 30.0}, 20.0), ({"step": 7.0}, 7.0), ({}, 20.0)):
        settings: dict[str, Any] = {"iterations": 600}
        run = BranchedRun(recording, iteration=300, params=params, settings=settings)
        branched = run.record()
        contract = branched.manifest.contract or Contract()
        assert contract.step == step
        assert contract.link in (None, step)
        assert "step" not in changes_of(branched.manifest)[0] or params == {"step": 7.0}
        assert reproduce(branched).equal
        assert verify(branched).holds
        again = BranchedRun(branched, iteration=500, params={"informed": True}).record()
        assert (again.manifest.contract or Contract()).step == step
        assert reproduce(again).equal


@pytest.mark.parametrize("planner", ["a-star", "lrta-star"])
def test_cells_that_are_not_the_default_today(planner: str) -> None:
    """A recording without a contract had cells of 0.5, faces alone, and moves of 1 to the goal."""
    former_defaults = {"cell": 0.5, "diagonals": False, "max_move": 1.0}
    scenario = Scenario(world="empty2d:size=3", planner=planner, start=(1, 1), goal=(2.2, 2.9))
    run = Run(replace(scenario, params=former_defaults))
    recording = run.record()
    manifest = replace(recording.manifest, scenario=scenario, contract=None)
    recording = replace(recording, manifest=manifest)
    assert (Run(scenario).manifest.contract or Contract()).cell == pytest.approx(0.15)
    made, known = run.manifest.contract or Contract(), contract_of(manifest, recording.world)
    assert known.lattice == made.lattice
    assert known.planner.chosen == former_defaults
    assert planner_settings(manifest)[0].items() >= former_defaults.items()
    assert reproduce(recording).equal
    assert verify(recording).holds


@pytest.mark.parametrize("planner", ["a-star", "lrta-star"])
def test_the_former_name_of_cells(planner: str) -> None:
    """Settings and contracts that name them `epsilon` are read as those that name them `cell`."""
    run = Run(Scenario(planner=planner, params={"epsilon": 2.0}, iterations=50))
    assert run.manifest.scenario.params == {"cell": 2.0}
    texts = run.manifest.to_strings()
    assert "epsilon" not in str(texts)
    texts = {name: text.replace('"cell"', '"epsilon"') for name, text in texts.items()}
    assert Manifest.from_strings(texts) == run.manifest
    with pytest.raises(BrrtError, match="epsilon is the former name of cell; give only cell"):
        Scenario(planner=planner, params={"epsilon": 2.0, "cell": 1.0})
    assert Scenario(planner="another", params={"epsilon": 2.0}).params == {"epsilon": 2.0}


def test_given_settings_stay() -> None:
    """What is given is used, None means automatic, and nothing is added to the manifest."""
    recording = former("rrt-star", stated=True)
    manifest, world = recording.manifest, recording.world
    given = replace(manifest.scenario, params={"gamma": 12.0, "step": None})
    (used,) = as_planned(replace(manifest, scenario=given), world)
    assert (used.params["gamma"], used.params["step"]) == (12.0, 20.0)
    assert used.params["goal_bias"] == 0.05
    assert manifest.scenario.params == {}
