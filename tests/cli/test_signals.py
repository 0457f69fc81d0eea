"""Ctrl-C during start-up, and more than once while files are closed."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

PRELUDE = """
import os, sys, time
from brrt.formats.mcap.sink import McapSink
closed = McapSink.close
def close(self, result):
    os.write(2, b"closing\\n")
    time.sleep({})
    closed(self, result)
McapSink.close = close
from brrt_cli.start import main
sys.argv[0] = "brrt"
main()
"""


def _start(tmp_path: Path, code: str, *args: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", code, "plan", *args],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _until(process: "subprocess.Popen[str]", text: str) -> None:
    assert process.stderr is not None
    for line in process.stderr:
        if text in line:
            return
    raise AssertionError(text)


@pytest.mark.slow
@pytest.mark.parametrize("presses", [2, 3])
def test_ctrl_c_while_files_are_closed(presses: int, tmp_path: Path) -> None:
    """The second says what is being closed, and waits; the third says what is cut."""
    code = PRELUDE.format(2 if presses == 2 else 60)
    process = _start(tmp_path, code, "--seed", "1")
    _until(process, "closing")  # the run has ended, without a key pressed
    for _ in range(presses):
        process.send_signal(signal.SIGINT)
        time.sleep(0.4)
    _, printed = process.communicate(timeout=30)
    assert process.returncode == 130
    lines = printed.splitlines()
    assert lines[0].startswith("brrt: closing run.mcap and run.rrd, for 5 s at most")
    if presses == 2:
        assert len(lines) == 1
        subprocess.run(
            [sys.executable, "-m", "brrt", "verify", "run.mcap"], cwd=tmp_path, check=True
        )
    else:
        assert lines[1:] == [
            "brrt: run.mcap is cut: save it with brrt recover run.mcap --out whole.mcap",
            "brrt: run.rrd is cut and cannot be read",
        ]


@pytest.mark.slow
def test_closing_that_lasts_too_long_is_ended(tmp_path: Path) -> None:
    """Five seconds after the second Ctrl-C."""
    process = _start(tmp_path, PRELUDE.format(60), "--seed", "1", "--out", "x.mcap")
    _until(process, "closing")
    for _ in range(2):
        process.send_signal(signal.SIGINT)
        time.sleep(0.2)
    began = time.monotonic()
    _, printed = process.communicate(timeout=30)
    assert process.returncode == 130
    assert 3 < time.monotonic() - began < 20
    assert "x.mcap is cut" in printed


@pytest.mark.slow
@pytest.mark.parametrize("after", [0.01, 0.1, 0.3, 0.6, 1.0, 1.5])
def test_ctrl_c_during_start_up(after: float, tmp_path: Path) -> None:
    """Exit code 130 and no traceback, whatever is being imported."""
    code = "import os; from brrt_cli.start import main; os.write(2, b'.\\n'); main()"
    process = _start(tmp_path, code, "--iterations", "100000000", "--param", "goal_bias=0",
                     "--param", "step=0.001")  # fmt: skip
    _until(process, ".")
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, printed = process.communicate(timeout=60)
    assert process.returncode == 130
    assert all(line.startswith("brrt: ") for line in printed.splitlines())
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]
