"""Rerun's viewer, driven from here: opened at an instant, in a window or without one, pictured."""

import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rerun.experimental import ViewerClient

from brrt.errors import RecordingError
from brrt.recording import viewer

HERE = "127.0.0.1"
START_S, LOAD_S, STILL_S = 60.0, 600.0, 60.0
"""Seconds that the viewer gets to start, to load a recording, and to draw it."""
_PAUSE_S = 0.25
"""Between two looks at what the viewer does."""
_DYING_S = 3.0
"""Within which a viewer that does not answer any more may turn out to have ended."""
_EMPTY_S = 2.0
"""After which a recording that has no times yet has none: nothing happened in it."""
_ENVIRONMENT = {"RERUN_APP_ONLY": "true", "NO_COLOR": "1", "RUST_LOG": "error"}
"""What it logs as news, it also shows above the picture for a while, if it is slow to start."""
_NO_DRIVER = ("graphics adapter", "render context", "shared libraries", "Vulkan")
"""What it says as it dies for want of a driver."""


class Cursor(NamedTuple):
    """An instant of a run: a number on the timeline `iteration` or `event`, or ns on `t`."""

    timeline: str
    value: int


class Program:
    """The viewer's program, as a process of ours that listens on this machine alone.

    Args:
        options: Its options.

    Raises:
        RecordingError: It is not installed.
    """

    def __init__(self, *options: str) -> None:
        file = viewer.program()
        if file is None:
            raise RecordingError("there is no Rerun viewer; pip install rerun-sdk brings it")
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - the viewer may outlive this object
        # A session of its own: Ctrl-C in the terminal reaches us alone, and we end it in order.
        self._process = subprocess.Popen(  # noqa: S603 - our own viewer
            [file, f"--bind={HERE}", *options],
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            start_new_session=True,
            env={**os.environ, **_ENVIRONMENT},
        )

    def check(self) -> None:
        """See that it still runs.

        Raises:
            RecordingError: It does not; with the reason, and what helps.
        """
        if self._process.poll() is None:
            return
        said = self.said()
        if any(text in said for text in _NO_DRIVER):
            raise RecordingError(
                "the Rerun viewer found no graphics driver; a software one will do "
                "(Debian: apt install mesa-vulkan-drivers libvulkan1 libegl1 libgl1-mesa-dri "
                "libxkbcommon-x11-0 libxcursor1 libxi6 libxrandr2)"
            )
        lines = said.strip().splitlines() or ["it said nothing"]
        raise RecordingError(f"the Rerun viewer ended: {lines[-1]}")

    def said(self) -> str:
        """Return what it has written so far."""
        self._log.seek(0)
        return self._log.read().decode(errors="replace")

    def wait(self) -> None:
        """Wait until it ends by itself."""
        self._process.wait()

    def stop(self) -> None:
        """End it, and wait for that."""
        self._process.terminate()
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()


def is_taken(port: int) -> bool:
    """Whether something listens at a port of this machine."""
    with socket.socket() as probe:
        probe.settimeout(1)
        return probe.connect_ex((HERE, port)) == 0


def free_port() -> int:
    """Return a port that nobody listens at."""
    with socket.socket() as probe:
        probe.bind((HERE, 0))
        return int(probe.getsockname()[1])


def show(run: Path, cursor: Cursor | None) -> None:
    """Open a recording in a window of its own; the window outlives us.

    A window that is open may hold a run with another layout, or with another number of degrees of
    freedom, which Rerun does not take beside it: recordings of one application share both.

    The viewer holds on to the file: once this returns, its name may go.

    Args:
        run: An .rrd file.
        cursor: Where to open it; None leaves that to the recording.

    Raises:
        RecordingError: There is no viewer, or it does not take the recording.
    """
    port = free_port()
    program = Program(f"--port={port}", "--hide-welcome-screen")
    try:
        with _telling("open the recording", program):
            _load(_connect(port, program), run, cursor)
    except BaseException:
        program.stop()
        raise


def screenshot(
    run: Path, picture: Path, cursor: Cursor | None = None, size: tuple[int, int] = (1600, 1000)
) -> None:
    """Write a picture of a recording in the viewer as a PNG; no screen is needed.

    Args:
        run: An .rrd file.
        picture: The file to write.
        cursor: Which instant; None leaves that to the recording.
        size: Width and height in pixels.

    Raises:
        RecordingError: The viewer cannot run here, or does not come to rest.
    """
    with headless(size) as client:
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
        with _telling("picture the recording", program):
            yield _connect(port, program)
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
        time.sleep(_PAUSE_S)
    raise RecordingError(f"{run}: its picture does not come to rest within {STILL_S:.0f} s")


def _connect(port: int, program: Program) -> ViewerClient:
    """Wait for a viewer to answer."""
    end = time.monotonic() + START_S
    while True:
        program.check()
        try:
            client = ViewerClient.connect(viewer.address(port))
            client.get_state()
        except (OSError, RuntimeError, ValueError) as error:
            if time.monotonic() > end:
                reason = str(error).splitlines()[0]
                raise RecordingError(
                    f"the Rerun viewer does not answer within {START_S:.0f} s ({reason})"
                ) from None
            time.sleep(_PAUSE_S)
        else:
            return client


def _load(client: ViewerClient, run: Path, cursor: Cursor | None) -> None:
    """Open a recording, wait for all of it, and go to an instant."""
    stores = client.open(str(run.resolve())).store_ids
    if not stores:
        said = [entry.message for entry in client.get_logs() if entry.level == "ERROR"]
        reason = said[-1].splitlines()[0] if said else "it does not say why"
        raise RecordingError(f"{run}: the Rerun viewer does not take it: {reason}")
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
        time.sleep(_PAUSE_S)
    raise RecordingError(f"{run}: the Rerun viewer does not show it within {LOAD_S:.0f} s")


def _time(cursor: Cursor) -> dict[str, Any]:
    if cursor.timeline == "t":
        return {"duration": np.timedelta64(cursor.value, "ns")}
    return {"sequence": cursor.value}


@contextmanager
def _telling(what: str, program: Program) -> Iterator[None]:
    """Turn what the viewer's client raises into one line; a viewer that dies says why itself."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        end = time.monotonic() + _DYING_S
        while time.monotonic() < end:
            program.check()
            time.sleep(_PAUSE_S)
        reason = (str(error).strip() or repr(error)).splitlines()[0]
        raise RecordingError(f"the Rerun viewer cannot {what}: {reason}") from None
