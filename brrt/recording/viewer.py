"""Rerun's viewer: where it is, and opening it."""

import importlib.util
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr

from brrt.errors import RecordingError

APPLICATION = "brrt"
PORT = 9876


def address(port: int | None = None) -> str:
    """Where a viewer listens."""
    return f"rerun+http://127.0.0.1:{PORT if port is None else port}/proxy"


def program() -> str | None:
    """Return the viewer's own file: the script `rerun` is a wrapper whose child outlives it."""
    own = importlib.util.find_spec("rerun_cli")
    folder = None if own is None or own.origin is None else str(Path(own.origin).parent)
    # Rerun looks for its viewer on the PATH alone, where a venv that is not activated is missing.
    return shutil.which("rerun", path=folder) or shutil.which("rerun")


def open_viewer(rec: rr.RecordingStream) -> None:
    """Open Rerun's viewer, or find one that is open.

    Raises:
        RecordingError: There is none.
    """
    try:
        # Without a recording that is enabled, `spawn` does nothing.
        with _nothing_to_inherit():
            rr.spawn(
                port=PORT,
                connect=False,
                hide_welcome_screen=True,
                executable_path=program(),
                recording=rec,
            )
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[0]
        raise RecordingError(f"cannot open the Rerun viewer: {reason}") from None


@contextmanager
def _nothing_to_inherit() -> Iterator[None]:
    """Keep our output from a child that outlives us: a pipe that we write to would never end."""
    kept = {number: os.dup(number) for number in (1, 2)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in kept:
            os.dup2(nowhere, number)
        yield
    finally:
        for number, copy in kept.items():
            os.dup2(copy, number)
            os.close(copy)
        os.close(nowhere)
