"""Two runs in one drawing, and the place of the event at which they first differ."""

from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from brrt import Kind, read
from brrt.views.rerun.drawing import draw_run
from brrt.views.rerun.pair import draw_pair
from brrt.views.rerun.ring import place_of
from tests.support.drawings import entities
from tests.support.recordings import GOLDEN, RECORDINGS, record


def test_two_runs_below_entities_of_their_own(tmp_path: Path) -> None:
    """Everything that the drawing of one run has is there for both, on the same timelines."""
    runs = [read(record(tmp_path / f"{seed}.mcap", seed=seed)) for seed in (1, 2)]
    difference = draw_pair(tmp_path / "pair.rrd", *runs)
    assert difference is not None
    found = entities(tmp_path / "pair.rrd")
    for letter, run in zip("AB", runs, strict=True):
        draw_run(tmp_path / "one.rrd", run)
        alone = {name for name in entities(tmp_path / "one.rrd") if name.startswith("/world")}
        mine = {name.removeprefix(f"/{letter}") for name in found if name.startswith(f"/{letter}/")}
        assert {n for n in mine if "/ring" not in n and n.startswith("/world")} == alone
        assert {"/world/ring", "/world/ring/label", "/run", "/log"} <= mine
    rest = {name for name in found if not name.startswith(("/A", "/B", "/__properties"))}
    assert rest == {"/difference"}
    for chunk in RrdReader(tmp_path / "pair.rrd").stream():
        if chunk.entity_path == "/difference":
            batch = chunk.to_record_batch()
            assert batch.column("event").to_pylist() == [difference.seq]
            assert batch.column("TextLog:text").to_pylist() == [[f"the runs part at {difference}"]]


def test_equal_runs_have_no_ring(tmp_path: Path) -> None:
    """Without a difference there is no ring and no line in the log."""
    runs = [read(record(tmp_path / f"{name}.mcap", seed=3)) for name in "ab"]
    assert draw_pair(tmp_path / "pair.rrd", *runs) is None
    assert not any(
        "/ring" in name or "difference" in name for name in entities(tmp_path / "pair.rrd")
    )


@pytest.mark.parametrize("other", ["squares2d-a-star", "boxes3d-lrta-star", "circles2d-chain"])
def test_any_two_runs(other: str, tmp_path: Path) -> None:
    """Other planners, worlds, dimensions and robots are drawn side by side too."""
    runs = [read(path) for path in (GOLDEN, RECORDINGS / f"{other}.mcap")]
    for a, b in (runs, runs[::-1]):
        assert draw_pair(tmp_path / "pair.rrd", a, b) is not None


def test_every_kind_of_event_has_a_place() -> None:
    """The place of an event of any kind is a configuration of the run."""
    kinds = set()
    for name in ("circles2d-rrt-star", "squares2d-bi-rrt-coin", "boxes3d-lrta-star"):
        recording = read(RECORDINGS / f"{name}.mcap")
        manifest, events = recording.manifest, recording.events()
        for kind, table in events.tables.items():
            kinds.add(kind)
            for row in table[[0, len(table) // 2, -1]]:
                place = place_of(events, manifest, int(row["seq"]))
                assert place.shape == (manifest.dof,)
                if "q" in (table.dtype.names or ()):
                    assert (place == row["q"]).all()
    assert {Kind.REWIRE, Kind.CONNECT, Kind.PATH, Kind.SHORTCUT, Kind.HEURISTIC} <= kinds
