"""What OMPL's default check of motions lets through, as numbers and as a picture.

    pip install 'brrt[ompl,plot]'
    python examples/ompl_demo.py [--resolution 0.01] [--out ompl_demo.png]

RRT-Connect and RRT* plan among 900 circles with radii from 0.2 to 0.4, on a map of 100 x 100. OMPL
checks motions in steps of 1 % of the space's extent by default, 1.4 here: many steps go over a
circle. `brrt verify` judges whole motions, by geometry of its own.
"""

import argparse
import os
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric, util

import brrt
from brrt.collision.motions import Obstacles, first_hits

mpl.use("agg")
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection

WORLD = brrt.make_world("circles2d:n=900,min_radius=0.2,max_radius=0.4,seed=1")
PLANNERS = {"RRTConnect": 5.0, "RRTstar": 1.0}
"""The planners, and how long each may plan in seconds."""

HIT = "#d62728"


def is_free(state: base.State) -> bool:
    """Return whether a point touches no circle."""
    away = WORLD.balls[:, :2] - (state[0], state[1])
    return bool((np.einsum("ij,ij->i", away, away) > WORLD.balls[:, 2] ** 2).all())


def set_up(planner: str, resolution: float) -> geometric.SimpleSetup:
    """Return the problem: from one corner of the map to the other."""
    space = base.RealVectorStateSpace(2)
    space.setBounds(0.0, 100.0)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(resolution)
    setup.setStateValidityChecker(is_free)
    start, goal = information.allocState(), information.allocState()
    for k in range(2):
        start[k], goal[k] = float(WORLD.start[k]), float(WORLD.goal[k])
    setup.setStartAndGoalStates(start, goal)
    made = getattr(geometric, planner)(information)
    made.setRange(8.0)
    setup.setPlanner(made)
    return setup


def motions_that_hit(recording: brrt.Recording) -> NDArray[np.float64]:
    """Return the ends of the trees' edges at the end that hit a circle, shape (n, 2, 2)."""
    trees = brrt.snapshot(recording).forest.values()
    ends = [np.stack([each.q[each.parent], each.q], axis=1)[each.parent >= 0] for each in trees]
    a, b = np.concatenate(ends).swapaxes(0, 1)
    hit = first_hits(Obstacles(WORLD), recording.robot(), a, b) >= 0
    return np.stack([a, b], axis=1)[hit]


def main() -> None:
    """Plan, record, judge and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--resolution", type=float, default=0.01, help="OMPL's own is 0.01")
    parser.add_argument("--out", type=Path, default=Path("ompl_demo.png"))
    given = parser.parse_args()
    util.setLogLevel(util.LOG_WARN)
    util.RNG.setSeed(1)
    figure, axes = plt.subplots(1, 2, figsize=(13, 6.7), layout="constrained")
    for ax, (planner, seconds) in zip(axes, PLANNERS.items(), strict=True):
        file = Path(f"ompl_demo_{planner}.mcap")
        setup = set_up(planner, given.resolution)
        with brrt.ompl.record(setup, file, world=WORLD):
            setup.solve(seconds)
        recording = brrt.read(file)
        broken = {each.rule: each for each in brrt.verify(recording).results}
        edges, hits = broken["edges free"], motions_that_hit(recording)
        (path,) = list(recording.events()[brrt.Kind.PATH]["waypoints"])[-1:] or [None]
        print(f"{planner}: {edges.broken} of {edges.examined} recorded edges hit a circle ({file})")
        brrt.plot(recording, ax)
        ax.add_collection(LineCollection(hits, colors=HIT, linewidths=2.5, zorder=50))
        title = f"{planner}: {edges.broken} of {edges.examined} edges"
        if path is not None:
            check = brrt.check_path(path.reshape(-1, 2), world=WORLD)
            part = f"{len(check.hits)} of {len(check.lengths)} motions of the last path"
            print(f"  {part} hit one; OMPL reports it as free")
            title += f" and {part}"
        ax.set_title("", loc="left")
        ax.set_title(f"{title} hit a circle (red)", fontsize=10)
    figure.savefig(given.out, dpi=110)
    print(f"the picture is {given.out}, the recordings ompl_demo_*.mcap; try --resolution 0.0005")
    sys.stdout.flush()
    os._exit(0)  # OMPL's Python module else prints what it takes for leaks


if __name__ == "__main__":
    main()
