"""Files that no command can read, and logs that contradict themselves: one line, exit code 2."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from brrt import Events, Kind, Scenario
from brrt.formats.mcap.records import MAGIC
from tests.conftest import Result, recorded
from tests.support.files import FORMATS, write

SCENARIO = Scenario(world="circles2d:n=9", seed=1, clock="logical", iterations=60)


@pytest.mark.parametrize("suffix", FORMATS)
def test_events_that_contradict_each_other(
    suffix: str, brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """Of a log that makes no tree commands say only that, with the name of its file."""
    (run, log), path = recorded(SCENARIO), f"bad{suffix}"
    for name, value in (("parent", 50), ("parent", 5), ("node", 7), ("iteration", 1 << 59)):
        edges = log[Kind.EDGE].copy()
        edges[name][5] = value
        write(tmp_path / path, run, Events(log.dof, {**log.tables, Kind.EDGE: edges}))
        for command in (
            ("replay", path), ("replay", path, "--node", "5"), ("explain", path),
            ("plot", path, "--out", "x.png", "--dpi", "40"),
            ("export", path, "--foxglove", "x.mcap", "--force"),
        ):  # fmt: skip
            done = brrt(*command)
            if done.code == 0:
                assert done.out
                assert name == "iteration" or command[0] in ("explain", "export"), command
                continue
            assert (done.code, done.out, done.err.count("\n")) == (2, "", 1), (command, done.err)
            assert done.err.startswith(f"brrt: {path}: ")
            assert done.err.endswith("; see brrt verify\n")
        assert brrt("verify", path).code == 1
        Path("x.png").unlink(missing_ok=True)


def test_what_is_no_file(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Folders, pipes, devices, loops of links, and nothing at all: one line, at once."""
    Path("folder").mkdir()
    os.mkfifo("pipe")
    Path("loop").symlink_to("loop")
    Path("zeros").symlink_to("/dev/zero")
    Path("empty").touch()
    Path("latin").write_bytes(b"\xff\xfe\x00")
    Path("short").write_bytes(MAGIC)
    Path("blank").write_bytes(MAGIC + bytes(10_000_000))
    Path("barren").write_bytes(MAGIC + (b"\x90" + bytes(8)) * 200_000)
    for name in "folder pipe loop zeros empty latin short blank barren missing".split():
        for command in (
            ("replay", name),
            ("recover", name, "--out", "x.mcap"),
            ("diff", name, "x"),
        ):
            done = brrt(*command)
            assert (done.code, done.out, done.err.count("\n")) == (2, "", 1), command
            assert done.err.startswith(f"brrt: {name}: ")
