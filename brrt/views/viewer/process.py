"""Rerun's viewer as a process of its own: its program, where it listens, and opening it."""

import importlib.util
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rerun.experimental import ViewerClient

from brrt.errors import RecordingError

HERE, PORT = "127.0.0.1", 9876
"""Where the viewer listens that live runs are sent to."""
START_S = 60.0
"""Seconds that a viewer gets to start."""
PAUSE_S = 0.25
"""Between two looks at what a viewer does."""
_DYING_S = 3.0
"""Within which a viewer that does not answer any more may turn out to have ended."""
_HELLO = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
"""How a gRPC client begins: the preface of HTTP/2 and settings, none (RFC 9113, sections 3.4 and
6.5)."""
_SETTINGS = 4
"""The type of the frame that the server answers with."""
_HELLO_S = 3.0
_ENVIRONMENT = {"RERUN_APP_ONLY": "true", "NO_COLOR": "1", "RUST_LOG": "error"}
"""What it logs as news, it also shows above the picture for a while, if it is slow to start."""
_NO_DRIVER = ("graphics adapter", "render context", "shared libraries", "Vulkan")
"""What it says as it dies for want of a driver."""


def address(port: int | None = None) -> str:
    """Where a viewer listens."""
    return f"rerun+http://{HERE}:{PORT if port is None else port}/proxy"


def program() -> str | None:
    """Return the viewer's own file: the script `rerun` is a wrapper whose child outlives it."""
    own = importlib.util.find_spec("rerun_cli")
    folder = None if own is None or own.origin is None else str(Path(own.origin).parent)
    # Rerun looks for its viewer on the PATH alone, where a venv that is not activated is missing.
    return shutil.which("rerun", path=folder) or shutil.which("rerun")


class Program:
    """The viewer's program, as a process of ours that listens on this machine alone.

    Args:
        options: Its options.

    Raises:
        RecordingError: It is not installed.
    """

    def __init__(self, *options: str) -> None:
        file = program()
        if file is None:
            raise RecordingError("there is no Rerun viewer; pip install rerun-sdk brings it")
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `leave` or `stop`
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

    def leave(self) -> None:
        """Let it outlive us, and this object."""
        self._log.close()
        self._process.returncode = 0  # else Python warns that nobody has waited for it

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


def open_viewer() -> None:
    """Open a viewer that streams can be sent to, or find the one that is open.

    Its window outlives us.

    Raises:
        RecordingError: It does not start, or something else listens in its place.
    """
    if is_taken(PORT):
        if not _answers(PORT):
            raise RecordingError(
                f"something that is no Rerun viewer, or does not answer, listens at port {PORT}; "
                f"end it, or write a file (--rrd) and look at that"
            )
        return
    window = Program(f"--port={PORT}", "--hide-welcome-screen")
    try:
        with telling("open", window):
            connect(PORT, window)
        window.leave()
    except BaseException:
        window.stop()
        raise


def _answers(port: int) -> bool:
    """Whether a gRPC server is at a port: a client would wait for ever for what is none."""
    try:
        with socket.create_connection((HERE, port), timeout=_HELLO_S) as probe:
            probe.sendall(_HELLO)
            return probe.recv(4)[3:] == bytes([_SETTINGS])
    except OSError:
        return False


def connect(port: int, program: Program) -> ViewerClient:
    """Wait for a viewer to answer."""
    end = time.monotonic() + START_S
    while True:
        program.check()
        try:
            client = ViewerClient.connect(address(port))
            client.get_state()
        except (OSError, RuntimeError, ValueError) as error:
            if time.monotonic() > end:
                reason = str(error).splitlines()[0]
                raise RecordingError(
                    f"the Rerun viewer does not answer within {START_S:.0f} s ({reason})"
                ) from None
            time.sleep(PAUSE_S)
        else:
            return client


@contextmanager
def telling(what: str, program: Program) -> Iterator[None]:
    """Turn what the viewer's client raises into one line; a viewer that dies says why itself."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        end = time.monotonic() + _DYING_S
        while time.monotonic() < end:
            program.check()
            time.sleep(PAUSE_S)
        reason = (str(error).strip() or repr(error)).splitlines()[0]
        raise RecordingError(f"the Rerun viewer cannot {what}: {reason}") from None
