"""The files that a command writes and the windows it opens, checked before any work."""

import os
import sys
from pathlib import Path

from brrt.errors import BrrtError
from brrt.output_names import expect_new


def check_output(
    path: Path | None, option: str, suffix: str | tuple[str, ...], *, force: bool
) -> None:
    """Raise unless a file can be written.

    Raises:
        BrrtError: Its name, its folder or an existing file forbids it.
    """
    if path is None:
        return
    allowed = (suffix,) if isinstance(suffix, str) else suffix
    if path.suffix not in allowed:
        raise BrrtError(f"{option} {path}: the name must end in {' or '.join(allowed)}")
    if not path.parent.is_dir():
        raise BrrtError(f"{option} {path}: there is no folder {path.parent}; make it first")
    if path.is_dir():
        raise BrrtError(f"{option} {path}: is a folder")
    if path.exists() and not force:
        raise BrrtError(f"{option} {path}: exists already; choose another name or add --force")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise BrrtError(f"{option} {path}: no permission to write there")
    expect_new(path, new=not force)


def check_display(*, view: bool) -> None:
    """Raise if a viewer is to open and there is no display; Rerun would wait for it forever.

    Raises:
        BrrtError: There is no display.
    """
    if view and not _has_display():
        raise BrrtError("--view needs a display and there is none; use --rrd instead")


def check_window() -> None:
    """Raise unless `brrt view` can open a window.

    Raises:
        BrrtError: There is no display.
    """
    if not _has_display():
        raise BrrtError(
            "the viewer's window needs a display and there is none; use the browser (--web) or "
            "take a picture (--screenshot x.png)"
        )


def _has_display() -> bool:
    return sys.platform != "linux" or bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())
