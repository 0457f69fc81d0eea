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


READERS = (
    (".mcap", "replay", "{}"), (".rrd", "verify", "{}"), ("", "explain", "{}"),
    (".toml", "plan", "{}"), ("", "plan", "{}"),
    *((suffix, "plan", "--world", "{}") for suffix in (".json", ".map", ".scen", ".yaml", ".png",
                                                       ".txt", ".geojson", "")),
    (".map", "worlds", "show", "{}"), (".json", "plan", "--robot", "{}"),
    (".robot", "plan", "--robot", "./{}"), (".mcap", "plan", "--from", "{}"),
    (".mcap", "recover", "{}", "--out", "x.mcap"),
    (".mcap", "export", "{}", "--foxglove", "x.mcap"), (".mcap", "export", "{}", "--csv", "c"),
    *((suffix, "verify", "--path", "{}", "--world", "empty2d") for suffix in (".csv", ".npy")),
)  # fmt: skip


@pytest.mark.parametrize("command", READERS, ids=" ".join)
def test_pipes_without_a_writer(command: tuple[str, ...], brrt: Callable[..., Result]) -> None:
    """Where a file is read, a pipe, a device or a folder is refused; none of them is waited for."""
    name = f"what{command[0]}"
    for make in (
        os.mkfifo, lambda at: Path(at).symlink_to("/dev/zero"), lambda at: Path(at).mkdir(),
    ):  # fmt: skip
        make(name)
        done = brrt(*(word.replace("{}", name) for word in command[1:]))
        assert (done.code, done.out, done.err.count("\n")) == (2, "", 1), done.err
        assert name in done.err
        assert make is os.mkfifo or Path(name).exists()
        Path(name).rmdir() if Path(name).is_dir() else Path(name).unlink()


@pytest.mark.parametrize("named", ["what.pgm", "what.png"])
def test_a_map_that_names_a_pipe(named: str, brrt: Callable[..., Result]) -> None:
    """The image of a ROS map."""
    os.mkfifo(named)
    Path("map.yaml").write_text(
        f"image: {named}\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    done = brrt("plan", "--world", "map.yaml", "--start", "1,1", "--goal", "2,2")
    assert (done.code, done.out) == (2, "")
    assert "a pipe or a device; save it to a file first" in done.err
