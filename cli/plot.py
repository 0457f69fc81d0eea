"""`brrt plot`: pictures of runs for papers and slides, without a viewer."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from .console import Watch, note, out
from .instants import At, AtEvent, AtIteration, beyond, instant
from .saved import Saved, opened

if TYPE_CHECKING:
    from brrt.views.matplotlib.history import Record

PICTURES, ANIMATIONS = (".png", ".svg", ".pdf"), (".gif", ".mp4")
_VERB = "draw them"
_LOOKS, _FILM = "Looks", "Animation"


def plot(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Recordings, .mcap or .rrd.")
    ],
    picture: Annotated[
        Path,
        typer.Option(
            "--out",
            help="A picture, .png, .svg or .pdf, or the run as it grows, .gif or .mp4.",
            show_default=False,
        ),
    ],
    what: Annotated[
        str | None,
        typer.Option(
            help="tree, cost, time, several of them with commas, or all; by default the tree, and "
            "the cost where the planner improves its path or there are several runs.",
            show_default=False,
        ),
    ] = None,
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    against: Annotated[
        str | None,
        typer.Option(
            help="Cost against time or iterations; time, unless a clock is logical.",
            rich_help_panel=_LOOKS,
            show_default=False,
        ),
    ] = None,
    rejects: Annotated[
        int,
        typer.Option(
            help="Draw that many of the newest rejected extensions.",
            min=0,
            rich_help_panel=_LOOKS,
        ),
    ] = 0,
    width: Annotated[
        float | None,
        typer.Option(
            help="Width in inches; 3.3, a column, for one panel, and 6.9 for more.",
            min=1.5,
            max=40,
            rich_help_panel=_LOOKS,
            show_default=False,
        ),
    ] = None,
    dpi: Annotated[
        int | None,
        typer.Option(
            help="Dots per inch; 300, and 145 in animations.",
            min=30,
            max=1200,
            rich_help_panel=_LOOKS,
            show_default=False,
        ),
    ] = None,
    azimuth: Annotated[
        float,
        typer.Option(help="Camera of 3D worlds, degrees around.", rich_help_panel=_LOOKS),
    ] = -62.0,
    elevation: Annotated[
        float, typer.Option(help="Camera of 3D worlds, degrees up.", rich_help_panel=_LOOKS)
    ] = 28.0,
    seconds: Annotated[
        float,
        typer.Option(help="How long it grows.", min=0.5, max=120, rich_help_panel=_FILM),
    ] = 8.0,
    fps: Annotated[
        float, typer.Option(help="Frames a second.", min=1, max=60, rich_help_panel=_FILM)
    ] = 20.0,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file.")] = False,
    partial: Annotated[
        bool, typer.Option("--partial", help="Take what is whole of a cut or damaged file.")
    ] = False,
) -> None:
    """Draw a run for a paper: its trees, the cost of its best path, where the time goes.

    brrt plot run.mcap --out tree.png

    brrt plot run.mcap --out early.pdf --at-iteration 100 --rejects 200

    brrt plot a.mcap b.mcap c.mcap --what cost --out costs.svg

    brrt plot run.mcap --out growth.gif
    """
    from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast

    from .outputs import check_output  # noqa: PLC0415

    check_output(picture, "--out", PICTURES + ANIMATIONS, force=force)
    moves = picture.suffix in ANIMATIONS
    panels = _panels(what)
    if against not in (None, "time", "iterations"):
        raise BrrtError(f"--against must be time or iterations, not {against!r}")
    if moves and (len(runs) > 1 or panels not in ([], ["tree"])):
        raise BrrtError(f"--out {picture}: an animation shows the tree of one run")
    limits = instant(at, at_event, at_iteration)

    from brrt.views.matplotlib.animation import DPI, Pace, need_ffmpeg, save_animation  # noqa: PLC0415
    from brrt.views.matplotlib.draw_world import need_matplotlib  # noqa: PLC0415
    from brrt.views.matplotlib.figure import Look, save_plot  # noqa: PLC0415

    need_matplotlib()
    if picture.suffix == ".mp4":
        need_ffmpeg()
    look = Look(
        width=width, dpi=dpi or (DPI if moves else 300), rejects=rejects,
        against=cast("Any", against),
        azimuth=azimuth, elevation=elevation,
    )  # fmt: skip
    with Watch(None, "reading").running() as watch:
        records = _records(runs, limits, partial=partial)
        watch.update(0, "drawing", "")
        if moves:

            def tell(done: int, total: int) -> None:
                watch.total = total
                watch.update(done, "drawing", f"frame {done:,} of {total:,}")

            save_animation(records[0], picture, look, Pace(seconds, fps), tell)
        else:
            save_plot(records, picture, panels, look)
    out.print(f"wrote {picture}", markup=False, soft_wrap=True)


def _panels(what: str | None) -> list[str]:
    from brrt.errors import unknown  # noqa: PLC0415
    from brrt.views.matplotlib.figure import PANELS  # noqa: PLC0415

    if what is None:
        return []
    if what == "all":
        return list(PANELS)
    names = [name.strip() for name in what.split(",")]
    for name in names:
        if name not in PANELS:
            raise unknown("part of a picture", name, (*PANELS, "all"))
    return list(dict.fromkeys(names))


def _records(runs: list[Path], limits: dict[str, int], *, partial: bool) -> "list[Record]":
    """Read the runs, up to the instant asked for; those of one name are told apart by folder."""
    from brrt.events import Events  # noqa: PLC0415
    from brrt.recording import Memory  # noqa: PLC0415
    from brrt.replay.fold import feed  # noqa: PLC0415
    from brrt.views.matplotlib.history import Record  # noqa: PLC0415

    names = Counter(run.stem for run in runs)
    records = []
    for run in runs:
        recording, memory = opened(run, partial=partial), Memory()
        end = feed(Saved(recording, partial=partial, verb=_VERB), [memory], limits)
        if end is not None:
            late = beyond(limits, *end)
            if late is not None:
                note(f"{late}; this is how it stood then")
        name = run.stem if names[run.stem] == 1 else str(run.with_suffix(""))
        events = Events.concat(recording.manifest.dof, memory.batches)
        records.append(Record(name, recording.manifest, recording.world, events))
    return records
