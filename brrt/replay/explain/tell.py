"""An explanation in words: rows of a name and what there is to say, for a screen of 80 columns."""

from collections.abc import Iterator

from brrt.replay.explain.facts import Facts

Row = tuple[str, str]


def rows(f: Facts) -> Iterator[Row]:
    """Tell the facts, the outcome first."""
    scenario = f.scenario
    yield "run", f"{scenario.planner} · {scenario.robot} · {scenario.world} · seed {scenario.seed}"
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
    effort = f"{figures['iterations']:,} iterations{time}"
    if figures["solved"]:
        ended = "" if figures["status"] == "solved" else f", ended by: {figures['status']}"
        return f"solved, a path of {_g(figures['path_cost'])} after {effort}{ended}"
    return f"not solved: {figures['status']} after {effort}"


def _grown(f: Facts) -> str:
    reached = ""
    if f.coverage is not None:
        reached = f"; in {f.coverage.share:.0%} of {f.coverage.cells:,} free cells of the world"
    if f.cells:
        again = f.cells["expansions"] - f.cells["cells"]
        return f"{f.cells['cells']:,} cells expanded, and {again:,} times one again{reached}"
    tried = f.accepted + f.failed
    accepted = "" if f.acceptance is None else f" from {tried:,} extensions, {f.acceptance:.0%}"
    return f"{f.figures['nodes']:,} nodes{accepted}{reached}"


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
        yield "most", f"{f.spot.share:.0%} within {sides} around {_place(f.spot.q)}"


def _way(f: Facts) -> str:
    if f.narrow is None:
        known = {True: "there is one", False: "there is none", None: "unknown"}[f.connected]
        return f"{known}: {f.way}"
    body = "" if f.scenario.robot.partition(":")[0] == "point" else ", for a point"
    width = f"{max(f.narrow.low, 0):.3g} to {f.narrow.high:.3g} wide{body}"
    place = f"at {_place(f.narrow.q)}"
    if not f.narrow.parts:
        return f"the widest one is {width} where it is narrowest, {place}"
    what = "cells" if f.cells else "nodes"
    passed = (
        f"{f.narrow.behind:,} {what} lie behind it"
        if f.narrow.behind
        else f"no {what[:-1]} got through"
    )
    when = "" if f.narrow.through is None else f", from iteration {f.narrow.through:,} on"
    return f"the widest one is {width} where it is narrowest, {place}; {passed}{when}"


def _goal(f: Facts) -> Iterator[Row]:
    near = f.approach
    if near is not None and near.far > 0:
        what = "cell" if f.cells else "node"
        hit = f"; {near.hit} is on the straight way" if near.hit else ""
        yield (
            "nearest",
            (
                f"{what} {near.node:,} at {_place(near.q)}, {_g(near.far)} from the goal "
                f"(the start: {_g(near.start)}); none nearer in the last {near.since:.0%}{hit}"
            ),
        )
    if f.gap is not None:
        hit = f"; between them {f.gap.hit}" if f.gap.hit else ""
        ends = f"{_place(f.gap.q)} and {_place(f.gap.other)}"
        yield "gap", f"the trees are at most {_g(f.gap.far)} apart, at {ends}{hit}"
    goals = f.goals
    if goals is not None:
        told = []
        if goals.drawn:
            told.append(f"drawn {goals.drawn:,} times, rejected {goals.failed:,} times")
        if goals.blocked:
            told.append(f"out of reach by the last motion {goals.blocked:,} times")
        by = ", ".join(f"{each.name} {each.share:.0%}" for each in goals.blockers[:2])
        yield "goal", "; ".join(told) + (f"; by {by}" if by else "")


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
    if not cells or not cells["moves"] or "lookahead" not in f.scenario.settings():
        return
    busiest, deepest = cells["busiest"], cells["deepest"]
    yield (
        "moves",
        (
            f"{cells['moves']:,}; each cell was entered {cells['moves_per_cell']:.3g} times, "
            f"that at {_place(busiest['q'])} {busiest['visits']:,} times"
        ),
    )
    if deepest["learnt"] > 0:
        yield (
            "learnt",
            (
                f"{cells['raised']:,} estimates rose, that at {_place(deepest['q'])} most: by "
                f"{_g(deepest['learnt'])} to {_g(deepest['estimate'])}"
            ),
        )


def _driven(f: Facts) -> Iterator[Row]:
    figures = f.figures
    if figures["max_move_time_s"] is None:
        return
    misses, deadline = figures["deadline_misses"], f.scenario.deadline
    late = f"{misses:,} later than {deadline:g} s, {figures['stays']:,} deadlines stood still"
    yield (
        "driven",
        f"{figures['moves']:,} moves, the slowest in {_seconds(figures['max_move_time_s'])}; "
        + (late if misses else f"all within {deadline:g} s"),
    )


def _seconds(value: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e6:.3g} us"


def _g(value: float | None) -> str:
    return "none" if value is None else f"{value:.5g}"


def _place(q: list[float]) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in q) + ")"
