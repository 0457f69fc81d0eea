"""Read a Rerun file that brrt wrote, through Rerun's own reader.

The file is a view of a run that also replays. Its format has no checksums of its contents, and
Rerun's reader aborts the process on some damage: a file that was cut or damaged is refused as far
as that shows, and the `.mcap` of the run, which is written beside it, is what replays then.
"""

import json
import struct
from collections.abc import Iterator, Mapping
from functools import partial
from os import SEEK_END
from pathlib import Path

import numpy as np
from rerun.chunk import LazyStore, RrdReader

from brrt.errors import BrrtError, RecordingError
from brrt.events import Events, Kind
from brrt.files import open_file, readable_name
from brrt.formats.integrity import Numbering, ReplacedError, parse_head
from brrt.formats.ordering import Waiting
from brrt.formats.rrd.columns import END, EVENTS, MANIFEST, WORLD, archetype, table_of
from brrt.recording import Recording
from brrt.scenario.manifest import Manifest

_MAGIC, _HEAD, _FRAME = b"RRF2", 12, struct.Struct("<QQ")
"""How a file begins, bytes before its first frame, and kind and length of each frame."""
_TAIL = struct.Struct("<QQI8sI")
"""The last bytes of a finished file: start, length and CRC-32 of its footer, magic, 1."""
_TAIL_MAGIC = b"RRF2FOOT"

_MOST_FRAME = 1 << 23
"""Bytes of a frame: events take up to 400,000, a world of 10 MB half of that. LZ4 turns a byte into
at most 255, and Rerun holds them twice: a file made to exhaust the memory gets 4 GB."""
_ANY, _TIMES = 1 << 26, 64
"""Bytes of all events in memory: in any case, and times the size of the file."""

_KINDS = {f"{EVENTS}{kind.label}": kind for kind in Kind}
_MOST_EVENTS = 1 << 16
"""Events in a batch."""


def read_rrd(path: Path) -> Recording:
    """Open a recording that `RerunSink` wrote.

    Raises:
        RecordingError: The file cannot be read, is cut or damaged, or is not a recording of brrt;
            reading the batches raises it too.
    """
    texts = _texts(path, _open(path))
    if MANIFEST not in texts or WORLD not in texts:
        raise RecordingError(f"{path}: a Rerun file, but not a recording of brrt (no {MANIFEST})")
    if END not in texts:
        raise _unusable(path, f"is cut, or was made of a file that was (no {END})")
    end = texts[END]
    try:
        strings = dict(json.loads(texts[MANIFEST]["json"]))
        result = dict(json.loads(end["result"])) if "result" in end else None
        stated = dict(json.loads(end.get("counts", "{}")))
        counts = {kind: int(stated[kind.label]) for kind in Kind if kind.label in stated}
        world_json, count = texts[WORLD]["json"], int(end["events"])
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise _unusable(path, f"is damaged ({error!r:.200})") from None
    manifest, world = parse_head(path, strings, world_json)
    batches = partial(_batches, path, manifest, texts[MANIFEST], count)
    return Recording(manifest, world, batches, result, counts or None)


def _unusable(path: Path, why: str) -> RecordingError:
    return RecordingError(f"{path}: {why}; replay the .mcap of the run")


def _damaged(path: Path, error: Exception) -> RecordingError:
    reason = (str(error).strip() or repr(error)).splitlines()[0]
    return _unusable(path, f"is damaged ({reason.partition(f'{path}: ')[2] or reason:.200})")


def _open(path: Path) -> LazyStore:
    """Return the chunks of the one recording in a file.

    Raises:
        RecordingError: The file is cut or damaged, or holds more than one recording.
    """
    try:
        _check_frames(path)
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    try:
        with readable_name(path) as name:
            reader = RrdReader(name)
            recordings = reader.recordings()
            if len(recordings) == 1:
                return reader.store()  # which keeps the file open
    except Exception as error:  # noqa: BLE001 - Rerun raises RuntimeError, ValueError and others
        raise _damaged(path, error) from None
    raise RecordingError(f"{path}: holds {len(recordings)} recordings; brrt reads a file with one")


