"""Names of recordings and applications: what shares a window and a layout in a viewer."""

from dataclasses import replace
from pathlib import Path

from brrt import Run, Scenario, read
from brrt.views.rerun import layout


def test_name_of_a_recording() -> None:
    """Runs that are equal have one, others another."""
    a, b = (
        Run(Scenario(world="circles2d:n=30", seed=7, clock="logical")).manifest for _ in range(2)
    )
    other = Run(Scenario(world="circles2d:n=30", seed=8, clock="logical")).manifest
    assert layout.recording_id(a) == layout.recording_id(b) != layout.recording_id(other)


def test_layouts_are_shared_by_what_can_share_them() -> None:
    """A viewer keeps one layout, and one kind of configuration, for each application."""
    pairs = set()
    for path in (Path(__file__).parents[3] / "recordings").glob("*.mcap"):
        manifest, world = read(path).manifest, read(path).world
        bounds = (*world.lower, *world.upper)
        what = (manifest.dim, manifest.dof, manifest.scenario.execute, bounds)
        for each in (world, replace(world, y_down=True)) if world.dim == 2 else (world,):
            pairs.add((layout.application(manifest, each), (*what, each.y_down)))
    names, wholes = zip(*pairs, strict=True)
    assert len(set(names)) == len(set(wholes)) == len(pairs) > 6
