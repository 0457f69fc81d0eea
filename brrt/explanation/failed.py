"""What to try after a run that found no path: rules, each from figures to a command."""

import math
from typing import Any

from brrt.explanation.clearance import at_least, at_most
from brrt.explanation.commands import Advice, anew, change, further, go_on, look, recording, rounded
from brrt.explanation.diagnosis import (
    fitting_step,
    grows,
    is_young,
    limited,
    scarce,
    step_of,
    stuck,
    width_of,
)
from brrt.explanation.facts import Facts
from brrt.explanation.report import counted, late

MOST_CUT = 10
"""A step is never advised to be more than so many times shorter."""

_FITS = 0.8
"""Cells are advised of so many times the width of the passage that they are to fit."""

_ROOM = 30_000_000
"""Cells beyond which no lattice is advised."""

_ENOUGH = 100
"""Extensions from which on a run's course means anything."""

_SPREADING = 0.15
"""The same of a run that still spreads: it is not stuck anywhere."""


def no_way(f: Facts) -> Advice | None:
    """There is no way: look at the picture before anything else."""
    if f.way.connected is not False:
        return None
    why = f"there is no way from start to goal: {f.way.reason}"
    return look(why, "plot", recording(f), suffix=".png")


def too_wide(f: Facts) -> Advice | None:
    """No way is wide enough for the body: searching on would not help."""
    if not f.way.too_narrow or f.way.widest is None:
        return None
    # The row of the way tells what was measured: another bound beside it would only confuse.
    widest = f"at most {at_most(f.way.widest)}" if f.narrow is None else width_of(f)
    why = (
        f"no pose of this body fits through: it is at least {at_least(f.way.body)} wide, the "
        f"widest way {widest}"
    )
    return look(why, "plot", recording(f), suffix=".png")


def small_cells(f: Facts) -> Advice | None:
    """The lattice shows no path: its cells are too large for the passage, or for a narrower one."""
    lattice = f.contract.lattice
    if lattice is None or f.figures["status"] != "no path":
        return None
    cells = f"cells of {lattice.epsilon:g}"
    if f.narrow is None:
        # Half of what no way is wider than, or a quarter of the cells where these are smaller yet.
        most = math.inf if f.way.widest is None else f.way.widest / 2
        epsilon = rounded(min(lattice.epsilon / 4, most), 2)
        return _finer(f, f"{cells} show no path, and {f.way.reason}", epsilon)
    # A line of the lattice leads through any straight passage along an axis that is wider than a
    # cell; through one that runs askew, or bends, none may until cells are smaller still.
    fitting = rounded(_FITS * max(f.narrow.low, f.narrow.high / 4), 2)
    if lattice.epsilon <= fitting:
        why = f"{cells} show no path, though the passage is {width_of(f)} wide"
        return _finer(f, why, rounded(lattice.epsilon / 2, 2))
    return _finer(f, f"{cells} are large for a passage {width_of(f)} wide", fitting)


def _finer(f: Facts, why: str, epsilon: float) -> Advice:
    """Advise smaller cells and as many expansions; of too many cells, a planner without any."""
    cells = _cells(f, epsilon)
    about = f.contract.planner
    if cells > _ROOM and about.continuous is not None:
        return change(f, f"{why}; of {epsilon:g} there are {cells:.2g}", planner=about.continuous)
    if cells > f.scenario.iteration_limit(about.default_iterations):
        return change(f, why, params={"epsilon": epsilon}, iterations=cells)
    return change(f, why, params={"epsilon": epsilon})


def _cells(f: Facts, epsilon: float) -> int:
    """Return how many cells the bounds hold."""
    return math.prod(int(side / epsilon) + 1 for side in f.sides)


def goal_bias(f: Facts) -> Advice | None:
    """The goal was never drawn, or draws of it took much of the run in vain."""
    draws = f.contract.draws
    if draws is None or f.contract.planner.bidirectional is None:
        return None
    bias = draws.goal_bias
    if bias == 0 and not f.figures["solved"]:
        return anew(f, "goal bias 0 never draws the goal", params={"goal_bias": 0.05})
    goals = f.goals
    share = 0.0 if goals is None else goals.failed / max(f.figures["iterations"], 1)
    if goals is None or share <= 0.2 or goals.failed < 0.5 * goals.drawn or bias <= 0.05:
        return None
    by = f", most by {goals.blockers[0].name}" if goals.blockers else ""
    drawn = f"{counted(goals.drawn, 'goal')}, and {goals.failed:,} of them in vain{by}"
    why = f"goal bias {bias:g} drew {drawn}: {share:.0%} of the run"
    return anew(f, why, params={"goal_bias": 0.05})


