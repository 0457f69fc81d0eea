"""A small RRT of our own for the arm in arm6.urdf, recorded to arm_rrt.mcap.

For example `brrt verify arm_rrt.mcap` and `brrt view arm_rrt.mcap` read that file.
"""

from pathlib import Path
from typing import Any

import numpy as np

import brrt

STEP, RADIUS = 0.3, 0.06
START, GOAL = np.array([-1.2, 0.9, 0.9, 0.0, 0.6, 0.0]), np.array([1.2, 0.9, 0.9, 0.0, 0.6, 1.0])

arm = brrt.make_robot(str(Path(__file__).with_name("arm6.urdf")))
box, ball = [0.25, -0.1, 0.0, 0.9, 0.1, 0.75], [0.4, 0.7, 0.9, 0.15]
lower, upper = np.array([-1.1, -1.1, 0]), np.array([1.1, 1.1, 1.4])
cell = brrt.World("cell", lower, upper, boxes=np.array([box]), balls=np.array([ball]))


def free(q: Any) -> Any:
    """Whether spheres along the links are clear of the obstacles, at configurations (n, 6)."""
    joints = arm.skeleton(q)[:, 1:]
    parts = np.linspace(0, 1, 6)[:, None]
    spheres = joints[:, :-1, None] * (1 - parts) + joints[:, 1:, None] * parts
    centre = spheres.reshape(len(q), -1, 3)
    nearest = np.clip(centre, cell.boxes[0, :3], cell.boxes[0, 3:])
    off_box = np.linalg.norm(centre - nearest, axis=-1) > RADIUS
    off_ball = np.linalg.norm(centre - cell.balls[0, :3], axis=-1) > RADIUS + cell.balls[0, 3]
    return (off_box & off_ball & (centre[..., 2] > RADIUS)).all(axis=1)


def plan(rec: brrt.Recorder, rng: np.random.Generator) -> None:
    """Grow a tree from the start until it reaches the goal."""
    lower, upper = arm.bounds(cell)
    nodes, parents = [START], [-1]
    rec.edge(START)
    for rec.iteration in range(1, 20_000):
        to_goal = rng.random() < 0.1
        sample = GOAL if to_goal else rng.uniform(lower, upper)
        rec.sample(sample, "goal" if to_goal else "uniform")
        near = int(np.argmin(np.linalg.norm(np.array(nodes) - sample, axis=1)))
        far = np.linalg.norm(sample - nodes[near])
        new = nodes[near] + (sample - nodes[near]) * min(1.0, STEP / max(far, STEP))
        if far == 0 or not free(arm.interpolate(nodes[near], new, np.linspace(0, 1, 8))).all():
            rec.reject(new, near, "collision")
            continue
        at = rec.edge(new, near)
        nodes, parents = [*nodes, new], [*parents, near]
        if to_goal and far <= STEP:
            way = []
            while at >= 0:
                way, at = [nodes[at], *way], parents[at]
            rec.path(way)
            return


with brrt.record("arm_rrt.mcap", world=cell, robot=arm, start=START, goal=GOAL) as rec:
    plan(rec, np.random.default_rng(1))
