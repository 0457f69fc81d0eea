"""Files of figures, and axes of the user's own."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from brrt import BrrtError, Events, Kind, Memory, plot
from brrt.events import table_dtype
from brrt.views.matplotlib.figure import FigureOptions, save_plot
from tests.support.figures import golden
from tests.support.pixels import opened


@pytest.mark.parametrize(
    ("ending", "begin"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")]
)
def test_figures_are_the_same_every_time(ending: str, begin: bytes, tmp_path: Path) -> None:
    """All panels are equal byte by byte, in the given width."""
    files = [tmp_path / f"{i}{ending}" for i in range(2)]
    for file in files:
        options = FigureOptions(width=5, dpi=80)
        save_plot([golden("circles2d-rrt-star")], file, ("tree", "cost", "time"), options)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert files[0].read_bytes().startswith(begin)
    assert sorted(tmp_path.iterdir()) == files
    if ending == ".png":
        assert opened(files[0].read_bytes()).shape[1] == 400


def test_many_edges_make_a_small_file(tmp_path: Path) -> None:
    """A tree of 30,000 edges is an image in a vector file."""
    rng, n = np.random.default_rng(1), 30_000
    edges = np.zeros(n, table_dtype(Kind.EDGE, 2))
    edges["seq"] = edges["iteration"] = edges["node"] = np.arange(n)
    edges["parent"] = np.maximum(np.arange(n) - rng.integers(1, 50, n), -1)
    edges["parent"][0] = -1
    edges["parent"][1:] = np.maximum(edges["parent"][1:], 0)
    edges["q"] = rng.uniform(0, 100, (n, 2))
    base, memory = golden("circles2d-rrt"), Memory()
    memory.write(Events(2, {Kind.EDGE: edges}))
    big = memory.recording(base.manifest, base.world)
    save_plot([big], tmp_path / "big.svg", ("tree",), FigureOptions(dpi=100))
    assert (tmp_path / "big.svg").stat().st_size < 1_000_000


def test_axes_of_the_user() -> None:
    """They are returned; axes with another projection are refused; a run may be cut."""
    ax = Figure().subplots()
    assert plot(golden("circles2d-rrt"), ax, seq=50) is ax
    assert "iteration" in ax.get_title(loc="left")
    with pytest.raises(BrrtError, match="the world is 3D"):
        plot(golden("boxes3d-lrta-star"), Figure().subplots())
    with pytest.raises(BrrtError, match="unknown panel 'tre'; did you mean 'tree'"):
        plot(golden("circles2d-rrt"), ax, what="tre")
