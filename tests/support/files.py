"""Recordings as files: written by a sink, read back, compared, and taken apart."""

import resource
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from brrt import Events, Manifest, McapSink, RecordingError, Run, World, read
from tests.conftest import result_of

FORMATS = (".mcap", ".rrd")


def new_sink(path: Path, manifest: Manifest, world: World) -> Any:
    """Open a sink by the suffix of the name."""
    if path.suffix == ".rrd":
        from brrt.views.rerun.sink import RerunSink

        return RerunSink(manifest, world, path=path)
    return McapSink(path, manifest, world)


def write(path: Path, run: Run, *batches: Events) -> None:
    """Write batches to a file, then the result that follows from them."""
    sink = new_sink(path, run.manifest, run.problem.world)
    try:
        for batch in batches:
            sink.write(batch)
    except BaseException:
        sink.close(None)
        raise
    sink.close(result_of(run.manifest, *batches))


def part(log: Events, first: int, end: int) -> Events:
    """Return the events from a number on, up to another."""
    tables = {k: t[(t["seq"] >= first) & (t["seq"] < end)] for k, t in log.tables.items()}
    return Events(log.dof, {k: t for k, t in tables.items() if len(t)})


def saved(path: Path) -> tuple[Events, RecordingError | None]:
    """Return the events that a file gives, and the error after them."""
    recording, batches = read(path), list[Events]()
    try:
        batches.extend(recording.batches())
    except RecordingError as error:
        return Events.concat(recording.manifest.dof, batches), error
    return Events.concat(recording.manifest.dof, batches), None


def begins(log: Events, events: Events) -> bool:
    """Whether a log begins with these events, times included."""
    return same(log.until(seq=len(events) - 1), events)


def same(a: Events, b: Events) -> bool:
    """Whether two logs are equal in every bit, their types included."""
    if a.tables.keys() != b.tables.keys():
        return False
    for kind, table in a.tables.items():
        if table.dtype != b[kind].dtype or len(table) != len(b[kind]):
            return False
        for name in table.dtype.names or ():
            for x, y in zip(table[name], b[kind][name], strict=True):
                if np.shape(x) != np.shape(y) or x.tobytes() != y.tobytes():
                    return False
    return True


@contextmanager
def files_limited_to(size: int) -> Iterator[None]:
    """Let writing fail beyond a size, as on a disk that fills up."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def mcap_records(data: bytes, *opcodes: int) -> list[tuple[int, int]]:
    """Return place and length, head included, of an MCAP file's records of some kinds."""
    found, at = [], 8
    while at + 9 <= len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        found += [(at, length + 9)] if opcode in opcodes else []
        at += length + 9
    return found


def flipped(data: bytes, place: int) -> bytes:
    """Return data in which one bit is another."""
    damaged = bytearray(data)
    damaged[place] ^= 1 << place % 8
    return bytes(damaged)
