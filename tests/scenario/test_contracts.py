"""Contracts: what planners state, what a manifest keeps of it, and who reads it."""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from brrt import (
    BranchedRun,
    BrrtError,
    Manifest,
    McapSink,
    Problem,
    Recording,
    Run,
    Scenario,
    World,
    read,
    verify,
)
from brrt.comparison.settings import settings_of
from brrt.events import Events
from brrt.planners import PLANNERS, make_planner, state_contract
from brrt.scenario import contracts
from brrt.scenario.contract import Contract, Draws, Growth, Lattice, Near, PlannerInfo
from brrt.scenario.contracts import changes_of, contract_of, contracts_of, planner_settings
from brrt.verification.result import RuleResult
from brrt.verification.rules import RULES
from tests.conftest import Result, findings_of, recorded, result_of
from tests.support import toys

GOLDEN = sorted((Path(__file__).parents[2] / "recordings").glob("*.mcap"))
SHORT = {name: 300 if name in ("a-star", "lrta-star") else 60 for name in PLANNERS}


def made(name: str, **more: Any) -> tuple[Run, Events]:
    """A short run of a planner."""
    iterations = SHORT.get(name, 60)
    given = {"world": "circles2d:n=8,seed=3", "seed": 3, "clock": "logical", **more}
    return recorded(Scenario(planner=name, iterations=iterations, **given))


def saved(run: Run, log: Events, path: Path, **changed: Any) -> Path:
    """Write a run with another manifest."""
    manifest = replace(run.manifest, **changed)
    sink = McapSink(path, manifest, run.problem.world)
    sink.write(log)
    sink.close(result_of(manifest, log))
    return path


def findings(rules: list[RuleResult]) -> list[tuple[str, int, int, list[str]]]:
    """What rules looked at and found, but for the one that asks the registered planner."""
    return [
        (each.rule, each.examined, each.broken, [found.message for found in each.findings])
        for each in rules
        if each.rule != "contract"
    ]


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_states_its_contract(name: str, tmp_path: Path) -> None:
    """It is in the file as the planner states it, with all settings and what it chose of them."""
    run, log = made(name)
    planner = make_planner(run.manifest.scenario)
    stated = read(saved(run, log, tmp_path / "run.mcap")).manifest.contract
    assert stated == run.manifest.contract == state_contract(planner, run.problem)
    assert stated is not None
    assert replace(stated, planner=PlannerInfo()) == planner.contract(run.problem)
    about = stated.planner
    assert about.registered
    assert about.default_iterations == planner.default_iterations
    assert about.settings == planner.as_dict()
    automatic = {name for name, value in about.settings.items() if value is None}
    assert about.chosen.keys() == automatic
    assert all(value > 0 for name, value in about.chosen.items() if name != "diagonals")
    assert set(about.fixed_params) <= set(about.settings)
    others = {about.bidirectional, about.first_path, about.continuous} - {None}
    assert others <= PLANNERS.keys() - {name}


def test_the_contract_names_what_views_and_advice_need() -> None:
    """The planner's alternatives, its greatest settings, and whether it learns or improves."""
    stated = {name: made(name)[0].manifest.contract or Contract() for name in PLANNERS}
    assert {name for name, each in stated.items() if each.learns} == {"lrta-star"}
    assert {name for name, each in stated.items() if each.improves} == {"rrt-star", "bi-rrt-star"}
    assert stated["rrt"].planner.bidirectional == "rrt-connect"
    assert stated["bi-rrt-star"].planner.first_path == "rrt-connect"
    assert stated["a-star"].planner.continuous == "rrt-connect"
    assert stated["lrta-star"].planner.greatest == {"lookahead": 10_000}
    assert [stated[name].cell for name in ("rrt", "a-star")] == [0.0, 0.5]


