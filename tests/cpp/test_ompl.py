"""`brrt_ompl.hpp`: what is recorded of OMPL's planners is what they have at the end."""

import json
import os
import re
import shutil
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from brrt import Kind, Recording, read, verify
from tests.support.compiler import OMPL, ROOT, compiled_with_ompl

pytestmark = pytest.mark.slow  # OMPL's headers take ten seconds to compile

SOURCE = Path(__file__).with_name("ompl.cpp")
PLANNERS = (
    "RRT", "RRTConnect", "RRTstar", "InformedRRTstar", "SORRTstar", "BITstar", "FMT", "BFMT", "PRM",
    "PRMstar", "LazyPRM", "EST", "KPIECE1", "BKPIECE1", "LBKPIECE1",
)  # fmt: skip
THREADED = ("PRM", "PRMstar")
"""Each run of these differs."""

Plan = Callable[..., dict[str, Any]]
Graph = tuple[Counter[tuple[float, ...]], Counter[frozenset[tuple[float, ...]]]]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile the program that plans."""
    return compiled_with_ompl(SOURCE, tmp_path_factory.mktemp("ompl") / "ompl", "-O1")


@pytest.fixture
def plan(program: Path) -> Plan:
    """Return `plan(planner, world, seed, file)`, which returns the graph at the end."""

    def run(*words: Any, iterations: int = 1500, **environment: str) -> dict[str, Any]:
        name, world, seed, *file = map(str, words)
        done = subprocess.run(
            [program, name, world, str(iterations), seed, *file], capture_output=True, text=True,
            check=False, timeout=120, env={**os.environ, **environment},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert isinstance(found, dict)
        return found

    return run


def graph(nodes: Iterable[tuple[float, ...]], edges: Iterable[frozenset[Any]], q: Any) -> Graph:
    """Return configurations, and motions between them in either direction."""
    return Counter(nodes), Counter(frozenset(q[end] for end in edge) for edge in set(edges))


def stated(found: dict[str, Any]) -> Graph:
    """Return the graph that OMPL's PlannerData states."""
    q = [tuple(node) for node in found["nodes"]]
    return graph(q, map(frozenset, found["edges"]), q)


def rebuilt(recording: Recording) -> Graph:
    """Return the graph that the events of a recording make."""
    made = recording.to_networkx()
    names = [f"q_{name}" for name in recording.robot().coordinates(recording.world)]
    q = {node: tuple(data[name] for name in names) for node, data in made.nodes(data=True)}
    return graph(q.values(), map(frozenset, made.edges()), q)


@pytest.mark.parametrize("world", ["circles", "wall", "se2"])
@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner(planner: str, world: str, plan: Plan, tmp_path: Path) -> None:
    """The rebuilt graph is OMPL's, nothing is accused, and the run is the same as unrecorded."""
    pytest.importorskip("networkx")
    for seed in (1, 2):
        path = tmp_path / f"{seed}.mcap"
        end = plan(planner, world, seed, path)
        recording = read(path)
        assert rebuilt(recording) == stated(end)
        assert not verify(recording).findings
        assert recording.manifest.scenario.planner.startswith("ompl:")
        assert recording.manifest.scenario.seed == seed
        assert recording.result is not None
        assert recording.result["solved"] == end["solved"]
        if planner not in THREADED:
            assert stated(plan(planner, world, seed)) == stated(end)


@pytest.mark.parametrize("planner", ["RRT", "RRTConnect", "RRTstar", "BITstar"])
def test_exact(planner: str, plan: Plan, tmp_path: Path) -> None:
    """Graphs that are compared at each iteration come to the same end."""
    pytest.importorskip("networkx")
    end = plan(planner, "circles", 3, tmp_path / "run.mcap", iterations=300, EXACT="1")
    recording = read(tmp_path / "run.mcap")
    assert rebuilt(recording) == stated(end)
    assert not verify(recording).findings


def test_compound_of_a_line_and_an_angle(plan: Plan, tmp_path: Path) -> None:
    """Such a robot is opaque: two numbers."""
    pytest.importorskip("networkx")
    for planner in ("RRTConnect", "RRTstar", "PRM", "LBKPIECE1"):
        path = tmp_path / f"{planner}.mcap"
        end = plan(planner, "arm", 1, path)
        recording = read(path)
        assert rebuilt(recording) == stated(end)
        assert recording.robot().opaque
        assert not verify(recording).findings


