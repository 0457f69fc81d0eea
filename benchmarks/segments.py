"""Segment checks a second of one core, by the shape and the number of obstacles.

    python benchmarks/segments.py [--segments 200000] [--rounds 15] [--json]

One compiled loop checks an array of segments for a point. Their lengths are spread evenly by
logarithm from 0.1 % to 100 % of the map's side, their directions evenly; of their ends no more is
asked than to lie within the map, so that some start within an obstacle. `hits` is the part that
touches something, `cells` the mean number of cells from end to end, which a hit cuts short. Rounds
go through all worlds in turn, so that a load from outside meets each; the figures are medians.

The bars: 3 million a second on 200 boxes in 3D, and on 20,000 not below a quarter of that, whether
the map grows with them (segments as long as on the small one, and growing with it) or they shrink.
"""

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt import Grid, World, make_robot, make_world
from brrt.kernels.jit import kernel
from brrt.kernels.space import segment_free
from brrt.kernels.spaces import make_space

Floats = NDArray[np.float64]

BAR, TIMES = 3e6, 4.0
LEAST = 1e-3
"""Length of the shortest segments, as a part of the map's side."""


@dataclass(frozen=True)
class Row:
    """What is measured.

    Attributes:
        title: What the table calls it.
        spec: The world, or how it is drawn.
        longest: How long its segments get, as a part of the map's side.
        draw: Makes the world, where no generator does.
    """

    title: str
    spec: str
    longest: float = 1.0
    draw: Callable[[], World] | None = None

    def world(self) -> World:
        """Make the world."""
        return make_world(self.spec) if self.draw is None else self.draw()


def rows() -> list[Row]:
    """Return the two rows that the bars are about first, then their kin, then other shapes."""
    grown = 100 ** (1 / 3)
    side, small = f"size={100 * grown:.6g}", f"min_side={2 / grown:.6g},max_side={15 / grown:.6g}"
    tiny = f"min_side={0.2 / grown:.6g},max_side={1.5 / grown:.6g}"
    return [
        Row("200 boxes", "boxes3d:n=200"),
        Row("20,000, same map, smaller boxes", f"boxes3d:n=20000,{small}"),
        Row("20,000, grown map, same boxes", f"boxes3d:n=20000,{side}"),
        Row("  and segments as in the small map", f"boxes3d:n=20000,{side}", 1 / grown),
        Row("20,000, same map, same boxes", "boxes3d:n=20000"),
        Row("20,000, same map, tiny boxes", f"boxes3d:n=20000,{tiny}"),
        Row("200 spheres", "spheres3d:n=200"),
        Row("50 circles", "circles2d:n=50"),
        Row("50 squares", "squares2d:n=50"),
        Row("50 polygons", "polygons2d:n=50"),
        Row("512 x 512 cells, 1 % at random", "noise", draw=lambda: noise(512, 0.01)),
        Row("1024 x 1024 cells, 1 % at random", "noise", draw=lambda: noise(1024, 0.01)),
        Row("1024 x 1024 cells, 0.01 % at random", "noise", draw=lambda: noise(1024, 1e-4)),
        Row("512 x 512 cells, rooms of 32 x 32", "rooms", draw=lambda: rooms(512)),
        Row("1024 x 1024 cells, rooms of 32 x 32", "rooms", draw=lambda: rooms(1024)),
    ]


def noise(n: int, blocked: float) -> World:
    """Make a map of n x n cells, each blocked or not at random."""
    cells = np.random.default_rng(0).random((n, n)) < blocked
    return World.of_grid("noise", Grid(cells, np.zeros(2), 1.0))


def rooms(n: int, side: int = 32, door: int = 6) -> World:
    """Make a map of n x n cells: square rooms with a door to each neighbour."""
    rng, cells = np.random.default_rng(0), np.zeros((n, n), np.bool_)
    for walls in (cells, cells.T):
        walls[::side] = True
        for corner in np.ndindex(n // side, n // side):
            row, first = np.array(corner) * side
            place = first + rng.integers(1, side - door)
            walls[row, place : place + door] = row == 0
    cells[-1] = cells[:, -1] = True
    return World.of_grid("rooms", Grid(cells, np.zeros(2), 1.0))


@kernel
def check_all(space: Any, A: Floats, B: Floats, free: NDArray[np.bool_]) -> None:
    """Check the motion from each row of A to the same row of B."""
    for i in range(len(A)):
        free[i] = segment_free(space, A, i, B, i)


def segments(world: World, n: int, longest: float) -> tuple[Floats, Floats]:
    """Draw n segments; one that leaves the map is drawn anew, but for its length."""
    rng, d = np.random.default_rng(0), world.dim
    lengths = world.extent * longest * LEAST ** rng.random((n, 1))
    A, B = np.empty((n, d)), np.empty((n, d))
    left = np.arange(n)
    while len(left):
        along = rng.normal(size=(len(left), d))
        along *= lengths[left] / np.sqrt((along**2).sum(axis=1, keepdims=True))
        A[left] = rng.uniform(world.lower, world.upper, along.shape)
        B[left] = A[left] + along
        left = left[((B[left] < world.lower) | (B[left] > world.upper)).any(axis=1)]
    return A, B


class Course:
    """A world with its segments, and the seconds that each round took."""

    def __init__(self, row: Row, n: int) -> None:
        self.row = row
        self.world = row.world()
        self.space: Any = make_space(make_robot("point"), self.world)
        self.A, self.B = segments(self.world, n, row.longest)
        self.free = np.zeros(n, np.bool_)
        check_all(self.space, self.A[:1], self.B[:1], self.free)
        self.times: list[float] = []

    def go(self) -> None:
        """Check every segment."""
        began = time.perf_counter()
        check_all(self.space, self.A, self.B, self.free)
        self.times.append(time.perf_counter() - began)

    def figures(self) -> dict[str, Any]:
        """Return what the rounds came to."""
        grid, map_ = self.space.obstacles, self.world.grid
        cells = [
            np.floor((P - grid.lower) * grid.per_length if map_ is None else map_.to_cells(P))
            for P in (self.A, self.B)
        ]
        return {
            "world": self.row.title.strip(),
            "spec": self.row.spec,
            "longest": self.row.longest,
            "per_second": len(self.free) / statistics.median(self.times),
            "hits": 1 - float(self.free.mean()),
            "cells": 1 + float(np.abs(cells[1] - cells[0]).sum(axis=1).mean()),
        }


def main() -> None:
    """Measure every row and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--segments", type=int, default=200_000)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--json", action="store_true", help="print one object and nothing else")
    options = parser.parse_args()
    courses = [Course(row, options.segments) for row in rows()]
    before = os.getloadavg()[0]
    for _ in range(options.rounds):
        for course in courses:
            course.go()
    found = [course.figures() for course in courses]
    if options.json:
        print(json.dumps({"load_before": before, "bar": BAR, "times": TIMES, "rows": found}))
        return
    print(f"load {before:.2f} before; bars: {BAR:,.0f} a second on 200 boxes, ratio {TIMES:g}")
    print(f"{'segment checks':38}{'a second':>12}{'ratio':>7}{'hits':>7}{'cells':>7}")
    for course, row in zip(courses, found, strict=True):
        ratio = found[0]["per_second"] / row["per_second"]
        boxes = f"{ratio:7.2f}" if "boxes3d" in row["spec"] else " " * 7
        title = f"{course.row.title:38}{row['per_second']:12,.0f}"
        print(f"{title}{boxes}{row['hits']:7.2f}{row['cells']:7.1f}")


if __name__ == "__main__":
    main()
