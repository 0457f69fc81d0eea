"""Events into MCAP: the ros2 profile, one topic a kind, a chunk of messages in one numpy pass."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from mcap import records
from numpy.typing import NDArray

from brrt.errors import WriteError
from brrt.events import FIELDS, Events, Kind
from brrt.formats.batching import Gathering
from brrt.formats.mcap.cdr import Layout, definition
from brrt.formats.mcap.container import Container
from brrt.formats.mcap.records import sealed
from brrt.recording import Result
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World

RUN, RESULT, WORLD = "brrt.run", "brrt.result", "world.json"
"""Names of the metadata and of the attachment."""

LEFT = "what was written before is whole: replay it with --partial, or see brrt recover"
"""What there is of a file whose disk filled up."""

_CHUNK_EVENTS = 8000
_CHUNK_SECONDS = 0.5
"""Half of what is promised: the rest is for the writing, on a machine that has more to do."""


def channel_of(kind: Kind) -> int:
    """Return the channel's number; 0 stands for no schema in MCAP."""
    return int(kind) + 1


class McapSink:
    """Writes every event, in order, to an MCAP file that stock tools read.

    Manifest and world come first, so that a cut file keeps them; the figures come last. A chunk
    is written at the latest by the first batch that comes half a second after its first event; in
    a `Background`, as `brrt plan` has it, that is so though the planner falls silent.

    Args:
        path: The file; it is overwritten.
        manifest: The run's.
        world: The run's.

    Raises:
        RecordingError: The file cannot be written.
    """

    def __init__(self, path: Path | str, manifest: Manifest, world: World) -> None:
        self._path, self._epoch = Path(path), manifest.epoch_ns
        self._layouts = {kind: Layout.parse(definition(kind, manifest.dof)) for kind in Kind}
        self._gathering = Gathering(manifest.dof, _CHUNK_EVENTS, _CHUNK_SECONDS)
        library = f"brrt {manifest.made_by.get('brrt', '')}".strip()
        try:
            self._file = Container(self._path, library)
            self._file.declare(*_schemas(manifest.dof), *_channels())
            self._file.metadata(RUN, sealed(manifest.to_strings()))
            self._file.attach(WORLD, world.to_json().encode(), manifest.epoch_ns)
            self._file.flush()
        except OSError as error:
            raise WriteError(path, error.strerror or str(error)) from None

    def write(self, events: Events) -> None:
        """Take a batch; small ones are gathered into one chunk."""
        self._write_chunk(self._gathering.add(events))

    def annotate(self, name: str, texts: dict[str, str]) -> None:
        """Keep named texts in the file, behind the events so far.

        Raises:
            RecordingError: The disk does not take them.
        """
        self._write_chunk(self._gathering.take())
        with self._failing():
            self._file.metadata(name, texts)

    def close(self, result: Result | None) -> None:
        """Write what is pending, the result, the index and the footer."""
        if self._file.closed:
            return
        try:
            self._write_chunk(self._gathering.take())
            with self._failing():
                if result is not None:
                    texts = {name: json.dumps(value) for name, value in result.items()}
                    self._file.metadata(RESULT, sealed(texts))
                self._file.finish()
        finally:
            with self._failing():
                self._file.close()

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """Say what can be saved where the disk does not take what is written."""
        try:
            yield
        except OSError as error:
            raise WriteError(self._path, error.strerror or str(error), LEFT) from None

    def _write_chunk(self, events: Events | None) -> None:
        if events is None:
            return
        raw, times, channels, offsets = self._encode(events)
        with self._failing():
            self._file.chunk(raw, times, channels, offsets)

    def _encode(
        self, events: Events
    ) -> tuple[bytes, NDArray[np.uint64], NDArray[np.uint8], NDArray[np.uint64]]:
        """Lay out Message records: (bytes, log times, channels, offsets of the records)."""
        first, kinds = events.kinds_in_order()
        sizes = np.zeros(len(kinds), np.int64)
        times = np.empty(len(kinds), np.uint64)
        blocks: list[tuple[NDArray[np.int64], Any]] = []
        for kind, table in events.tables.items():
            rows = table["seq"] - first
            records_of = self._fill(kind, table)
            times[rows] = records_of["log_time"]
            layout = self._layouts[kind]
            if layout.ragged is None:
                sizes[rows] = layout.record.itemsize
                blocks.append((rows, records_of))
                continue
            for i, row in enumerate(rows):
                packed = layout.pack(records_of[i], table[layout.ragged][i])
                sizes[row] = len(packed)
                blocks.append((rows[i : i + 1], np.frombuffer(packed, f"V{len(packed)}")))
        offsets = np.cumsum(sizes) - sizes
        raw = np.empty(int(sizes.sum()), np.uint8)
        for rows, block in blocks:
            size = block.dtype.itemsize
            # Every place where a record of this size could begin, as one overlapping view.
            window = np.ndarray((len(raw) - size + 1,), f"V{size}", raw.data, strides=(1,))
            window[offsets[rows]] = block.view(f"V{size}")
        return raw.tobytes(), times, kinds + np.uint8(1), offsets.astype(np.uint64)

    def _fill(self, kind: Kind, table: NDArray[np.void]) -> NDArray[np.void]:
        """Copy a table's columns into Message records."""
        layout = self._layouts[kind]
        block = layout.blank(len(table), channel_of(kind))
        block["seq"] = table["seq"] & 0xFFFFFFFF
        block["log_time"] = table["t"] + self._epoch
        block["publish_time"] = block["log_time"]
        block["iteration"] = table["iteration"]
        for field in FIELDS[kind]:
            if field.name != layout.ragged:
                block[field.name] = table[field.name]
        return block


def _schemas(dof: int) -> list[records.Schema]:
    return [
        records.Schema(
            id=channel_of(kind),
            data=definition(kind, dof).encode(),
            encoding="ros2msg",
            name=f"brrt_msgs/msg/{kind.label.capitalize()}",
        )
        for kind in Kind
    ]


def _channels() -> list[records.Channel]:
    return [
        records.Channel(
            id=channel_of(kind),
            topic=f"/brrt/{kind.label}",
            message_encoding="cdr",
            metadata={},
            schema_id=channel_of(kind),
        )
        for kind in Kind
    ]
