"""Names of files that are written: unpredictable at first; no other process has the final one."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from brrt.errors import BrrtError, WriteError
from brrt.files import OutputFile, replacing
from brrt.output_names import TakenError, expect_new, open_temporary
from brrt.runs.run import Run
from tests.conftest import Result


def test_temporary_names_cannot_be_predicted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A link or a pipe that waits at a temporary name is not followed and not waited for."""
    names = iter(["link", "pipe", "free", "other"])
    monkeypatch.setattr("brrt.output_names.secrets.token_hex", lambda _: next(names))
    victim = tmp_path / "victim"
    (tmp_path / ".brrt-link.mcap").symlink_to(victim)
    os.mkfifo(tmp_path / ".brrt-pipe.mcap")
    name, number = open_temporary(tmp_path / "run.mcap")
    os.close(number)
    assert name.name == ".brrt-free.mcap"
    assert not victim.exists()
    monkeypatch.undo()
    assert len({open_temporary(tmp_path / "x")[0].name for _ in range(5)}) == 5


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_appears_meanwhile_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    """Without --force the later one keeps its data under the next name; also without hard links."""
    if not links:

        def refuse(*_: Any) -> None:
            raise PermissionError(1, "no links here")

        monkeypatch.setattr(os, "link", refuse)
    path = tmp_path / "run.mcap"
    (tmp_path / "run-2.mcap").write_bytes(b"third")
    expect_new(path, new=True)
    file = OutputFile(path)
    file.write(b"mine")
    path.write_bytes(b"theirs")
    file.appear()
    with pytest.raises(TakenError, match=r"run-3\.mcap"):
        file.close()
    expect_new(path, new=True)
    with pytest.raises(TakenError, match=r"run-4\.mcap"), replacing(path) as unfinished:
        unfinished.write_bytes(b"mine too")
    texts = {each.name: each.read_bytes() for each in tmp_path.iterdir()}
    assert texts == {
        "run.mcap": b"theirs",
        "run-2.mcap": b"third",
        "run-3.mcap": b"mine",
        "run-4.mcap": b"mine too",
    }


def test_by_default_files_are_replaced(tmp_path: Path) -> None:
    """As in Python's own `open`."""
    path = tmp_path / "run.mcap"
    path.write_bytes(b"old")
    with replacing(path) as unfinished:
        unfinished.write_bytes(b"new")
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("appeared", [True, False])
def test_a_folder_that_vanishes_is_an_error(tmp_path: Path, appeared: bool) -> None:
    """The data would be gone with the descriptor."""
    folder = tmp_path / "out"
    folder.mkdir()
    file = OutputFile(folder / "run.mcap")
    file.write(b"data")
    if appeared:
        file.appear()
    shutil.rmtree(folder)
    if appeared:
        with pytest.raises(WriteError, match="removed or replaced"):
            file.close()
    else:
        with pytest.raises(FileNotFoundError):
            file.appear()
        file.close()
    folder.mkdir()
    with pytest.raises(BrrtError, match="No such file"), replacing(folder / "x.png") as unfinished:
        unfinished.write_bytes(b"data")
        shutil.rmtree(folder)


def _before(method: str, monkeypatch: pytest.MonkeyPatch, action: Callable[[], object]) -> None:
    """Do something before a method of a run."""
    original = getattr(Run, method)

    def patched(self: Run, *args: Any) -> Any:
        action()
        return original(self, *args)

    monkeypatch.setattr(Run, method, patched)


def test_two_runs_of_one_name(
    brrt: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Another run's files appear between the check of the names and the first batch."""
    theirs = [tmp_path / "run.mcap", tmp_path / "run.rrd"]
    _before("_set_up", monkeypatch, lambda: [path.write_text("theirs") for path in theirs])
    done = brrt("plan", "--seed", 1)
    assert (done.code, done.out) == (2, "")
    assert sorted(line.rpartition(" ")[2] for line in done.err.splitlines()) == [
        f"{tmp_path}/run-2.mcap",
        f"{tmp_path}/run-2.rrd",
    ]
    assert {path.read_text() for path in theirs} == {"theirs"}
    monkeypatch.undo()
    for kept in ("run-2.mcap", "run-2.rrd"):
        assert brrt("verify", tmp_path / kept).code == 0


def test_a_vanished_folder_ends_the_command(
    brrt: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Exit code 2 and one line, not a run that says where its file would be."""
    folder = tmp_path / "out"
    folder.mkdir()
    _before("execute", monkeypatch, lambda: shutil.rmtree(folder))
    done = brrt("plan", "--seed", 1, "--out", "out/x.mcap")
    assert (done.code, done.out) == (2, "")
    assert done.err.count("\n") == 1
    assert "x.mcap" in done.err