def test_contracts_of_branches(tmp_path: Path) -> None:
    """Each stretch keeps its own; of a recording without one, the planner states it."""
    parent, log = made("rrt")
    bare = replace(parent.manifest, contract=None)
    for manifest in (parent.manifest, bare):
        recording = Recording(manifest, parent.problem.world, lambda: [log])
        once = BranchedRun(recording, iteration=2, params={"step": 2.0}).record()
        run = BranchedRun(once, iteration=4, params={"goal_bias": 0.5})
        events = run.record().events()
        path = saved(run, events, tmp_path / f"{manifest.contract is None}.mcap")
        kept = read(path).manifest
        assert kept == run.manifest
        first, second, third = (each for each in kept.contracts if each is not None)
        assert first == parent.manifest.contract
        assert (second.step, third.step) == (2.0, 2.0)
        assert [each.draws and each.draws.goal_bias for each in (second, third)] == [0.05, 0.5]
        assert kept.ruling(3).contract == second
        assert changes_of(kept) == ("step 2, was auto", "goal_bias 0.5, was 0.05")
        assert findings_of(kept, run.problem.world, events) == []


def test_old_versions_read_a_branch() -> None:
    """Contracts stand beside the branches, in which older versions refuse unknown fields."""
    parent, log = made("rrt")
    run = BranchedRun(Recording(parent.manifest, parent.problem.world, lambda: [log]), iteration=2)
    texts = run.manifest.to_strings()
    (branch,) = json.loads(texts["branches"])
    assert branch.keys() == {"parent", "file", "iteration", "events", "scenario", "seed"}
    assert texts.pop("contract")
    assert texts.pop("branch_contracts")
    assert Manifest.from_strings(texts).contracts == (None, None)


FULL = Contract(
    step=2.0, line_of_sight=True, link=3.0, stops=False, near=Near(5.0, 2.0, 2),
    lattice=Lattice(0.5, False, 1.0, 3, ordered=True, trials=2), draws=Draws(0.1, True, 0.2, True),
    growth=Growth(4, "coin", True, "extend", True, True, False),
    planner=PlannerInfo(
        registered=True, default_iterations=5, bidirectional="a", first_path="b", continuous="c",
        settings={"step": None, "mode": "x", "on": True}, chosen={"step": 2.0},
        greatest={"step": 4}, fixed_params=("mode",),
    ),
)  # fmt: skip


@pytest.mark.parametrize("contract", [Contract(), FULL, replace(FULL, near=None)])
def test_round_trip(contract: Contract) -> None:
    """A contract is read as it was written; what equals the default is not written."""
    assert Contract.from_dict(json.loads(json.dumps(contract.as_dict()))) == contract
    assert Contract().as_dict() == {}


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ("[1]", "a contract must be an object, not"),
        ('{"stepp": 1}', "unknown parameter of a contract 'stepp'; did you mean 'step'"),
        ('{"step": "far"}', "step must be a number, not 'far'"),
        ('{"step": -1}', "step must be above 0, not -1"),
        ('{"stops": "maybe"}', "stops must be true or false, not 'maybe'"),
        ('{"near": {"gamma": 2}}', "longest must be a number, not None"),
        ('{"near": {"gamma": 2, "longest": 1, "dof": 0}}', "dof must be at least 1, not 0"),
        ('{"lattice": 5}', "lattice must be an object, not 5"),
        ('{"lattice": {"cell": 0}}', "cell must be above 0, not 0"),
        ('{"draws": {"goal_bias": 2}}', "goal_bias must be at most 1, not 2"),
        ('{"growth": {"turn": "often"}}', "unknown value of turn 'often'"),
        ('{"planner": {"settings": [1]}}', "settings must be a table of names and values"),
        ('{"planner": {"settings": {"a": [1]}}}', "settings a must be a finite number or a text"),
        ('{"planner": {"chosen": {"a": "b"}}}', "chosen a must be a finite number or a text"),
        ('{"planner": {"fixed_params": [1]}}', "fixed_params must be a list of names"),
        ('{"planner": {"first_path": 5}}', "first_path must be a text, not 5"),
        ('{"step": NaN}', "NaN is no number"),
        ("{", "the manifest is damaged"),
    ],
)
def test_damaged_contracts(stated: str, message: str) -> None:
    """They are refused in one line."""
    texts = made("rrt")[0].manifest.to_strings()
    for damaged in (
        {"contract": stated},
        {"branches": "[]", "branch_contracts": f"[{stated}]"},
    ):
        with pytest.raises(BrrtError, match=r"^the manifest is damaged: [^\n]*$") as refused:
            Manifest.from_strings({**texts, **damaged})
        assert "contract" not in damaged or message in str(refused.value)


