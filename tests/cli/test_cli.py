"""The command line, as a user types it."""

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
CONTRACT = (
    "planner world robot seed solved status iterations events samples rejects nodes edges rewires "
    "path_cost path smoothed_cost smoothed_path plan_time_s smooth_time_s moves max_move_time_s "
    "deadline_misses"
).split()


def test_plan_writes_both_recordings_and_says_how_to_look(brrt: Command) -> None:
    """Without a word more, `brrt plan` does the main job."""
    done = brrt("plan")
    assert done.code == 0, done.err
    assert "solved" in done.out
    assert "brrt replay run.mcap" in done.out
    assert "brrt view run.rrd" in done.out
    assert Path("run.mcap").stat().st_size > 1000
    assert Path("run.rrd").stat().st_size > 1000
    assert "brrt view a.mcap" in brrt("plan", "--out", "a.mcap").out


def test_one_of_a_thing_is_no_plural(brrt: Command) -> None:
    """One iteration, one sample, one motion."""
    told = brrt("plan", "--world", "empty2d", "--planner", "rrt-connect", "--no-record").out
    for text in (" 1 iteration in ", ": 1 sample, ", " 1 link ", ", 1 motion, "):
        assert text in told
    assert " nodes, " in told


def test_replay_prints_what_plan_printed(brrt: Command) -> None:
    """Key for key, from either file, with the real clock."""
    planned = brrt("plan", "--json", "--out", "a.mcap", "--rrd", "a.rrd").json
    assert set(CONTRACT) <= set(planned)
    assert brrt("replay", "a.mcap", "--json").json == planned
    assert brrt("replay", "a.rrd", "--json").json == planned


def test_a_seed_fixes_everything(brrt: Command) -> None:
    """Two runs with one seed are equal event by event; another seed is not."""
    for name, seed in (("a", 7), ("b", 7), ("c", 8)):
        assert brrt("plan", "--seed", seed, "--out", f"{name}.mcap").code == 0
    equal, parted = (brrt("replay", "a.mcap", "--check", f"{x}.mcap") for x in "bc")
    assert (equal.code, parted.code) == (0, 1)
    assert "a.mcap (seed 7) and b.mcap (seed 7) are equal" in equal.out
    heading = (
        "A  a.mcap (seed 7)\nB  c.mcap (seed 8)\nThe first difference is event 2; before it:\n"
    )
    assert heading in parted.out
    assert all(len(line) <= 80 for line in parted.out.partition(heading)[2].splitlines())
    assert brrt("replay", "a.mcap", "--check", "c.mcap", "--json").json["check"]["equal"] is False


def test_replay_at_an_instant(brrt: Command) -> None:
    """The three ways to name an instant agree with each other."""
    brrt("plan", "--out", "a.mcap", "--clock", "logical")
    at_event = brrt("replay", "a.mcap", "--at-event", 100, "--json").json
    assert at_event["events"] == 101
    assert at_event["status"] == "running"
    assert brrt("replay", "a.mcap", "--at", "100us", "--json").json == at_event
    assert brrt("replay", "a.mcap", "--at", "0.1ms", "--json").json == at_event
    assert brrt("replay", "a.mcap", "--at-iteration", 30, "--json").json["samples"] == 30
    assert brrt("replay", "a.mcap", "--at", "1h").code == 2
    assert brrt("replay", "a.mcap", "--at", "1s", "--at-event", 3).code == 2


@pytest.mark.parametrize(
    ("option", "beyond", "message"),
    [
        ("--at", "1s", "the recording ends at 0.00"),
        ("--at-event", 10**9, "the recording ends with event "),
        ("--at-iteration", 10**9, "the recording ends with iteration "),
    ],
)
def test_replay_beyond_the_end(option: str, beyond: object, message: str, brrt: Command) -> None:
    """The last instant is silent; after it there is a line on stderr, and the last figures."""
    planned = brrt("plan", "--out", "a.mcap", "--clock", "logical", "--json").json
    done = brrt("replay", "a.mcap", option, beyond, "--json")
    assert (done.code, done.json) == (0, planned)
    assert message in done.err
    assert done.err.count("\n") == 1
    last = planned["events"] - 1
    for name, value in (("--at", f"{last}us"), ("--at-event", last),
                        ("--at-iteration", planned["iterations"])):  # fmt: skip
        end = brrt("replay", "a.mcap", name, value, "--json")
        assert (end.json, end.err) == (planned, "")


def test_iterations_as_people_write_them(brrt: Command) -> None:
    """1e2 is a hundred."""
    for text in ("1e2", "100", "100.0"):
        done = brrt("plan", "--iterations", text, "--param", "goal_bias=0", "--param", "step=0.01",
                    "--no-record", "--json")  # fmt: skip
        assert done.json["iterations"] == 100
    for text in ("1.5", "nan", "1e999", "many"):
        done = brrt("plan", "--iterations", text, "--no-record")
        assert done.code == 2
        assert f"'{text}' is not a whole number" in done.err


def test_replay_writes_rerun(brrt: Command) -> None:
    """An MCAP becomes an .rrd that replays to the same figures."""
    planned = brrt("plan", "--json", "--out", "a.mcap").json
    assert brrt("replay", "a.mcap", "--rrd", "b.rrd").code == 0
    assert brrt("replay", "b.rrd", "--json").json == planned


def test_no_path_is_exit_1_and_a_recording(brrt: Command) -> None:
    """A run that fails is recorded all the same."""
    done = brrt("plan", "--iterations", 20, "--out", "a.mcap", "--json")
    assert done.code == 1
    assert done.json["status"] == "iteration limit"
    assert done.json["path"] is None
    assert brrt("replay", "a.mcap", "--json").json == done.json


