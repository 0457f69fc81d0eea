"""A log is summed up whatever its length."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import (
    Kind,
)
from brrt.events import table_dtype
from brrt.explanation.summary import IterationBins, ThinnedRejects


@settings(max_examples=40)
@given(st.lists(st.integers(0, 40_000), min_size=1, max_size=60))
def test_bins_double(iterations: list[int]) -> None:
    """Sums by bins, whose length doubles on the way, are those of the final length."""
    bins, dtype = IterationBins(), table_dtype(Kind.EDGE, 2)
    for iteration in sorted(iterations):
        table = np.zeros(1, dtype)
        table["iteration"] = iteration
        bins.reach(iteration)
        bins.count(table, 0)
        bins.approach(table, np.array([float(iteration)]))
    at = np.array(iterations) // bins.length
    assert bins.sums[:, 0].tolist() == np.bincount(at, minlength=len(bins.sums)).tolist()
    for place in np.unique(at).tolist():
        assert bins.nearest[place] == min(i for i in iterations if i // bins.length == place)


@settings(max_examples=40)
@given(st.lists(st.integers(0, 30), max_size=30))
def test_rejections_are_thinned_evenly(sizes: list[int]) -> None:
    """Every k-th rejection is kept, from the first on, at most twice the limit."""
    thinned, seen = ThinnedRejects(2, most=10), 0
    for size in sizes:
        table = np.zeros(size, table_dtype(Kind.REJECT, 2))
        table["seq"] = np.arange(seen, seen + size)
        seen += size
        thinned.add(table)
    kept = thinned.rows()["seq"].tolist()
    assert len(kept) <= 20
    stride = kept[1] - kept[0] if len(kept) > 1 else 1
    assert kept == list(range(0, seen, stride))[: len(kept)]
    assert seen - (kept[-1] if kept else 0) <= stride
