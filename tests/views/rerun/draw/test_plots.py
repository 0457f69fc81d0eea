"""Plots over time agree with counts of the events."""

from pathlib import Path

import numpy as np
import pytest

from brrt import Kind, read, record
from brrt.events import Reason
from brrt.views.rerun.drawing import draw_run
from tests.support.drawings import drawn, rows_below, rows_of, scenario


@pytest.mark.parametrize("planner", ["rrt", "bi-rrt-star", "a-star"])
def test_shares_and_times(planner: str, tmp_path: Path) -> None:
    """Shares are counts of extensions so far; times of iterations add up to the whole."""
    path = tmp_path / "run.rrd"
    events = drawn(path, scenario(planner, smooth=False))
    added = len(events[Kind.EDGE]) + len(events[Kind.EXPAND])
    rejects = events[Kind.REJECT]
    for entity, values in rows_below(path, "/series/extensions/", ":scalars").items():
        name, (seq, (share,)) = entity.rsplit("/", 1)[-1], max(values)
        tried = sum(
            int((events[kind]["seq"] <= seq).sum())
            for kind in (Kind.EDGE, Kind.EXPAND, Kind.REJECT)
        )
        count = added if name == "accepted" else sum(rejects["reason"] == Reason[name.upper()])
        assert share == pytest.approx(100 * count / tried)
    times = rows_of(path, "/series/iteration_time", ":scalars")
    steps = events[Kind.SAMPLE] if len(events[Kind.SAMPLE]) else events[Kind.EXPAND]
    at = np.searchsorted(steps["seq"], [seq for seq, _ in times])
    made = np.diff(steps["iteration"][at].astype(int), prepend=0)
    spent = np.array([value for _, (value,) in times]) @ made
    assert spent == pytest.approx(int(steps["t"][-1]) / 1e3)


def test_a_recording_without_samples(tmp_path: Path) -> None:
    """Edges and links tell its iterations apart; links count as accepted extensions."""
    with record(tmp_path / "run.mcap", world="circles2d:n=4", planner="mine") as rec:
        rec.edge([5, 5])
        for number in range(1, 300):
            rec.iteration = number
            rec.edge([5, 5 + number / 10], number - 1)
            if number > 1:
                rec.link(number, number - 2)
            rec.reject([9, 9], number)
    path = tmp_path / "run.rrd"
    recording = read(tmp_path / "run.mcap")
    draw_run(path, recording)
    events = recording.events()
    times = rows_of(path, "/series/iteration_time", ":scalars")
    assert len(times) > 100
    steps = np.concatenate([events[k][["seq", "t", "iteration"]] for k in (Kind.EDGE, Kind.LINK)])
    steps = steps[np.argsort(steps["seq"])]
    at = np.searchsorted(steps["seq"], [seq for seq, _ in times])
    made = np.diff(steps["iteration"][at].astype(int), prepend=0)
    spent = np.array([value for _, (value,) in times]) @ made
    assert spent == pytest.approx(int(steps["t"][at[-1]]) / 1e3)
    shares = rows_below(path, "/series/extensions/", ":scalars")["/series/extensions/accepted"]
    assert max(shares)[1][0] == pytest.approx(100 * 598 / (598 + 299), abs=0.2)
