"""A planner in plain Python."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brrt import Contract, Events, Kind, Planner, Problem
from brrt.collision.motions import first_hits
from brrt.collision.obstacles import Obstacles
from brrt.events import Phase, Reason, Source, Stage, Status
from brrt.kernels.event_log import EventLog
from brrt.planners.base.stop import Stop
from brrt.scenario.contract import Draws
from brrt.scenario.query import Query
from brrt.settings import param


@dataclass(frozen=True, slots=True)
class PlainRRT(Planner):
    """RRT (LaValle 1998) in plain Python, for any robot whose motions numpy can judge."""

    step: float = param(5.0, "longest edge", above=0)
    goal_bias: float = param(0.1, "probability of drawing the goal", low=0, high=1)

    def contract(self, query: Query) -> Contract:  # noqa: ARG002
        """State what verify may hold a recording to."""
        return Contract(step=self.step, draws=Draws(goal_bias=self.goal_bias), stops=True)

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """Grow a tree from the start until it reaches the goal."""
        robot, obstacles = problem.robot, Obstacles(problem.world)
        nodes, parents, costs = [problem.start], [-1], [0.0]
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        log.emit(Kind.EDGE, 0, tree=0, node=0, parent=-1, cost=0.0, q=problem.start)
        n, status = 0, None
        while status is None:
            n += 1
            to_goal = bool(rng.random() < self.goal_bias)
            drawn = problem.goal if to_goal else rng.uniform(problem.lower, problem.upper)
            source = Source.GOAL if to_goal else Source.UNIFORM
            log.emit(Kind.SAMPLE, n, tree=0, source=source, q=drawn)
            far = robot.distance(np.array(nodes), drawn)
            near = int(far.argmin())
            part = min(1.0, self.step * (1 - 1e-12) / max(far[near], 1e-300))
            new = drawn if part == 1.0 else robot.interpolate(nodes[near], drawn, part)
            if first_hits(obstacles, robot, nodes[near][None], new[None])[0] >= 0:
                log.emit(Kind.REJECT, n, tree=0, node=near, reason=Reason.COLLISION, q=new)
            elif far[near] > 0:
                costs.append(costs[near] + float(robot.distance(nodes[near], new)))
                parents.append(near)
                nodes.append(new)
                last = len(nodes) - 1
                log.emit(Kind.EDGE, n, tree=0, node=last, parent=near, cost=costs[-1], q=new)
                if to_goal and part == 1.0:
                    path = [last]
                    while path[-1] > 0:
                        path.append(parents[path[-1]])
                    waypoints = np.array([nodes[i] for i in reversed(path)])
                    log.emit(Kind.PATH, n, stage=Stage.RAW, cost=costs[-1], waypoints=waypoints)
                    status = Status.SOLVED
            status = status or stop.reached(n, log.elapsed_s)
            if log.room < 4:
                yield log.drain()
        log.emit(Kind.PHASE, n, name=Phase.PLAN, status=status)
        yield log.drain()
