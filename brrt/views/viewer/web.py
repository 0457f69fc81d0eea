"""Rerun's viewer in the browser: a server for this machine only."""

import time
from pathlib import Path
from urllib.parse import quote

from brrt.errors import BrrtError, RecordingError
from brrt.views.viewer import process
from brrt.views.viewer.process import HERE, START_S, Program, free_port, is_taken

PORT = 9090
"""Of the page, unless another program listens there."""
_PAUSE_S = 0.1


class Server:
    """A web page with an .rrd file, which exists until `close`.

    Args:
        file: The file; it must not be deleted meanwhile.
        port: Port of the page; None takes `PORT` if it is free, else another one.

    Attributes:
        address: Address of the page.

    Raises:
        BrrtError: The port is taken.
        RecordingError: The server does not start.
    """

    def __init__(self, file: Path, port: int | None = None) -> None:
        if port is not None and is_taken(port):
            raise BrrtError(
                f"port {port} is taken; choose another one, or leave --port out to get a free one"
            )
        page = port or (free_port() if is_taken(PORT) else PORT)
        events = free_port()
        self._program = Program(
            str(file), "--serve-web", f"--port={events}", f"--web-viewer-port={page}"
        )
        source = quote(process.address(events), safe="")
        self.address = f"http://{HERE}:{page}/?theme=dark&url={source}"
        try:
            self._wait_for(page, events)
        except BaseException:
            self.close()
            raise

    def wait(self) -> None:
        """Wait until the server ends.

        Raises:
            RecordingError: It has ended without `close`.
        """
        self._program.wait()
        self._program.check()

    def close(self) -> None:
        """End the server."""
        self._program.stop()

    def _wait_for(self, *ports: int) -> None:
        end = time.monotonic() + START_S
        while not all(map(is_taken, ports)):
            self._program.check()
            if time.monotonic() > end:
                raise RecordingError(f"the web viewer does not start within {START_S:.0f} s")
            time.sleep(_PAUSE_S)
