"""`brrt`: help, options, wrong usage, and what a command imports."""

import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Result

Command = Callable[..., Result]
COMMANDS = "plan replay plot verify diff explain export view recover planners robots worlds".split()


def imported(*args: str) -> set[str]:
    """Run the command in a process of its own; return the top-level packages that it imports."""
    code = (
        "import sys, brrt_cli.app\n"
        "try: brrt_cli.app.main(sys.argv[1:])\n"
        "except SystemExit: pass\n"
        "print('\\n' + ' '.join({name.partition('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *args], capture_output=True, text=True, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


def test_help_lists_all_commands(brrt: Command) -> None:
    """In their order, each with its first sentence, within 80 columns."""
    done = brrt("--help")
    assert done.code == 0
    assert "brrt replay run.mcap" in done.out
    listed = done.out.partition(" Commands ")[2]
    starts = [listed.index(f"│ {name} ") for name in COMMANDS]
    assert starts == sorted(starts)
    assert "Run a planner in a world and record every event." in listed


@pytest.mark.parametrize("name", [*COMMANDS, "worlds list", "worlds show", "worlds make"])
def test_help_of_a_command(name: str, brrt: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """Examples keep their lines at 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")
    done = brrt(*name.split(), "-h")
    assert (done.code, done.err) == (0, "")
    lines = [line.strip() for line in done.out.splitlines()]
    assert max(map(len, lines)) <= 80
    if "Examples:" in lines:
        first = lines.index("Examples:") + 1
        examples = lines[first : lines.index("", first)]
        assert examples
        assert all(line.startswith(f"brrt {name.split(maxsplit=1)[0]}") for line in examples)


def test_completion_knows_the_commands(brrt: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """A shell that asks for names beginning with "re" gets them with their help."""
    monkeypatch.setenv("_BRRT_COMPLETE", "complete_zsh")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", "brrt re")
    done = brrt()
    assert "replay" in done.out
    assert "recover" in done.out
    assert "plan" not in done.out.replace("replay", "")


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["rplay"], "No such command 'rplay'. Did you mean 'replay'"),
        (["plan", "--sed", "1"], "No such option: --sed"),
        (["plan", "--seed", "x"], "'--seed': 'x' is not a whole number."),
        (["plan", "--iterations", "1.5"], "'--iterations': '1.5' is not a whole number."),
        (["plan", "--iterations", "1e999"], "'1e999' is not a whole number."),
        (["plan", "--time", "soon"], "'--time': 'soon' is not a number."),
        (["plot", "a.mcap", "--out", "a.png", "--dpi", "5"], "5 is not between 30 and 1200."),
        (["plot", "a.mcap"], "Missing option '--out'"),
        (["replay"], "Missing argument 'run'"),
    ],
)
def test_wrong_usage_is_one_line(args: list[str], message: str, brrt: Command) -> None:
    """Exit code 2, and one line on stderr that names the option."""
    done = brrt(*args)
    assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
    assert message in done.err
    assert re.search(r"\(see brrt( [a-z-]+)? --help\)\n$", done.err)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["plan", "--seed", "1e3", "--iterations", "1E4", "--no-record", "--shortcuts", "5e0"], ""),
        (["plan", "--at-event", "1e2", "--from", "none.mcap"], "none.mcap: No such file"),
        (["plan", "--at-iteration", "2e0", "--from", "none.mcap"], "none.mcap: No such file"),
        (["replay", "none.mcap", "--at-event", "1e2"], "none.mcap: No such file"),
        (["replay", "none.mcap", "--node", "1e1", "--tree", "1e0"], "none.mcap: No such file"),
        (["plot", "none.mcap", "--out", "a.png", "--dpi", "1e2"], "none.mcap: No such file"),
        (["view", "none.mcap", "--web", "--port", "8e3"], "none.mcap: No such file"),
        (["view", "none.mcap", "--web", "--port", "8e9"], "8e9 is not between 1 and 65535"),
        (["replay", "none.mcap", "--at-event", "1e-2"], "'1e-2' is not a whole number."),
    ],
)
def test_whole_numbers(args: list[str], message: str, brrt: Command) -> None:
    """With an exponent, wherever a whole number is given."""
    done = brrt(*args)
    assert message in done.err
    assert done.code == (2 if message else 0)
    if not message:
        assert "seed 1000" in done.out


def test_whole_numbers_are_exact(brrt: Command) -> None:
    """Beyond what a float holds."""
    args = ("plan", "--no-record", "--world", "empty2d", "--json")
    assert brrt(*args, "--seed", "1e23").json["seed"] == 10**23


def test_the_package_is_the_command() -> None:
    """`python -m brrt`; to import it runs nothing."""
    done = subprocess.run(
        [sys.executable, "-m", "brrt", "robots", "nonsense"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("brrt: unknown robot 'nonsense'")
    import brrt.__main__  # noqa: F401


@pytest.mark.parametrize("stem", ["-x", "a 'b'", "[bold]"])
def test_printed_commands_work(stem: str, brrt: Command) -> None:
    """Whatever the names of files, and for each command that prints commands."""

    def run_printed(text: str) -> int:
        found = re.findall(r"brrt (?:view|replay|recover|plan) .*", text.replace(" \\\n", " "))
        for line in found:
            words = shlex.split(line)[1:]
            if words[0] != "view":
                done = brrt(*words)
                assert done.code in (0, 1), (line, done.err)
            else:
                assert all(Path(word).exists() for word in words[1:2])
        return len(found)

    mcap = f"{stem}.mcap"
    planned = brrt("plan", f"--out={mcap}", "--iterations", "20", "--no-smooth")
    assert run_printed(planned.out) == 2
    other = brrt("plan", f"--out={stem}2.mcap", "--iterations", "20", "--seed", "1")
    assert other.code == 1
    assert run_printed(brrt("diff", "--", mcap, f"{stem}2.mcap").out) == 2
    assert run_printed(brrt("explain", "--", mcap).out) >= 1
    Path(mcap).write_bytes(Path(mcap).read_bytes()[:-500])
    assert run_printed(brrt("verify", "--", mcap).err) == 1
    made = brrt("worlds", "make", "empty2d", f"--out={stem}.json")
    assert brrt("plan", "--no-record", *shlex.split(made.out)[-2:]).code == 0


def test_without_a_command(brrt: Command) -> None:
    """The help is printed, and nothing is said on stderr."""
    done = brrt()
    assert (done.code, done.err) == (2, "")
    assert "Usage: brrt" in done.out


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (EOFError("Ran out of input"), "a file ends too early: Ran out of input"),
        (OSError(28, "No space left on device"), "No space left on device"),
        (RuntimeError("a bug"), "a bug"),
    ],
)
def test_unexpected_errors(
    error: Exception, message: str, brrt: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They end neither as Ctrl-C, as which typer takes an EOFError, nor as "no path"."""

    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("brrt.planners.rrt.RRT.describe", fail)
    done = brrt("planners")
    assert done.code == 2
    assert message in done.err.splitlines()[-1]


def test_help_is_fast() -> None:
    """The list of commands imports none of the heavy packages, nor do their help pages."""
    heavy = {"mcap", "numba", "numpy", "pyarrow", "rerun"}
    assert not imported("--help") & heavy
    assert not imported("replay", "--help") & heavy


def test_values_are_converted_without_pydantic() -> None:
    """Its import would be the slowest part of most commands."""
    assert not imported("replay", "none.mcap", "--at-event", "3") & {"pydantic"}


def test_no_colours_off_a_terminal(shell: Command) -> None:
    """Output that goes to a file or a pipe holds no escape codes."""
    done = shell("robots")
    assert done.code == 0
    assert "\x1b" not in done.out + done.err


def test_only_drawing_imports_rerun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither planning nor replaying an .mcap does."""
    monkeypatch.chdir(tmp_path)
    assert "rerun" not in imported("plan", "--out", "a.mcap")
    assert "rerun" not in imported("replay", "a.mcap")
