"""An animation of a run: a .gif by Pillow or an .mp4 by ffmpeg."""

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from brrt.errors import BrrtError
from brrt.files import replacing
from brrt.recording import Recording
from brrt.views.colours import OBSTACLE_3D, PAPER_OBSTACLE, rgb
from brrt.views.matplotlib import style
from brrt.views.matplotlib.draw_world import need_matplotlib
from brrt.views.matplotlib.figure import FigureOptions, add_legend, height_of_tree, tree_panel
from brrt.views.matplotlib.playback import Playback
from brrt.views.matplotlib.tree_panel import TreePanel

Pixels = NDArray[np.uint8]
Progress = Callable[[int, int], None]
"""Gets the number of finished frames and of all frames."""

DPI = 145
"""Of animations: the width of a column then has 480 pixels."""
_MOST_PIXELS = 2048
_PLANNING = 0.85
"""Part of the frames for planning, if there are events after it."""
_HOLD_S = 1.5
"""Additional time of the last frame."""
_FEWEST_FRAMES, _MOST_EDGES = 24, 2_000_000
"""Edges drawn in all frames, about: larger trees get fewer frames in the same time."""
_MOST_BYTES = 5_000_000
"""Of a .gif; frames of a larger one are dropped."""


def save_animation(
    recording: Recording,
    path: Path,
    options: FigureOptions | None = None,
    *,
    seconds: float = 8.0,
    fps: float = 20.0,
    progress: Progress = lambda done, total: None,  # noqa: ARG005 - does nothing by default
) -> None:
    """Draw a run as it grows into a .gif or .mp4 file; equal runs give equal files.

    Args:
        recording: The run.
        path: The file; it appears once it is complete.
        options: How it is drawn.
        seconds: Duration, without the additional time of the last frame.
        fps: Frames a second.
        progress: Gets the number of finished frames and of all frames.

    Raises:
        BrrtError: matplotlib or, for .mp4, ffmpeg is missing or fails, the figure is too large,
            or the file cannot be written.
    """
    options, recording = options or FigureOptions(dpi=DPI), recording.until()
    need_matplotlib()
    write = _write_gif
    if path.suffix == ".mp4":
        write = _write_mp4
        need_ffmpeg()
    with style.paper():
        panel, canvas = _stage(recording, options)
        seqs, durations = frame_times(panel.playback, seconds, fps)
        frames = _frames(panel, canvas, seqs, progress)
        with replacing(path) as unfinished:
            write(frames, durations, unfinished)