def test_golden_recordings_state_none() -> None:
    """The registered planner does, in the tests of recordings made before contracts were."""
    assert GOLDEN
    for path in GOLDEN:
        recording = read(path)
        manifest, world = recording.manifest, recording.world
        assert manifest.contracts == (None,)
        planner = make_planner(manifest.scenario)
        settings = planner.as_dict()
        if planner.fixed_params:  # a lattice's, which were fixed by default in these recordings
            settings |= {"cell": 0.5, "max_move": 1.0}
            settings["diagonals"] = bool(settings["diagonals"])
        assert contract_of(manifest, world) == state_contract(
            planner, Problem.recorded(manifest, world)
        )
        assert planner_settings(manifest) == (settings,)
        assert contracts.contract_differences(manifest, world) is None


def test_settings_of_a_recording_without_a_contract() -> None:
    """They compare as those of one that has it."""
    run, _ = made("rrt-star")
    with_ = Recording(run.manifest, run.problem.world, list)
    without = replace(run.manifest, contract=None)
    assert list(settings_of(with_, replace(with_, manifest=without))) == []
    other = replace(without, scenario=replace(without.scenario, params={"step": 3.0}))
    rows = settings_of(with_, replace(with_, manifest=other))
    assert [row.name for row in rows] == ["param step"]


BLOCKED = """
import json, sys
for name in ("numba", "llvmlite", "brrt.kernels", "brrt.planners", "brrt.runs"):
    sys.modules[name] = None  # an import of it fails
from brrt import read, verify
from brrt.scenario.contracts import contract_of, planner_settings
all_found = []
for path in sys.argv[1:]:
    run = read(path)
    rules = [
        (each.rule, each.examined, each.broken, [found.message for found in each.findings])
        for each in verify(run).results
        if each.rule != "contract"
    ]
    contract = contract_of(run.manifest, run.world).as_dict()
    all_found.append([rules, contract, [dict(each) for each in planner_settings(run.manifest)]])
print(json.dumps(all_found))
"""


def test_verify_needs_no_planner(tmp_path: Path) -> None:
    """Where none can be imported, rules find in a recording with a contract what they find here."""
    paths = []
    for name in PLANNERS:
        run, log = made(name, execute=True)
        paths.append(saved(run, log, tmp_path / f"{name}.mcap"))
        wrong = replace(run.manifest.contract or Contract(), step=0.01, link=0.01, stops=None)
        paths.append(saved(run, log, tmp_path / f"{name}-wrong.mcap", contract=wrong))
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED, *map(str, paths), str(GOLDEN[0])],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    *found, golden = json.loads(done.stdout)
    for path, (rules, contract, known) in zip(paths, found, strict=True):
        kept = read(path)
        here = verify(kept).results
        assert rules == json.loads(json.dumps(findings(here)))
        assert Contract.from_dict(contract) == contract_of(kept.manifest, kept.world)
        assert known == list(planner_settings(kept.manifest))
    rules, contract, known = golden
    assert sum(broken for _, _, broken, _ in rules) == 0
    assert contract == {}
    assert known == [read(GOLDEN[0]).manifest.scenario.params]


