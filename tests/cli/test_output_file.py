"""Folders that take no file: each command that writes says so in one line."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Result

WRITERS = (
    ("plan", "--out", "{}/x.mcap"),
    ("plan", "--rrd", "{}/x.rrd"),
    ("plan", "--from", "run.mcap", "--at-iteration", "3", "--seed", "2", "--out", "{}/x.mcap"),
    ("recover", "run.mcap", "--out", "{}/x.mcap"),
    ("recover", "run.mcap", "--out", "{}/x.rrd"),
    ("replay", "run.mcap", "--rrd", "{}/x.rrd"),
    ("export", "run.mcap", "--foxglove", "{}/x.mcap"),
    ("export", "run.mcap", "--foxglove", "x.mcap", "--layout", "{}/x.json"),
    ("plot", "run.mcap", "--out", "{}/x.png", "--dpi", "40"),
    ("worlds", "make", "circles2d:n=3", "--out", "{}/x.json"),
)


@pytest.fixture
def sealed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Make a folder read-only, also for root."""
    folder = tmp_path / "sealed"
    folder.mkdir(mode=0o555)
    allowed = os.access

    def access(path: Any, mode: int, **options: Any) -> bool:
        if mode & os.W_OK and Path(path) == Path("sealed"):
            return False
        return allowed(path, mode, **options)

    monkeypatch.setattr(os, "access", access)
    yield folder
    assert list(folder.iterdir()) == []
    folder.chmod(0o755)


@pytest.fixture
def recording(brrt: Callable[..., Result]) -> Path:
    """Record a run beside that folder."""
    assert brrt("plan", "--world", "circles2d:n=40", "--seed", "7", "--out", "run.mcap").code == 0
    return Path("run.mcap")


def test_read_only_folder(brrt: Callable[..., Result], recording: Path, sealed: Path) -> None:
    """The message comes before any work, and nothing is written."""
    before = recording.read_bytes()
    for command in WRITERS:
        done = brrt(*(word.format(sealed.name) for word in command))
        assert (done.code, done.out) == (2, ""), command
        assert done.err.count("\n") == 1
        assert "sealed/x." in done.err
        assert "no permission to write there" in done.err
    assert recording.read_bytes() == before


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no /proc here")
def test_folder_that_refuses_files(
    brrt: Callable[..., Result], recording: Path, tmp_path: Path
) -> None:
    """Where only the attempt to write fails, the error is one line as well."""
    for command in WRITERS:
        done = brrt(*(word.format("/proc") for word in command))
        assert done.code == 2, command
        assert done.err.splitlines()[-1].startswith("brrt: cannot write /proc/x."), done.err
        assert "Traceback" not in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]
