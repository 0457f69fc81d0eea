"""A run as it grows, as a .gif by Pillow or an .mp4 by ffmpeg."""

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from brrt.errors import BrrtError
from brrt.files import replacing
from brrt.views.colours import OBSTACLE, OBSTACLE_3D
from brrt.views.matplotlib import style
from brrt.views.matplotlib.draw_world import need_matplotlib, rgb
from brrt.views.matplotlib.figure import Look, explain, height_of_tree, tree_panel
from brrt.views.matplotlib.history import History, Record
from brrt.views.matplotlib.tree import TreePanel

Pixels = NDArray[np.uint8]
Progress = Callable[[int, int], None]
"""Is told how many frames are done, and of how many."""

DPI = 145
"""Of animations: a column's width then has 480 pixels."""
_MOST_PIXELS = 2048
_PLANNING = 0.85
"""Part of the frames in which the planner is at work, where anything happens afterwards."""
_HOLD_S = 1.5
"""How long the last frame stays."""
_FEWEST_FRAMES, _MOST_EDGES = 24, 2_000_000
"""Edges drawn over all frames, about: beyond that there are fewer frames, of the same seconds."""
_MOST_BYTES = 5_000_000
"""Of a .gif; one that is larger loses frames."""


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast a run is shown.

    Attributes:
        seconds: How long it takes.
        fps: Frames a second.
    """

    seconds: float = 8.0
    fps: float = 20.0


def save_animation(
    record: Record,
    path: Path,
    look: Look | None = None,
    pace: Pace | None = None,
    progress: Progress = lambda done, total: None,  # noqa: ARG005 - nobody asked
) -> None:
    """Draw a run as it grows into a .gif or .mp4 file; equal runs give equal files.

    Args:
        record: The run.
        path: The file; it appears under its name when it is whole.
        look: How it is drawn.
        pace: How fast.
        progress: Is told how far the work is.

    Raises:
        BrrtError: matplotlib or, for .mp4, ffmpeg is missing or fails, the picture is too large,
            or the file cannot be written.
    """
    look, pace = look or Look(dpi=DPI), pace or Pace()
    need_matplotlib()
    write = _write_gif
    if path.suffix == ".mp4":
        write = _write_mp4
        need_ffmpeg()
    with style.paper():
        panel, canvas = _stage(record, look)
        seqs, seconds = instants(panel.history, pace)
        frames = _frames(panel, canvas, seqs, progress)
        with replacing(path) as unfinished:
            write(frames, seconds, unfinished)


def need_ffmpeg() -> str:
    """Return where ffmpeg is.

    Raises:
        BrrtError: It is nowhere.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        raise BrrtError(
            ".mp4 files need ffmpeg, which is not on the PATH; install it, or write a .gif"
        )
    return found


