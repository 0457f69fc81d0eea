"""examples/plugin, built and installed apart, adds to brrt what it says."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.slow

Command = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the package and install it into a folder of its own."""
    folder = tmp_path_factory.mktemp("plugin")
    shutil.copytree(ROOT / "examples" / "plugin", folder / "source")
    build = ["install", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    target = ["--target", str(folder / "site"), str(folder / "source")]
    subprocess.run([sys.executable, "-m", "pip", *build, *target], check=True)
    return folder / "site"


@pytest.fixture
def brrt_with(tmp_path: Path) -> Command:
    """Run a command with a folder of packages on the path, in an empty folder."""

    def call(site: Path | None, *args: object) -> subprocess.CompletedProcess[str]:
        path = {} if site is None else {"PYTHONPATH": str(site)}
        return subprocess.run(
            [sys.executable, "-m", "brrt_cli", *map(str, args)],
            capture_output=True, text=True, cwd=tmp_path, env={**os.environ, **path}, check=False,
        )  # fmt: skip

    return call


def test_it_is_listed(site: Path, brrt_with: Command) -> None:
    """With its package and its parameters."""
    for command, name in (
        ("planners", "plain-rrt"), ("robots", "truck"), ("worlds", "colonnade2d"),
        ("worlds", "pillars"),
    ):  # fmt: skip
        done = brrt_with(site, command, "--json")
        assert done.stderr == ""
        entry = json.loads(done.stdout)[name]
        assert entry["package"] == "brrt-example 1.0"
        assert entry["about"]
        assert name not in json.loads(brrt_with(None, command, "--json").stdout)
    assert "(from brrt-example 1.0)" in brrt_with(site, "planners").stdout


def test_its_planner_is_judged_where_it_is_not_installed(site: Path, brrt_with: Command) -> None:
    """By the contract in the file, as where it is installed; its rule is known there alone."""
    plan = ("plan", "--planner", "plain-rrt", "--world", "colonnade2d", "--no-smooth", "--json")
    done = brrt_with(site, *plan, "--out", "run.mcap")
    assert done.returncode == 0, done.stderr
    for place, rule in ((site, True), (None, False)):
        found = json.loads(brrt_with(place, "verify", "run.mcap", "--json").stdout)
        assert found["holds"]
        assert found["planner_known"]
        assert ("distinct waypoints" in {each["rule"] for each in found["rules"]}) == rule
        assert brrt_with(place, "replay", "run.mcap", "--json").stdout == done.stdout
    again = brrt_with(site, "verify", "run.mcap", "--rerun")
    assert again.returncode == 0, again.stdout
    assert "plain-rrt is not registered" in brrt_with(None, "verify", "run.mcap", "--rerun").stderr


def test_its_robot_its_world_and_its_files(site: Path, brrt_with: Command, tmp_path: Path) -> None:
    """A robot that extends one of ours is moved by our planners."""
    (tmp_path / "hall.pillars").write_text("size 60 40\n20 20 5\n40 15 6\n")
    done = brrt_with(
        site, "plan", "--planner", "rrt-connect", "--robot", "truck:length=6", "--world",
        "hall.pillars", "--start", "5,5,0", "--goal", "55,35,0", "--out", "run.mcap",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "rrt-connect · truck:length=6 · hall.pillars" in done.stdout
    assert brrt_with(site, "verify", "run.mcap").returncode == 0
    without = brrt_with(None, "replay", "run.mcap")
    assert without.returncode == 2
    assert "unknown kind of robot 'truck'" in without.stderr
    (tmp_path / "hall.pillars").write_text("size 60\n")
    wrong = brrt_with(site, "worlds", "show", "hall.pillars")
    assert wrong.returncode == 2
    assert "hall.pillars:1: a line reads size WIDTH HEIGHT, or X Y RADIUS" in wrong.stderr
