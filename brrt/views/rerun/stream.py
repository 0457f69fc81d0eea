"""Rerun's recording streams, as all files and views of ours have them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from brrt.views.rerun.pipe import Drain
from brrt.views.viewer import process


def new_stream(name: str, application: str) -> Any:
    """Make a stream that goes nowhere yet.

    Args:
        name: Tells it from others; equal for what is to be one.
        application: A viewer keeps one layout for each.
    """
    rr.set_strict_mode(True)  # otherwise Rerun drops what it does not understand
    rec = rr.RecordingStream(application, recording_id=name, send_properties=False)
    rr.set_log_time_enabled(False, recording=rec)
    return rec


def connect(rec: Any, layout: rrb.Blueprint, drain: Drain | None, *, view: bool) -> None:
    """Let a stream run into a file, into the viewer that is open, or into both."""
    sinks: list[Any] = [rr.GrpcSink(process.address())] if view else []
    try:
        if drain is not None:
            sinks.append(rr.FileSink(drain.inlet))
        rec.set_sinks(*sinks, default_blueprint=layout)
    finally:
        if drain is not None:
            drain.leave()


@contextmanager
def filled(rec: Any, layout: rrb.Blueprint, path: Path | None, *, view: bool) -> Iterator[None]:
    """Let a stream take what the body logs, and end it.

    Args:
        rec: The stream.
        layout: How a viewer shows it.
        path: The file; it is overwritten.
        view: Open the viewer, or use one that is open.

    Raises:
        RecordingError: The file cannot be written, or there is no viewer.
    """
    if view:
        process.open_viewer()
    drain = None if path is None else Drain(path)
    try:
        connect(rec, layout, drain, view=view)
        yield
        rec.flush()
    finally:
        rec.disconnect()
        if drain is not None:
            drain.close()
