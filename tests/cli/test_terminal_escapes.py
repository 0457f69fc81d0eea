"""Recordings and files whose names hold escape sequences: no command sends one to the terminal."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brrt import PLANNERS, McapSink, Run, Scenario, World, read
from brrt.events import Events
from brrt.text import visible
from brrt.views.rerun.layout import document
from tests.conftest import Result

Command = Callable[..., Result]

EVIL = "\x1b]0;x\x07a\u202eb\u200b|[l](http://e)\n| r | $x$ <b>"
FILE = "ru\x1b[31mn.mcap"
UNSEEN = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u200b\u202e]")


class Planner:
    """RRT under a name of its own."""

    def solve(self, *args: Any) -> Iterator[Events]:
        """Plan as RRT does."""
        yield from PLANNERS["rrt"]().solve(*args)


@pytest.fixture
def evil(tmp_path: Path) -> Path:
    """Return a recording with names that hold escape sequences, in a file of such a name."""
    scenario = Scenario(planner=EVIL, seed=1, iterations=60)
    world = World(EVIL, np.zeros(2), np.full(2, 10.0), start=np.ones(2), goal=np.full(2, 9.0))
    run = Run(scenario, planner=Planner(), world=world)
    path = tmp_path / FILE
    run.execute([McapSink(path, run.manifest, run.problem.world)])
    return path


@pytest.mark.parametrize(
    "command",
    [
        "replay {}",
        "replay {} --json",
        "replay {} --text",
        "replay {} --node 3",
        "verify {}",
        "verify {} --json",
        "diff {} {}",
        "explain {}",
        "export {} --out out.mcap",
        "plot {} --out out.svg",
        "recover {} --out whole.mcap",
        "plan --world {}",
        "plan --param {}=1",
        "worlds show {}",
        "verify {}.none",
        "{}",
    ],
)
def test_commands(command: str, evil: Path, brrt: Command, tmp_path: Path) -> None:
    """What is printed has no control; the names are legible."""
    args = [str(evil) if each == "{}" else each.format(str(evil)) for each in command.split()]
    done = brrt(*args)
    printed = done.out + done.err
    assert printed
    assert not UNSEEN.search(printed)
    for made in tmp_path.glob("out.svg"):
        assert not UNSEEN.search(made.read_text("utf-8"))


def test_document(evil: Path) -> None:
    """The viewer's page: one row a setting, and no link."""
    recording = read(evil)
    text = document(recording.manifest)
    assert not UNSEEN.search(text)
    assert "](" not in text.replace("\\](", "")
    assert sum(line.startswith("| world") for line in text.splitlines()) == 1
    assert not any(line.startswith("| r ") for line in text.splitlines())


def test_styles_and_bars_on_a_terminal() -> None:
    """Rich's own sequences are sent; those in a text are not."""
    code = (
        "import sys\n"
        "from brrt_cli.streams import robust_streams\n"
        "from brrt_cli.console import console, print_line\n"
        "from rich.text import Text\n"
        "with robust_streams():\n"
        "    print('\\x1b[35mprinted')\n"
        "    print_line('\\x1b[35mline', style='bold')\n"
        "    console().print(Text('\\x1b[35mtext', style='red'))\n"
        "    console().print('[red]\\x1b[35mmarkup[/red]')\n"
        "    raise SystemExit(0)\n"
    )
    terminal, end = os.openpty()
    env = {**os.environ, "TERM": "xterm-256color"}
    env.pop("NO_COLOR", None)
    subprocess.run([sys.executable, "-c", code], stdout=end, env=env, timeout=60, check=True)
    os.close(end)
    sent = os.read(terminal, 10_000).decode()
    os.close(terminal)
    assert "\x1b[35m" not in sent
    assert sent.count(visible("\x1b[35m")) == 4
    assert "\x1b[1m" in sent
    assert "\x1b[31m" in sent
