"""An explanation in words: rows of a name and what there is to say, for a screen of 80 columns."""

from collections.abc import Iterator, Sequence
from math import dist
from textwrap import wrap

from brrt.explanation.clearance import Narrow, at_least
from brrt.explanation.diagnosis import width_of
from brrt.explanation.facts import Facts
from brrt.scenario.contracts import changes_of

Row = tuple[str, str]

WIDTH = 79
"""Columns that are written to: the last one of 80 stays free."""

_CORNER = 0.1
"""Of the map's longest side, how far a corner of it reaches."""

_SOME = 0.05
"""Of the iterations, what is told of the goal's rejected draws."""

_END = 0.005
"""Of a run, what is too little to name in percent."""


def rows(f: Facts) -> Iterator[Row]:
    """Tell the facts, the outcome first."""
    scenario = f.scenario
    yield "run", f"{scenario.planner} · {scenario.robot} · {scenario.world} · seed {scenario.seed}"
    for branch, change in zip(f.manifest.branches, changes_of(f.manifest), strict=True):
        file = branch.file or "another run"
        yield "from", f"{file}, behind iteration {branch.iteration:,}: {change}"
    yield "outcome", _outcome(f)
    yield "grown", _grown(f)
    yield from _course(f)
    yield from _rejected(f)
    yield "way", _way(f)
    yield from _goal(f)
    yield from _paths(f)
    yield from _cells(f)
    yield from _driven(f)


def _outcome(f: Facts) -> str:
    figures = f.figures
    time = "" if figures["plan_time_s"] is None else f" in {_seconds(figures['plan_time_s'])}"
    effort = f"{counted(figures['iterations'], 'iteration')}{time}"
    if f.cut:
        found = f"with a path of {_g(figures['path_cost'])}" if figures["solved"] else "not solved"
        return f"cut short, {found}: the recording breaks off after {effort}"
    if figures["solved"]:
        status = figures["status"]
        ended = {"solved": "", "running": "; planning goes on"}.get(status, f", ended by: {status}")
        return f"solved, a path of {_g(figures['path_cost'])} after {effort}{ended}"
    if figures["status"] == "running":
        return f"not solved yet after {effort}"
    return f"not solved: {figures['status']} after {effort}"


def _grown(f: Facts) -> str:
    reached = ""
    if f.coverage is not None:
        reached = f"; in {f.coverage.share:.0%} of {f.coverage.cells:,} free cells of the world"
    if f.cells:
        again = f.cells["expansions"] - f.cells["cells"]
        return f"{counted(f.cells['cells'], 'cell')} expanded, and {again:,} again{reached}"
    tried = f.accepted + f.failed
    accepted = ""
    if f.acceptance is not None:
        accepted = f" from {counted(tried, 'extension')}, {f.acceptance:.0%}"
    return f"{counted(f.figures['nodes'], 'node')}{accepted}{reached}"


def _course(f: Facts) -> Iterator[Row]:
    """Yield a table of the run's tenths, a column for each."""
    if len(f.tenths) < 2:
        return
    yield "iteration", _columns([_short(tenth.last) for tenth in f.tenths])
    for name, values in (
        ("% new cells" if f.cells else "% accepted", [_percent(t.accepted) for t in f.tenths]),
        ("us each", [None if t.us is None else f"{t.us:.3g}" for t in f.tenths]),
        ("from goal", [None if t.nearest is None else f"{t.nearest:.3g}" for t in f.tenths]),
    ):
        if any(value is not None for value in values):
            yield name, _columns(["-" if value is None else value for value in values])


def _percent(part: float | None) -> str | None:
    return None if part is None else f"{100 * part:.0f}"


def _columns(values: list[str]) -> str:
    return "".join(f"{value:>6}" for value in values)


def _short(n: int) -> str:
    """Write a count in four places."""
    for size, unit in ((10**9, "G"), (10**6, "M"), (10**3, "k")):
        if n >= size and n >= 10_000:
            return f"{n / size:.2g}{unit}" if n < 10 * size else f"{n / size:.0f}{unit}"
    return str(n)


def _rejected(f: Facts) -> Iterator[Row]:
    total = sum(f.reasons.values())
    if not total:
        return
    counts = ", ".join(f"{reason} {n:,}" for reason, n in f.reasons.items())
    yield "rejected", f"{total:,}: {counts}" if len(f.reasons) > 1 else counts
    if f.blockers:
        yield "by", ", ".join(f"{each.name} {each.share:.0%}" for each in f.blockers)
    if f.spot is not None and f.spot.share >= 0.05:
        sides = " x ".join(f"{side:.3g}" for side in f.spot.sides)
        yield "most", f"{f.spot.share:.0%} within {sides} around {place(f.spot.q)}"


def _way(f: Facts) -> str:
    solved, narrow = f.figures["solved"], f.narrow
    if narrow is None:
        if solved and f.way.widest is not None:
            return f"there is one: the run found it, but {f.way.reason}"
        known = {True: "there is one", False: "there is none", None: "unknown"}[f.way.connected]
        return f"{known}: {'the run found it' if solved else f.way.reason}"
    width = f"{width_of(f)} wide where it is narrowest"
    told = [f"the widest one is {width}, {_where(f, narrow)}"]
    if f.way.body and narrow.low < f.way.body:
        told.append(f"this body is at least {at_least(f.way.body)} wide")
    if solved and narrow.crossed is not None:
        way = "leads through there" if narrow.crossed else "takes another way"
        told.append(f"the path {way}")
    if narrow.parts and not (solved and (len(f.trees) > 1 or not narrow.crossed)):
        told.append(_passed(narrow, "cell" if f.cells else "node"))
    return "; ".join(told)


