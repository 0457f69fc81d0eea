"""Random scenarios over all planners, robots and worlds: for the soak and for the tests."""

import hashlib
import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt import BrrtError, Problem, Robot, Scenario, World, make_robot, make_world

Floats = NDArray[np.float64]

SIDE = 20.0
LINKS = (1, 3, 6)
"""Few counts of links: kernels are compiled anew for each."""

ROBOTS = ("point 2D", "point 3D", "polygon", *(f"chain {n}" for n in LINKS))
TREES = ("rrt", "rrt-connect", "bi-rrt", "rrt-star", "bi-rrt-star")
SEARCHES = ("lrta-star", "a-star")
PLANNERS = (*TREES, *SEARCHES)

_FLAT = {
    "circles2d": "max_radius", "squares2d": "max_side", "boxes2d": "max_side",
    "polygons2d": "max_radius",
}  # fmt: skip
_DEEP = {"boxes3d": "max_side", "spheres3d": "max_radius"}


def draw(seed: int, folder: Path, planner: str | None = None, robot: str | None = None) -> Scenario:
    """Draw a scenario that can be run; the same for the same arguments.

    Args:
        seed: Of all draws.
        folder: Where robots and worlds are written that need a file.
        planner: One of `PLANNERS`; any by default.
        robot: One of `ROBOTS`; any that suits the planner by default.
    """
    rng = np.random.default_rng(seed)
    while True:
        name = planner or str(rng.choice(PLANNERS))
        suits = ROBOTS[:2] if name in SEARCHES else ROBOTS
        found = _attempt(rng, folder, name, robot or str(rng.choice(suits)))
        if found is not None:
            return found


def command(scenario: Scenario) -> str:
    """Write a scenario as the command line that runs it."""
    words = ["brrt", "plan", "--world", scenario.world, "--robot", scenario.robot]
    words += ["--planner", scenario.planner, "--seed", str(scenario.seed)]
    for name, q in (("start", scenario.start), ("goal", scenario.goal)):
        if q is not None:
            words.append(f"--{name}=" + ",".join(map(repr, q)))
    for name, value in scenario.params.items():
        words += ["--param", f"{name}={str(value).lower()}"]
    words += ["--iterations", str(scenario.iterations), "--clock", scenario.clock]
    words += ["--smooth" if scenario.smooth else "--no-smooth"]
    words += ["--shortcuts", str(scenario.shortcuts)]
    if scenario.execute:
        words += ["--execute", "--max-move", repr(scenario.max_move)]
    return shlex.join(words)


def _attempt(rng: np.random.Generator, folder: Path, planner: str, kind: str) -> Scenario | None:
    """Draw once; None where start and goal cannot be found."""
    deep = kind == "point 3D"
    world_name = _world(rng, folder, deep=deep)
    robot_name = _robot(rng, folder, kind)
    try:
        world = make_world(world_name)
        robot = make_robot(robot_name).resolved(world)
        start = _free(rng, robot, world)
        goal = start if rng.random() < 0.05 else _free(rng, robot, world)
    except BrrtError:
        return None
    if start is None or goal is None:
        return None
    if rng.random() < 0.15:
        near = robot.interpolate(start, goal, float(rng.choice([1e-9, 0.01, 0.1])))
        goal = near if robot.collision(world, near) is None else goal
    ends = [tuple(q.tolist()) for q in (start, goal)]
    scenario = Scenario(
        world=world_name, robot=robot_name, planner=planner, start=ends[0], goal=ends[1],
        params=_params(rng, planner), seed=int(rng.integers(0, 2**32)),
        iterations=int(rng.choice([1, 10, 60, 150, 300])), smooth=bool(rng.random() < 0.7),
        shortcuts=int(rng.choice([0, 1, 20, 60])), execute=bool(rng.random() < 0.3),
        max_move=float(rng.choice([0.3, 1.0, 7.0])),
        clock="real" if rng.random() < 0.3 else "logical",
    )  # fmt: skip
    try:
        # Obstacles make way for start and goal, and may come to lie where these were free.
        Problem.of(scenario)
    except BrrtError:
        return None
    return scenario


def _world(rng: np.random.Generator, folder: Path, *, deep: bool) -> str:
    """Name a world: empty, sparse, dense, or of boxes on whole coordinates that touch."""
    sizes = _DEEP if deep else _FLAT
    if rng.random() < 0.15:
        return _touching(rng, folder, 3 if deep else 2)
    name = str(rng.choice(list(sizes)))
    n, least = int(rng.choice([0, 3, 10, 25, 60])), "min_" + sizes[name].partition("_")[2]
    most = float(rng.choice([0.3, 1.0, 3.0] if n < 50 else [0.3, 1.0]))
    seed = int(rng.integers(0, 1000))
    return f"{name}:n={n},size={SIDE:g},{least}=0.1,{sizes[name]}={most},seed={seed}"


