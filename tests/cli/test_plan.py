"""`brrt plan`: what it writes and prints, and one line for bad input."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from brrt import metrics, read
from tests.conftest import Result

Command = Callable[..., Result]


def test_default_outputs(brrt: Command) -> None:
    """Without options, both recordings, and the commands that open them."""
    done = brrt("plan")
    assert done.code == 0, done.err
    assert "solved" in done.out
    assert "brrt replay run.mcap" in done.out
    assert "brrt view run.rrd" in done.out
    assert Path("run.mcap").stat().st_size > 1000
    assert Path("run.rrd").stat().st_size > 1000
    assert "brrt view a.mcap" in brrt("plan", "--out", "a.mcap").out


def test_singular_and_plural(brrt: Command) -> None:
    """One iteration, one sample, one motion."""
    text_out = brrt("plan", "--world", "empty2d", "--planner", "rrt-connect", "--no-record").out
    for text in (" 1 iteration in ", ": 1 sample, ", " 1 link ", ", 1 motion, "):
        assert text in text_out
    assert " nodes, " in text_out


def test_whole_numbers(brrt: Command) -> None:
    """1e2 and 100.0 are 100."""
    for text in ("1e2", "100", "100.0"):
        done = brrt("plan", "--iterations", text, "--param", "goal_bias=0", "--param", "step=0.01",
                    "--no-record", "--json")  # fmt: skip
        assert done.json["iterations"] == 100


def test_no_path(brrt: Command) -> None:
    """A run without a path is recorded as well."""
    done = brrt("plan", "--iterations", 20, "--out", "a.mcap", "--json")
    assert done.code == 1
    assert done.json["status"] == "iteration limit"
    assert done.json["path"] is None
    assert brrt("replay", "a.mcap", "--json").json == done.json


def test_scenario_file_and_options(brrt: Command) -> None:
    """A TOML file sets what options set, options win, and a map beside it is found."""
    folder = Path("maps")
    folder.mkdir()
    (folder / "m.txt").write_text("boundary 0 0 0 9 9 9 1 1 1\nblock 4 0 0 5 9 8 1 1 1\n")
    (folder / "s.toml").write_text(
        'world = "m.txt"\nstart = [1, 1, 1]\ngoal = [8, 8, 1]\nseed = 3\n[params]\nstep = 0.7\n'
    )
    done = brrt("plan", "maps/s.toml", "--seed", 4, "--no-record", "--json")
    assert done.code == 0, done.err
    assert done.json["seed"] == 4
    assert done.json["world"].endswith("m.txt")
    (folder / "s.toml").write_text("wrold = 1\n")
    assert (
        "unknown key of a scenario 'wrold'; did you mean 'world'?"
        in brrt("plan", "maps/s.toml").err
    )


BAD = {
    "world": (["--world", "circle2d"], "unknown world 'circle2d'; did you mean 'circles2d'?"),
    "world parameter": (["--world", "circles2d:m=3"], "unknown parameter of world circles2d 'm'"),
    "world file": (["--world", "no/map.txt"], "no/map.txt: No such file"),
    "planner": (["--planner", "rtt"], "unknown planner 'rtt'; did you mean 'rrt'?"),
    "robot": (["--robot", "pont"], "unknown robot 'pont'; did you mean 'point'?"),
    "parameter": (["--param", "stepp=1"], "did you mean 'step'?"),
    "parameter without value": (["--param", "step"], "must read name=value"),
    "range": (["--param", "step=-1"], "step must be above 0, not -1"),
    "not a number": (["--param", "step=nan"], "step must be a finite number"),
    "bias": (["--param", "goal_bias=2"], "goal_bias must be at most 1"),
    "choice": (["--param", "goal_test=steps"], "did you mean 'step'?"),
    "size": (["--world", "circles2d:size=inf"], "size must be a finite number"),
    "crowded": (["--world", "boxes2d:n=50,min_side=99,max_side=100"], "leave no room"),
    "start in collision": (
        ["--world", "boxes3d", "--start", "nan,1,1"],
        "start nan,1,1 must be finite",
    ),
    "outside": (["--start", "-1,5"], "start -1,5 is outside the bounds"),
    "dimension": (["--start", "1,2,3"], "start 1,2,3: 3 given; a configuration here has 2"),
    "text": (["--goal", "a,b"], "goal must be numbers"),
    "seed": (["--seed", "-1"], "seed must be at least 0"),
    "iterations": (["--iterations", "0"], "iterations must be at least 1"),
    "time": (["--time", "nan"], "time must be above 0"),
    "clock": (["--clock", "reel"], "unknown clock 'reel'; did you mean 'real'?"),
    "folder": (["--out", "no/run.mcap"], "there is no folder no"),
    "suffix": (["--out", "run.bag"], "must end in .mcap"),
    "contradiction": (["--no-record", "--out", "a.mcap"], "contradicts"),
    "scenario": (["nothing.toml"], "nothing.toml: No such file"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input(case: str, brrt: Command) -> None:
    """Exit code 2, one line that names what is wrong, and nothing written."""
    args, message = BAD[case]
    done = brrt("plan", *args)
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert done.err.count("\n") == 1
    assert not list(Path().iterdir())


def test_start_in_collision(brrt: Command) -> None:
    """The message names the obstacle."""
    Path("m.txt").write_text("boundary 0 0 0 9 9 9 1 1 1\nblock 4 0 0 5 9 8 1 1 1\n")
    done = brrt("plan", "--world", "m.txt", "--start", "4.5,1,1", "--goal", "8,8,1")
    assert done.code == 2
    assert "start 4.5,1,1 is in collision with box 0 (4, 0, 0 to 5, 9, 8)" in done.err
    assert "give --start x,y,z" in brrt("plan", "--world", "m.txt").err


def test_existing_files(brrt: Command) -> None:
    """They are kept unless --force is given."""
    Path("run.mcap").write_text("precious")
    done = brrt("plan")
    assert done.code == 2
    assert "exists already" in done.err
    assert Path("run.mcap").read_text() == "precious"
    assert not Path("run.rrd").exists()
    assert brrt("plan", "--force").code == 0
    assert read(Path("run.mcap")).result is not None


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_close_the_files(number: signal.Signals, tmp_path: Path) -> None:
    """Ctrl-C, SIGTERM and SIGHUP leave two complete recordings; the exit code names the signal."""
    command = [sys.executable, "-m", "brrt_cli", "plan", "--json", "--param", "goal_bias=0",
               "--param", "step=0.001", "--iterations", "100000000"]  # fmt: skip
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    mcap = tmp_path / "run.mcap"
    deadline = time.monotonic() + 100
    while time.monotonic() < deadline and not (mcap.exists() and mcap.stat().st_size > 2_000_000):
        time.sleep(0.05)
    process.send_signal(number)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    figures = json.loads(out)
    assert figures["status"] == "interrupted"
    for name in ("run.mcap", "run.rrd"):
        recording = read(tmp_path / name)
        assert metrics(recording).as_dict() == figures == recording.result


def test_cache_folder(tmp_path: Path) -> None:
    """Compiled kernels go to BRRT_CACHE_DIR; where that is not writable, a note says so."""
    code = "from brrt.kernels.jit import CACHE_FOLDER; print(CACHE_FOLDER)"
    env = {**os.environ, "BRRT_CACHE_DIR": str(tmp_path / "mine")}
    where = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env
    )
    assert where.stdout.startswith(str(tmp_path / "mine"))
    (tmp_path / "file").write_text("")
    env["BRRT_CACHE_DIR"] = str(tmp_path / "file")
    where = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env
    )
    assert where.stdout.strip() == "None"
    plan = [sys.executable, "-m", "brrt_cli", "plan", "--no-record", "--start", "-1,5"]
    refused = subprocess.run(
        plan, capture_output=True, text=True, check=False, env=env, cwd=tmp_path
    )
    assert "again in each run" in refused.stderr
    assert "BRRT_CACHE_DIR" in refused.stderr
    assert "once" not in refused.stderr
