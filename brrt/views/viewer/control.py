"""Rerun's viewer under control: open a drawing at an instant, in a window or for a picture."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rerun.experimental import ViewerClient

from brrt.errors import RecordingError
from brrt.views.viewer.process import PAUSE_S, Program, connect, free_port, viewer_errors

LOAD_S, STILL_S = 600.0, 60.0
"""Time limits of the viewer to load a file, and to draw it."""
_EMPTY_S = 2.0
"""A file without times after that has no events."""


class Cursor(NamedTuple):
    """An instant of a run: a number on the timeline `iteration` or `event`, or ns on `t`."""

    timeline: str
    value: int


def show(file: Path, cursor: Cursor | None) -> None:
    """Open an .rrd file in a new window, which stays open when this process ends.

    Without a cursor, the file's layout chooses the instant. The file may be deleted afterwards.

    Raises:
        RecordingError: There is no viewer, or it rejects the file.
    """
    port = free_port()
    program = Program(f"--port={port}", "--hide-welcome-screen")
    try:
        with viewer_errors("open the recording", program):
            _load(connect(port, program), file, cursor)
        program.leave()
    except BaseException:
        program.stop()
        raise


def screenshot(
    file: Path,
    picture: Path,
    cursor: Cursor | None = None,
    size: tuple[int, int] = (1600, 1000),
) -> None:
    """Write a picture of an .rrd file in the viewer as a PNG; no screen is needed.

    Raises:
        RecordingError: The viewer cannot run, or its picture does not come to rest.
    """
    with headless(size) as client:
        png = shoot(client, file, cursor)
    try:
        picture.write_bytes(png)
    except OSError as error:
        raise RecordingError(f"cannot write {picture}: {error.strerror}") from None


@contextmanager
def headless(size: tuple[int, int]) -> Iterator[ViewerClient]:
    """Run a viewer without a window until the body ends.

    Raises:
        RecordingError: The viewer cannot run, or fails in the body.
    """
    port, (width, height) = free_port(), size
    program = Program(
        "--headless", f"--port={port}", f"--window-size={width}x{height}", "--hide-welcome-screen"
    )
    try:
        with viewer_errors("picture the recording", program):
            yield connect(port, program)
    finally:
        program.stop()


def shoot(
    client: ViewerClient, file: Path, cursor: Cursor | None, view: str | None = None
) -> bytes:
    """Return a picture of an .rrd file in the viewer, as a PNG, once it is at rest.

    `view` is the title of one view; None takes the whole window.

    Raises:
        RecordingError: The picture does not come to rest.
    """
    _load(client, file, cursor)
    end = time.monotonic() + STILL_S
    views = {each.name: each.view_id for each in client.get_state().views}
    last = b""
    while time.monotonic() < end:
        png = client.take_screenshot(None if view is None else views[view])
        if png == last:  # while chunks are loaded, a spinner turns
            return png
        last = png
        time.sleep(PAUSE_S)
    raise RecordingError(f"{file}: its picture does not come to rest within {STILL_S:.0f} s")


def _load(client: ViewerClient, file: Path, cursor: Cursor | None) -> None:
    """Open a file, wait until all of it is loaded, and go to an instant."""
    stores = client.open(str(file.absolute())).store_ids
    if not stores:
        errors = [entry.message for entry in client.get_logs() if entry.level == "ERROR"]
        reason = errors[-1].splitlines()[0] if errors else "no reason given"
        raise RecordingError(f"{file}: the Rerun viewer rejects the file: {reason}")
    begin = time.monotonic()
    while time.monotonic() < begin + LOAD_S:
        state = client.get_state()
        mine = next((each for each in state.recordings if each.store_id == stores[0]), None)
        if mine is not None and state.views and not state.loading:
            if cursor is None or (mine.current_timeline, mine.current_time) == cursor:
                return
            if mine.timelines:
                at = _time(cursor)
                client.set_time(cursor.timeline, **at, play_state="paused", recording=stores[0])
            elif time.monotonic() > begin + _EMPTY_S:
                return
        time.sleep(PAUSE_S)
    raise RecordingError(f"{file}: the Rerun viewer does not show it within {LOAD_S:.0f} s")


def _time(cursor: Cursor) -> dict[str, Any]:
    if cursor.timeline == "t":
        return {"duration": np.timedelta64(cursor.value, "ns")}
    return {"sequence": cursor.value}
