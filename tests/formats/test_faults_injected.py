"""Every operation on a file that is written fails in turn, and every step of its writer."""

import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import pytest

import brrt
from brrt import RecordingError, Scenario, read
from brrt.formats.mcap.container import Container
from tests.conftest import Result, recorded
from tests.support.faults import WAYS, Disk, failing
from tests.support.files import FORMATS, begins, part, same, saved, write

SCENARIO = Scenario(world="circles2d:n=9", seed=1, clock="logical", iterations=60)
PLAN = ("plan", "--world", "circles2d:n=9", "--seed", "1", "--clock", "logical", "--iterations",
        "60")  # fmt: skip
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "plan mcap": ((*PLAN, "--out", "disk/a.mcap"), ("a.mcap",)),
    "plan rrd": ((*PLAN, "--rrd", "disk/a.rrd"), ("a.rrd",)),
    "plan both": ((*PLAN, "--out", "disk/a.mcap", "--rrd", "disk/a.rrd"), ("a.mcap", "a.rrd")),
    "recover mcap": (("recover", "cut.mcap", "--out", "disk/a.mcap"), ("a.mcap",)),
    "recover rrd": (("recover", "cut.mcap", "--out", "disk/a.rrd"), ("a.rrd",)),
    "export": (("export", "run.mcap", "--foxglove", "disk/a.mcap", "--layout", "disk/a.json"),
               ("a.mcap", "a.json")),
    "replay": (("replay", "run.mcap", "--rrd", "disk/a.rrd"), ("a.rrd",)),
    "worlds": (("worlds", "make", "circles2d:n=9", "--out", "disk/a.json"), ("a.json",)),
    "plot": (("plot", "run.mcap", "--out", "disk/a.png", "--dpi", "40"), ("a.png",)),
}  # fmt: skip


@pytest.fixture
def disk(brrt: Callable[..., Result], tmp_path: Path) -> Path:
    """Make a folder to write into, and beside it a recording and one that is cut."""
    run, log = recorded(SCENARIO)
    write(tmp_path / "run.mcap", run, part(log, 0, 60), part(log, 60, len(log)))
    data = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:-700])
    (tmp_path / "disk").mkdir()
    return tmp_path / "disk"


def left(disk: Path) -> Iterator[Path]:
    """Remove all files and return those that there were."""
    files = sorted(disk.iterdir())
    yield from files
    for file in files:
        file.unlink()


@pytest.mark.slow
@pytest.mark.parametrize("old", [False, True], ids=["new", "over an old file"])
@pytest.mark.parametrize("name", COMMANDS)
def test_a_disk_that_fails(
    name: str,
    old: bool,
    brrt: Callable[..., Result],
    disk: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One line, exit code 2; what there is can be read, and an old file stays until then."""
    command, names = COMMANDS[name]
    command = (*command, "--force") if old else command
    counting = Disk(disk)
    with failing(counting, monkeypatch):
        assert brrt(*command).code in (0, 1)
    whole = {file.name: file.read_bytes() for file in left(disk)}
    assert sorted(whole) == sorted(names)
    for place in range(len(counting.done)):
        for way in WAYS if counting.done[place] == "write" else WAYS[:2]:
            for each in names if old else ():
                (disk / each).write_text("old")
            faulty = Disk(disk, way, place)
            with failing(faulty, monkeypatch):
                done = brrt(*command)
            case = (way, place, counting.done, faulty.done, faulty.failed, done)
            files = {file.name: file.read_bytes() for file in disk.iterdir()}
            if faulty.failed:
                assert done.code == 2, case
                lines = [line for line in done.err.splitlines() if line.startswith("brrt: ")]
                assert len(lines) == 1, case
                assert "Traceback" not in done.err, case
                assert any(word in lines[0] for word in ("Input/output", "No space")), case
            assert set(files) <= set(names), case
            for each, data in files.items():
                if data != b"old" and data != whole[each]:
                    check_part(disk / each, name)
            list(left(disk))


def check_part(path: Path, name: str) -> None:
    """Check that a file that could not be written in whole is good as far as it goes."""
    log = recorded(SCENARIO)[1]
    if path.suffix == ".mcap":
        assert name.startswith("plan"), path
        assert begins(log, saved(path)[0])
        return
    assert path.suffix == ".rrd"
    try:  # two .rrd files of a run differ
        events = read(path).events()
        assert begins(log, events) if name.startswith("plan") else same(events, log)
    except RecordingError as error:
        assert name.startswith("plan"), path
        assert str(error).endswith("; replay the .mcap of the run")  # cut, or its end is missing


class Memory:
    """Memory that runs out when the writers make their n-th call.

    Args:
        place: Number of the call; by default there is enough.
    """

    def __init__(self, place: int = -1) -> None:
        self._place, self.calls = place, list[str]()

    def __call__(self, frame: Any, event: str, _: Any) -> None:
        """Take a call, as `sys.settrace` hands it over."""
        file, name = frame.f_code.co_filename, frame.f_code.co_name
        if event == "call" and file.startswith(WRITERS):
            self.calls.append(f"{file.rpartition('/')[2]}:{name}")
            if len(self.calls) - 1 == self._place:
                raise MemoryError

    def __enter__(self) -> Self:
        self._before = sys.gettrace()
        sys.settrace(self)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(self._before)


PACKAGE = Path(brrt.__path__[0])
WRITERS = tuple(str(PACKAGE / part) for part in ("formats", "views/rerun", "files.py"))
CLEANING = ("<", "close", "_disconnect", "truncate")
"""What releases files must be called; where that fails, the process ends and takes them along."""


@pytest.mark.slow
@pytest.mark.parametrize("suffix", FORMATS)
def test_memory_that_runs_out(suffix: str, tmp_path: Path) -> None:
    """In each call of a writer in turn: what was written before is good, and nothing else left."""
    (run, log), folder = recorded(SCENARIO), tmp_path / "disk"
    parts = part(log, 0, 60), part(log, 60, len(log))
    folder.mkdir()
    with Memory() as counting:
        write(folder / f"run{suffix}", run, *parts)
    list(left(folder))
    for place, call in enumerate(counting.calls):
        if call.rpartition(":")[2].startswith(CLEANING):
            continue
        with Memory(place), suppress(MemoryError, RecordingError):  # a thread's pace may differ
            write(folder / f"run{suffix}", run, *parts)
        for file in left(folder):
            assert file.name == f"run{suffix}", (place, call)
            check_part(file, "plan")


def test_a_command_that_has_no_memory(
    brrt: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line, exit code 2."""
    monkeypatch.setattr(Container, "chunk", lambda *_: bytes(1 << 60))
    done = brrt(*PLAN, "--out", "run.mcap")
    assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
    assert "memory" in done.err