def _touching(rng: np.random.Generator, folder: Path, dim: int) -> str:
    n = int(rng.integers(1, 15))
    low = rng.integers(0, int(SIDE) - 2, (n, dim)).astype(float)
    high = low + rng.integers(0, 3, (n, dim))
    rows = rng.integers(0, int(SIDE), (n // 2, dim + 1)).astype(float)
    rows[:, dim] = rng.integers(0, 3, len(rows))
    bounds = np.zeros(dim), np.full(dim, SIDE)
    world = World("touching", *bounds, balls=rows, boxes=np.concatenate([low, high], axis=1))
    return _saved(folder, "world", world.to_json())


def _robot(rng: np.random.Generator, folder: Path, kind: str) -> str:
    if kind.startswith("point"):
        return "point"
    if kind == "polygon":
        length, width = rng.choice([0.3, 1.0, 3.0], 2).tolist()
        if rng.random() < 0.4:
            return f"polygon:length={length},width={width}"
        hulls = [_hull(rng, rng.uniform(-1, 1, 2)) for _ in range(rng.integers(1, 4))]
        return _defined(folder, "polygon", polygons=hulls)
    links = int(kind.split()[1])
    own = bool(rng.random() < 0.5)
    base = np.round(rng.uniform(4, 16, 2), 1).tolist()
    if rng.random() < 0.6:
        length, width = rng.choice([0.5, 1.0, 2.0]), rng.choice([0.0, 0.05, 0.3])
        wrap, limit = rng.random() < 0.3, rng.choice([0.5, 1.5707963267948966, 3.1])
        return (
            f"chain:links={links},length={length},width={width},wrap={str(wrap).lower()},"
            f"limit={limit},self_collision={str(own).lower()},base_x={base[0]},base_y={base[1]}"
        )
    joints = []
    for i in range(links):
        limits: Any = [None, [-1.5, 1.5], [-0.3, 2.0]][int(rng.integers(3))]
        offset = [1.0, 0.0] if i else [0.0, 0.0]
        joints.append({"offset": offset, "link": _hull(rng, [0.5, 0.0]), "limits": limits})
    return _defined(folder, "chain", base=base, joints=joints, self_collision=own)


def _hull(rng: np.random.Generator, middle: Any) -> list[list[float]]:
    """Vertices of a convex polygon, or of a line segment."""
    k = int(rng.integers(2, 7))
    angles = 2 * np.pi * (rng.random() + (np.arange(k) + rng.uniform(-0.3, 0.3, k)) / k)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return (np.asarray(middle) + rng.choice([0.2, 0.6]) * around).round(3).tolist()  # type: ignore[no-any-return]


def _defined(folder: Path, kind: str, **definition: Any) -> str:
    head = {"schema": "brrt.robot", "version": 1, "kind": kind}
    return _saved(folder, "robot", json.dumps(head | definition))


def _saved(folder: Path, what: str, text: str) -> str:
    """Write a file whose name says what is in it, so that the same draws name the same file."""
    path = folder / f"{what}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.json"
    path.write_text(text)
    return str(path)


def _free(rng: np.random.Generator, robot: Robot, world: World) -> Floats | None:
    """Draw a free configuration, now and then one at its limits."""
    low, high = robot.bounds(world)
    for _ in range(60):
        q = rng.uniform(low, high)
        if rng.random() < 0.2:
            at = rng.random(len(q)) < 0.5
            q[at] = np.where(rng.random(len(q)) < 0.5, low, high)[at]
        if rng.random() < 0.2:
            q = np.clip(np.round(q), low, high)
        q = robot.canonical(q)
        if robot.collision(world, q) is None:
            return np.asarray(q)
    return None


def _params(rng: np.random.Generator, planner: str) -> dict[str, Any]:  # noqa: C901 - a table
    """Draw settings of a planner."""

    def pick(*values: Any) -> Any:
        return values[int(rng.integers(len(values)))]

    if planner in SEARCHES:
        found = {"cell": pick(0.5, 1.0, 3.7)}
        found["max_move"] = found["cell"] * pick(2.0, 2.0, 5.0)
        found["diagonals"] = pick(True, False)
        if planner == "lrta-star":
            found |= {"lookahead": pick(1, 1, 4, 30), "trials": pick(1, 1, 3)}
        return found
    params: dict[str, Any] = (
        {"step": pick(0.2, 1.0, 1.0, 4.0, 1000.0)} if rng.random() < 0.8 else {}
    )
    if planner == "rrt":
        params |= {"goal_bias": pick(0.0, 0.05, 0.3), "goal_test": pick("step", "line-of-sight")}
        params["count_failed"] = pick(True, True, False)
        if rng.random() < 0.3:
            params |= {"keep_intermediate": True, "slices": pick(1, 3, 10)}
    elif planner == "bi-rrt":
        params |= {name: pick("extend", "connect") for name in ("grow", "link")}
        params["turn"] = pick("alternate", "smaller", "coin")
        params["always_link"] = pick(True, False)
    elif planner != "rrt-connect":
        params |= {"informed": pick(True, False), "stop_at_first": pick(True, False, False)}
        if rng.random() < 0.5:
            params["gamma"] = pick(0.5, 5.0, 1000.0)
        if planner == "rrt-star":
            params["goal_bias"] = pick(0.0, 0.05, 1.0)
        elif rng.random() < 0.5:
            params["connect_distance"] = pick(0.3, 3.0, 50.0)
    return params