@pytest.mark.parametrize("changed", [{"stops": None}, {"growth": None}, {"draws": Draws()}])
def test_a_forged_contract_is_found(
    changed: dict[str, Any], brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """It would keep rules from judging; of another version the difference is noted."""
    run, log = made("rrt")
    forged = replace(run.manifest.contract or Contract(), **changed)
    (name,) = changed
    path = saved(run, log, tmp_path / "forged.mcap", contract=forged)
    found = verify(read(path)).findings
    assert {each.rule for each in found} == {"contract"}
    assert found[0].message.startswith(name)
    done = brrt("verify", path)
    assert done.code == 1
    assert "BROKEN" in done.out
    older = {**run.manifest.made_by, "brrt": "0.0.1"}
    saved(run, log, path, contract=forged, made_by=older)
    assert verify(read(path)).holds
    done = brrt("verify", path)
    assert done.code == 0
    assert f"the contract is that of brrt 0.0.1: {name}" in done.err


class Bounded(toys.Pair):
    """A toy that promises shorter edges than it makes."""

    def contract(self, query: Any) -> Contract:
        """Half of the step."""
        return replace(super().contract(query), step=toys.STEP / 2)


class Mistaken(toys.Pair):
    """A toy that returns something else."""

    def contract(self, query: Any) -> Any:
        """No contract."""
        return {"step": toys.STEP}


def test_a_foreign_planner_is_verified_by_its_contract(
    brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """The one that it states, which the recording keeps."""
    scenario = Scenario(
        world="circles2d:n=12,seed=3", planner="theirs", params={"zeal": 7}, seed=3, iterations=60
    )
    for number, (planner, broken) in enumerate(((toys.Pair(), 0), (Bounded(), 1))):
        run = Run(scenario, planner=planner)
        recording = run.record()
        path = saved(run, recording.events(), tmp_path / f"{number}.mcap")
        assert planner_settings(read(path).manifest) == ({"zeal": 7},)
        done = brrt("verify", path, "--json")
        assert done.code == broken
        assert done.json["planner_known"] is True
        rules = {rule["rule"]: rule["broken"] for rule in done.json["rules"]}
        assert {name for name, count in rules.items() if count} == {"edge lengths"} - {
            "edge lengths" if not broken else ""
        }
    with pytest.raises(BrrtError, match=r"contract\(\) of a planner must return a brrt.Contract"):
        Run(scenario, planner=Mistaken())


def test_a_rule_reads_the_stretch_that_it_judges() -> None:
    """`contracts_of` has one contract for each stretch."""
    parent, log = made("rrt")
    run = BranchedRun(
        Recording(parent.manifest, parent.problem.world, lambda: [log]), iteration=2, seed=4
    )
    assert len(contracts_of(run.manifest, run.problem.world)) == 2
    assert any(rule.name == "contract" for rule in RULES)


def test_parameters_are_checked_by_the_planning_wing(
    brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """Before anything is written, wherever they come from; a scenario alone takes any."""
    wrong = Scenario.parse({"planner": "rrt", "params": {"step": "far"}})
    with pytest.raises(BrrtError, match=r"^step must be a number, not 'far'$"):
        Run(wrong)
    with pytest.raises(BrrtError, match=r"^unknown parameter of planner rrt 'spet'; did you mean"):
        Run(Scenario(params={"spet": 1}))
    assert Run(Scenario(params={"step": "2"})).manifest.scenario.params == {"step": 2.0}
    file = tmp_path / "mine.toml"
    file.write_text('[params]\nstep = "far"\n')
    for given, message in (
        (["--param", "step=far"], "step must be a number, not 'far'"),
        ([file], f"{file}: step must be a number, not 'far'"),
    ):
        done = brrt("plan", *given)
        assert (done.code, done.out) == (2, "")
        assert message in " ".join(done.err.split())
        assert len(done.err.strip().splitlines()) == 1 or str(file) in done.err
    assert not list(tmp_path.glob("*.mcap"))


def test_damaged_parameters_of_a_recording(tmp_path: Path) -> None:
    """They matter where the registered planner is asked."""
    run, _ = made("rrt")
    wrong = replace(run.manifest.scenario, params={"step": "far"})
    manifest = replace(run.manifest, scenario=wrong, contract=None)
    world: World = run.problem.world
    for ask in (lambda: contracts_of(manifest, world), lambda: planner_settings(manifest)):
        with pytest.raises(BrrtError, match=r"^the manifest is damaged: step must be a number"):
            ask()
