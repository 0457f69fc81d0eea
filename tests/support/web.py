"""`brrt view --web` as a process, and the ports where processes listen."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def served(folder: Path, *args: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run `brrt view ... --web` until the body ends; yield the process and its address."""
    command = [sys.executable, "-m", "brrt_cli", "view", *map(str, args), "--web"]
    with subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(folder)},
    ) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert " at http://127.0.0.1:" in line
            yield process, line.split(" at ")[1].strip()
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()
                raise


def ports_of(process: Any) -> dict[int, str]:
    """Return the ports where a process of psutil listens, and the address of each."""
    found = process.net_connections()
    return {each.laddr.port: each.laddr.ip for each in found if each.status == "LISTEN"}
