"""`brrt view`: a recording, or two, in the Rerun viewer: a window, the browser, or a picture."""

import re
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import SIGNALLED, Watch, out
from .instants import At, AtEvent, AtIteration, beyond, instant
from .saved import Saved, opened
from .signals import handling_signals

if TYPE_CHECKING:
    from brrt.events import Events
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
    partial: Annotated[
        bool, typer.Option("--partial", help="Take what is whole of a cut or damaged file.")
    ] = False,
) -> None:
    """Look at a recording, or at two side by side with a ring where they part.

    The window stays when the command ends.

    brrt view run.mcap

    brrt view run.mcap --at-iteration 400

    brrt view seven.mcap eight.mcap

    brrt view run.mcap --web

    brrt view run.mcap --at 20ms --screenshot run.png
    """
    limits = instant(at, at_event, at_iteration)
    pixels = _check(runs, limits, web, port, screenshot, size, force=force)
    # Ended by a signal as by Ctrl-C, nothing that we started or wrote for a while outlives us.
    with tempfile.TemporaryDirectory(prefix="brrt-") as folder, handling_signals(_end):
        with Watch(None, "drawing").running() as watch:
            file, cursor, *marks = _prepare(runs, limits, Path(folder), watch, partial=partial)
        if web:
            _serve(file, runs, port)
            return
        from brrt.views.viewer import control  # noqa: PLC0415 - costs half a second

        with Watch(None, "waiting for the viewer").running():
            if screenshot is None:
                control.show(file, cursor, *marks)
            else:
                control.screenshot(file, screenshot, cursor, pixels, *marks)
        if screenshot is not None:
            out.print(f"{screenshot}: written", markup=False, soft_wrap=True)


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
    """See that the options go together; return the size of the picture."""
    from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast

    from .outputs import check_output, check_window  # noqa: PLC0415

    if len(runs) > 2:
        raise BrrtError(f"brrt view shows one run, or two side by side, not {len(runs)}")
    if web and screenshot is not None:
        raise BrrtError("give one of --web and --screenshot")
    if web and limits:
        # Rerun 0.41 takes an instant in an address, `#when=iteration@200`, for what a catalog
        # server has, and not for a proxy's recording or a file's: tried in Chromium.
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


def _prepare(
    runs: list[Path], limits: dict[str, int], folder: Path, watch: Watch, *, partial: bool
) -> "tuple[Path, Cursor | None, *tuple[Path, ...]]":
    """Return an .rrd file of the runs, drawn into the folder where needed, and where to open it.

    Behind them come files with more to show.
    """
    recordings = [opened(run, partial=partial) for run in runs]
    logs, cut = [], False
    for recording, run in zip(recordings, runs, strict=True):
        watch.update(0, f"reading {run.name}", "")
        saved = Saved(recording, partial=partial, verb="show them")
        logs.append([batch for batch in saved if len(batch)])
        cut = cut or saved.cut
    _check_instant(limits, logs)

    from brrt.views.viewer.control import Cursor  # noqa: PLC0415 - costs half a second

    cursors = [Cursor(_TIMELINES[name], value) for name, value in limits.items()]
    cursor = cursors[0] if cursors else None
    if len(runs) == 2:
        return _prepare_pair(runs, recordings, logs, folder, watch, cursor)
    marks = _marks(recordings[0], logs[0], limits, folder)
    if runs[0].suffix == ".rrd" and not cut:
        return runs[0], cursor, *marks
    file = folder / f"{runs[0].stem}.rrd"
    _draw(recordings[0], logs[0], file, watch)
    return file, cursor, *marks


def _marks(
    recording: "Recording", log: "list[Events]", limits: dict[str, int], folder: Path
) -> list[Path]:
    """Draw a ring around the place of the event that is asked for, if one is."""
    from brrt.events import Events  # noqa: PLC0415
    from brrt.views.rerun.marker import draw_mark  # noqa: PLC0415

    if "seq" not in limits:
        return []
    mark, events = folder / "mark.rrd", Events.concat(recording.manifest.dof, log)
    draw_mark(mark, recording.manifest, recording.world, events, limits["seq"])
    return [mark]


def _check_instant(limits: dict[str, int], logs: "list[list[Events]]") -> None:
    """See that at least one of the runs lasts until the instant."""
    from brrt.errors import BrrtError  # noqa: PLC0415
    from brrt.events import Instant  # noqa: PLC0415

    if not limits:
        return
    late = [
        beyond(limits, sum(map(len, log)), log[-1].last if log else Instant(0, 0)) for log in logs
    ]
    if all(late):
        raise BrrtError(f"{late[-1]}; the instant asked for comes later")


def _draw(recording: "Recording", log: "list[Events]", file: Path, watch: Watch) -> None:
    """Draw a recording as `brrt replay --rrd` does."""
    from brrt.views.rerun.sink import RerunSink  # noqa: PLC0415

    sink, done = RerunSink(recording.manifest, recording.world, path=file), 0
    watch.total = total = sum(map(len, log))
    try:
        for batch in log:
            sink.write(batch)
            done += len(batch)
            watch.update(done, "drawing", f"{done:,} of {total:,} events")
    finally:
        sink.close(recording.result)


def _prepare_pair(
    runs: list[Path],
    recordings: "list[Recording]",
    logs: "list[list[Events]]",
    folder: Path,
    watch: Watch,
    cursor: "Cursor | None",
) -> "tuple[Path, Cursor | None]":
    """Draw two runs; where nothing else is asked for, they open where they part."""
    from brrt.events import Events  # noqa: PLC0415
    from brrt.views.rerun.pair import Side, draw_pair  # noqa: PLC0415
    from brrt.views.viewer.control import Cursor  # noqa: PLC0415

    watch.update(0, "drawing both runs", "")
    sides = [
        Side(
            run.name,
            recording.manifest,
            recording.world,
            Events.concat(recording.manifest.dof, log),
        )
        for run, recording, log in zip(runs, recordings, logs, strict=True)
    ]
    file = folder / "pair.rrd"
    difference = draw_pair(file, *sides)
    told = "are equal, event by event" if difference is None else f"part at {difference}"
    out.print(f"{runs[0]} and {runs[1]} {told}", markup=False, soft_wrap=True)
    if cursor is None and difference is not None:
        cursor = Cursor("event", difference.seq)
    return file, cursor


def _serve(file: Path, runs: list[Path], port: int | None) -> None:
    from brrt.views.viewer.web import Server  # noqa: PLC0415

    server = Server(file, port)
    try:
        what = " and ".join(map(str, runs))
        out.print(f"{what} at {server.address}", markup=False, soft_wrap=True)
        out.print("Ctrl-C ends it")
        out.file.flush()
        server.wait()
    finally:
        server.close()


def _end(number: int, _: object) -> None:
    sys.exit(SIGNALLED + number)
