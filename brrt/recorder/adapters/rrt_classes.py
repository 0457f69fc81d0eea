"""Planners in the style of PythonRobotics: classes of a script, recognized by their methods."""

import inspect
import threading
from collections.abc import Callable
from functools import wraps
from typing import Any

from brrt.recorder.adapters.adapter import Adapter
from brrt.recorder.adapters.classes import when_defined
from brrt.recorder.adapters.rrt_solve import Solve
from brrt.recorder.adapters.solves import Solves

PLANNING = "planning"
STEPS = ("get_random_node", "steer", "check_collision")
METHODS = (PLANNING, "get_nearest_node_index", *STEPS)
"""What such a class has; its objects have a `node_list` while they plan."""


class RRTClasses(Adapter):
    """Classes with planning, get_random_node, get_nearest_node_index, steer, check_collision.

    Each call of `planning` is a solve. Nodes have x, y and a parent; obstacles are circles
    `(x, y, radius)` in `obstacle_list`. The methods are replaced in the class, those that are
    inherited too, so that all its objects and subclasses are recorded.
    """

    def __init__(self) -> None:
        self._active = threading.local()
        self._replaced: list[tuple[type, str, Any]] = []

    def install(self, solves: Solves) -> Callable[[], None]:
        """See `Adapter.install`."""
        end = when_defined(lambda kind: self._hook(kind, solves))

        def undo() -> None:
            end()
            for kind, name, before in reversed(self._replaced):
                setattr(kind, name, before)

        return undo

    def _hook(self, kind: type, solves: Solves) -> None:
        """Replace the methods that a class defines, if it is such a planner."""
        if not all(callable(getattr(kind, name, None)) for name in METHODS):
            return
        for each in kind.__mro__:
            for name in (PLANNING, *STEPS):
                method = vars(each).get(name)
                inner = getattr(method, "__func__", method)
                if not inspect.isfunction(inner) or hasattr(inner, "__brrt__"):
                    continue
                made = self._planning(inner, solves) if name == PLANNING else self._step(inner)
                made.__brrt__ = True
                again = type(method) if isinstance(method, staticmethod | classmethod) else None
                self._replaced.append((each, name, method))
                setattr(each, name, made if again is None else again(made))

    def _planning(self, planning: Callable[..., Any], solves: Solves) -> Any:
        @wraps(planning)
        def recorded(planner: Any, *given: Any, **named: Any) -> Any:
            outer = getattr(self._active, "solve", None)
            if outer is not None and outer.planner is planner:  # a subclass calls its base's
                return planning(planner, *given, **named)
            solve = Solve(planner, solves)
            self._active.solve = solve
            try:
                path = planning(planner, *given, **named)
            except BaseException:
                solve.interrupted()
                raise
            finally:
                self._active.solve = outer
            solve.ended(path)
            return path

        return recorded

    def _step(self, method: Callable[..., Any]) -> Any:
        name = method.__name__
        is_steer = name == "steer"  # most calls; only the first motion is looked at

        @wraps(method)
        def recorded(*given: Any, **named: Any) -> Any:
            solve = getattr(self._active, "solve", None)
            if solve is None or solve.inside or (is_steer and solve.is_open):
                return method(*given, **named)
            solve.inside = True
            try:
                found = method(*given, **named)
            finally:
                solve.inside = False
            solve.called(name, given, named, found)
            return found

        return recorded
