"""Runs in notebooks: the example does what it says, and the viewer gets the whole recording."""

import importlib
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure
from rerun.chunk import RrdReader

import brrt

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _no_windows(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Draw into memory, and let go of the figures."""
    plt.switch_backend("agg")
    monkeypatch.setitem(sys.modules, "rerun_notebook", None)
    yield
    plt.close("all")


def test_example_notebook(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every cell runs, in order; the run is solved, told, drawn and found sound."""
    monkeypatch.chdir(tmp_path)
    book = json.loads((ROOT / "examples" / "look_inside.ipynb").read_text("utf-8"))
    names: dict[str, Any] = {}
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), "look_inside.ipynb", "exec"), names)  # noqa: S102
    told = capsys.readouterr().out
    assert names["figures"]["path_cost"] <= names["figures"]["first_path_cost"]
    assert "first path: cost" in told
    assert f"{len(names['rejected'])} rejections" in told
    recording = names["recording"]
    assert brrt.check(recording.manifest, recording.world, recording.events()) == []
    assert len(plt.get_fignums()) == 4


def test_show_without_the_viewer() -> None:
    """A picture stands in for it."""
    recording = brrt.read(ROOT / "recordings" / "circles2d-rrt.mcap")
    figure = brrt.show(recording)
    assert isinstance(figure, Figure)
    assert len(figure.axes[0].collections)


def test_show_fills_the_viewer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What reaches Rerun's widget is the recording, every event of it."""
    path = tmp_path / "sent.rrd"

    class Viewer:
        """Writes to a file what the widget would take."""

        def __init__(self, **size: Any) -> None:
            assert size["width"] == 640

        def add_recording(self, rec: Any, blueprint: Any) -> None:
            """See `rerun.notebook.Viewer`."""
            rec.save(path, default_blueprint=blueprint)

    importlib.import_module("rerun.notebook")  # it looks into the real package as it is imported
    monkeypatch.setitem(sys.modules, "rerun_notebook", ModuleType("rerun_notebook"))
    monkeypatch.setattr("rerun.notebook.Viewer", Viewer)
    recording = brrt.read(ROOT / "recordings" / "circles2d-rrt.mcap")
    assert isinstance(brrt.show(recording, width=640), Viewer)
    rows = sum(
        chunk.num_rows for chunk in RrdReader(path).stream() if chunk.entity_path.startswith("/ev/")
    )
    assert rows == len(recording.events())
