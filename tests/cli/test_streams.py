"""Terminals that are not UTF-8, names that are not text, a stdout that is full or closed."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Result

Command = Callable[..., Result]
Bash = Callable[..., subprocess.CompletedProcess[bytes]]
PLAN = "plan --no-record --world empty2d"
FULL = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")


@pytest.fixture
def bash(tmp_path: Path) -> Bash:
    """Run a line of bash, in which `brrt` is the command, in an empty folder."""

    def call(line: str, **env: str) -> subprocess.CompletedProcess[bytes]:
        head = f'set -o pipefail; brrt() {{ "{sys.executable}" -m brrt_cli "$@"; }}; '
        return subprocess.run(
            ["/bin/bash", "-c", head + line],
            capture_output=True,
            cwd=tmp_path,
            env={**os.environ, **env},
            timeout=120,
            check=False,
        )

    return call


ENCODINGS = {
    "ascii": {"PYTHONIOENCODING": "ascii"},
    "latin-1": {"PYTHONIOENCODING": "latin-1:strict"},
    "C": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
}


@pytest.mark.parametrize("name", ENCODINGS)
def test_terminals_without_utf8(name: str, bash: Bash) -> None:
    """Characters that the encoding lacks are replaced, and the exit code is that of the run."""
    done = bash(f"brrt {PLAN}", **ENCODINGS[name])
    assert (done.returncode, done.stderr) == (0, b"")
    dot = "·".encode("latin-1") if name == "latin-1" else b"-"
    assert done.stdout.split(b"\n")[0].split()[:4] == [b"run", b"rrt", dot, b"point"]


@pytest.mark.parametrize("command", ["plan --help", "worlds show empty2d", "planners rrt"])
def test_frames_without_utf8(command: str, bash: Bash) -> None:
    """Help, worlds and tables."""
    done = bash(f"brrt {command}", **ENCODINGS["C"])
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.isascii()


def test_help_in_a_pipe(bash: Bash) -> None:
    """It ends with its frame: a stream of texts takes no bytes."""
    for command in ("--help", "view --help", "worlds --help"):
        done = bash(f"brrt {command}")
        assert done.returncode == 0
        assert b"b'" not in done.stdout
        assert done.stdout.decode().rstrip().endswith("─╯")


@FULL
@pytest.mark.parametrize("command", [f"{PLAN} --json", "planners", "--help"])
def test_full_stdout(command: str, bash: Bash) -> None:
    """One line on stderr, and neither "no path" nor success."""
    done = bash(f"brrt {command} > /dev/full")
    assert (done.returncode, done.stderr) == (2, b"brrt: cannot write: No space left on device\n")


@pytest.mark.parametrize("command", [f"{PLAN} --json", "--help"])
@pytest.mark.parametrize("end", [">&-", ">&- 2>&- <&-", "2>&1 | true"])
def test_closed_stdout(command: str, end: str, bash: Bash) -> None:
    """There is nothing to say, and the exit code is that of the run."""
    done = bash(f"brrt {command} {end}")
    assert (done.returncode, done.stderr) == (0, b"")


@FULL
def test_full_stderr(bash: Bash) -> None:
    """Notes and messages are lost; the exit code is not."""
    assert bash(f"brrt {PLAN} --iterations 1 2> /dev/full").returncode == 1
    assert bash("brrt nonsense 2> /dev/full").returncode == 2
    assert bash("brrt nonsense > /dev/full 2> /dev/full").returncode == 2


def test_closed_files_do_not_take_the_place_of_stdout(bash: Bash, tmp_path: Path) -> None:
    """A recording would otherwise get what is printed, or the other way round."""
    done = bash("brrt plan --world empty2d --out a.mcap >&- 2>&- <&- && brrt verify a.mcap")
    assert done.returncode == 0


@pytest.mark.parametrize("name", ["odd\udcff", "lone\udce9\udcff", "日本"])
def test_names_that_are_not_text(name: str, brrt: Command) -> None:
    """Of the world and of recordings, in all formats."""
    world, mcap, rrd = (f"{name}{suffix}" for suffix in (".json", ".mcap", ".rrd"))
    assert brrt("worlds", "make", "circles2d:n=9", "--out", world).code == 0
    made = brrt("plan", "--world", world, "--out", mcap, "--rrd", rrd, "--no-smooth")
    assert (made.code, made.err) == (0, "")
    replayed = brrt("replay", rrd, "--check", mcap)
    assert (replayed.code, replayed.err) == (0, "")
    for args in (
        ("verify", mcap),
        ("explain", rrd),
        ("diff", mcap, rrd),
        ("replay", mcap, "--rrd", f"{name}-2.rrd"),
        ("plot", mcap, "--out", f"{name}.svg"),
        ("plot", mcap, "--out", f"{name}.png"),
        ("export", rrd, "--foxglove", f"{name}-f.mcap", "--layout", f"{name}-l.json"),
        ("recover", mcap, "--out", f"{name}-3.mcap"),
        ("worlds", "show", world, "--rrd", f"{name}-w.rrd"),
        ("plan", "--from", mcap, "--at-iteration", "5", "--rrd", f"{name}-4.rrd"),
    ):
        done = brrt(*args)
        assert done.code == 0, done.err
    assert brrt("replay", mcap, "--json").json["world"] == world


def test_limited_address_space(bash: Bash, tmp_path: Path) -> None:
    """Rerun would abort; one line says how much it needs."""
    assert bash(f"brrt {PLAN.replace('--no-record', '--out run.mcap')}").returncode == 0
    for command in ("replay run.mcap --rrd run.rrd", "plan --rrd run.rrd"):
        done = bash(f"ulimit -v 1500000; brrt {command}", OPENBLAS_NUM_THREADS="1")
        assert done.returncode == 2
        assert done.stderr.count(b"\n") == 1
        assert b"needs 3,000,000 kB of address space, and `ulimit -v` allows 1,5" in done.stderr
    assert not (tmp_path / "run.rrd").exists()


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RuntimeError("can't start new thread"),
        ImportError("a.so: failed to map segment from shared object"),
        OSError("Could not find/load shared object file 'a.so'"),
    ],
)
def test_memory_that_runs_out(
    error: Exception, brrt: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line, also where none is left to lay it out, and exit code 2."""

    def failing(*_: object, **__: object) -> None:
        raise error

    def laying_out(**_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("brrt_cli.app.app", failing)
    monkeypatch.setattr("brrt.errors.address_space", lambda: 1e9)
    monkeypatch.setattr("brrt_cli.console.console", laying_out)
    result = brrt("plan")
    assert result.code == 2
    said = "brrt: the memory does not suffice; free some, or use a smaller world or budget\n"
    assert result.err == said
