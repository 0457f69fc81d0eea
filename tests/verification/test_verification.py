"""`verify` as a whole: clean runs, what cannot be judged, and rules that never fail."""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Contract, Events, Kind, McapSink, Memory, Recording, Run, Scenario, verify
from brrt.events import Stage
from brrt.verification import verification
from brrt.verification.rules import RULES
from tests.conftest import Result, result_of
from tests.support import scenarios
from tests.support.cases import BODIES, PLANNERS, SHORT, Case, body, planned, run_of, short
from tests.support.doctoring import doctors
from tests.support.toys import TOYS


@pytest.mark.parametrize("name", [*PLANNERS, *TOYS])
def test_clean_runs_have_no_findings(name: str) -> None:
    """Of registered planners and of planners from outside."""
    assert planned(name).broken() == set()


@pytest.mark.parametrize("name", BODIES)
def test_clean_runs_of_bodies_have_no_findings(name: str) -> None:
    """And there is something to judge: edges, rejections, a path."""
    case = body(name)
    assert case.broken() == set()
    assert all(len(case.log[kind]) > 2 for kind in (Kind.EDGE, Kind.REJECT))
    assert len(case.log[Kind.PATH])


@pytest.mark.parametrize("name", list(TOYS))
@pytest.mark.parametrize("seed", range(4))
def test_toys_have_no_findings(name: str, seed: int) -> None:
    """In other worlds, by other seeds, with and without a contract."""
    n, memory = 0 if name == "march" else 12, Memory()
    scenario = Scenario(
        world=f"{'boxes2d' if seed % 2 else 'circles2d'}:n={n},seed={seed}",
        planner=f"toy-{name}", seed=seed, iterations=60, smooth=name != "march",
    )  # fmt: skip
    run = Run(scenario, planner=TOYS[name])
    run.execute([memory])
    contract = TOYS[name].contract(run.problem)
    case = Case(run.manifest, run.problem.world, memory.events(), contract)
    assert case.broken() == set()
    unstated = replace(case.manifest, contract=None)
    assert replace(case, manifest=unstated, contract=None).broken() == set()


