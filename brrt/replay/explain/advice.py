"""What to try next: rules, each from figures to a command. None guesses beyond its figures."""

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from brrt.replay.explain.command import command, text
from brrt.replay.explain.facts import Facts
from brrt.scenario import Scenario

MOST = 3
"""Advice that is given at most."""

_ONE_TREE = {"rrt": "rrt-connect", "rrt-star": "bi-rrt-star"}
"""What grows a second tree from the goal, instead of each planner."""

_ENOUGH = 100
"""Extensions from which on a run's course means anything."""

_GROWING = 0.05
"""Of what was reached, the part that must have come in the last third of a run that grows."""

_SPREADING = 0.15
"""The same of a run that still spreads: it is not stuck anywhere."""

_CLIMBING = ("rrt-star", "bi-rrt-star")
"""Planners that go on improving."""


@dataclass(frozen=True, slots=True)
class Advice:
    """Something to try.

    Attributes:
        why: The figures that it follows from.
        command: The command that tries it.
        scenario: What the command plans; None where it only looks.
    """

    why: str
    command: str
    scenario: Scenario | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return what a person reads."""
        return {"why": self.why, "command": self.command}


Rule = Callable[[Facts], Advice | None]


def advise(facts: Facts) -> list[Advice]:
    """Return what follows from the figures, the most telling first; `MOST` at most."""
    found: list[Advice] = []
    idle: set[Rule] = set()
    for rule in _SOLVED if facts.figures["solved"] else _UNSOLVED:
        advice = None if rule in idle else rule(facts)
        if advice is not None:
            found.append(advice)
            idle.update(_INSTEAD.get(rule, ()))
    return found[:MOST]


def no_way(f: Facts) -> Advice | None:
    """No way was found among the finest cells: look at the map before anything else."""
    if f.narrow is not None or f.way.startswith("not looked for"):
        return None
    what = "there is no way" if f.connected is False else "no way is to be seen"
    words = ["brrt", "worlds", "show", f.scenario.world, *_ends(f)]
    return Advice(f"{what} from start to goal: {f.way}", shlex.join(words))


def small_cells(f: Facts) -> Advice | None:
    """The lattice shows no path, and its cells are not much smaller than the passage."""
    lattice = None if f.contract is None else f.contract.lattice
    if lattice is None or f.narrow is None or f.figures["status"] != "no path":
        return None
    if lattice.epsilon <= f.narrow.low / 4:
        return None
    epsilon = _rounded(max(f.narrow.low, f.narrow.high / 4) / 4)
    why = f"cells of {lattice.epsilon:g} are large for a passage {_width(f)} wide"
    return _with(f, why, params={"epsilon": epsilon})


def long_step(f: Facts) -> Advice | None:
    """Steps are longer than the passage is wide, and none got through it."""
    step = _step(f)
    if step is None or not _stuck(f) or f.narrow is None or step <= f.narrow.high:
        return None
    why = f"step {step:g} is longer than the passage {_width(f)} wide, and no node got through"
    return _with(f, why, params={"step": _rounded(max(f.narrow.low, f.narrow.high / 4))})


def second_tree(f: Facts) -> Advice | None:
    """One tree stopped growing in front of the passage, or came no nearer for half of the run."""
    planner = _ONE_TREE.get(f.scenario.planner)
    if planner is None or f.approach is None or f.accepted + f.failed < _ENOUGH:
        return None
    if f.coverage is not None and f.coverage.late > _SPREADING:
        return None
    if _stuck(f):
        why = "no node got through the passage; a tree from the goal meets it from behind"
    elif f.approach.since >= 0.5:
        why = f"no node came nearer to the goal in the last {f.approach.since:.0%} of the run"
    else:
        return None
    step = f.scenario.params.get("step")
    return _with(f, why, planner=planner, params={} if step is None else {"step": step})


def short_step(f: Facts) -> Advice | None:
    """The tree is small because its steps are short, and longer ones fit the passage."""
    step, coverage, usual = _step(f), f.coverage, 0.05 * f.extent
    if step is None or coverage is None or f.acceptance is None:
        return None
    if f.acceptance < 0.1 or coverage.share > 0.5 or step > usual / 5:
        return None
    reached = f"{f.accepted:,} steps of {step:g} reached {coverage.share:.0%} of the free space"
    wide = usual if f.narrow is None else min(usual, max(f.narrow.low, 2 * step))
    if _stuck(f) and f.narrow is not None and wide > f.narrow.high:
        return None
    return _with(f, reached, params={"step": _rounded(wide)})


def goal_bias(f: Facts) -> Advice | None:
    """The goal was never drawn, or most draws of it were in vain."""
    bias = f.scenario.settings().get("goal_bias")
    if bias is None or f.scenario.planner not in _ONE_TREE:
        return None
    if bias == 0:
        return _with(f, "goal bias 0 never draws the goal", params={"goal_bias": 0.05})
    goals, samples = f.goals, f.figures["samples"]
    if goals is None or bias <= 0.2 or not samples or goals.failed < 0.9 * goals.drawn:
        return None
    by = f", most by {goals.blockers[0].name}" if goals.blockers else ""
    why = f"goal bias {bias:g} drew {goals.drawn:,} goals and {goals.failed:,} were rejected{by}"
    return _with(f, why, params={"goal_bias": 0.05})


def longer(f: Facts) -> Advice | None:
    """The run was still getting somewhere when its budget ended."""
    if f.figures["status"] not in ("iteration limit", "time limit"):
        return None
    if _grows(f) and f.coverage is not None:
        why = f"{f.coverage.late:.0%} of what was reached came in the run's last third"
        times = min(100, max(4, round(2 / f.coverage.share)))
    elif f.approach is not None and f.approach.since <= 0.3:
        why = f"it came nearer to the goal until the last {f.approach.since:.0%} of the run"
        times = 4
    else:
        return None
    return _with(f, f"{why}: it was still growing", **_more(f, times))


def look_ahead(f: Facts) -> Advice | None:
    """LRTA* goes in and out of the same cells: it is in a depression of its estimates."""
    often = f.cells.get("moves_per_cell", 0.0)
    lookahead = f.scenario.settings().get("lookahead")
    if lookahead is None or often < 2:
        return None
    deepest = f.cells["deepest"]
    why = (
        f"each cell was entered {often:.3g} times; the estimate at {_place(deepest['q'])} had to "
        f"rise by {deepest['learnt']:.4g}"
    )
    return _with(f, why, params={"lookahead": min(10_000, max(10, 10 * lookahead))})


def enough(f: Facts) -> Advice | None:
    """The second half of a run that improves its path brought next to nothing."""
    p = f.progress
    if f.scenario.planner not in _CLIMBING or p is None or p.half_cost is None:
        return None
    gain = 1 - p.best_cost / p.half_cost if p.half_cost > 0 else 0.0
    if gain >= 0.01:
        why = f"the second half of the run still took {gain:.1%} off the path"
        return _with(f, why, **_more(f, 2))
    why = f"the second half of the run took {gain:.2%} off the path"
    return _with(f, why, iterations=max(1, f.figures["iterations"] // 2), time=None)


def informed(f: Facts) -> Advice | None:
    """Once there is a path, samples that cannot improve it were drawn all the same."""
    p, settings = f.progress, f.scenario.settings()
    if p is None or settings.get("informed") is not False or settings.get("stop_at_first"):
        return None
    after = 1 - p.first / max(f.figures["iterations"], 1)
    if after < 0.5 or f.approach is None or p.best_cost < 1.02 * f.approach.start:
        return None
    why = f"{after:.0%} of the run came after the first path, drawing from the whole space"
    return _with(f, why, params={"informed": True})


def late_moves(f: Facts) -> Advice | None:
    """Moves missed their deadlines: plan for less long, or by a planner that moves at once."""
    if not f.figures["deadline_misses"]:
        return None
    slowest, deadline = f.figures["max_move_time_s"], f.scenario.deadline
    why = f"the slowest move took {slowest:.3g} s; the deadline is {deadline:g} s"
    if f.scenario.planner in _CLIMBING and f.figures["plan_time_s"]:
        part = 0.8 * deadline / f.figures["plan_time_s"]
        iterations = int(part * f.figures["iterations"])
        p = f.progress
        if p is not None and iterations > p.first:
            return _with(f, why, iterations=int(_rounded(iterations)), time=None)
        return _with(f, why, params={"stop_at_first": True})
    if f.scenario.planner == "rrt":
        return _with(f, why, planner="rrt-connect", params={})
    return _with(f, why, deadline=_rounded(2 * slowest))


def slow_tree(f: Facts) -> Advice | None:
    """One tree spent most of the run in front of the passage, and reached nothing new there."""
    if f.scenario.planner != "rrt" or f.narrow is None or f.narrow.through is None:
        return None
    before = f.narrow.through / max(f.figures["iterations"], 1)
    drought = 0.0 if f.coverage is None else f.coverage.drought
    if f.accepted + f.failed < 1000 or before < 0.5 or drought < 0.3:
        return None
    why = (
        f"{before:.0%} of the run passed before a node got through the passage, and for "
        f"{drought:.0%} of it nothing new was reached"
    )
    step = f.scenario.params.get("step")
    return _with(f, why, planner="rrt-connect", params={} if step is None else {"step": step})


_UNSOLVED: tuple[Rule, ...] = (
    no_way, small_cells, goal_bias, short_step, second_tree, long_step, look_ahead, longer,
)  # fmt: skip
_SOLVED: tuple[Rule, ...] = (late_moves, short_step, slow_tree, look_ahead, enough, informed)

_INSTEAD: Mapping[Rule, tuple[Rule, ...]] = {
    no_way: _UNSOLVED,
    goal_bias: (longer,),
    short_step: (second_tree, longer),
}
"""Rules that have nothing to say once another one has found a cause."""


def _stuck(f: Facts) -> bool:
    """Whether a passage parts start and goal, and no node is behind it."""
    return f.narrow is not None and f.narrow.parts and not f.narrow.behind


def _grows(f: Facts) -> bool:
    """Whether the run still reached new space in its last third."""
    return f.coverage is not None and f.coverage.late >= _GROWING


def _step(f: Facts) -> float | None:
    return None if f.contract is None else f.contract.step


def _width(f: Facts) -> str:
    assert f.narrow is not None  # noqa: S101 - the caller's
    return f"{max(f.narrow.low, 0):.3g} to {f.narrow.high:.3g}"


def _place(q: list[float]) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in q) + ")"


def _more(f: Facts, times: int) -> dict[str, Any]:
    """A budget that is so many times as large, of the kind that ended the run."""
    if f.figures["status"] == "time limit" and f.scenario.time is not None:
        return {"time": _rounded(times * f.scenario.time)}
    return {"iterations": times * max(f.figures["iterations"], 1)}


def _rounded(value: float) -> float:
    """Round down to one digit."""
    size = float(f"1e{f'{value:e}'.partition('e')[2]}")
    return float(f"{int(value / size * (1 + 1e-12)) * size:.6g}")


def _with(
    f: Facts,
    why: str,
    *,
    planner: str | None = None,
    params: Mapping[str, Any] | None = None,
    **budget: Any,
) -> Advice:
    """Advise to run the same with changes.

    Args:
        f: What is known.
        why: What the advice follows from.
        planner: Another planner; `params` are then all that is set.
        params: Settings that are changed.
        budget: Other fields of the scenario.
    """
    before = f.scenario.params if planner is None else {}
    scenario = replace(
        f.scenario,
        planner=planner or f.scenario.planner,
        params={**before, **(params or {})},
        **budget,
    )
    return Advice(why, command(scenario), scenario)


def _ends(f: Facts) -> list[str]:
    names = [name for name in ("start", "goal") if getattr(f.scenario, name) is not None]
    return [f"--{name}={text(getattr(f.manifest, name))}" for name in names]
