"""A Chromium without a window, driven through its debugging pipe: no driver, no package."""

import base64
import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), None)
TIMEOUT = shutil.which("timeout")

_OPTIONS = (
    "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist", "--disable-background-networking", "--no-first-run",
    "--remote-debugging-pipe",
)  # fmt: skip


class Page:
    """A page in the browser; `pipe` is a pair of files, to write to it and to read from it."""

    def __init__(self, pipe: tuple[int, int], size: tuple[int, int]) -> None:
        self._out, self._in = pipe
        self._number, self._rest, self._session = 0, b"", ""
        target = self._ask("Target.createTarget", url="about:blank")["targetId"]
        attached = self._ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        self._ask(
            "Emulation.setDeviceMetricsOverride",
            width=size[0], height=size[1], deviceScaleFactor=1, mobile=False,
        )  # fmt: skip

    def visit(self, address: str) -> None:
        """Go to an address."""
        self._ask("Page.navigate", url=address)

    def click(self, x: float, y: float) -> None:
        """Click at a place, in pixels from the left and from the top."""
        where = {"x": x, "y": y, "button": "left", "clickCount": 1}
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self._ask("Input.dispatchMouseEvent", type=kind, **where)
            time.sleep(0.5)  # what draws a frame now and then looks at the mouse now and then

    def picture(self) -> bytes:
        """Return what the page shows, as a PNG; empty between two pages, where it shows nothing."""
        return base64.b64decode(self._ask("Page.captureScreenshot", format="png").get("data", ""))

    def _ask(self, method: str, **params: Any) -> dict[str, Any]:
        self._number += 1
        question: dict[str, Any] = {"id": self._number, "method": method, "params": params}
        if self._session:
            question["sessionId"] = self._session
        os.write(self._out, json.dumps(question).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                return dict(answer.get("result", {}))

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            data = os.read(self._in, 1 << 16)
            assert data, "the browser is gone"
            self._rest += data
        message, _, self._rest = self._rest.partition(b"\0")
        found = json.loads(message)
        assert isinstance(found, dict)
        return found


@contextmanager
def browser(folder: Path, size: tuple[int, int], seconds: int) -> Iterator[Page]:
    """Open a page; the browser and all its processes end with the body, or after a time.

    Args:
        folder: For the browser's own files.
        size: Of the page, in pixels.
        seconds: After which it is killed, whatever it does.
    """
    assert CHROMIUM is not None
    assert TIMEOUT is not None
    theirs, ours = os.pipe(), os.pipe()

    def hand_over() -> None:
        """Put the pipe where the browser looks for it: 3 to read from, 4 to write to."""
        ends = os.dup(theirs[0]), os.dup(ours[1])
        high = [os.dup2(end, 100 + i) for i, end in enumerate(ends)]
        os.dup2(high[0], 3)
        os.dup2(high[1], 4)

    process = subprocess.Popen(
        [TIMEOUT, "-k", "2", str(seconds), CHROMIUM, *_OPTIONS, f"--user-data-dir={folder}"],
        preexec_fn=hand_over,  # noqa: PLW1509 - there is no other way to give it files 3 and 4
        close_fds=False,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        os.close(theirs[0])
        os.close(ours[1])
        yield Page((theirs[1], ours[0]), size)
    finally:
        os.close(theirs[1])
        os.close(ours[0])
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
