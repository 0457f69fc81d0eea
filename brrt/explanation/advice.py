"""What to try next: rules, each from figures to a command. None guesses beyond its figures."""

from collections.abc import Callable, Mapping

from brrt.explanation import failed
from brrt.explanation.commands import Advice, anew, change, further, go_on, look, recording, rounded
from brrt.explanation.diagnosis import fitting_step, limited, step_of, stuck
from brrt.explanation.facts import Facts
from brrt.explanation.report import place

MOST = 3
"""Advice that is given at most."""

Rule = Callable[[Facts], Advice | None]


def advise(facts: Facts) -> list[Advice]:
    """Return what follows from the figures, the most telling first; `MOST` at most."""
    found: list[Advice] = []
    idle: set[Rule] = set()
    rules = _SOLVED if facts.figures["solved"] else _UNSOLVED
    if not facts.contract.planner.registered:  # nothing could run it again
        rules = _LOOKS
    for rule in rules:
        advice = None if rule in idle else rule(facts)
        if advice is not None:
            found.append(advice)
            idle.update(_INSTEAD.get(rule, ()))
    if not found and rules is _UNSOLVED:
        found += filter(None, [failed.anything(facts)])
    return [each.numbered(i + 1, facts.file) for i, each in enumerate(found[:MOST])]


def cut_short(f: Facts) -> Advice | None:
    """Nothing but a kill, or a person, ended the run: go on from there."""
    if f.figures["status"] == "interrupted":
        return go_on(f, "the run was interrupted; this goes on where it ended")
    if not f.cut or f.figures["iterations"] < 2:
        return None
    # Of the last iteration some may be missing.
    last = f.figures["iterations"] - 1
    why = "the recording breaks off in the midst of the run; this goes on from there"
    return go_on(f, why, iteration=last)


def short_step(f: Facts) -> Advice | None:
    """The tree is small because its steps are short, and longer ones fit the passage."""
    step, coverage, usual = step_of(f), f.coverage, 0.05 * f.extent
    if step is None or coverage is None or f.acceptance is None:
        return None
    if f.acceptance < 0.1 or coverage.share > 0.5 or step > usual / 5:
        return None
    reached = f"{f.accepted:,} steps of {step:g} reached {coverage.share:.0%} of the free space"
    wide = usual if f.narrow is None else min(usual, max(f.narrow.low, 2 * step))
    # What `long_step` advises is not taken back.
    if f.narrow is not None and f.narrow.parts and step >= min(rounded(fitting_step(f)), wide):
        return None
    if stuck(f) and f.narrow is not None and wide > f.narrow.high:
        return None
    return anew(f, reached, params={"step": rounded(wide)})


def look_ahead(f: Facts) -> Advice | None:
    """LRTA* goes in and out of the same cells: it is in a depression of its estimates."""
    often, lattice = f.cells.get("moves_per_cell", 0.0), f.contract.lattice
    if lattice is None or lattice.lookahead is None or often < 2:
        return None
    ten = 10 * lattice.lookahead
    most = int(f.contract.planner.greatest.get("lookahead", ten))
    deepest = f.cells["deepest"]
    why = (
        f"each cell was entered {often:.3g} times on average; the estimate at "
        f"{place(deepest['q'])} had to rise by {deepest['learnt']:.4g}"
    )
    if limited(f):  # what was learnt stays right whatever the lookahead is
        return further(f, why, 10, params={"lookahead": min(most, max(100, ten))})
    return change(f, why, params={"lookahead": min(most, max(10, ten))})


def enough(f: Facts) -> Advice | None:
    """The second half of a run that improves its path brought next to nothing."""
    p = f.progress
    if not f.contract.improves or p is None or p.half_cost is None:
        return None
    gain = 1 - p.best_cost / p.half_cost if p.half_cost > 0 else 0.0
    if gain >= 0.01:
        why = f"the second half of the run still took {gain:.1%} off the path"
        return further(f, why, 2, least=1)
    why = f"the second half of the run took {gain:.2%} off the path"
    half = max(1, f.figures["iterations"] // 2)
    if f.manifest.branches and half <= f.manifest.branches[-1].iteration:
        return look(why, "replay", recording(f), "--at-iteration", str(half))
    return change(f, why, iterations=half, time=None)


def informed(f: Facts) -> Advice | None:
    """Once there is a path, samples that cannot improve it were drawn all the same."""
    p, draws = f.progress, f.contract.draws
    if p is None or draws is None or draws.informed or not f.contract.improves:
        return None
    if f.contract.stops:
        return None
    after = 1 - p.first / max(f.figures["iterations"], 1)
    if after < 0.5 or f.approach is None or p.best_cost < 1.02 * f.approach.start:
        return None
    why = f"{after:.0%} of the run came after the first path, drawing from the whole space"
    return change(f, why, params={"informed": True})


def late_moves(f: Facts) -> Advice | None:
    """Moves missed their deadlines: plan for less long, or by a planner that moves at once."""
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
            return change(f, why, iterations=int(rounded(iterations)), time=None)
        return change(f, why, params={"stop_at_first": True})
    if f.contract.planner.bidirectional is not None and not f.contract.improves:
        return change(f, why, planner=f.contract.planner.bidirectional, params={})
    return change(f, why, deadline=rounded(2 * slowest))


def slow_tree(f: Facts) -> Advice | None:
    """One tree spent most of the run in front of the passage, and reached nothing new there."""
    planner = f.contract.planner.bidirectional
    if planner is None or f.contract.improves or f.narrow is None or f.narrow.through is None:
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
    return change(f, why, planner=planner, params={} if step is None else {"step": step})


_LOOKS: tuple[Rule, ...] = (failed.no_way, failed.too_wide)
_UNSOLVED: tuple[Rule, ...] = (
    *_LOOKS, cut_short, failed.small_cells, failed.goal_bias, short_step, failed.young,
    failed.unseen, failed.second_tree, failed.cramped, failed.long_step, look_ahead,
    failed.all_cells, failed.longer,
)  # fmt: skip
_SOLVED: tuple[Rule, ...] = (
    cut_short, late_moves, failed.goal_bias, short_step, slow_tree, look_ahead, enough, informed,
)  # fmt: skip

_INSTEAD: Mapping[Rule, tuple[Rule, ...]] = {
    failed.no_way: _UNSOLVED,
    failed.too_wide: _UNSOLVED,
    failed.goal_bias: (failed.young, failed.longer),
    short_step: (failed.young, failed.second_tree, failed.longer),
    failed.young: (failed.unseen, failed.longer),
    failed.second_tree: (failed.cramped,),
    failed.unseen: (failed.longer,),
    failed.all_cells: (failed.longer,),
    look_ahead: (failed.longer,),
}
"""Rules that have nothing to say once another one has found a cause."""
