"""Rerun's recording streams: how they are named, and where they lead."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from brrt.files import replacing
from brrt.views.rerun.pipe import FilePipe
from brrt.views.viewer import process


def new_stream(name: str, application: str) -> Any:
    """Return a stream that leads nowhere yet.

    Args:
        name: Streams of one name are one recording in a viewer.
        application: A viewer keeps one layout for each.
    """
    rr.set_strict_mode(True)  # otherwise Rerun drops what it does not understand
    rec = rr.RecordingStream(application, recording_id=name, send_properties=False)
    rr.set_log_time_enabled(False, recording=rec)
    return rec


def connect(rec: Any, layout: rrb.Blueprint, pipe: FilePipe | None, *, view: bool) -> None:
    """Let a stream lead into a file, into the viewer that is open, or into both."""
    sinks: list[Any] = [rr.GrpcSink(process.address())] if view else []
    try:
        if pipe is not None:
            sinks.append(rr.FileSink(pipe.inlet))
        rec.set_sinks(*sinks, default_blueprint=layout)
    finally:
        if pipe is not None:
            pipe.close_inlet()


@contextmanager
def rrd_file(
    path: Path, name: str, application: str, layout: rrb.Blueprint
) -> Iterator[rr.RecordingStream]:
    """Collect what the body logs, and write it to an .rrd file at the end.

    The file appears once it is complete, and replaces an older one. Rerun's own file writer may
    hang when a write fails, so the bytes pass through memory.

    Raises:
        BrrtError: The file cannot be written.
    """
    rec = new_stream(name, application)
    try:
        buffer = rec.binary_stream()
        rec.send_blueprint(layout)  # active: the web viewer ignores a default that comes late
        yield rec
        data = buffer.read(flush=True) or b""
    finally:
        rec.disconnect()
    with replacing(path) as unfinished:
        unfinished.write_bytes(data)


@contextmanager
def viewer_stream(
    name: str, application: str, layout: rrb.Blueprint
) -> Iterator[rr.RecordingStream]:
    """Show what the body logs in the open viewer, or in one that is opened for it.

    Raises:
        RecordingError: There is no viewer.
    """
    process.open_viewer()
    rec = new_stream(name, application)
    try:
        connect(rec, layout, None, view=True)
        yield rec
        rec.flush()
    finally:
        rec.disconnect()
