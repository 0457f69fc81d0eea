"""A run in a notebook."""

from typing import Any

from brrt.recording import Recording


def show(recording: Recording, *, width: int = 1200, height: int = 700) -> Any:
    """Show a run in a notebook: the cell's last value, or `display` of it.

    Args:
        recording: The run.
        width: Width of the viewer in pixels.
        height: Height of the viewer in pixels.

    Returns:
        Rerun's viewer where rerun-notebook is installed, and otherwise a figure of matplotlib.

    Raises:
        BrrtError: Neither is installed.
    """
    try:
        import rerun_notebook  # noqa: F401, PLC0415 - an extra that brings much of Jupyter
    except ImportError:
        from brrt.views.matplotlib.figure import plot  # noqa: PLC0415 - matplotlib is an extra

        return plot(recording).figure
    from rerun.notebook import Viewer  # noqa: PLC0415 - costs half a second

    from brrt.views.rerun.sink import RerunSink  # noqa: PLC0415 - imports rerun

    viewer = Viewer(width=width, height=height, use_global_recording=False)
    sink = RerunSink(recording.manifest, recording.world, embed=viewer)
    for batch in recording.batches():
        sink.write(batch)
    sink.close(recording.result)
    return viewer
