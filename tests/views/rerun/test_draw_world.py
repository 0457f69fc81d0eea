"""Obstacles in Rerun are filled."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt.views.rerun.draw_world import _filled_boxes

sides = st.floats(1e-3, 1e3)


@settings(max_examples=30)
@given(st.lists(st.tuples(sides, sides), min_size=1, max_size=4), st.integers(0, 99))
def test_boxes_are_filled(sizes: list[tuple[float, float]], seed: int) -> None:
    """Thick lines cover all of a box, whatever its shape, and nothing outside."""
    upper = np.array(sizes)
    fill = _filled_boxes(0 * upper, upper)
    centres, halves, radii = (
        np.array(part.as_arrow_array().to_pylist())  # type: ignore[union-attr]
        for part in (fill.centers, fill.half_sizes, fill.radii)
    )
    assert (halves > 0).all()  # Rerun draws no others
    rng = np.random.default_rng(seed)
    for corner in upper:
        mine = (np.abs(centres - corner / 2) < 1e-6 * corner).all(axis=1) & (radii > 0)
        points = corner * np.concatenate([rng.random((200, 2)), [[0.5, 0.5]]])
        away = np.abs(points[:, None] - corner / 2) - halves[mine]
        # The distance to a rectangle's outline, from outside and from inside.
        far = np.where(
            (away > 0).any(axis=-1), np.hypot(*np.maximum(away, 0).T).T, -away.max(axis=-1)
        )
        assert (far < radii[mine]).any(axis=1).mean() > 0.99  # all but the tips of the corners
        assert (far[-1] < radii[mine]).any()
        assert (halves[mine] + radii[mine, None] < 1.000001 * corner / 2).all()
