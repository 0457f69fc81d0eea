"""The progress bar: on a terminal alone, styled, one at a time, with an estimate."""

import os
import subprocess
import sys

import pytest

PLAIN = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
HEAD = (
    "import time, sys\n"
    "from brrt_cli.streams import robust_streams\n"
    "from brrt_cli.console import note\n"
    "from brrt_cli.progress import ProgressBar\n"
)
ALONE = """
with robust_streams(), ProgressBar(3, 'waiting').running() as bar:
    time.sleep(1.3)
    bar.update(1, 'planning \\xb7 y', '7 nodes')
    time.sleep(0.2)
    bar.update(2, 'planning \\xb7 y', '9 nodes')
    note('said meanwhile')
    print('a result', flush=True)
    time.sleep(0.3)
"""
NESTED = """
with robust_streams(), ProgressBar(None, 'judging').running():
    time.sleep(1.1)
    with ProgressBar(3, 'reading').running() as bar:
        bar.update(1, 'reading', '1 event')
        time.sleep(0.3)
    time.sleep(0.3)
"""


def shown(code: str, **env: str) -> tuple[bytes, bytes]:
    """Run code with a terminal as stderr; return what the terminal gets, and stdout."""
    terminal, end = os.openpty()
    done = subprocess.run(
        [sys.executable, "-c", HEAD + code], stdout=subprocess.PIPE, stderr=end,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80", **env}, timeout=60, check=False,
    )  # fmt: skip
    os.close(end)
    text = os.read(terminal, 1 << 20)
    os.close(terminal)
    assert done.returncode == 0, text
    return text, done.stdout


@pytest.mark.parametrize("env", [{}, PLAIN])
def test_bar(env: dict[str, str]) -> None:
    """Its styles are the terminal's sequences; notes come through, and results go to stdout."""
    text, out = shown(ALONE, **env)
    assert out == b"a result\n"
    assert b"said meanwhile" in text
    assert b"\x1b[2K" in text
    assert b"\\x1b" not in text
    assert b"7 nodes" in text
    assert b" s left" in text
    dot = b"-" if env else "·".encode()
    assert b"planning " + dot + b" y" in text
    assert text.isascii() is bool(env)


def test_a_bar_within_a_bar() -> None:
    """The inner job is shown by the outer bar, which goes on with its own text."""
    text, _ = shown(NESTED)
    places = [text.find(b"judging"), text.find(b"reading"), text.rfind(b"judging")]
    assert sorted(places) == places
    assert -1 not in places
    assert b"1 event" in text