def _check_frames(path: Path) -> None:
    """Check that a file ends as a finished one does, and that its frames lead there.

    Raises:
        OSError: The file cannot be read.
        RecordingError: It is cut or damaged.
    """
    with open_file(path) as file:
        if file.read(_HEAD)[: len(_MAGIC)] != _MAGIC:
            raise RecordingError(f"{path}: not a Rerun recording")
        size = file.seek(0, SEEK_END)
        file.seek(max(0, size - _TAIL.size))
        tail = file.read(_TAIL.size)
        if len(tail) < _TAIL.size or not tail[:-4].endswith(_TAIL_MAGIC):
            raise _unusable(path, "is cut")
        at, end = _HEAD, size - _TAIL.size
        while at < end:
            file.seek(at)
            length = _FRAME.unpack(file.read(_FRAME.size))[1]
            if length > end - at - _FRAME.size:
                raise _unusable(path, f"is damaged near byte {at:,}")
            if length > _MOST_FRAME:
                why = f"has a frame of {length:,} bytes; brrt reads up to {_MOST_FRAME:,}"
                raise _unusable(path, why)
            at += _FRAME.size + length


def _texts(path: Path, store: LazyStore) -> dict[str, dict[str, str]]:
    """Return the named texts of the entities at the beginning and at the end of a file."""
    texts: dict[str, dict[str, str]] = {}
    try:
        for chunk in store.stream().filter(content=[MANIFEST, WORLD, END]):
            entity, batch = chunk.entity_path, chunk.to_record_batch()
            batch.validate(full=True)
            prefix = f"{archetype(entity)}:"
            for name in batch.schema.names:
                if name.startswith(prefix) and batch.num_rows:
                    value = batch.column(name)[-1].as_py()
                    texts.setdefault(entity, {})[name.removeprefix(prefix)] = str(value[0])
    except Exception as error:  # noqa: BLE001 - whatever damage leads Rerun and pyarrow to
        raise _damaged(path, error) from None
    return texts


def _batches(
    path: Path, manifest: Manifest, head: Mapping[str, str], count: int
) -> Iterator[Events]:
    """Yield the `count` events that the file states, in order; `head` are the manifest's texts.

    Raises:
        RecordingError: The file is damaged, or another one than when it was opened.
    """
    store = _open(path)
    if _texts(path, store).get(MANIFEST) != head:
        raise ReplacedError(path)
    waiting, numbering, unpacked = Waiting(manifest.dof), Numbering(), 0
    most = _ANY + _TIMES * path.stat().st_size
    try:
        for chunk in store.stream().filter(content=[f"{EVENTS}**"]):
            kind = _KINDS.get(chunk.entity_path)
            if kind is None or chunk.is_static:
                continue
            batch = chunk.to_record_batch()
            unpacked += batch.nbytes
            if unpacked > most:
                raise BrrtError("it unpacks to more than any real file")  # noqa: TRY301
            batch.validate(full=True)
            waiting.add(kind, table_of(kind, manifest.dof, batch))
            if waiting.complete(numbering.next):
                events = waiting.events()
                waiting.clear()
                numbering.take(events)
                yield from _sliced(events)
        if waiting.count or numbering.next != count:
            there = numbering.next + waiting.count
            raise BrrtError(f"{count:,} events were written, {there:,} are there")  # noqa: TRY301
    except Exception as error:  # noqa: BLE001 - whatever damage leads Rerun and pyarrow to
        raise _damaged(path, error) from None


def _sliced(events: Events) -> Iterator[Events]:
    """Divide events, of which none is missing, into batches of `_MOST_EVENTS`."""
    if len(events) <= _MOST_EVENTS:
        if len(events):
            yield events
        return
    first, _ = events.kinds_in_order()
    for begin in range(first, first + len(events), _MOST_EVENTS):
        tables = {}
        for kind, table in events.tables.items():
            low, high = np.searchsorted(table["seq"], (begin, begin + _MOST_EVENTS))
            if low < high:
                tables[kind] = table[low:high]
        yield Events(events.dof, tables)
