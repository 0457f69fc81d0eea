"""The demonstration of examples/."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("ompl")

DEMO = Path(__file__).parents[2] / "examples" / "ompl_demo.py"


@pytest.mark.slow
def test_it_shows_edges_and_paths_in_collision(tmp_path: Path) -> None:
    """One command: numbers, a picture, recordings."""
    done = subprocess.run(
        [sys.executable, str(DEMO)], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    lines = [line for line in done.stdout.splitlines() if "edges hit" in line]
    assert len(lines) == 2
    assert not any(": 0 of" in line for line in lines)
    assert (tmp_path / "ompl_demo.png").stat().st_size > 10_000
    assert len(list(tmp_path.glob("*.mcap"))) == 2
