"""The facts in words: rows of a name and a text, for a screen of 80 columns."""

from collections.abc import Iterable, Iterator, Sequence
from math import dist
from textwrap import wrap

from brrt.explanation.clearance import Narrow, at_least
from brrt.explanation.diagnosis import width_of
from brrt.explanation.facts import Facts
from brrt.explanation.places import Blocker
from brrt.replay.text import counted, seconds, vector
from brrt.scenario.contracts import changes_of

Row = tuple[str, str]

WIDTH = 79
"""Columns that are written to: the last one of 80 stays free."""

_CORNER = 0.1
"""Distance from start or goal within which a place is close to it, as part of the extent."""

_SOME = 0.05
"""Share of the iterations from which on rejected samples of the goal are given in percent."""

_END = 0.005
"""Share of the run that counts as its very end."""


def rows(f: Facts) -> Iterator[Row]:
    """Yield the facts, the outcome first."""
    scenario = f.scenario
    # Recordings of other planners that state no seed have that of the default.
    known = f.contract.planner.registered or scenario.seed
    seed = f" · seed {scenario.seed}" if known else ""
    yield "run", f"{scenario.planner} · {scenario.robot} · {scenario.world}{seed}"
    for branch, change in zip(f.manifest.branches, changes_of(f.manifest), strict=True):
        parent = branch.file or "another run"
        yield "branched", f"from {parent} after iteration {branch.iteration:,}: {change}"
    yield "outcome", _outcome(f)
    yield ("cells" if f.cells else "tree" if len(f.trees) < 2 else "trees"), _reached(f)
    yield from _course(f)
    yield from _rejected(f)
    if f.manifest.knows_robot:
        yield "clearance", _clearance(f)
    yield from _goal(f)
    yield from _paths(f)
    yield from _moves(f)
    yield from _execution(f)


def _outcome(f: Facts) -> str:
    figures = f.figures
    time = "" if figures["plan_time_s"] is None else f" in {seconds(figures['plan_time_s'])}"
    effort = f"{counted(figures['iterations'], 'iteration')}{time}"
    path = f"path of cost {_number(figures['path_cost'])}"
    if f.cut:
        found = f"with a {path}" if figures["solved"] else "without a path"
        return f"the recording is cut after {effort}, {found}"
    if figures["solved"]:
        status = figures["status"]
        ended = {"solved": "", "running": "; still planning"}.get(status, f"; ended by {status}")
        return f"solved: {path} after {effort}{ended}"
    if figures["status"] == "running":
        return f"not solved yet after {effort}"
    return f"not solved: {figures['status']} after {effort}"


def _reached(f: Facts) -> str:
    if f.cells:
        again = f.cells["expansions"] - f.cells["cells"]
        texts = [f"{f.cells['cells']:,} expanded, {counted(again, 'repeated expansion')}"]
    else:
        texts = [counted(f.figures["nodes"], "node")]
        if f.acceptance is not None:
            tried = counted(f.accepted + f.failed, "extension")
            texts.append(f"{f.acceptance:.0%} of {tried} accepted")
    if f.coverage is not None:
        c = f.coverage
        texts.append(f"reached {c.share:.0%} of the free space ({c.cells:,} coarse cells)")
    return "; ".join(texts)


def _course(f: Facts) -> Iterator[Row]:
    """Yield the tenths of the run as a table, a column for each."""
    if len(f.tenths) < 2:
        return
    yield "iteration", _columns(_short(tenth.last) for tenth in f.tenths)
    longest = max((t.us for t in f.tenths if t.us is not None), default=0.0)
    unit, size = next(pair for pair in _UNITS if longest < 1e3 * pair[1] or pair is _UNITS[-1])
    for name, values, part in (
        ("% new cells" if f.cells else "% accepted", [_percent(t.accepted) for t in f.tenths], 1.0),
        (f"{unit} each", [t.us for t in f.tenths], size),
        ("to goal", [t.nearest for t in f.tenths], 1.0),
    ):
        # With a tree from the goal, or in a graph, one tree's distance says nothing of the way.
        if name == "to goal" and (len(f.trees) > 1 or f.figures["vertices"]):
            continue
        if any(value is not None for value in values):
            yield name, _columns("-" if v is None else _compact(v / part) for v in values)


