"""Advice after a run that found no path: rules, each from facts to a command."""

import math
from typing import Any

from brrt import digits
from brrt.explanation.clearance import at_least, at_most
from brrt.explanation.commands import Advice, extend, file_of, replan, resume, rounded, show
from brrt.explanation.diagnosis import (
    ended_by_budget,
    fitting_step,
    is_growing,
    is_scarce,
    is_spreading,
    is_stuck,
    width_of,
)
from brrt.explanation.facts import Facts
from brrt.explanation.report import late
from brrt.replay.text import counted

MOST_CUT = 10
"""Factor by which a step is shortened at most."""

_FITS = 0.8
"""Advised size of cells, as part of the width of the passage that they must fit."""

_ROOM = 30_000_000
"""Cells beyond which no lattice is advised."""

_ENOUGH = 100
"""Extensions from which on the course of a run is judged."""

_SPREADING = 0.15
"""Share of the reached cells that were reached late by a tree that is not stuck."""


def no_path(f: Facts) -> Advice | None:
    """No path exists: show the world."""
    if f.clearance.connected is not False:
        return None
    why = f"no path exists from start to goal: {f.clearance.reason}"
    return show(why, "plot", file_of(f), suffix=".png")


def body_too_wide(f: Facts) -> Advice | None:
    """No path is wide enough for the body: a longer search does not help."""
    if not f.clearance.too_narrow or f.clearance.widest is None:
        return None
    # The same bound as in the row `clearance`.
    proven = f.narrow is None
    widest = f"at most {at_most(f.clearance.widest)}" if proven else width_of(f)
    why = (
        f"no pose of this body fits through: it is at least {at_least(f.clearance.body)} wide, and "
        f"the widest path {widest}"
    )
    return show(why, "plot", file_of(f), suffix=".png")


def short_move(f: Facts) -> Advice | None:
    """No cell is within a move of the goal, and from the nearest one a longer move is free."""
    lattice, approach = f.contract.lattice, f.approach
    if lattice is None or approach is None or approach.hit is not None:
        return None
    if approach.far * (1 - 1e-9) <= lattice.max_move or approach.far > 2 * lattice.cell:
        return None
    why = (
        f"the goal is {approach.far:.3g} from the nearest cell that was reached, and the longest "
        f"move to it is {lattice.max_move:g}"
    )
    return replan(f, why, params={"max_move": float(digits.at_least(approach.far, 3))})


def large_cells(f: Facts) -> Advice | None:
    """The lattice has no path: its cells are too large for the passage."""
    lattice = f.contract.lattice
    if lattice is None or f.figures["status"] != "no path":
        return None
    cells = f"cells of {lattice.cell:g}"
    if f.narrow is None:
        # Half of the bound on the width, or a quarter of the cells if that is smaller.
        most = math.inf if f.clearance.widest is None else f.clearance.widest / 2
        edge = rounded(min(lattice.cell / 4, most), 2)
        return _finer(f, f"{cells} have no path, and {f.clearance.reason}", edge)
    # A straight passage along an axis that is wider than a cell contains a line of the lattice;
    # one that is oblique or bends may need smaller cells.
    fitting = rounded(_FITS * max(f.narrow.low, f.narrow.high / 4), 2)
    if lattice.cell <= fitting:
        why = f"{cells} have no path, although the passage is {width_of(f)} wide"
        return _finer(f, why, rounded(lattice.cell / 2, 2))
    return _finer(f, f"{cells} are too large for a passage that is {width_of(f)} wide", fitting)


def _finer(f: Facts, why: str, edge: float) -> Advice:
    """Advise smaller cells and as many expansions; for too many cells, another planner."""
    cells = _cells(f, edge)
    about = f.contract.planner
    if cells > _ROOM and about.continuous is not None:
        why = f"{why}; there are {cells:.2g} cells of {edge:g}"
        return replan(f, why, planner=about.continuous)
    params = {"cell": edge}
    if f.contract.lattice is not None and f.contract.lattice.max_move < 2 * edge:
        params["max_move"] = 2 * edge  # no point is farther from the nearest cell
    if cells > f.scenario.iteration_limit(about.default_iterations):
        return replan(f, why, params=params, iterations=cells)
    return replan(f, why, params=params)


def _cells(f: Facts, edge: float) -> int:
    """Return how many cells of a size the bounds hold."""
    return math.prod(int(side / edge) + 1 for side in f.sides)


