"""The metrics are a fold over the events."""

from itertools import pairwise

import numpy as np
import pytest

from brrt import Kind, Metrics, Scenario
from tests.conftest import recorded
from tests.support.logs import split

SCENARIO = Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical")


def test_metrics_are_a_fold() -> None:
    """Whatever the batches, the metrics are the same, and they are those of the log."""
    run, log = recorded(SCENARIO)
    figures = []
    for size in (13, 70, 10_000):
        metrics = Metrics(run.manifest)
        for batch in split(log, size):
            metrics.write(batch)
        figures.append(metrics.as_dict())
    assert figures[0] == figures[1] == figures[2]
    assert figures[0]["events"] == len(log)
    assert figures[0]["samples"] == len(log[Kind.SAMPLE]) == figures[0]["iterations"]
    path = np.array(figures[0]["smoothed_path"])
    length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(path))
    assert figures[0]["smoothed_cost"] == pytest.approx(length, rel=1e-12)
    assert figures[0]["moves"] == len(path) - 1
