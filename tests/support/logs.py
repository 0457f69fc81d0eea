"""Recordings in memory, for tests of what reads them."""

import numpy as np

from brrt import Events, Recording, Scenario
from tests.conftest import recorded, result_of


def split(log: Events, size: int) -> list[Events]:
    """Split a log into batches of so many events."""
    ends = range(size - 1, len(log) + size, size)
    firsts = [0, *(end + 1 for end in ends)]
    return [
        Events(log.dof, {k: t[np.searchsorted(t["seq"], first) :] for k, t in part.tables.items()
                         if len(t) > np.searchsorted(t["seq"], first)})
        for first, part in zip(firsts, (log.until(seq=end) for end in ends), strict=False)
    ]  # fmt: skip


def recording(scenario: Scenario, size: int = 1000) -> Recording:
    """Return the recording of a scenario, in batches of so many events."""
    run, log = recorded(scenario)
    parts = split(log, size)
    return Recording(run.manifest, run.problem.world, lambda: parts, result_of(run.manifest, log))
