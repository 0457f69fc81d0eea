"""Rerun's viewer, driven from here: opened at an instant, in a window or without one, pictured."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rerun.experimental import ViewerClient

from brrt.errors import RecordingError
from brrt.views.viewer.process import PAUSE_S, Program, connect, free_port, telling

LOAD_S, STILL_S = 600.0, 60.0
"""Seconds that the viewer gets to load a recording, and to draw it."""
_EMPTY_S = 2.0
"""After which a recording that has no times yet has none: nothing happened in it."""


class Cursor(NamedTuple):
    """An instant of a run: a number on the timeline `iteration` or `event`, or ns on `t`."""

    timeline: str
    value: int


def show(run: Path, cursor: Cursor | None, *marks: Path) -> None:
    """Open a recording in a window of its own; the window outlives us.

    One that is open goes on showing what somebody looks at.

    The viewer holds on to the file: once this returns, its name may go.

    Args:
        run: An .rrd file.
        cursor: Where to open it; None leaves that to the recording.
        marks: Files of the same recording with more to show.

    Raises:
        RecordingError: There is no viewer, or it does not take the recording.
    """
    port = free_port()
    program = Program(f"--port={port}", "--hide-welcome-screen")
    try:
        with telling("open the recording", program):
            _load(connect(port, program), run, cursor, *marks)
        program.leave()
    except BaseException:
        program.stop()
        raise


def screenshot(
    run: Path,
    picture: Path,
    cursor: Cursor | None = None,
    size: tuple[int, int] = (1600, 1000),
    *marks: Path,
) -> None:
    """Write a picture of a recording in the viewer as a PNG; no screen is needed.

    Args:
        run: An .rrd file.
        picture: The file to write.
        cursor: Which instant; None leaves that to the recording.
        size: Width and height in pixels.
        marks: Files of the same recording with more to show.

    Raises:
        RecordingError: The viewer cannot run here, or does not come to rest.
    """
    with headless(size) as client:
        _load(client, run, cursor, *marks)
        png = shoot(client, run, cursor)
    try:
        picture.write_bytes(png)
    except OSError as error:
        raise RecordingError(f"cannot write {picture}: {error.strerror}") from None


@contextmanager
def headless(size: tuple[int, int]) -> Iterator[ViewerClient]:
    """Run a viewer without a window; it ends with the body.

    Raises:
        RecordingError: It cannot run here, or fails in what the body asks of it.
    """
    port, (width, height) = free_port(), size
    program = Program(
        "--headless", f"--port={port}", f"--window-size={width}x{height}", "--hide-welcome-screen"
    )
    try:
        with telling("picture the recording", program):
            yield connect(port, program)
    finally:
        program.stop()


def shoot(client: ViewerClient, run: Path, cursor: Cursor | None, view: str | None = None) -> bytes:
    """Return a picture of a recording, as a PNG, once it stands still.

    Args:
        client: The viewer.
        run: An .rrd file; a viewer that has it open already only shows it.
        cursor: Which instant; None leaves that to the recording.
        view: Which view of it, by its name; None takes the whole viewer.

    Raises:
        RecordingError: It does not come to rest.
    """
    _load(client, run, cursor)
    end = time.monotonic() + STILL_S
    views = {each.name: each.view_id for each in client.get_state().views}
    last = b""
    while time.monotonic() < end:
        png = client.take_screenshot(None if view is None else views[view])
        # While chunks are still fetched, a wheel turns in the picture.
        if png == last:
            return png
        last = png
        time.sleep(PAUSE_S)
    raise RecordingError(f"{run}: its picture does not come to rest within {STILL_S:.0f} s")


def _load(client: ViewerClient, run: Path, cursor: Cursor | None, *marks: Path) -> None:
    """Open a recording, wait for all of it, and go to an instant."""
    stores = client.open(str(run.resolve())).store_ids
    if not stores:
        said = [entry.message for entry in client.get_logs() if entry.level == "ERROR"]
        reason = said[-1].splitlines()[0] if said else "it does not say why"
        raise RecordingError(f"{run}: the Rerun viewer does not take it: {reason}")
    for mark in marks:
        client.open(str(mark.resolve()))
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
    raise RecordingError(f"{run}: the Rerun viewer does not show it within {LOAD_S:.0f} s")


def _time(cursor: Cursor) -> dict[str, Any]:
    if cursor.timeline == "t":
        return {"duration": np.timedelta64(cursor.value, "ns")}
    return {"sequence": cursor.value}
