"""Kills at full speed and damaged copies; benchmarks/faults.py has thousands."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_faults() -> None:
    """What a killed run leaves can be recovered, and no damaged copy reads as another run."""
    script = Path(__file__).parents[2] / "benchmarks" / "faults.py"
    done = subprocess.run(
        [sys.executable, script, "--kills", "1", "--foreign", "1", "--copies", "36"],
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("findings: 0") == 3