def test_default_resolution_lets_edges_through(plan: Plan, tmp_path: Path) -> None:
    """Verify finds what OMPL's motion check by resolution missed."""
    rules = set()
    for planner in ("RRT", "RRTstar", "KPIECE1"):
        plan(planner, "sparse", 3, tmp_path / f"{planner}.mcap")
        rules |= {found.rule for found in verify(read(tmp_path / f"{planner}.mcap")).findings}
    assert "edges free" in rules
    assert rules <= {"edges free", "rewires free", "paths free", "links free"}


def test_exception_and_unwritable_file(plan: Plan, tmp_path: Path) -> None:
    """An exception of the planner leaves a whole file; without a file it plans all the same."""
    end = plan("RRT", "circles", 1, "/nowhere/run.mcap")
    assert stated(end) == stated(plan("RRT", "circles", 1))
    path = tmp_path / "run.mcap"
    with pytest.raises(AssertionError, match="the check failed"):
        plan("RRT", "circles", 1, path, THROWS="1")
    recording = read(path)
    assert recording.result is not None
    assert recording.result["status"] == "interrupted"
    assert not verify(recording).findings


@pytest.mark.parametrize("planner", ["RRT", "RRTstar", "BITstar", "PRM"])
def test_second_solve(planner: str, plan: Plan, tmp_path: Path) -> None:
    """It continues with the graph of the first one, in a file of its own."""
    pytest.importorskip("networkx")
    end = plan(planner, "circles", 1, tmp_path / "run.mcap", TWICE="1")
    assert rebuilt(read(tmp_path / "run-2.mcap")) == stated(end)
    for path in tmp_path.glob("*.mcap"):
        assert not verify(read(path)).findings


def test_killed_process(program: Path, tmp_path: Path) -> None:
    """What was compared before can be read."""
    path = tmp_path / "run.mcap"
    with subprocess.Popen([program, "RRTstar", "circles", "1000000000", "1", path]) as process:
        time.sleep(3)
        process.kill()
    recording = read(path, partial=True)
    log = recording.events()
    assert len(log[Kind.EDGE]) > 1000
    assert log.last.t > 5e8
    assert not verify(recording).findings


@pytest.mark.parametrize("sanitizer", ["address,undefined", "thread"])
def test_sanitizers(sanitizer: str, tmp_path: Path) -> None:
    """No sanitizer reports anything."""
    program = tmp_path / "ompl"
    compiled_with_ompl(SOURCE, program, "-O1", "-g", f"-fsanitize={sanitizer}")
    for planner in ("RRTConnect", "InformedRRTstar", "BITstar", "PRM"):
        command = [program, planner, "circles", "500", "1", tmp_path / f"{planner}.mcap"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert "Sanitizer" not in done.stderr, done.stderr


def test_function_of_the_page(tmp_path: Path) -> None:
    """What docs/cpp.md shows of OMPL compiles."""
    blocks = re.findall(r"```cpp\n(.*?)```", (ROOT / "docs" / "cpp.md").read_text(), re.DOTALL)
    source = tmp_path / "plan.cpp"
    source.write_text(f"#include <ompl/geometric/SimpleSetup.h>\n{blocks[1]}")
    compiled_with_ompl(source, Path(os.devnull), "-fsyntax-only")


def test_example_by_cmake(tmp_path: Path) -> None:
    """`find_package(brrt)` finds OMPL, too; the example plans, and its file can be read."""
    if not OMPL.is_dir() or shutil.which("cmake") is None:
        pytest.skip("needs libompl-dev and cmake")
    build, folder = tmp_path / "build", ROOT / "examples" / "cpp"
    package = f"-Dbrrt_DIR={ROOT / 'brrt' / 'cmake'}"
    commands: list[list[str | Path]] = [
        ["cmake", package, "-S", folder, "-B", build],
        ["cmake", "--build", build, "--target", "ompl_rrt_star"],
        [build / "ompl_rrt_star", tmp_path / "run.mcap"],
    ]
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    recording = read(tmp_path / "run.mcap")
    assert recording.manifest.scenario.planner == "ompl:RRTstar"
    assert recording.result is not None
    assert recording.result["solved"]
