"""Rerun's viewer in the browser: a server on this machine alone."""

import time
from pathlib import Path
from urllib.parse import quote

from brrt.errors import BrrtError, RecordingError
from brrt.views.viewer import process
from brrt.views.viewer.process import HERE, START_S, Program, free_port, is_taken

PORT = 9090
"""Where the page is, if nothing else is there."""
_PAUSE_S = 0.1


class Server:
    """A page with a recording, as long as the object is not closed.

    Args:
        run: An .rrd file; it must stay.
        port: Where the page is to be; None takes `PORT`, or a free one.

    Attributes:
        address: What to open in the browser.

    Raises:
        BrrtError: The port is taken.
        RecordingError: The server does not start.
    """

    def __init__(self, run: Path, port: int | None = None) -> None:
        if port is not None and is_taken(port):
            raise BrrtError(
                f"port {port} is taken; choose another one, or name none to get a free one"
            )
        page = port or (free_port() if is_taken(PORT) else PORT)
        events = free_port()
        self._program = Program(
            str(run), "--serve-web", f"--port={events}", f"--web-viewer-port={page}"
        )
        source = quote(process.address(events), safe="")
        self.address = f"http://{HERE}:{page}/?theme=dark&url={source}"
        try:
            self._wait_for(page, events)
        except BaseException:
            self.close()
            raise

    def wait(self) -> None:
        """Wait for the server's end.

        Raises:
            RecordingError: It has ended, though nobody closed it.
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