def goal_bias(f: Facts) -> Advice | None:
    """The goal was never sampled, or its rejected samples took much of the run."""
    draws = f.contract.draws
    if draws is None or f.contract.planner.bidirectional is None:
        return None
    bias = draws.goal_bias
    if bias == 0 and not f.figures["solved"]:
        return replan(f, "goal bias 0 never samples the goal", 4, params={"goal_bias": 0.05})
    goals = f.goals
    share = 0.0 if goals is None else goals.failed / max(f.figures["iterations"], 1)
    if goals is None or share <= 0.2 or goals.failed < 0.5 * goals.drawn or bias <= 0.05:
        return None
    by = f", mostly by {goals.blockers[0].name}" if goals.blockers else ""
    why = (
        f"goal bias {bias:g} sampled the goal {counted(goals.drawn, 'time')}, and {goals.failed:,} "
        f"of these samples were rejected{by}: {share:.0%} of the run"
    )
    return replan(f, why, 4, params={"goal_bias": 0.05})


def spreading(f: Facts) -> Advice | None:
    """The tree had only begun to spread when the budget ended."""
    if not ended_by_budget(f) or not is_spreading(f) or f.coverage is None:
        return None
    c = f.coverage
    times = min(100, max(10, round(8 / c.share)))
    why = (
        f"{counted(f.figures['iterations'], 'iteration')} reached {c.share:.0%} of the free space, "
        f"{c.single:.0%} of it with a single node per cell"
    )
    return extend(f, why if is_scarce(f) else f"{why}: the tree was still spreading", times)


def cramped(f: Facts) -> Advice | None:
    """Few extensions are accepted and the tree stays where it is: many cheap iterations."""
    planner = f.contract.planner.first_path
    if planner is None or not ended_by_budget(f) or not is_scarce(f) or f.acceptance is None:
        return None
    if f.accepted + f.failed < _ENOUGH or f.approach is None or f.approach.since < 0.5:
        return None
    why = (
        f"{f.acceptance:.1%} of {f.accepted + f.failed:,} extensions were accepted, and no node "
        f"came nearer to the goal in the last {f.approach.since:.0%} of the run"
    )
    return replan(f, why, 10, planner=planner, params=same_step(f))


def second_tree(f: Facts) -> Advice | None:
    """One tree did not get through the passage, or came no nearer for half of the run."""
    planner = f.contract.planner.bidirectional
    if planner is None or f.approach is None or f.accepted + f.failed < _ENOUGH:
        return None
    if f.coverage is not None and f.coverage.late > _SPREADING:
        return None
    if is_spreading(f) and not is_stuck(f):
        return None
    if is_stuck(f):
        why = "no node got through the passage; a second tree enters it from the goal's side"
    elif f.approach.since >= 0.5:
        why = f"no node came nearer to the goal in the last {f.approach.since:.0%} of the run"
    else:
        return None
    return replan(f, why, 4, planner=planner, params=same_step(f))


def long_step(f: Facts) -> Advice | None:
    """The step is longer than the passage is wide, and no node got through."""
    step = f.contract.step
    if step is None or not is_stuck(f) or f.narrow is None or step <= f.narrow.high:
        return None
    why = f"step {step:g} is longer than the passage is wide ({width_of(f)}): no node got through"
    # With a tenth of the step the same distance takes ten times the nodes.
    shorter = rounded(max(fitting_step(f), step / MOST_CUT))
    return replan(f, why, max(4, step / shorter), params={"step": shorter})


def same_step(f: Facts) -> dict[str, Any]:
    """Return the step that was given, as a setting of another planner."""
    step = f.scenario.params.get("step")
    return {} if step is None else {"step": step}


def unknown_clearance(f: Facts) -> Advice | None:
    """Cells are too coarse to find a path; a longer search may."""
    known = f.clearance
    if not ended_by_budget(f) or known.connected is not None or known.widest is None:
        return None
    return extend(f, f"{known.reason}: a longer search may find one", 50)


def all_cells(f: Facts) -> Advice | None:
    """A search that expands each cell once ends with the last cell."""
    lattice = f.contract.lattice
    if lattice is None or f.contract.learns or f.figures["status"] != "iteration limit":
        return None
    cells = _cells(f, lattice.cell)
    if cells <= f.figures["iterations"]:
        return None
    why = (
        f"{counted(f.figures['iterations'], 'cell')} were expanded; the bounds hold {cells:,}, and "
        "none is expanded twice"
    )
    return resume(f, why, iterations=cells)


def longer(f: Facts) -> Advice | None:
    """The run still progressed when its budget ended."""
    if not ended_by_budget(f):
        return None
    if is_growing(f) and f.coverage is not None:
        why = f"{f.coverage.late:.0%} of the reached space was first reached in the last third"
        times = min(100, max(4, round(2 / f.coverage.share)))
    elif f.approach is not None and f.approach.since <= 0.3:
        why = f"it came nearer to the goal {late(f.approach.since)}"
        times = 10
    else:
        return None
    still = "the search still progressed" if f.cells else "the tree was still growing"
    return extend(f, f"{why}: {still}", times)


def out_of_budget(f: Facts) -> Advice | None:
    """The budget ended the run, and no other rule applies."""
    why = "the budget ended the run, and no other fact explains why it found no path"
    return extend(f, why, 10) if ended_by_budget(f) else None
