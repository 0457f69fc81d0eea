"""An MCAP file of a run whose 3D panel in Foxglove or Lichtblick shows any instant after a seek.

After a seek these viewers know the last message of each topic. Whatever grows or changes is spread
over a few topics, so that these messages together show the run after all events up to and including
that time, and nothing of later ones: see `interval_topics`.

Events cannot be read back from the file.
"""

import struct
from collections.abc import Callable, Iterator
from heapq import merge
from importlib.metadata import version
from itertools import chain, islice
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap import records

from brrt.files import replacing
from brrt.formats.mcap.container import Container
from brrt.formats.mcap.messages import MESSAGE
from brrt.recording import Recording
from brrt.views.foxglove.draw_world import static_messages
from brrt.views.foxglove.layout import layout
from brrt.views.foxglove.messages import DEFINITIONS
from brrt.views.foxglove.streams import MarkerStreams, Message

EXPORT = "brrt.export"
"""Name of the metadata that describe the run."""

_CHUNK, _LEVEL = 8 << 20, 13
"""Bytes of a chunk, and level of compression: most of a message repeats an earlier one of the same
chunk. At 4 MiB the file is an eighth larger, at level 3 a quarter. But a viewer that seeks unpacks
a chunk for each topic: at 16 MiB it would take twice as long, for 3 % less."""


def export(
    recording: Recording,
    path: Path | str,
    *,
    layout_path: Path | str | None = None,
    progress: Callable[[float], object] = float,
) -> int:
    """Write a run as messages that Foxglove and Lichtblick draw.

    Args:
        recording: The run.
        path: The MCAP file; it appears once it is complete, and replaces an older one.
        layout_path: Where to write a layout to import, likewise.
        progress: Gets the part that has been written, from 0 to 1.

    Returns:
        Messages written.

    Raises:
        BrrtError: A file cannot be written, or the events contradict each other.
    """
    events, manifest, world = recording.events(), recording.manifest, recording.world
    streams = MarkerStreams(manifest, world, events).streams()
    first = [Message(0, *what) for what in static_messages(manifest, world)]
    messages = chain(first, merge(*streams, key=itemgetter(0)))
    topics: dict[str, int] = {}
    with replacing(Path(path)) as unfinished:
        file = Container(unfinished, f"brrt {version('brrt')}", _LEVEL)
        try:
            file.metadata(EXPORT, manifest.to_strings())
            packed = _pack(file, messages, manifest.epoch_ns, topics)
            # Every seek reads the static messages: they have a small chunk of their own.
            count = _fill(file, islice(packed, len(first)), 0, float)
            count += _fill(file, packed, events.last.t, progress)
            file.finish()
        finally:
            file.close()
        if layout_path is not None:
            with replacing(Path(layout_path)) as other:
                other.write_text(layout(world, topics))
    return count


class _Packed(NamedTuple):
    """A Message record of the MCAP file; `t` as in `Message`."""

    t: int
    log_time: int
    channel: int
    data: bytes


def _pack(
    file: Container, messages: Iterator[Message], epoch: int, topics: dict[str, int]
) -> Iterator[_Packed]:
    """Yield Message records; declare each topic before its first one, and add it to `topics`."""
    schemas = {name: number for number, name in enumerate(DEFINITIONS, 1)}
    for name, number in schemas.items():
        file.declare(records.Schema(number, DEFINITIONS[name].encode(), "ros2msg", name))
    for t, topic, schema, body in messages:
        if topic not in topics:
            topics[topic] = len(topics) + 1
            file.declare(records.Channel(topics[topic], topic, "cdr", {}, schemas[schema]))
        # opcode, length, channel, sequence, time of log, time of publication
        sizes = MESSAGE, 22 + len(body), topics[topic], 0, epoch + t, epoch + t
        yield _Packed(t, epoch + t, topics[topic], struct.pack("<BQHIQQ", *sizes) + body)


def _fill(
    file: Container, messages: Iterator[_Packed], end: int, progress: Callable[[float], object]
) -> int:
    """Write messages in chunks; return their number."""
    count, size, pending = 0, 0, list[_Packed]()
    for message in messages:
        pending.append(message)
        size += len(message.data)
        if size >= _CHUNK:
            _flush(file, pending)
            progress(message.t / max(1, end))
            count, size = count + len(pending), 0
            pending.clear()
    if pending:
        _flush(file, pending)
    return count + len(pending)


def _flush(file: Container, messages: list[_Packed]) -> None:
    times = np.array([message.log_time for message in messages], np.uint64)
    channels = np.array([message.channel for message in messages], np.uint16)
    sizes = np.array([len(message.data) for message in messages], np.uint64)
    raw = b"".join(message.data for message in messages)
    file.chunk(raw, times, channels, np.cumsum(sizes) - sizes)
