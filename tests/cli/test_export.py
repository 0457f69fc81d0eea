"""`brrt export`: its files, and one line for bad input."""

import json
from collections.abc import Callable
from pathlib import Path

from mcap.reader import make_reader

from brrt import Events, Kind, Scenario
from tests.conftest import Result, recorded
from tests.support.files import write
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
        ((golden, "--layout", "x.json", "--csv", "x"), "--layout needs --foxglove"),
        ((golden, "--graphml", "x.xml"), "must end in .graphml"),
        ((golden, "--csv", "x", "--parquet", "x"), "need folders of their own"),
        ((golden, "--csv", "l.json"), "--csv l.json: is a file; name a folder"),
        ((golden, "--csv", ".", "--force"), "--csv .: holds l.json"),
        ((golden, "--csv", "x", "--at", "1s", "--at-event", "3"), "give one of --at"),
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


def test_tables_and_graph(brrt: Callable[..., Result]) -> None:
    """Several at once, at an instant, and again with --force."""
    golden = RECORDINGS / "circles2d-rrt-star.mcap"
    command = ("export", golden, "--csv", "c", "--parquet", "p", "--graphml", "g.graphml")
    done = brrt(*command, "--at-iteration", "100")
    assert (done.code, done.err) == (0, "")
    assert done.out.splitlines()[0].startswith("c: 436 rows in 9 files: phase, sample, reject, ")
    assert done.out.splitlines()[2] == "g.graphml: 80 nodes"
    assert len(Path("c/nodes.csv").read_text().splitlines()) == 81
    assert brrt(*command).code == 2
    assert brrt(*command, "--force", "--at", "10s").err.count("this is its end") == 1
    assert len(Path("c/nodes.csv").read_text().splitlines()) == 271
    assert brrt("verify", "--path", "c/best_path.csv", "--world", "circles2d:n=20,seed=3").code == 0


def test_an_instant_for_foxglove(brrt: Callable[..., Result]) -> None:
    """The file has what there is until then."""
    golden = RECORDINGS / "boxes3d-bi-rrt-star.mcap"
    done = brrt("export", golden, "--foxglove", "viz.mcap", "--at-iteration", "20")
    assert done.code == 0
    assert 0 < int(done.out.split()[1]) < 513


def test_tables_of_events_that_make_no_tree(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """The tables are written and the nodes left out; there is no graph."""
    run, log = recorded(Scenario(world="circles2d:n=9", seed=1, clock="logical", iterations=60))
    edges = log[Kind.EDGE].copy()
    edges["node"][5] = 40
    write(tmp_path / "bad.mcap", run, Events(log.dof, {**log.tables, Kind.EDGE: edges}))
    done = brrt("export", "bad.mcap", "--csv", "c")
    assert (done.code, done.err.count("\n")) == (0, 1)
    assert "do not make trees" in done.err
    assert not Path("c/nodes.csv").exists()
    done = brrt("export", "bad.mcap", "--graphml", "g.graphml")
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert not Path("g.graphml").exists()
