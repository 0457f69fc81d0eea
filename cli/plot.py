"""`brrt plot`: figures of runs for papers and slides, without a viewer."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from .console import print_line
from .options import Accepted, At, AtEvent, AtIteration, Force, instant
from .progress import ProgressBar

if TYPE_CHECKING:
    from brrt.recording import Limits, Recording

PICTURES, ANIMATIONS = (".png", ".svg", ".pdf"), (".gif", ".mp4")
_LOOKS, _FILM = "Looks", "Animation"


def plot(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Recordings, .mcap or .rrd.")
    ],
    picture: Annotated[
        Path,
        typer.Option(
            "--out",
            help="A figure, .png, .svg or .pdf, or an animation, .gif or .mp4.",
            show_default=False,
        ),
    ],
    what: Annotated[
        str | None,
        typer.Option(
            help="tree, cost, time, several of them with commas, or all. Default: the tree, with "
            "the cost if the planner improves its path; for several runs the cost.",
            show_default=False,
        ),
    ] = None,
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    against: Annotated[
        str | None,
        typer.Option(
            help="Cost against time or iterations. Default: time, unless a clock is logical.",
            rich_help_panel=_LOOKS,
            show_default=False,
        ),
    ] = None,
    rejects: Annotated[
        int,
        typer.Option(
            help="Draw so many of the newest rejected extensions.",
            min=0,
            rich_help_panel=_LOOKS,
        ),
    ] = 0,
    width: Annotated[
        float | None,
        typer.Option(
            help="Width in inches. Default: 3.3, a column, for one panel; 6.9, a page, for more.",
            min=1.5,
            max=40,
            rich_help_panel=_LOOKS,
            show_default=False,
        ),
    ] = None,
    dpi: Annotated[
        int | None,
        typer.Option(
            help="Dots per inch. Default: 300; 145 for animations.",
            min=30,
            max=1200,
            rich_help_panel=_LOOKS,
            show_default=False,
        ),
    ] = None,
    azimuth: Annotated[
        float,
        typer.Option(
            help="Camera of 3D worlds: degrees around the vertical.", rich_help_panel=_LOOKS
        ),
    ] = -62.0,
    elevation: Annotated[
        float,
        typer.Option(
            help="Camera of 3D worlds: degrees above the horizon.", rich_help_panel=_LOOKS
        ),
    ] = 28.0,
    seconds: Annotated[
        float,
        typer.Option(help="Duration of the animation.", min=0.5, max=120, rich_help_panel=_FILM),
    ] = 8.0,
    fps: Annotated[
        float, typer.Option(help="Frames a second.", min=1, max=60, rich_help_panel=_FILM)
    ] = 20.0,
    force: Force = False,
    _partial: Accepted = False,
) -> None:
    """Draw a run for a paper: its trees, the cost of its best path, the time of its iterations.

    Examples:
      brrt plot run.mcap --out tree.png
      brrt plot run.mcap --out early.pdf --at-iteration 100 --rejects 200
      brrt plot a.mcap b.mcap c.mcap --what cost --out costs.svg
      brrt plot run.mcap --out growth.gif
    """
    from brrt.errors import BrrtError

    from .output_file import check_output

    check_output(picture, "--out", PICTURES + ANIMATIONS, force=force)
    moves = picture.suffix in ANIMATIONS
    panels = _panels(what)
    if against not in (None, "time", "iterations"):
        raise BrrtError(f"--against must be time or iterations, not {against!r}")
    if moves and (len(runs) > 1 or panels not in ([], ["tree"])):
        raise BrrtError(f"--out {picture}: an animation shows the tree of one run")
    limits = instant(at, at_event, at_iteration)

    from brrt.views.matplotlib.animation import DPI, need_ffmpeg, save_animation
    from brrt.views.matplotlib.draw_world import need_matplotlib
    from brrt.views.matplotlib.figure import FigureOptions, save_plot

    need_matplotlib()
    if picture.suffix == ".mp4":
        need_ffmpeg()
    options = FigureOptions(
        width=width, dpi=dpi or (DPI if moves else 300), rejects=rejects,
        against=cast("Any", against), azimuth=azimuth, elevation=elevation,
    )  # fmt: skip
    with ProgressBar(None, "reading").running() as watch:
        recordings = [_load(run, limits) for run in runs]
        watch.update(0, "drawing", "")
        if moves:

            def progress(done: int, total: int) -> None:
                watch.total = total
                watch.update(done, "drawing", f"frame {done:,} of {total:,}")

            save_animation(
                recordings[0], picture, options, seconds=seconds, fps=fps, progress=progress
            )
        else:
            save_plot(recordings, picture, panels, options, _names(runs))
    print_line(f"wrote {picture}")


def _panels(what: str | None) -> list[str]:
    from brrt.errors import unknown
    from brrt.views.matplotlib.figure import PANELS

    if what is None:
        return []
    if what == "all":
        return list(PANELS)
    names = [name.strip() for name in what.split(",")]
    for name in names:
        if name not in PANELS:
            raise unknown("part of a picture", name, (*PANELS, "all"))
    return list(dict.fromkeys(names))


def _load(run: Path, limits: "Limits") -> "Recording":
    """Return a recording up to the instant, with its events in memory."""
    from brrt.replay.fold import until

    from .run_file import open_run

    recording = open_run(run, limits, partial=True)
    batches = list(until(recording.batches(), limits))
    return replace(recording, batches=lambda: batches)


def _names(runs: list[Path]) -> list[str]:
    """Return the name of each run in the legend: with its folder if several share a name."""
    stems = Counter(run.stem for run in runs)
    return [run.stem if stems[run.stem] == 1 else str(run.with_suffix("")) for run in runs]
