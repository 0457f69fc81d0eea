"""The state of a run after an event, against plain loops over the log."""

from typing import Any

import numpy as np
import pytest

from brrt import Kind, forest
from brrt.views.matplotlib.playback import Playback
from tests.support.figures import golden


def test_rejects_are_the_newest_extensions() -> None:
    """They go from the node to the sample."""
    recording = golden("circles2d-rrt")
    tree, rows = forest(recording.events())[0], recording.events()[Kind.REJECT][-12:]
    playback = Playback(recording)
    expected = np.stack([tree.q[rows["node"]], rows["q"]], axis=1)
    assert np.array_equal(playback.rejects(playback.last, 12), expected)


@pytest.mark.parametrize("name", ["boxes3d-lrta-star", "squares2d-a-star"])
def test_cells_have_the_values_of_a_plain_loop(name: str) -> None:
    """Estimates are the distance until they are raised; costs are the newest."""
    recording, playback = golden(name), Playback(golden(name))
    log, goal = recording.events(), np.array(recording.manifest.goal)
    for seq in np.linspace(0, playback.last, 7).astype(int).tolist():
        part, values, places = log.until(seq=seq), dict[int, float](), dict[int, Any]()
        for row in part[Kind.EXPAND]:
            places.setdefault(int(row["cell"]), row["q"])
            if name == "squares2d-a-star":
                values[int(row["cell"])] = float(row["cost"])
            else:
                values.setdefault(int(row["cell"]), float(np.linalg.norm(row["q"] - goal)))
        for row in part[Kind.HEURISTIC]:
            if int(row["cell"]) in values:
                values[int(row["cell"])] = float(row["h"])
        where, found = playback.cells(seq)
        assert np.array_equal(where, np.array(list(places.values())).reshape(-1, len(goal)))
        assert np.allclose(found, [values[cell] for cell in places], rtol=1e-12)


@pytest.mark.parametrize("name", ["circles2d-rrt", "squares2d-intermediate", "circles2d-chain"])
def test_paths_during_smoothing(name: str) -> None:
    """Each shortcut changes the path, up to the smoothed path of the log."""
    playback, log = Playback(golden(name)), golden(name).events()
    raw, smoothed = log[Kind.PATH]
    assert playback.paths(int(raw["seq"]) - 1) == (None, None)
    for cut in log[Kind.SHORTCUT][:: 1 + len(log[Kind.SHORTCUT]) // 7]:
        paths = playback.paths(int(cut["seq"]))
        best = paths.short or paths.raw
        assert best is not None
        assert best[1] == pytest.approx(cut["cost"], rel=1e-9)
    paths = playback.paths(int(smoothed["seq"]) - 1)
    assert paths.short is not None
    assert np.array_equal(paths.short[0], smoothed["waypoints"])
