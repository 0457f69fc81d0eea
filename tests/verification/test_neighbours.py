"""The search for neighbours, against all pairs."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import make_robot
from brrt.verification.neighbours import NeighbourSearch, nearest


@settings(max_examples=40)
@given(
    n=st.integers(1, 120),
    seed=st.integers(0, 999),
    most=st.sampled_from([1, 300, 10**9]),
    kind=st.sampled_from(["point", "polygon:length=3,width=1"]),
    cells=st.sampled_from([2, 99]),
)
def test_search_finds_all_neighbours(n: int, seed: int, most: int, kind: str, cells: int) -> None:
    """Against all pairs; nodes may coincide, and angles wrap."""
    rng = np.random.default_rng(seed)
    robot, dof = make_robot(kind), 2 if kind == "point" else 3
    q, places = (rng.integers(0, cells, (m, dof)) / cells * 6 - 3 for m in (n, 20))
    radius, count = rng.uniform(0, 4, 20), rng.integers(1, n + 1, 20)
    search = NeighbourSearch(q, robot.distance, places, radius, count, most)
    found = {
        (i, j) for a, b, _ in search.pairs() for i, j in zip(a.tolist(), b.tolist(), strict=True)
    }
    far = robot.distance(places[:, None], q[None])
    there = (far <= radius[:, None]) & (np.arange(n) < count[:, None]) & search.searched[:, None]
    assert found == {(i, j) for i, j in np.argwhere(there).tolist()}
    assert search.searched.any()
    assert most < 10**9 or search.searched.all()
    node, least, second = nearest(NeighbourSearch(q, robot.distance, places, radius, count, most))
    ordered = np.sort(np.where(there, far, np.inf), axis=1)
    np.testing.assert_array_equal(least, ordered[:, 0])
    np.testing.assert_array_equal(second, ordered[:, 1] if n > 1 else np.inf)
    assert ((node >= 0) == np.isfinite(least)).all()