def instants(history: History, pace: Pace) -> tuple[NDArray[np.int64], list[float]]:
    """Choose the events after which a frame is drawn, and how long each is seen, in seconds.

    The number of events rises as the square of the time, so that the first ones are seen one by
    one; what comes after planning gets a part of its own.
    """
    wanted = max(3, round(pace.seconds * pace.fps))
    nodes = history.nodes(history.last)
    most = max(_FEWEST_FRAMES, 2 * _MOST_EDGES // max(nodes, 1))
    frames = min(wanted, most)
    last, planned = history.last, history.planned
    after = last > planned
    growing = max(2, int(frames * _PLANNING)) if after else frames
    seqs = np.linspace(0, 1, growing) ** 2 * planned
    if after:
        seqs = np.concatenate([seqs, np.linspace(planned, last, frames - growing + 1)[1:]])
    chosen = np.round(seqs).astype(np.int64)
    shown = [pace.seconds / len(chosen)] * len(chosen)
    shown[-1] += _HOLD_S
    return chosen, shown


def _stage(record: Record, look: Look) -> tuple[TreePanel, Any]:
    """Draw what never changes; return the panel, and the canvas that holds it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    width = look.width or style.COLUMN_IN + 0.01
    size = width, height_of_tree(record, width)
    if max(size) * look.dpi > _MOST_PIXELS:
        raise BrrtError(
            f"{max(size) * look.dpi:.0f} pixels are too many for an animation, which has at most "
            f"{_MOST_PIXELS}; give a smaller --width or --dpi"
        )
    figure = Figure(figsize=size, dpi=look.dpi, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    panel = tree_panel(figure, record, look)
    explain(figure, panel, _marks(panel))
    canvas.draw()
    figure.set_layout_engine("none")
    for artist in panel.drawn_last:
        artist.set_animated(True)
    canvas.draw()
    return panel, canvas


def _marks(panel: TreePanel) -> list[Any]:
    """Return what a legend has to name of all that comes; a robot has arrived at the end."""
    marks: list[Any] = []
    for seq in (panel.history.planned, panel.history.last):
        panel.show(seq)
        marks += [mark for mark in panel.legend() if mark not in marks]
    return marks


def _frames(
    panel: TreePanel, canvas: Any, seqs: NDArray[np.int64], progress: Progress
) -> Iterator[Pixels]:
    """Yield a picture after each of the events, shape (height, width, 3), both even."""
    ax = canvas.figure.axes[0]
    ground = canvas.copy_from_bbox(canvas.figure.bbox)
    for number, seq in enumerate(seqs.tolist()):
        canvas.restore_region(ground)
        panel.show(seq)
        for artist in panel.drawn_last:
            if hasattr(artist, "do_3d_projection"):
                artist.do_3d_projection()
            ax.draw_artist(artist)
        pixels = np.asarray(canvas.buffer_rgba())
        height, width = (side // 2 * 2 for side in pixels.shape[:2])
        yield pixels[:height, :width, :3].copy()
        progress(number + 1, len(seqs))


def _write_gif(frames: Iterator[Pixels], seconds: list[float], path: Path) -> None:
    """Write frames in the colours that pictures are made of, leaving some out of a large file."""
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette().tobytes())
    plain = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    ends = np.round(100 * np.cumsum(seconds)).astype(int)  # a .gif counts hundredths
    kept = np.arange(len(plain))
    while True:
        # Each frame stays until the next one, the last one of all to the end.
        begins = np.append(np.concatenate([[0], ends])[kept], ends[-1])
        plain[kept[0]].save(
            path, save_all=True, append_images=[plain[i] for i in kept[1:]], loop=0,
            duration=(10 * np.diff(begins)).tolist(), optimize=False, disposal=1,
        )  # fmt: skip
        share = _MOST_BYTES / path.stat().st_size
        if share >= 1 or len(kept) <= _FEWEST_FRAMES:
            return
        fewer = max(_FEWEST_FRAMES, int(0.95 * share * len(kept)))
        kept = np.linspace(0, len(plain) - 1, fewer).round().astype(int)


def _palette() -> Pixels:
    """Return white, and each colour in use from whole to faint, shape (n, 3).

    A palette made from the frames would leave out what is small, like the start and the goal.
    """
    from matplotlib import colormaps  # noqa: PLC0415

    trees = [colour for number in (0, 1, 2) for colour in style.tree_style(number)[1:]]
    others = [style.START, style.GOAL, style.RAW, style.SMOOTHED, style.REJECTED, style.QUIET,
              style.ROBOT, rgb(OBSTACLE_3D), rgb(OBSTACLE)]  # fmt: skip
    full = np.array([*trees, *others])[:, None]
    faint = 1 - (1 - full) * np.array([1.0, 0.75, 0.5, 0.25])[:, None]
    heat = colormaps[style.HEAT](np.linspace(0, 1, 48))[:, :3]
    in_space = 1 - (1 - heat) * style.CELL_ALPHA
    colours = np.concatenate([[[1, 1, 1]], faint.reshape(-1, 3), heat, in_space])
    return np.unique((255 * colours).round().astype(np.uint8), axis=0)


def _write_mp4(frames: Iterator[Pixels], seconds: list[float], path: Path) -> None:
    """Pipe frames into ffmpeg."""
    first = next(frames)
    size = f"{first.shape[1]}x{first.shape[0]}"
    command = [
        need_ffmpeg(), "-y", "-loglevel", "error", "-nostdin", "-f", "rawvideo",
        "-pix_fmt", "rgb24", "-s", size, "-r", f"{1 / seconds[0]:.6f}", "-i", "-", "-an",
        "-vf", f"tpad=stop_mode=clone:stop_duration={_HOLD_S}", "-c:v", "libx264", "-crf", "20",
        "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-map_metadata", "-1",
        "-fflags", "+bitexact", "-flags:v", "+bitexact", "-threads", "1", str(path),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as complaints:
        process = subprocess.Popen(  # noqa: S603 - found on the user's own PATH
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=complaints
        )
        assert process.stdin is not None  # noqa: S101 - it is a pipe
        try:
            # If it ends before it has read everything, its exit code and its words say why.
            with suppress(BrokenPipeError), process.stdin:
                process.stdin.write(first.tobytes())
                for frame in frames:
                    process.stdin.write(frame.tobytes())
        except BaseException:
            process.kill()
            raise
        finally:
            code = process.wait()
        if code != 0:
            complaints.seek(0)
            said = complaints.read().decode(errors="replace").strip().splitlines()
            why = said[-1] if said else f"exit code {code}"
            raise BrrtError(f"ffmpeg cannot write {path.suffix}: {why}; write a .gif instead")