def young(f: Facts) -> Advice | None:
    """The tree had hardly begun to spread when the budget ended."""
    if not limited(f) or not is_young(f) or f.coverage is None:
        return None
    c = f.coverage
    times = min(100, max(10, round(8 / c.share)))
    why = (
        f"{counted(f.figures['iterations'], 'iteration')} reached {c.share:.0%} of the free space, "
        f"and {c.single:.0%} of that with a single node"
    )
    return further(f, why if scarce(f) else f"{why}: the tree was still spreading", times)


def cramped(f: Facts) -> Advice | None:
    """Hardly an extension is accepted, and the tree does not get away: keep it cheap, and many."""
    planner = f.contract.planner.first_path
    if planner is None or not limited(f) or not scarce(f) or f.acceptance is None:
        return None
    if f.accepted + f.failed < _ENOUGH or f.approach is None or f.approach.since < 0.5:
        return None
    why = (
        f"of {f.accepted + f.failed:,} extensions {f.acceptance:.1%} were accepted, and none came "
        f"nearer to the goal in the last {f.approach.since:.0%} of the run"
    )
    return anew(f, why, 10, planner=planner, params=_same_step(f))


def second_tree(f: Facts) -> Advice | None:
    """One tree stopped growing in front of the passage, or came no nearer for half of the run."""
    planner = f.contract.planner.bidirectional
    if planner is None or f.approach is None or f.accepted + f.failed < _ENOUGH:
        return None
    if f.coverage is not None and f.coverage.late > _SPREADING:
        return None
    if is_young(f) and not stuck(f):
        return None
    if stuck(f):
        why = "no node got through the passage; a tree from the goal meets it from behind"
    elif f.approach.since >= 0.5:
        why = f"no node came nearer to the goal in the last {f.approach.since:.0%} of the run"
    else:
        return None
    return anew(f, why, planner=planner, params=_same_step(f))


def long_step(f: Facts) -> Advice | None:
    """Steps are longer than the passage is wide, and none got through it."""
    step = step_of(f)
    if step is None or not stuck(f) or f.narrow is None or step <= f.narrow.high:
        return None
    why = f"step {step:g} is longer than the passage {width_of(f)} wide, and no node got through"
    # A tenth of the step takes ten times the nodes to get as far: no less at once.
    shorter = rounded(max(fitting_step(f), step / MOST_CUT))
    return anew(f, why, max(4, step / shorter), params={"step": shorter})


def _same_step(f: Facts) -> dict[str, Any]:
    """Return the step that was set, for another planner."""
    step = f.scenario.params.get("step")
    return {} if step is None else {"step": step}


def unseen(f: Facts) -> Advice | None:
    """Cells were too coarse to tell whether there is a way: only a search could."""
    if not limited(f) or f.way.connected is not None or f.way.widest is None:
        return None
    return further(f, f"{f.way.reason}: a longer search may find it", 50)


def all_cells(f: Facts) -> Advice | None:
    """The search for a shortest path on a lattice has its end: each cell is expanded once."""
    lattice = f.contract.lattice
    if lattice is None or f.contract.learns or f.figures["status"] != "iteration limit":
        return None
    cells = _cells(f, lattice.epsilon)
    if cells <= f.figures["iterations"]:
        return None
    why = (
        f"{counted(f.figures['iterations'], 'cell')} were expanded; the bounds hold {cells:,}, and "
        "none is expanded twice"
    )
    return go_on(f, why, iterations=cells)


def longer(f: Facts) -> Advice | None:
    """The run was still getting somewhere when its budget ended."""
    if not limited(f):
        return None
    if grows(f) and f.coverage is not None:
        why = f"{f.coverage.late:.0%} of what was reached came in the run's last third"
        times = min(100, max(4, round(2 / f.coverage.share)))
    elif f.approach is not None and f.approach.since <= 0.3:
        why = f"it came nearer to the goal {late(f.approach.since)}"
        times = 10
    else:
        return None
    going = "getting somewhere" if f.cells else "growing"
    return further(f, f"{why}: it was still {going}", times)


def anything(f: Facts) -> Advice | None:
    """The budget ended the run, and nothing else has anything to say."""
    if not limited(f):
        return None
    why = "the budget ended the run, and no other figure tells why it found no path"
    return further(f, why, 10)
