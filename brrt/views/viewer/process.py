"""The processes of Rerun's viewer: start one, connect to it, or find the one that is open."""

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
"""Address of the viewer for live runs."""
START_S = 60.0
"""Time limit of a viewer to start."""
PAUSE_S = 0.25
"""Between two requests to a viewer."""
_DYING_S = 3.0
"""A viewer that stops answering may end within that time, and give a reason."""
_HELLO = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
"""First bytes of a gRPC client: HTTP/2's preface and empty settings (RFC 9113, 3.4 and 6.5)."""
_SETTINGS = 4
"""Type of the frame with which the server answers."""
_HELLO_S = 3.0
_ENVIRONMENT = {"RERUN_APP_ONLY": "true", "NO_COLOR": "1", "RUST_LOG": "error"}
"""A viewer that starts slowly would show its log messages above the picture."""
_NO_DRIVER = ("graphics adapter", "render context", "shared libraries", "Vulkan")
"""Words in the output of a viewer that ends because there is no driver."""


def address(port: int | None = None) -> str:
    """Return the address of a viewer."""
    return f"rerun+http://{HERE}:{PORT if port is None else port}/proxy"


def program() -> str | None:
    """Return the viewer's executable; the script `rerun` is a wrapper that does not end it."""
    own = importlib.util.find_spec("rerun_cli")
    folder = None if own is None or own.origin is None else str(Path(own.origin).parent)
    # Rerun itself searches the PATH only, which lacks a venv that is not activated.
    return shutil.which("rerun", path=folder) or shutil.which("rerun")


class Program:
    """A process of the viewer that listens on this machine only.

    Raises:
        RecordingError: The viewer is not installed.
    """

    def __init__(self, *options: str) -> None:
        file = program()
        if file is None:
            raise RecordingError("there is no Rerun viewer; pip install rerun-sdk brings it")
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `leave` or `stop`
        # A session of its own: Ctrl-C in the terminal reaches only brrt, which then stops it.
        self._process = subprocess.Popen(  # noqa: S603 - the viewer of rerun-sdk
            [file, f"--bind={HERE}", *options],
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            start_new_session=True,
            env={**os.environ, **_ENVIRONMENT},
        )

    def check(self) -> None:
        """Check that the process runs.

        Raises:
            RecordingError: It has ended; the message has the reason and what to do.
        """
        if self._process.poll() is None:
            return
        self._log.seek(0)
        output = self._log.read().decode(errors="replace")
        if any(text in output for text in _NO_DRIVER):
            raise RecordingError(
                "the Rerun viewer found no graphics driver; a software one is enough "
                "(Debian: apt install mesa-vulkan-drivers libvulkan1 libegl1 libgl1-mesa-dri "
                "libxkbcommon-x11-0 libxcursor1 libxi6 libxrandr2)"
            )
        lines = output.strip().splitlines() or ["no reason given"]
        raise RecordingError(f"the Rerun viewer ended: {lines[-1]}")

    def wait(self) -> None:
        """Wait until the process ends by itself."""
        self._process.wait()

    def leave(self) -> None:
        """Let the process run on when this one ends."""
        self._log.close()
        self._process.returncode = 0  # without it Python warns about a running child

    def stop(self) -> None:
        """End the process."""
        self._process.terminate()
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()


def is_taken(port: int) -> bool:
    """Return whether a program listens at a port of this machine."""
    with socket.socket() as probe:
        probe.settimeout(1)
        return probe.connect_ex((HERE, port)) == 0


def free_port() -> int:
    """Return a free port."""
    with socket.socket() as probe:
        probe.bind((HERE, 0))
        return int(probe.getsockname()[1])


def open_viewer() -> None:
    """Open the viewer for live runs unless it is open; its window stays when this process ends.

    Raises:
        RecordingError: It does not start, or another program listens at its port.
    """
    if is_taken(PORT):
        if not _answers(PORT):
            raise RecordingError(
                f"the program at port {PORT} is not a Rerun viewer, or does not answer; end it, or "
                f"write a file with --rrd and open that"
            )
        return
    window = Program(f"--port={PORT}", "--hide-welcome-screen")
    try:
        with viewer_errors("open", window):
            connect(PORT, window)
        window.leave()
    except BaseException:
        window.stop()
        raise


def _answers(port: int) -> bool:
    """Return whether a gRPC server listens at a port; a client waits forever for another one."""
    try:
        with socket.create_connection((HERE, port), timeout=_HELLO_S) as probe:
            probe.sendall(_HELLO)
            return probe.recv(4)[3:] == bytes([_SETTINGS])
    except OSError:
        return False


def connect(port: int, program: Program) -> ViewerClient:
    """Connect to a viewer that is starting."""
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
def viewer_errors(what: str, program: Program) -> Iterator[None]:
    """Turn errors of the client into one line, or into the reason why the viewer ended."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        end = time.monotonic() + _DYING_S
        while time.monotonic() < end:
            program.check()
            time.sleep(PAUSE_S)
        reason = (str(error).strip() or repr(error)).splitlines()[0]
        raise RecordingError(f"the Rerun viewer cannot {what}: {reason}") from None
