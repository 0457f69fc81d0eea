"""What to try next: the rules in order, and those for runs with a path.

No rule goes beyond its facts.
"""

from collections.abc import Callable, Mapping

from brrt.explanation import unsolved
from brrt.explanation.commands import Advice, extend, file_of, replan, resume, rounded, show
from brrt.explanation.diagnosis import ended_by_budget, fitting_step, is_stuck
from brrt.explanation.facts import Facts
from brrt.explanation.report import place
from brrt.explanation.unsolved import same_step

MOST = 3
"""Advice that is given at most."""

Rule = Callable[[Facts], Advice | None]


def advise(facts: Facts) -> list[Advice]:
    """Return what follows from the facts, the most promising first; `MOST` at most."""
    found, excluded = list[Advice](), set[Rule]()
    rules = _SOLVED if facts.figures["solved"] else _UNSOLVED
    if not facts.contract.planner.registered:  # no command plans such a run
        rules = _ANY
    for rule in rules:
        advice = None if rule in excluded else rule(facts)
        if advice is not None:
            found.append(advice)
            excluded.update(_EXCLUDES.get(rule, ()))
    if not found and rules is _UNSOLVED:
        found += filter(None, [unsolved.out_of_budget(facts)])
    return [each.numbered(i, facts.file) for i, each in enumerate(found[:MOST], 1)]


def unfinished(f: Facts) -> Advice | None:
    """The run was interrupted or its recording is cut: continue."""
    if f.figures["status"] == "interrupted":
        return resume(f, "the run was interrupted; this command continues it")
    if not f.cut or f.figures["iterations"] < 2:
        return None
    # The last iteration may be incomplete.
    last = f.figures["iterations"] - 1
    why = "the recording is cut before planning ended; this command continues the run from there"
    return resume(f, why, iteration=last)


def short_step(f: Facts) -> Advice | None:
    """The tree is small because its steps are short, and longer ones fit the passage."""
    step, coverage, usual = f.contract.step, f.coverage, 0.05 * f.extent
    if step is None or coverage is None or f.acceptance is None:
        return None
    if f.acceptance < 0.1 or coverage.share > 0.5 or step > usual / 5:
        return None
    why = f"{f.accepted:,} steps of {step:g} reached {coverage.share:.0%} of the free space"
    wide = usual if f.narrow is None else min(usual, max(f.narrow.low, 2 * step))
    # Do not undo what `long_step` advises.
    if f.narrow is not None and f.narrow.parts and step >= min(rounded(fitting_step(f)), wide):
        return None
    if is_stuck(f) and f.narrow is not None and wide > f.narrow.high:
        return None
    return replan(f, why, 4, params={"step": rounded(wide)})


def lookahead(f: Facts) -> Advice | None:
    """LRTA* enters the same cells again and again: it is in a depression of its estimates."""
    often, lattice = f.cells.get("moves_per_cell", 0.0), f.contract.lattice
    if lattice is None or lattice.lookahead is None or often < 2:
        return None
    ten = 10 * lattice.lookahead
    most = int(f.contract.planner.greatest.get("lookahead", ten))
    deepest = f.cells["deepest"]
    why = (
        f"each cell was entered {often:.3g} times on average; the estimate at "
        f"{place(f, deepest['q'])} rose by {deepest['learnt']:.4g}"
    )
    if ended_by_budget(f):  # the learnt estimates are valid for any lookahead
        return extend(f, why, 10, params={"lookahead": min(most, max(100, ten))})
    return replan(f, why, params={"lookahead": min(most, max(10, ten))})


