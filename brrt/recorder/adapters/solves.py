"""The recordings of a script's solves, which adapters open."""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from brrt.errors import BrrtError
from brrt.events import Status
from brrt.recorder.record import record
from brrt.recorder.recorder import Recorder


@dataclass
class Solves:
    """Names and opens a recording for each solve of a script.

    Attributes:
        folder: Where the recordings go.
        stem: What their names begin with; a number follows, from 1 on.
        on_failed: Takes what could not be recorded and why, one line.
        files: The recordings so far, in order.
    """

    folder: Path
    stem: str
    on_failed: Callable[[str], None]
    files: list[Path] = field(default_factory=list)
    _process: int = field(default_factory=os.getpid)
    _opened: list[Recorder] = field(default_factory=list)

    def next_file(self) -> Path:
        """Return the file of the next solve, for adapters that write it by themselves.

        Raises:
            BrrtError: This is a child process, which would write the files of its parent.
        """
        if os.getpid() != self._process:
            raise BrrtError("it runs in a child process; run it in the script's own process")
        self.files.append(self.folder / f"{self.stem}-{len(self.files) + 1}.mcap")
        return self.files[-1]

    def open(self, **given: Any) -> Recorder:
        """Open the recording of a solve; close it, or use it in a `with` statement.

        Args:
            given: What `brrt.record` takes beside the file.

        Raises:
            BrrtError: As `brrt.record`; then there is no file, and the solve has no number.
        """
        file = self.next_file()
        try:
            self._opened.append(record(file, **given))
        except BaseException:
            self.files.remove(file)
            raise
        return self._opened[-1]

    def failed(self, what: str, error: BaseException) -> None:
        """Report that a solve is not recorded, or only in part; the script goes on.

        Args:
            what: The solve, such as "RRT.planning".
            error: Why.
        """
        reason = str(error) if isinstance(error, BrrtError) else repr(error)
        self.on_failed(f"{what} is not recorded: {reason}")

    def close(self) -> None:
        """Close what is still open, as interrupted, once the script has ended."""
        if os.getpid() == self._process:
            for each in self._opened:
                try:
                    each.close(Status.INTERRUPTED)
                except Exception as error:  # noqa: BLE001 - the others are closed too
                    self.failed("the end of a solve", error)
