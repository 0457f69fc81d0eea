"""The commands that read work where numba cannot be imported."""

import subprocess
import sys
from pathlib import Path

import pytest

from brrt import McapSink, Run, Scenario

RECORDINGS = Path(__file__).parents[2] / "recordings"
BLOCKED = """
import sys
from importlib.metadata import entry_points
sys.modules["numba"] = sys.modules["llvmlite"] = None
(script,) = entry_points(group="console_scripts", name="brrt")
script.load()(sys.argv[1:])
"""
GOLDEN, OTHER = (str(RECORDINGS / f"circles2d-{name}.mcap") for name in ("rrt", "rrt-star"))

PATH = "path.csv"


def blocked(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a process in which importing numba raises."""
    return subprocess.run(
        [sys.executable, "-c", BLOCKED, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("replay", GOLDEN), 0),
        (("replay", GOLDEN, "--json"), 0),
        (("replay", GOLDEN, "--node", "5"), 0),
        (("replay", GOLDEN, "--text"), 0),
        (("replay", GOLDEN, "--check", OTHER), 1),
        (("diff", GOLDEN, OTHER), 1),
        (("explain", OTHER), 0),
        (("view", "--help"), 0),
        (("export", GOLDEN, "--foxglove", "viz.mcap"), 0),
        (("export", OTHER, "--csv", "c", "--graphml", "g.graphml", "--at-iteration", "99"), 0),
        (("verify", "--path", PATH, "--world", "circles2d:n=20,seed=3"), 1),
        (("recover", GOLDEN, "--out", "whole.mcap"), 0),
        (("robots",), 0),
        (("worlds", "show", "circles2d:n=5"), 0),
    ],
)
def test_reading_needs_no_compiler(arguments: tuple[str, ...], code: int, tmp_path: Path) -> None:
    """Each command does its work."""
    (tmp_path / PATH).write_text("5,5\n40,9\n")
    done = blocked(tmp_path, *arguments)
    assert (done.returncode, done.stderr) == (code, "")
    assert done.stdout


def test_verify_needs_no_compiler(tmp_path: Path) -> None:
    """A recording that states its planner's contract is verified by that."""
    run = Run(Scenario(world="circles2d:n=40", seed=7))
    run.execute([McapSink(tmp_path / "run.mcap", run.manifest, run.problem.world)])
    done = blocked(tmp_path, "verify", "run.mcap")
    assert (done.returncode, done.stderr) == (0, "")


def test_planning_needs_one(tmp_path: Path) -> None:
    """It fails in such a process, which proves that numba is blocked."""
    assert "numba" in blocked(tmp_path, "plan", "--no-record").stderr
