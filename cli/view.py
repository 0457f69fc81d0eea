"""`brrt view`: one recording or two in the Rerun viewer: a window, the browser or a picture."""

import re
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import SIGNALLED, print_line
from .options import Accepted, At, AtEvent, AtIteration, instant
from .progress import ProgressBar
from .signals import handling_signals

if TYPE_CHECKING:
    from brrt.recording import Recording
    from brrt.views.viewer.control import Cursor

_TIMELINES = {"t": "t", "seq": "event", "iteration": "iteration"}
_SMALLEST, _LARGEST = 200, 8192
"""Pixels along a side of a picture."""


def view(
    runs: Annotated[
        list[Path], typer.Argument(help="A recording, .mcap or .rrd; or two.", metavar="RUN [RUN]")
    ],
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    web: Annotated[
        bool,
        typer.Option(
            "--web",
            help="Serve the viewer to this machine's browser, until Ctrl-C.",
            rich_help_panel="Where",
        ),
    ] = False,
    port: Annotated[
        int | None,
        typer.Option(
            help="Of the page that --web serves. Default 9090, or a free one.",
            rich_help_panel="Where",
            min=1,
            max=65535,
        ),
    ] = None,
    screenshot: Annotated[
        Path | None,
        typer.Option(
            help="Write a picture, .png, instead of opening a window.", rich_help_panel="Where"
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            help="Of the picture in pixels. Default 1600x1000.",
            metavar="WIDTHxHEIGHT",
            rich_help_panel="Where",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the picture.")] = False,
    _partial: Accepted = False,
) -> None:
    """Show a recording, or two side by side with a ring where they first differ.

    The run is shown at its end, unless an instant is given; drag the time slider.
    The window stays open when the command ends.

    Examples:
      brrt view run.mcap
      brrt view run.mcap --at-iteration 400
      brrt view seven.mcap eight.mcap
      brrt view run.mcap --web
      brrt view run.mcap --at 20ms --screenshot run.png
    """
    limits = instant(at, at_event, at_iteration)
    pixels = _check(runs, limits, web, port, screenshot, size, force=force)
    # The handler raises, so a signal too removes the folder and ends the processes started here.
    with tempfile.TemporaryDirectory(prefix="brrt-") as folder, handling_signals(_end):
        with ProgressBar(None, "drawing").running() as watch:
            file, cursor = _draw(runs, limits, Path(folder), watch)
        if web:
            _serve(file, runs, port)
            return
        from brrt.views.viewer import control

        with ProgressBar(None, "waiting for the viewer").running():
            if screenshot is None:
                control.show(file, cursor)
            else:
                control.screenshot(file, screenshot, cursor, pixels)
        if screenshot is not None:
            print_line(f"{screenshot}: written")


def _check(
    runs: list[Path],
    limits: dict[str, int],
    web: bool,
    port: int | None,
    screenshot: Path | None,
    size: str | None,
    *,
    force: bool,
) -> tuple[int, int]:
    """Check the options; return the size of the picture in pixels."""
    from brrt.errors import BrrtError

    from .output_file import check_output, check_window

    if len(runs) > 2:
        raise BrrtError(f"brrt view shows one run, or two side by side, not {len(runs)}")
    if web and screenshot is not None:
        raise BrrtError("give one of --web and --screenshot")
    if web and limits:
        # Rerun 0.41 takes an instant in an address, `#when=iteration@200`, for recordings of a
        # catalog server only, not for those of a proxy or a file.
        raise BrrtError(
            "the web viewer opens at the start; leave --at out and drag the time slider, or "
            "take a picture of the instant with --screenshot"
        )
    if port is not None and not web:
        raise BrrtError("--port is the web page's; add --web")
    if size is not None and screenshot is None:
        raise BrrtError("--size is the picture's; add --screenshot FILE.png")
    check_output(screenshot, "--screenshot", ".png", force=force)
    if not web and screenshot is None:
        check_window()
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", size or "1600x1000")
    if match is None:
        raise BrrtError(f"--size must read WIDTHxHEIGHT, as 1600x1000, not {size!r}")
    width, height = int(match[1]), int(match[2])
    if not (_SMALLEST <= width <= _LARGEST and _SMALLEST <= height <= _LARGEST):
        raise BrrtError(f"--size {size}: each side must have {_SMALLEST} to {_LARGEST} pixels")
    return width, height


def _draw(
    runs: list[Path], limits: dict[str, int], folder: Path, watch: ProgressBar
) -> "tuple[Path, Cursor | None]":
    """Return an .rrd file of the runs, drawn into the folder if needed, and where to open it."""
    recordings = []
    for run in runs:
        watch.update(0, f"reading {run.name}", "")
        recordings.append(_load(run))
    _check_instant(limits, recordings)
    from brrt.views.rerun.drawing import draw_run
    from brrt.views.rerun.pair import draw_pair
    from brrt.views.viewer.control import Cursor

    cursors = [Cursor(_TIMELINES[name], value) for name, value in limits.items()]
    cursor, file = cursors[0] if cursors else None, folder / f"{_stem(runs[0])}.rrd"
    last = max((batch.last.iteration for run in recordings for batch in run.batches()), default=0)
    if len(runs) == 2:
        watch.update(0, "drawing both runs", "")
        difference = draw_pair(file, *recordings)
        result = "are equal, event by event" if difference is None else f"part at {difference}"
        print_line(f"{runs[0]} and {runs[1]} {result}")
        if cursor is None and difference is not None:
            cursor = Cursor("event", difference.seq)
        return file, cursor or Cursor("iteration", last)
    cursor = cursor or Cursor("iteration", last)
    ring = limits.get("seq")
    if runs[0].suffix == ".rrd" and ring is None and recordings[0].result is not None:
        if file.stem == runs[0].stem:
            return runs[0], cursor
        file.symlink_to(runs[0].absolute())
        return file, cursor
    watch.total = total = sum(map(len, recordings[0].batches()))
    draw_run(
        file,
        recordings[0],
        ring=ring,
        progress=lambda done: watch.update(done, "drawing", f"{done:,} of {total:,} events"),
    )
    return file, cursor


def _stem(run: Path) -> str:
    """Return a file's name without its ending, as the viewer can read it."""
    from brrt.text import readable

    return readable(run.stem).replace("\\", "_") if readable(run) != str(run) else run.stem


def _load(run: Path) -> "Recording":
    """Return a recording with its events in memory."""
    from .run_file import open_run

    recording = open_run(run, partial=True)
    batches = [batch for batch in recording.batches() if len(batch)]
    return replace(recording, batches=lambda: batches)


def _check_instant(limits: dict[str, int], recordings: "list[Recording]") -> None:
    """Check that at least one of the runs lasts until the instant."""
    from brrt.errors import BrrtError
    from brrt.events import Instant

    from .run_file import end_before

    ends = []
    for recording in recordings:
        log = list(recording.batches())
        last = log[-1].last if log else Instant(0, 0)
        ends.append(end_before(limits, sum(map(len, log)), last))
    if all(ends):
        raise BrrtError(f"{ends[-1]}; the instant asked for comes later")


def _serve(file: Path, runs: list[Path], port: int | None) -> None:
    from brrt.views.viewer.web import Server

    server = Server(file, port)
    try:
        what = " and ".join(map(str, runs))
        print_line(f"{what} at {server.address}")
        print_line("Ctrl-C ends it")
        sys.stdout.flush()
        server.wait()
    finally:
        server.close()


def _end(number: int, _: object) -> None:
    sys.exit(SIGNALLED + number)
