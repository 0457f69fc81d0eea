"""The commands that read work where numba cannot be imported."""

import subprocess
import sys
from pathlib import Path

import pytest

RECORDINGS = Path(__file__).parents[2] / "recordings"
BLOCKED = """
import sys
from importlib.metadata import entry_points
sys.modules["numba"] = sys.modules["llvmlite"] = None
(script,) = entry_points(group="console_scripts", name="brrt")
script.load()(sys.argv[1:])
"""
GOLDEN, OTHER = (str(RECORDINGS / f"circles2d-{name}.mcap") for name in ("rrt", "rrt-star"))


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("replay", GOLDEN), 0),
        (("replay", GOLDEN, "--json"), 0),
        (("diff", GOLDEN, OTHER), 1),
        (("explain", OTHER), 0),
        (("view", "--help"), 0),
        (("export", GOLDEN, "--foxglove", "viz.mcap"), 0),
    ],
)
def test_reading_needs_no_compiler(arguments: tuple[str, ...], code: int, tmp_path: Path) -> None:
    """Each command does its work in a process in which importing numba raises."""
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED, *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (code, "")
    assert done.stdout
