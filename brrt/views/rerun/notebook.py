"""A run in a notebook."""

from typing import Any

from brrt.recording import Recording


def show(recording: Recording, *, width: int = 1200, height: int = 700) -> Any:
    """Return a view of a run for a notebook cell, which shows its last value.

    Args:
        recording: The run.
        width: Width of the viewer in pixels.
        height: Height of the viewer in pixels.

    Returns:
        Rerun's viewer if rerun-notebook is installed, else a matplotlib figure.

    Raises:
        BrrtError: Neither is installed.
    """
    try:
        import rerun_notebook  # noqa: F401, PLC0415 - an extra that brings much of Jupyter
    except ImportError:
        from brrt.views.matplotlib.figure import plot  # noqa: PLC0415 - matplotlib is an extra

        return plot(recording).figure
    from rerun.notebook import Viewer  # noqa: PLC0415 - costs half a second

    from brrt.views.rerun import layout  # noqa: PLC0415 - imports rerun
    from brrt.views.rerun.drawing import draw_into  # noqa: PLC0415
    from brrt.views.rerun.stream import new_stream  # noqa: PLC0415

    manifest, world = recording.manifest, recording.world
    rec = new_stream(layout.recording_id(manifest), layout.application(manifest, world))
    viewer = Viewer(width=width, height=height, use_global_recording=False)
    viewer.add_recording(rec, layout.blueprint(manifest, world))
    draw_into(rec, recording)
    rec.flush()
    rec.disconnect()
    return viewer