def _percent(share: float | None) -> float | None:
    return None if share is None else round(100 * share)


_UNITS = ("us", 1.0), ("ms", 1e3), ("s", 1e6)
"""Units of time, and how many microseconds each is."""


def _compact(value: float) -> str:
    """Write a number in 5 characters or less, with 3 digits if they fit."""
    texts = (f"{value:.{digits}g}" for digits in (3, 2, 1))
    return next((text for text in texts if len(text) <= 5), f"{value:.0e}")


def _columns(values: Iterable[str]) -> str:
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
        yield "blocked by", _shares(f.blockers)
    if f.spot is not None and f.spot.share >= 0.05:
        sides = " x ".join(f"{side:.3g}" for side in f.spot.sides)
        yield "region", f"{f.spot.share:.0%} of them within {sides} around {place(f, f.spot.q)}"


def _shares(blockers: Sequence[Blocker]) -> str:
    return ", ".join(f"{each.name} {each.share:.0%}" for each in blockers)


def _clearance(f: Facts) -> str:
    solved, narrow, known = f.figures["solved"], f.narrow, f.clearance
    if narrow is None:
        if solved and known.widest is not None:
            return f"the run found a path, but {known.reason}"
        if solved:
            return "a path exists: the run found one"
        exists = {True: "a path exists", False: "no path exists", None: "unknown"}
        return f"{exists[known.connected]}: {known.reason}"
    texts = [f"the widest path is {width_of(f)} wide at its narrowest place, {_where(f, narrow)}"]
    if known.body and narrow.low < known.body:
        texts.append(f"the body is at least {at_least(known.body)} wide")
    if solved and narrow.crossed is not None:
        texts.append(f"the run's path {'leads through it' if narrow.crossed else 'avoids it'}")
    if narrow.parts and not (solved and (len(f.trees) > 1 or not narrow.crossed)):
        texts.append(_beyond(narrow, "cell" if f.cells else "node"))
    return "; ".join(texts)


def _where(f: Facts, narrow: Narrow) -> str:
    """Write where the narrowest place is; next to start or goal it is no passage."""
    for name, end in (("start", f.manifest.start), ("goal", f.manifest.goal)):
        near = min(narrow.high, _CORNER * f.extent)
        if f.clearance.body == 0 and dist(narrow.q, end[: len(narrow.q)]) <= near:
            return f"{place(f, narrow.q)}, close to the {name}"
    return place(f, narrow.q)


def _beyond(narrow: Narrow, what: str) -> str:
    if not narrow.behind:
        near = "" if narrow.near else f", and none came within {narrow.reach:.3g} of it"
        return f"no {what} got through{near}"
    first = "" if narrow.through is None else f", the first in iteration {narrow.through:,}"
    are = "is" if narrow.behind == 1 else "are"
    return f"{counted(narrow.behind, what)} {are} beyond it{first}"


