"""The format of files with graph events: older versions of brrt refuse it in one line."""

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from brrt import Kind, McapSink, Recording, Run, Scenario, read
from brrt.events import Events, table_dtype
from brrt.formats.mcap.container import Container
from brrt.formats.mcap.messages import TOPICS
from brrt.formats.mcap.reader import is_whole
from brrt.formats.recover import recover
from brrt.scenario.manifest import Manifest

RUN = Scenario(world="circles2d:n=5,seed=1", seed=1, smooth=False)
Open = Callable[[Path, Manifest, Any], Any]


def _rerun(path: Path, manifest: Manifest, world: Any) -> Any:
    from brrt.views.rerun.sink import RerunSink

    return RerunSink(manifest, world, path=path)


def _with_graph(recording: Recording) -> list[Events]:
    """Return the events of a run, and graph events after them."""
    batches = list(recording.batches())
    count, last = sum(map(len, batches)), batches[-1].last
    head = (last.t + 1, last.iteration)
    vertex = np.array([(count, *head, 1, 0, (1, 2))], table_dtype(Kind.VERTEX, 2))
    check = np.array([(count + 1, head[0] + 1, head[1], 1, 0, -1, 0.25, (3, 4))],
                     table_dtype(Kind.CHECK, 2))  # fmt: skip
    return [*batches, Events(2, {Kind.VERTEX: vertex}), Events(2, {Kind.CHECK: check})]


@pytest.mark.parametrize(("name", "sink"), [("run.mcap", McapSink), ("run.rrd", _rerun)])
def test_a_file_changes_its_format(tmp_path: Path, name: str, sink: Open) -> None:
    """With its first graph event, wherever that is; nothing is lost."""
    run, path = Run(RUN).record(), tmp_path / name
    batches = _with_graph(run)
    opened = sink(path, run.manifest, run.world)
    for batch in batches[:-2]:
        opened.write(batch)
    opened.annotate("brrt.note", {"some": "text"})  # writes what was gathered
    for batch in batches[-2:]:
        opened.write(batch)
    opened.close(None)
    recording = read(path)
    assert recording.manifest.format == "3"
    assert run.manifest.format == "1"
    assert recording.manifest.to_strings() == run.manifest.to_strings() | {"format": "3"}
    log = recording.events()
    assert len(log) == sum(map(len, batches))
    assert log[Kind.CHECK][0].tolist()[3:7] == (1, 0, -1, 0.25)
    assert log[Kind.CHECK]["q"].tolist() == [[3, 4]]
    assert log[Kind.VERTEX]["q"].tolist() == [[1, 2]]


def test_the_file_is_whole_and_of_stock_tools(tmp_path: Path) -> None:
    """Its checksums hold, and the stock reader finds the new topics."""
    run, path = Run(RUN).record(), tmp_path / "run.mcap"
    sink = McapSink(path, run.manifest, run.world)
    for batch in _with_graph(run):
        sink.write(batch)
        sink.annotate("brrt.note", {})
    sink.close(None)
    assert is_whole(path)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        topics = {channel.topic for _, channel, _ in reader.iter_messages()}
        texts = {each.name: each.metadata for each in reader.iter_metadata()}
    assert {"/brrt/vertex", "/brrt/check"} <= topics
    assert texts["brrt.run"]["format"] == "3"
    recover(path, tmp_path / "anew.mcap")
    assert read(tmp_path / "anew.mcap").manifest.format == "3"


def test_a_file_without_graph_events_keeps_its_format(tmp_path: Path) -> None:
    """It declares none of the new topics."""
    run, path = Run(RUN).record(), tmp_path / "run.mcap"
    sink = McapSink(path, run.manifest, run.world)
    for batch in run.batches():
        sink.write(batch)
    sink.close(None)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {channel.topic for channel in summary.channels.values()}
    assert topics == {topic for topic, kind in TOPICS.items() if kind <= Kind.MOVE}
    assert read(path).manifest.format == "1"


@pytest.mark.parametrize("between", [0, 1, 1 << 20, 3_000_001])
def test_checksum_of_rewritten_texts(tmp_path: Path, between: int) -> None:
    """The checksum of the data section is that of the bytes in the file."""
    path, old, new = tmp_path / "x.mcap", {"a": "1"}, {"a": "3, longer"}
    file = Container(path, "test")
    file.rewritable_metadata("x", old)
    file.attach("y", bytes(between), 0)
    file.rewrite_metadata("x", old, new)
    file.flush()
    assert file._crc == zlib.crc32(path.read_bytes())
    with pytest.raises(ValueError, match="x needs"):
        file.rewrite_metadata("x", new, {"a": "b" * 99})
    file.close()
