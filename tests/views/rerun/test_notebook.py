"""Runs in notebooks: every cell of the example runs, and the viewer gets the whole drawing."""

import importlib
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure

import brrt
from tests.support.drawings import items_of

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def _no_windows(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Draw into memory, and close all figures."""
    plt.switch_backend("agg")
    monkeypatch.setitem(sys.modules, "rerun_notebook", None)
    yield
    plt.close("all")


def test_example_notebook(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every cell runs, in order; the run is solved, drawn and keeps its contract."""
    monkeypatch.chdir(tmp_path)
    book = json.loads((ROOT / "examples" / "look_inside.ipynb").read_text("utf-8"))
    names: dict[str, Any] = {}
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), "look_inside.ipynb", "exec"), names)  # noqa: S102
    out = capsys.readouterr().out
    assert names["result"]["path_cost"] <= names["result"]["first_path_cost"]
    assert "first path: cost" in out
    assert f"{len(names['rejected'])} rejections" in out
    recording = names["recording"]
    assert brrt.verify(recording).findings == []
    assert len(plt.get_fignums()) == 4


def test_show_without_the_viewer() -> None:
    """A figure is returned instead."""
    recording = brrt.read(ROOT / "recordings" / "circles2d-rrt.mcap")
    figure = brrt.show(recording)
    assert isinstance(figure, Figure)
    assert len(figure.axes[0].collections)


def test_show_fills_the_viewer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rerun's widget gets the drawing of the whole run."""
    path = tmp_path / "sent.rrd"

    class Viewer:
        """Writes what the widget would get to a file."""

        def __init__(self, **size: Any) -> None:
            assert size["width"] == 640

        def add_recording(self, rec: Any, blueprint: Any) -> None:
            """See `rerun.notebook.Viewer`."""
            rec.save(path, default_blueprint=blueprint)

    importlib.import_module("rerun.notebook")  # importing it needs the real package
    monkeypatch.setitem(sys.modules, "rerun_notebook", ModuleType("rerun_notebook"))
    monkeypatch.setattr("rerun.notebook.Viewer", Viewer)
    recording = brrt.read(ROOT / "recordings" / "circles2d-rrt.mcap")
    assert isinstance(brrt.show(recording, width=640), Viewer)
    nodes = items_of(path, "/world/tree/start", ":strips")
    assert len(nodes) == len(recording.events()[brrt.Kind.EDGE]) - 1
