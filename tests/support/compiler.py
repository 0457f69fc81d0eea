"""Compile the C++ programs of the tests."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
INCLUDE = ROOT / "brrt" / "include"

OMPL = Path("/usr/include/ompl-1.5")
"""Headers of OMPL, as Debian installs them."""

STRICT = ("-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
"""How the headers must compile."""


def compiled(source: Path, program: Path, *options: str, compiler: str = "g++") -> Path:
    """Compile a program, or skip the test where there is no such compiler."""
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    command = [compiler, "-pthread", f"-I{INCLUDE}", str(source), "-o", str(program), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return program


def compiled_with_ompl(source: Path, program: Path, *options: str) -> Path:
    """Compile a program that uses OMPL, or skip the test where OMPL is not installed."""
    if not OMPL.is_dir():
        pytest.skip("needs libompl-dev")
    folders = ("-isystem", str(OMPL), "-isystem", "/usr/include/eigen3")
    return compiled(source, program, *STRICT, *folders, *options, "-lompl")