@pytest.mark.slow
@settings(max_examples=50, deadline=None)  # benchmarks/soak.py judges thousands
@given(
    seed=st.integers(0, 2**32),
    planner=st.sampled_from(scenarios.PLANNERS),
    robot=st.sampled_from(["polygon", "chain 3"]),
    solid=st.booleans(),
)
def test_contracts_hold(
    seed: int, planner: str, robot: str, solid: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Whatever world, robot, seed and settings, also if the log is cut."""
    point = ("point 2D", "point 3D")[seed % 2]
    robot = robot if solid and planner in scenarios.TREES else point
    scenario = scenarios.draw(seed, tmp_path_factory.getbasetemp(), planner, robot)
    memory, run = Memory(), Run(scenario)
    run.execute([memory])
    log = memory.events()
    case = Case(run.manifest, run.problem.world, log)
    assert verify(case.recording()).findings == [], scenarios.command(scenario)
    for part in (log.until(seq=seed % len(log)), log.until(seq=-1)):
        cut = replace(replace(case, log=part).recording(), result=None)
        assert verify(cut).findings == [], scenarios.command(scenario)


def test_windows_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the windows end, the results are the same."""
    monkeypatch.setattr(verification, "_WINDOW", 1)
    smaller = run_of(planner="bi-rrt", params={"turn": "smaller", "step": 4}, seed=3)
    coin = run_of(planner="bi-rrt", params={"turn": "coin", "step": 2}, seed=3)
    for case in (smaller, coin, planned("bi-rrt-star"), planned("rrt")):
        assert case.broken() == set()
        size, tables = len(case.log) // 25, case.log.tables
        windows = [
            Events(2, {kind: t[t["seq"] // size == n] for kind, t in tables.items()})
            for n in range(len(case.log) // size + 1)
        ]
        recording = case.recording()
        parts = replace(recording, batches=partial(iter, windows))
        assert verify(parts) == verify(recording)


def test_every_rule_has_a_recording_that_breaks_it() -> None:
    """And a promise that is a sentence."""
    modules = {rule.__module__.rpartition(".")[::2] for rule in RULES}
    tests = [import_module(f"tests.{package[5:]}.test_{name}") for package, name in sorted(modules)]
    assert {rule.name for rule in RULES} == {rule for test in tests for rule, *_ in test.DOCTORED}
    assert all(rule.promise.endswith(".") for rule in RULES)


def reasons(case: Case) -> dict[str, list[str]]:
    """What could not be judged, and why."""
    return dict(verify(case.recording(), contract=case.contract).not_judged)


@pytest.mark.parametrize(
    "name", ["rrt", "rrt-star", "bi-rrt", "bi-rrt-star", "lrta-star", "a-star"]
)
def test_whole_recordings_are_judged_in_whole(name: str) -> None:
    """Rules without anything to judge, such as those on links of one tree, are no gap."""
    assert reasons(planned(name)) == {}


def test_what_cannot_be_judged_is_said() -> None:
    """A recording without edges, samples or a contract does not read as if all rules held."""
    rrt = planned("rrt")
    silent = {"steering", "sources", "goal draws", "uniform draws", "turns", "extensions"}
    assert silent <= set(reasons(rrt.without(Kind.SAMPLE))["no samples"])
    trees = {"nodes", "edge costs", "edges free", "paths in trees", "edge lengths"}
    found = reasons(rrt.without(Kind.SAMPLE, Kind.EDGE))
    assert trees <= set(found["no edges"])
    unknown = replace(rrt, manifest=replace(rrt.manifest, contract=None)).with_scenario(
        planner="another"
    )
    ((reason, names),) = reasons(unknown).items()
    assert reason == "the recording states no contract and planner another is not registered"
    assert {"steering", "endings", "best first"} <= set(names)
    bare = reasons(unknown.without(Kind.SAMPLE, Kind.EDGE, Kind.REJECT))
    assert trees - {"paths in trees", "edge lengths"} <= set(bare["no edges"])
    assert "samples" in bare["no samples"]
    assert "proves nothing of a tree" not in str(verify(rrt.recording()))
    for case in (rrt.without(Kind.EDGE), unknown.without(Kind.SAMPLE, Kind.EDGE, Kind.REJECT)):
        text = str(verify(case.recording()))
        assert text.endswith("judged; without edges the log proves nothing of a tree")
    cells = planned("a-star").without(Kind.EXPAND)
    assert "best first" in reasons(cells)["no expanded cells"]
    assert "no edges" not in reasons(cells)


def test_the_end_of_a_cut_recording_is_not_judged() -> None:
    """Neither held against it nor taken as kept."""
    case = planned("rrt")
    cut = Recording(case.manifest, case.world, lambda: [case.log.until(seq=200)])
    found = verify(cut)
    assert found.holds
    assert found.is_cut
    assert {"metrics", "endings", "arrival"} <= set(found.not_judged["the run's end is missing"])


def test_another_contract_may_be_given() -> None:
    """It replaces that of the recording."""
    case = planned("rrt")
    assert not verify(case.recording(), contract=Contract(step=0.1)).holds
    assert verify(case.recording(), contract=Contract()).holds


HARMLESS = {
    ("phase", "status"),  # a run may have been interrupted
    ("reject", "swapped"),  # neighbours are rejected in any order
    ("edge", "swapped"),  # roots
    ("shortcut", "i"), ("shortcut", "j"), ("shortcut", "swapped"),  # others may have been tried
    ("rewire", "swapped"), ("heuristic", "swapped"),  # the order in which costs are learnt
    ("path", "dropped"), ("connect", "dropped"), ("connect", "swapped"), ("heuristic", "h"),
    ("heuristic", "dropped"),
}  # fmt: skip
"""Kinds and ways of doctoring that may lead to a log of another correct run."""


@pytest.mark.parametrize(
    "name", sorted(set(SHORT) - {"blocked", "sliced", "informed", "one trial"})
)
def test_what_is_doctored_at_random_is_found(name: str) -> None:
    """One event of each kind, in each way; benchmarks/doctor.py does thousands."""
    case, rng = short(name), np.random.default_rng(len(name))
    assert case.broken() == set()
    for kind, way, doctor in doctors(case.log):
        log = doctor(case.log, kind, int(rng.integers(0, len(case.log[kind]))), rng)
        if log is not None and (kind.label, way) not in HARMLESS:
            assert replace(case, log=log).broken(), (kind.label, way)


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_no_log_makes_a_rule_fail(data: st.DataObject) -> None:
    """Whatever is in a field, rules find something or nothing; they never raise."""
    case = planned(data.draw(st.sampled_from([*PLANNERS, *TOYS])))
    for _ in range(data.draw(st.integers(1, 4))):
        kind = data.draw(st.sampled_from([k for k in Kind if len(case.log[k])]))
        table = case.log[kind]
        row = data.draw(st.integers(0, len(table) - 1))
        name = data.draw(st.sampled_from(table.dtype.names or ()))
        values: st.SearchStrategy[Any]
        if name == "waypoints":
            values = st.lists(st.tuples(st.floats(), st.floats()), max_size=4).map(
                lambda rows: np.array(rows, float).reshape(-1, 2)
            )
        elif table[name].dtype.kind == "f":
            values = st.floats()
        else:
            info = np.iinfo(table[name].dtype) if table[name].dtype != bool else None
            values = st.booleans() if info is None else st.integers(int(info.min), int(info.max))
        case = case.edit(kind, row, **{name: data.draw(values)})
    case.broken()


HOME = {
    "world": "circles2d:n=10,seed=3", "start": (20.0, 30.0), "goal": (20.0, 30.0), "iterations": 40,
}  # fmt: skip
"""A run whose start is its goal."""


@pytest.mark.parametrize("planner", ["rrt", "rrt-connect", "bi-rrt", "rrt-star", "bi-rrt-star"])
@pytest.mark.parametrize("smooth", [True, False])
def test_trees_whose_start_is_the_goal(planner: str, smooth: bool) -> None:
    """A path of one waypoint, reported at once; nothing is broken."""
    case = run_of(**HOME, planner=planner, smooth=smooth, execute=True)
    assert case.broken() == set()
    path = case.log[Kind.PATH]
    assert len(path["waypoints"][0]) == 1
    assert path["cost"][0] == 0.0


@pytest.mark.parametrize("params", [{}, {"lookahead": 5}, {"trials": 3}])
def test_robots_whose_start_is_the_goal(params: dict[str, object]) -> None:
    """Each trial expands a cell and reports its path on arrival; a missing path is found."""
    case = run_of(**HOME, planner="lrta-star", params=params | {"cell": 4.0})
    assert case.broken() == set()
    raw = case.log[Kind.PATH]["stage"] == Stage.RAW
    assert len(case.log[Kind.EXPAND]) == raw.sum() == params.get("trials", 1)
    assert not len(case.log[Kind.MOVE])
    assert "paths walked" in case.drop(Kind.PATH, 0).broken()


def test_a_search_whose_start_is_the_goal() -> None:
    """The first cell is the goal."""
    case = run_of(**HOME, planner="a-star", params={"cell": 4.0})
    assert case.broken() == set()
    assert len(case.log[Kind.EXPAND]) == 1
    assert case.drop(Kind.PATH, 0).broken() == {"outcome", "smoothed"}


def written(case: Case, path: Path) -> Path:
    """Write a case into a file."""
    sink = McapSink(path, case.manifest, case.world)
    sink.write(case.log)
    sink.close(result_of(case.manifest, case.log))
    return path


def test_verify_json(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Names and types that programs rely on; all rules are listed."""
    done = brrt("verify", written(planned("rrt"), tmp_path / "run.mcap"), "--json")
    assert done.code == 0
    shape = {
        "holds": bool, "planner_known": bool, "cut": bool, "events": int, "rules": list,
        "not_judged": dict, "has_tree": bool,
    }  # fmt: skip
    assert {name: type(value) for name, value in done.json.items()} == shape
    assert done.json["holds"]
    assert [rule["rule"] for rule in done.json["rules"]] == [rule.name for rule in RULES]
    for rule in done.json["rules"]:
        assert {name: type(value) for name, value in rule.items()} == {
            "rule": str, "promise": str, "examined": int, "broken": int, "findings": list,
        }  # fmt: skip


def test_a_contract_that_leaves_out_a_part() -> None:
    """What it leaves out is not judged, which is said; registered planners promise all they can."""
    case = planned("rrt")
    found = verify(case.recording(), contract=Contract(step=100.0, stops=True))
    assert {"uniform draws", "goal draws"} <= set(found.not_judged["the contract states no draws"])
    assert "steering" in found.not_judged["the contract states no growth"]
    assert not any("near" in reason or "lattice" in reason for reason in found.not_judged)
    assert "the contract states no draws" in str(found)
    assert str(found).endswith("could not be judged")


def test_verify_text(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """A line for each rule, no wider than a terminal; --long prints whole promises."""
    run = written(planned("rrt"), tmp_path / "run.mcap")
    done, long = brrt("verify", run), brrt("verify", run, "--long")
    assert done.code == long.code == 0
    lines = done.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert all("holds" in line for line in lines[:-1])
    assert lines[-1] == f"all {len(lines) - 1} rules hold"
    assert RULES[0].promise in long.out


def test_verify_text_says_what_was_not_judged(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """In lines of 80 columns, and not in a line that all rules hold."""
    run = written(planned("rrt").without(Kind.SAMPLE, Kind.REJECT), tmp_path / "run.mcap")
    done = brrt("verify", run)
    assert max(len(line) for line in done.out.splitlines() if "view: " not in line) <= 80
    assert "not judged, no samples: " in done.out
    assert done.out.splitlines()[-1].endswith("could not be judged")
    assert "rules hold" in done.out.splitlines()[-1]
    assert "all" not in done.out.splitlines()[-1]


def test_broken_rules_come_first(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """With what they found, and exit code 1."""
    case = planned("rrt").edit(Kind.SAMPLE, 1, q=[-3.0, 5.0])
    done = brrt("verify", written(case, tmp_path / "bad.mcap"))
    assert done.code == 1
    assert "BROKEN" in done.out.splitlines()[0]
    assert "sample at (-3, 5)" in done.out
    assert done.out.splitlines()[-1].endswith(" broken")


def test_a_cut_file_needs_partial(brrt: Callable[..., Result]) -> None:
    """Otherwise it is refused; what is promised of the end is not judged."""
    brrt(
        "plan", "--planner", "rrt-star", "--world", "circles2d:n=20", "--iterations", "20000",
        "--no-smooth", "--out", "run.mcap",
    )  # fmt: skip
    whole = Path("run.mcap").read_bytes()
    Path("cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    refused = brrt("verify", "cut.mcap")
    assert refused.code == 2
    assert "--partial" in refused.err
    done = brrt("verify", "cut.mcap", "--partial", "--json")
    assert done.code == 0
    assert done.json["cut"]
    assert done.json["events"] > 1000
    assert brrt("verify", "run.mcap", "--partial", "--json").json["cut"] is False


def test_verify_without_docstrings(tmp_path: Path) -> None:
    """`python -OO` drops docstrings and assertions; no text of the rules depends on them."""
    run = written(planned("rrt"), tmp_path / "run.mcap")
    outputs = [
        subprocess.run(
            [sys.executable, *flags, "-m", "brrt_cli", "verify", str(run), "--json"],
            capture_output=True, text=True, check=True,
        ).stdout
        for flags in ([], ["-OO"])
    ]  # fmt: skip
    assert json.loads(outputs[0]) == json.loads(outputs[1])