def _where(f: Facts, narrow: Narrow) -> str:
    """Write where the narrowest place is; that of start or goal itself is no passage."""
    at = f"at {place(narrow.q)}"
    for name, end in (("start", f.manifest.start), ("goal", f.manifest.goal)):
        near = min(narrow.high, _CORNER * f.extent)
        if f.way.body == 0 and dist(narrow.q, end[: len(narrow.q)]) <= near:
            return f"{at}, close to the {name}"
    return at


def _passed(narrow: Narrow, what: str) -> str:
    if not narrow.behind:
        near = "" if narrow.near else f", none came within {narrow.reach:.3g} of it"
        return f"no {what} got through{near}"
    when = "" if narrow.through is None else f", from iteration {narrow.through:,} on"
    lie = "lies" if narrow.behind == 1 else "lie"
    return f"{counted(narrow.behind, what)} {lie} behind it{when}"


def _goal(f: Facts) -> Iterator[Row]:
    near = f.approach
    if near is not None and near.far > 0 and not f.figures["solved"]:
        what = "cell" if f.cells else "node"
        hit = f"; {near.hit} is on the straight way" if near.hit else ""
        yield (
            "nearest",
            (
                f"{what} {near.node:,} at {place(near.q)}, {_g(near.far)} from the goal "
                f"(the start: {_g(near.start)}); {_since(near.since)}{hit}"
            ),
        )
    if f.gap is not None:
        hit = f"; between them {f.gap.hit}" if f.gap.hit else ""
        ends = f"{place(f.gap.q)} and {place(f.gap.other)}"
        yield "gap", f"the trees come within {f.gap.far:.4g} of each other, at {ends}{hit}"
    goals = f.goals
    if goals is not None:
        told = []
        if goals.drawn:
            drawn, failed = (counted(n, "time") for n in (goals.drawn, goals.failed))
            share = goals.failed / max(f.figures["iterations"], 1)
            of_all = f" ({share:.0%} of the iterations)" if share >= _SOME else ""
            told.append(f"drawn {drawn}, rejected {failed}{of_all}")
        if goals.blocked:
            told.append(f"out of reach by the last motion {counted(goals.blocked, 'time')}")
        by = ", ".join(f"{each.name} {each.share:.0%}" for each in goals.blockers[:2])
        yield "goal", "; ".join(told) + (f"; by {by}" if by else "")


def _since(share: float) -> str:
    if share < _END:
        return f"it came nearer {late(share)}"
    return f"none nearer in the last {share:.0%}"


def late(share: float) -> str:
    """Write until when a run got somewhere, by the share of it that came after."""
    return "up to the very end" if share < _END else f"until the last {share:.0%} of the run"


def _paths(f: Facts) -> Iterator[Row]:
    p = f.progress
    if p is None:
        return
    straight = ""
    if f.approach is not None and f.approach.start > 0:
        straight = f", {p.best_cost / f.approach.start:.3g} times the straight line"
    if p.paths == 1:
        yield "path", f"{_g(p.best_cost)}{straight}, found in iteration {p.first:,}"
        return
    half = "" if p.half_cost is None else f", {_g(p.half_cost)} half-way"
    yield (
        "paths",
        (
            f"the first in iteration {p.first:,} cost {_g(p.first_cost)}{half}, the last of "
            f"{p.paths:,} in {p.best:,} {_g(p.best_cost)}{straight}"
        ),
    )


def _cells(f: Facts) -> Iterator[Row]:
    cells = f.cells
    if not cells or not cells["moves"] or not f.contract.learns:
        return
    busiest, deepest = cells["busiest"], cells["deepest"]
    often = cells["moves_per_cell"]
    entered = "each cell was entered once"
    if busiest["visits"] > 1:
        most = f"that at {place(busiest['q'])} {counted(busiest['visits'], 'time')}"
        entered = f"each cell was entered {often:.3g} times on average, {most}"
    yield "moves", f"{cells['moves']:,}; {entered}"
    if deepest["learnt"] > 0:
        yield (
            "learnt",
            (
                f"{counted(cells['raised'], 'estimate')} rose, that at {place(deepest['q'])} "
                f"most: by {_g(deepest['learnt'])} to {_g(deepest['estimate'])}"
            ),
        )


def _driven(f: Facts) -> Iterator[Row]:
    figures = f.figures
    if figures["max_move_time_s"] is None:
        return
    misses, deadline = figures["deadline_misses"], f.scenario.deadline
    stood = counted(figures["stays"], "deadline")
    late = f"{misses:,} later than {deadline:g} s, {stood} stood still"
    yield (
        "driven",
        f"{counted(figures['moves'], 'move')}, the slowest in "
        f"{_seconds(figures['max_move_time_s'])}; "
        + (late if misses else f"all within {deadline:g} s"),
    )


def _seconds(value: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e6:.3g} us"


def _g(value: float | None) -> str:
    return "none" if value is None else f"{value:.5g}"


def place(q: list[float]) -> str:
    """Write a configuration, or a place."""
    return "(" + ", ".join(f"{x:.4g}" for x in q) + ")"


def counted(n: int, one: str) -> str:
    """Write a number of things: `1 node`, `1,200 nodes`."""
    return f"{n:,} {one if n == 1 else one + 's'}"


def table(found: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of rows for a screen of 80 columns."""
    width = max(len(name) for name, _ in found) + 2
    for name, text in found:
        lines = wrap(text, WIDTH - width, break_on_hyphens=False)
        for i, line in enumerate(lines):
            yield ("" if i else name).ljust(width) + line
