"""`brrt export`: its files, and one line for bad input."""

import json
from collections.abc import Callable
from pathlib import Path

from mcap.reader import make_reader

from tests.conftest import Result
from tests.support.recordings import RECORDINGS


def test_command(brrt: Callable[..., Result]) -> None:
    """It counts its messages, keeps older files, and its layout shows every topic."""
    golden = RECORDINGS / "boxes3d-bi-rrt-star.mcap"
    done = brrt("export", golden, "--foxglove", "viz.mcap", "--layout", "l.json")
    assert (done.code, done.err) == (0, "")
    assert "513 messages" in done.out
    with Path("viz.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {channel.topic for channel in summary.channels.values()}
    data = json.loads(Path("l.json").read_text())
    assert data["layout"] in data["configById"]
    panel = data["configById"][data["layout"]]
    assert panel["topics"].keys() == topics
    assert all(topic["visible"] for topic in panel["topics"].values())
    assert panel["followTf"] == "world"
    before = Path("viz.mcap").read_bytes()
    for args, text in (
        ((golden, "--foxglove", "viz.mcap"), "exists already"),
        ((golden, "--foxglove", "x.mcap", "--layout", "l.json"), "exists already"),
        ((golden, "--foxglove", "x.bag"), "must end in .mcap"),
        ((golden,), "name a file with --foxglove"),
        (("viz.mcap", "--foxglove", "viz.mcap", "--force"), "is the recording"),
        (("viz.mcap", "--foxglove", "x.mcap"), "not a recording of brrt"),
    ):
        failed = brrt("export", *args)
        assert failed.code == 2
        assert text in failed.err
        assert failed.err.count("\n") == 1
    assert Path("viz.mcap").read_bytes() == before
    assert brrt("export", golden, "--foxglove", "viz.mcap", "--force").code == 0


def test_command_takes_what_is_whole(brrt: Callable[..., Result]) -> None:
    """A cut file is exported up to the cut, with one line on stderr."""
    data = (RECORDINGS / "circles2d-chain.mcap").read_bytes()
    Path("cut.mcap").write_bytes(data[: len(data) * 3 // 4])
    done = brrt("export", "cut.mcap", "--foxglove", "viz.mcap")
    assert (done.code, done.err.count("\n")) == (0, 1)
    assert "the end of the run is missing" in done.err
    assert Path("viz.mcap").exists()