def half_the_budget(f: Facts) -> Advice | None:
    """The second half of a run that improves its path improved it little, or still much."""
    p = f.progress
    if not f.contract.improves or p is None or p.half_cost is None:
        return None
    gain = 1 - p.best_cost / p.half_cost if p.half_cost > 0 else 0.0
    if gain >= 0.01:
        why = f"the second half of the run still improved the path by {gain:.1%}"
        return extend(f, why, 2, least=1)
    why = f"the second half of the run improved the path by {gain:.2%}"
    half = max(1, f.figures["iterations"] // 2)
    if f.manifest.branches and half <= f.manifest.branches[-1].iteration:
        return show(why, "replay", file_of(f), "--at-iteration", str(half))
    return replan(f, why, iterations=half, time=None)


def informed(f: Facts) -> Advice | None:
    """After the first path, samples came from where no better path can lead."""
    p, draws = f.progress, f.contract.draws
    if p is None or draws is None or draws.informed or not f.contract.improves or f.contract.stops:
        return None
    after = 1 - p.first / max(f.figures["iterations"], 1)
    if after < 0.5 or f.approach is None or p.best_cost < 1.02 * f.approach.start:
        return None
    why = f"{after:.0%} of the run came after the first path, with samples from the whole space"
    return replan(f, why, params={"informed": True})


def late_moves(f: Facts) -> Advice | None:
    """Moves missed their deadlines: plan for less long, or with a planner that moves at once."""
    if not f.figures["deadline_misses"]:
        return None
    slowest, deadline = f.figures["max_move_time_s"], f.scenario.deadline
    why = f"the slowest move took {slowest:.3g} s; the deadline is {deadline:g} s"
    if f.contract.improves and f.figures["plan_time_s"]:
        part = 0.8 * deadline / f.figures["plan_time_s"]
        iterations = int(part * f.figures["iterations"])
        p = f.progress
        began = max((branch.iteration for branch in f.manifest.branches), default=0)
        if p is not None and iterations > max(p.first, began):
            return replan(f, why, iterations=int(rounded(iterations)), time=None)
        return replan(f, why, params={"stop_at_first": True})
    if f.contract.planner.bidirectional is not None and not f.contract.improves:
        return replan(f, why, planner=f.contract.planner.bidirectional, params={})
    return replan(f, why, deadline=rounded(2 * slowest))


def slow_tree(f: Facts) -> Advice | None:
    """One tree took most of the run to get through the passage, and reached nothing meanwhile."""
    planner = f.contract.planner.bidirectional
    if planner is None or f.contract.improves or f.narrow is None or f.narrow.through is None:
        return None
    before = f.narrow.through / max(f.figures["iterations"], 1)
    drought = 0.0 if f.coverage is None else f.coverage.drought
    if f.accepted + f.failed < 1000 or before < 0.5 or drought < 0.3:
        return None
    why = (
        f"the first node got through the passage after {before:.0%} of the run, and for "
        f"{drought:.0%} of it no new space was reached"
    )
    return replan(f, why, planner=planner, params=same_step(f))


_ANY: tuple[Rule, ...] = (unsolved.no_path, unsolved.body_too_wide)
_UNSOLVED: tuple[Rule, ...] = (
    *_ANY, unfinished, unsolved.short_move, unsolved.large_cells, unsolved.goal_bias, short_step,
    unsolved.spreading,
    unsolved.unknown_clearance, unsolved.second_tree, unsolved.cramped, unsolved.long_step,
    lookahead, unsolved.all_cells, unsolved.longer,
)  # fmt: skip
_SOLVED: tuple[Rule, ...] = (
    unfinished, late_moves, unsolved.goal_bias, short_step, slow_tree, lookahead, half_the_budget,
    informed,
)  # fmt: skip

_EXCLUDES: Mapping[Rule, tuple[Rule, ...]] = {
    unsolved.no_path: _UNSOLVED,
    unsolved.body_too_wide: _UNSOLVED,
    unsolved.short_move: (unsolved.large_cells, lookahead, unsolved.all_cells, unsolved.longer),
    unsolved.goal_bias: (unsolved.spreading, unsolved.longer),
    short_step: (unsolved.spreading, unsolved.second_tree, unsolved.longer),
    unsolved.spreading: (unsolved.unknown_clearance, unsolved.longer),
    unsolved.second_tree: (unsolved.cramped,),
    unsolved.unknown_clearance: (unsolved.longer,),
    unsolved.all_cells: (unsolved.longer,),
    lookahead: (unsolved.longer,),
}
"""Rules that do not apply once another one has found the cause."""