def _goal(f: Facts) -> Iterator[Row]:
    near, gap, goals = f.approach, f.gap, f.goals
    if near is not None and near.far > 0 and not f.figures["solved"]:
        what = "cell" if f.cells else "node"
        far, start = _number(near.far), _number(near.start)
        at = f"{what} {near.node:,} at {place(f, near.q)}"
        texts = [f"{at}, {far} from the goal (start: {start})"]
        if near.since < _END:
            texts.append("reached at the very end")
        else:
            texts.append(f"no nearer {what} in the last {near.since:.0%} of the run")
        texts += [f"{near.hit} blocks the straight motion"] if near.hit else []
        yield "nearest", "; ".join(texts)
    if gap is not None:
        hit = f"; {gap.hit} is between them" if gap.hit else ""
        at = f"{place(f, gap.q)} and {place(f, gap.other)}"
        yield "gap", f"the trees are {gap.far:.4g} apart, at {at}{hit}"
    if goals is not None:
        texts = []
        if goals.drawn:
            share = goals.failed / max(f.figures["iterations"], 1)
            # A planner may try the goal from many nodes in each iteration.
            per = f"{share:.0%} of the iterations" if share <= 1 else f"{share:.3g} an iteration"
            part = f" ({per})" if share >= _SOME else ""
            times = counted(goals.drawn, "time")
            texts.append(f"sampled {times}, rejected {counted(goals.failed, 'time')}{part}")
        if goals.blocked:
            texts.append(f"motion to it blocked {counted(goals.blocked, 'time')}")
        texts += [f"blocked by {_shares(goals.blockers[:2])}"] if goals.blockers else []
        yield "goal", "; ".join(texts)


def _paths(f: Facts) -> Iterator[Row]:
    p = f.progress
    if p is None:
        return
    straight = ""
    lengths = f.manifest.claims.costs == "length"
    if f.approach is not None and f.approach.start > 0 and lengths:
        straight = f", {p.best_cost / f.approach.start:.2f} times the straight line"
    if p.paths == 1:
        yield "path", f"cost {_number(p.best_cost)}{straight}, found in iteration {p.first:,}"
        return
    costs = [f"{_number(p.first_cost)} in iteration {p.first:,}"]
    costs += [] if p.half_cost is None else [f"{_number(p.half_cost)} after half of the run"]
    costs.append(f"{_number(p.best_cost)} in iteration {p.best:,}{straight}")
    yield "paths", f"{p.paths:,}, cost {', '.join(costs)}"


def _moves(f: Facts) -> Iterator[Row]:
    cells = f.cells
    if not cells or not cells["moves"] or not f.contract.learns:
        return
    busiest, deepest = cells["busiest"], cells["deepest"]
    entered = "each cell was entered once"
    if busiest["visits"] > 1:
        most = f"{place(f, busiest['q'])} {counted(busiest['visits'], 'time')}"
        entered = f"each cell was entered {cells['moves_per_cell']:.3g} times on average, {most}"
    yield "moves", f"{cells['moves']:,}; {entered}"
    if deepest["learnt"] > 0:
        rose = f"{_number(deepest['learnt'])} to {_number(deepest['estimate'])}"
        yield "estimates", f"{cells['raised']:,} rose, most at {place(f, deepest['q'])}: by {rose}"


def _execution(f: Facts) -> Iterator[Row]:
    figures = f.figures
    if figures["max_move_time_s"] is None:
        return
    deadline, misses = f.scenario.deadline, figures["deadline_misses"]
    late = f"all within the deadline of {deadline:g} s"
    if misses:
        stays = counted(figures["stays"], "deadline")
        late = f"{misses:,} missed the deadline of {deadline:g} s, the robot stayed for {stays}"
    slowest = f"the slowest planned in {seconds(figures['max_move_time_s'])}"
    yield "execution", f"{counted(figures['moves'], 'move')}, {slowest}; {late}"


def late(share: float) -> str:
    """Write until when a run progressed, by the share of the run that came after."""
    return "up to the very end" if share < _END else f"until the last {share:.0%} of the run"


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.5g}"


def place(f: Facts, q: Sequence[float]) -> str:
    """Write a configuration or a point in digits that tell it apart."""
    return vector(q, f.digits[len(q)])


def table(found: Sequence[Row]) -> Iterator[str]:
    """Yield rows as lines of 80 columns."""
    width = max(len(name) for name, _ in found) + 2
    for name, text in found:
        for i, line in enumerate(wrap(text, WIDTH - width, break_on_hyphens=False)):
            yield ("" if i else name).ljust(width) + line