def test_scenario_file_and_options(brrt: Command) -> None:
    """A TOML file holds what the options do, options win, and a map is found beside it."""
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
    "option": (["--sed", "1"], "No such option: --sed"),
    "whole number": (["--seed", "x"], "Invalid value for '--seed'"),
    "scenario": (["nothing.toml"], "nothing.toml: No such file"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(case: str, brrt: Command) -> None:
    """Exit code 2, one line that names what is wrong, and nothing written."""
    args, message = BAD[case]
    done = brrt("plan", *args)
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert done.err.count("\n") == 1
    assert not list(Path().iterdir())


def test_collision_names_the_obstacle(brrt: Command) -> None:
    """A start inside a loaded block says which one."""
    Path("m.txt").write_text("boundary 0 0 0 9 9 9 1 1 1\nblock 4 0 0 5 9 8 1 1 1\n")
    done = brrt("plan", "--world", "m.txt", "--start", "4.5,1,1", "--goal", "8,8,1")
    assert done.code == 2
    assert "start 4.5,1,1 is in collision with box 0 (4, 0, 0 to 5, 9, 8)" in done.err
    assert "give --start x,y,z" in brrt("plan", "--world", "m.txt").err


def test_existing_output_is_kept(brrt: Command) -> None:
    """Without --force nothing is overwritten; with it, it is."""
    Path("run.mcap").write_text("precious")
    done = brrt("plan")
    assert done.code == 2
    assert "exists already" in done.err
    assert Path("run.mcap").read_text() == "precious"
    assert not Path("run.rrd").exists()
    assert brrt("plan", "--force").code == 0
    assert read(Path("run.mcap")).result is not None


def test_cut_and_foreign_recordings(brrt: Command) -> None:
    """A cut file is replayed with one line on stderr; with --check it needs --partial."""
    brrt("plan", "--out", "a.mcap", "--iterations", 30_000, "--param", "goal_bias=0",
         "--param", "step=0.02")  # fmt: skip
    whole = Path("a.mcap").read_bytes()
    Path("cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    for options in ([], ["--partial"]):
        done = brrt("replay", "cut.mcap", "--json", *options)
        assert (done.code, done.err.count("\n")) == (0, 1)
        assert "is cut at byte" in done.err
        assert "the run did not finish" in done.err
        assert done.json["status"] == "running"
        assert 0 < done.json["events"] < 60_003
    for options in (["cut.mcap", "--check", "a.mcap"], ["a.mcap", "--check", "cut.mcap"]):
        done = brrt("replay", *options)
        assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
        assert "with --partial, or save them with brrt recover cut.mcap" in done.err
        assert brrt("replay", *options, "--partial").code == 1
    for name, text in (("a.txt", "hello"), ("b.mcap", "hello"), ("c.rrd", "RRF2hello")):
        Path(name).write_text(text)
        assert brrt("replay", name).code == 2
    assert "No such file" in brrt("replay", "none.mcap").err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_close_the_files(number: signal.Signals, tmp_path: Path) -> None:
    """Ctrl-C, SIGTERM and a terminal's closing end in two whole recordings; the code says which."""
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


def test_help_is_fast_and_teaches(shell: Command) -> None:
    """`brrt --help` imports none of the heavy packages, and shows how to begin."""
    done = shell("--help")
    assert done.code == 0
    assert "brrt replay run.mcap" in done.out
    code = (
        "import sys, brrt_cli.app\n"
        "try: brrt_cli.app.main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numba', 'numpy', 'rerun', 'mcap', 'pyarrow') if m in sys.modules])"
    )
    seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert seen.stdout.splitlines()[-1] == "[]"


def test_plan_without_rerun_does_not_import_it(tmp_path: Path) -> None:
    """Only the Rerun sink pays for rerun."""
    code = (
        "import sys, brrt_cli.app\n"
        "try: brrt_cli.app.main(['plan', '--out', 'a.mcap'])\n"
        "except SystemExit: pass\n"
        "print('rerun' in sys.modules)"
    )
    seen = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert seen.stdout.splitlines()[-1] == "False"


def test_no_colours_off_a_terminal(shell: Command) -> None:
    """Output that goes to a file or a pipe holds no escape codes."""
    done = shell("plan", "--no-record")
    assert done.code == 0
    assert "\x1b" not in done.out + done.err


@pytest.mark.parametrize("name", ["planners", "robots", "worlds"])
def test_lists(name: str, brrt: Command) -> None:
    """Each list is a table for people and an object for programs."""
    text, data = brrt(name), brrt(name, "--json")
    assert text.code == data.code == 0
    for entry in data.json:
        assert entry in text.out


@pytest.mark.parametrize("name", ["planners", "robots", "worlds list"])
def test_lists_show_one_alone(name: str, brrt: Command) -> None:
    """A name after the list's picks one; a wrong one is named, with the nearest."""
    every = brrt(*name.split(), "--json").json
    one = min(every)
    assert brrt(*name.split(), one, "--json").json == {one: every[one]}
    wrong = brrt(*name.split(), one + "x")
    assert wrong.code == 2
    assert f"did you mean {one!r}?" in wrong.err


def test_cache_folder_may_be_all_that_is_writable(tmp_path: Path) -> None:
    """Compiled kernels go to the user's cache folder, or nowhere where there is none."""
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
    said = subprocess.run(plan, capture_output=True, text=True, check=False, env=env, cwd=tmp_path)
    assert "again in each run" in said.stderr
    assert "BRRT_CACHE_DIR" in said.stderr
    assert "once" not in said.stderr