def need_ffmpeg() -> str:
    """Return the path of ffmpeg.

    Raises:
        BrrtError: It is not installed.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        raise BrrtError(
            ".mp4 files need ffmpeg, which is not on the PATH; install it, or write a .gif"
        )
    return found


def frame_times(
    playback: Playback, seconds: float, fps: float
) -> tuple[NDArray[np.int64], list[float]]:
    """Return the event after which each frame is drawn, and its duration in seconds.

    During planning the number of events grows with the square of the time, so that the first events
    are visible one by one.
    """
    wanted = max(3, round(seconds * fps))
    last, planned = playback.last, playback.planned
    most = 2 * _MOST_EDGES // max(playback.nodes(last), 1)
    frames = min(wanted, max(_FEWEST_FRAMES, most))
    after = last > planned
    growing = max(2, int(frames * _PLANNING)) if after else frames
    seqs = np.linspace(0, 1, growing) ** 2 * planned
    if after:
        seqs = np.concatenate([seqs, np.linspace(planned, last, frames - growing + 1)[1:]])
    chosen = np.round(seqs).astype(np.int64)
    durations = [seconds / len(chosen)] * len(chosen)
    durations[-1] += _HOLD_S
    return chosen, durations


def _stage(recording: Recording, options: FigureOptions) -> tuple[TreePanel, Any]:
    """Draw what never changes; return the panel and its canvas."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    width = options.width or style.COLUMN_IN + 0.01
    size = width, height_of_tree(recording, width)
    if max(size) * options.dpi > _MOST_PIXELS:
        raise BrrtError(
            f"{max(size) * options.dpi:.0f} pixels are too many for an animation, which has at "
            f"most {_MOST_PIXELS}; give a smaller --width or --dpi"
        )
    figure = Figure(figsize=size, dpi=options.dpi, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    panel = tree_panel(figure, recording, options)
    add_legend(figure, panel, _legend(panel))
    canvas.draw()
    figure.set_layout_engine("none")
    for artist in panel.drawn_last:
        artist.set_animated(True)
    canvas.draw()
    return panel, canvas


def _legend(panel: TreePanel) -> list[Any]:
    """Return the artists that any frame shows; at the end a robot is hidden by the goal."""
    artists: list[Any] = []
    for seq in (panel.playback.planned, panel.playback.last):
        panel.show(seq)
        artists += [artist for artist in panel.legend() if artist not in artists]
    return artists


def _frames(
    panel: TreePanel, canvas: Any, seqs: NDArray[np.int64], progress: Progress
) -> Iterator[Pixels]:
    """Yield a frame after each of the events, shape (height, width, 3) with even sides."""
    ax = canvas.figure.axes[0]
    background = canvas.copy_from_bbox(canvas.figure.bbox)
    for number, seq in enumerate(seqs.tolist()):
        canvas.restore_region(background)
        panel.show(seq)
        for artist in panel.drawn_last:
            if hasattr(artist, "do_3d_projection"):
                artist.do_3d_projection()
            ax.draw_artist(artist)
        pixels = np.asarray(canvas.buffer_rgba())
        height, width = (side // 2 * 2 for side in pixels.shape[:2])
        yield pixels[:height, :width, :3].copy()
        progress(number + 1, len(seqs))


def _write_gif(frames: Iterator[Pixels], durations: list[float], path: Path) -> None:
    """Write frames with a fixed palette; drop some if the file is too large."""
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette().tobytes())
    images = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    ends = np.round(100 * np.cumsum(durations)).astype(int)  # a .gif counts hundredths
    kept = np.arange(len(images))
    while True:
        # Each frame lasts until the next kept one, the last one to the end.
        begins = np.append(np.concatenate([[0], ends])[kept], ends[-1])
        images[kept[0]].save(
            path, save_all=True, append_images=[images[i] for i in kept[1:]], loop=0,
            duration=(10 * np.diff(begins)).tolist(), optimize=False, disposal=1,
        )  # fmt: skip
        share = _MOST_BYTES / path.stat().st_size
        if share >= 1 or len(kept) <= _FEWEST_FRAMES:
            return
        fewer = max(_FEWEST_FRAMES, int(0.95 * share * len(kept)))
        kept = np.linspace(0, len(images) - 1, fewer).round().astype(int)


def _palette() -> Pixels:
    """Return white, and each colour in use from full to faint, shape (n, 3).

    A palette made from the frames would lack the colours of small dots such as start and goal.
    """
    from matplotlib import colormaps  # noqa: PLC0415

    trees = [colour for number in (0, 1, 2) for colour in style.tree_style(number)[1:]]
    others = [style.START, style.GOAL, style.PATH, style.SMOOTHED, style.REJECTED, style.QUIET,
              style.ROBOT, rgb(OBSTACLE_3D), rgb(PAPER_OBSTACLE)]  # fmt: skip
    full = np.array([*trees, *others])[:, None]
    faint = 1 - (1 - full) * np.array([1.0, 0.75, 0.5, 0.25])[:, None]
    heat = colormaps[style.HEAT](np.linspace(0, 1, 48))[:, :3]
    heat_3d = 1 - (1 - heat) * style.CELL_ALPHA
    colours = np.concatenate([[[1, 1, 1]], faint.reshape(-1, 3), heat, heat_3d])
    return np.unique((255 * colours).round().astype(np.uint8), axis=0)


def _write_mp4(frames: Iterator[Pixels], durations: list[float], path: Path) -> None:
    """Pipe frames into ffmpeg."""
    first = next(frames)
    size = f"{first.shape[1]}x{first.shape[0]}"
    command = [
        need_ffmpeg(), "-y", "-loglevel", "error", "-nostdin", "-f", "rawvideo",
        "-pix_fmt", "rgb24", "-s", size, "-r", f"{1 / durations[0]:.6f}", "-i", "-", "-an",
        "-vf", f"tpad=stop_mode=clone:stop_duration={_HOLD_S}", "-c:v", "libx264", "-crf", "20",
        "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-map_metadata", "-1",
        "-fflags", "+bitexact", "-flags:v", "+bitexact", "-threads", "1", str(path),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(  # noqa: S603 - found on the user's own PATH
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors
        )
        assert process.stdin is not None  # noqa: S101 - it is a pipe
        try:
            # If ffmpeg ends before it has read everything, its exit code and output say why.
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
            errors.seek(0)
            lines = errors.read().decode(errors="replace").strip().splitlines()
            why = lines[-1] if lines else f"exit code {code}"
            raise BrrtError(f"ffmpeg cannot write {path.suffix}: {why}; write a .gif instead")
