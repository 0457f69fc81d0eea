"""A gate on the figures of many seeds: did a change make a planner worse by more than a margin?

Runs of the same seed are pairs. That paths are no longer found is tested by McNemar's exact test.
Where both found one, it is tested of each figure whether the new one, divided by 1 + margin, is
larger than the old one: by Wilcoxon's signed ranks on the logarithms, with the exact distribution.
Where a change does no harm beyond the margins, that is where within each pair old and scaled new
could as well be swapped, or the new is smaller, all tests together fail with a chance of at most
alpha (Bonferroni). Nothing is assumed of how the figures are distributed. On the same code a gate
always comes to the same verdict: it does not pass today and fail tomorrow.

`benchmarks/gate.py` measures false alarms, and what is found with which chance.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from brrt.errors import BrrtError, unknown
from brrt.scenario.command import command
from brrt.scenario.scenario import Scenario
from brrt.testing import ranks
from brrt.testing.figures import PROBLEM, Figures, Source

ALPHA = 0.01
"""Chance of a false alarm."""

SEEDS = 20


@dataclass(frozen=True, slots=True)
class Judged:
    """What became of one figure.

    Attributes:
        name: The figure.
        margin: Relative increase that is allowed; None for `solved`, where none is.
        old: Median of the pairs in which both found a path, not a number where there is none; of
            `solved`, how many did.
        new: The same of the new runs.
        at_least: Relative increase that the data prove, at the confidence of this test.
        p: How likely figures this much worse are where no harm was done.
        passed: Whether p is above this test's share of alpha.
        worst: Seed whose figure grew most.
    """

    name: str
    margin: float | None
    old: float
    new: float
    at_least: float
    p: float
    passed: bool
    worst: int | None


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a gate found.

    Attributes:
        name: What was judged.
        seeds: How many pairs.
        alpha: Chance of a false alarm, over all figures.
        identical: Whether each run's figures are the old ones, to the last bit.
        figures: One for each test.
        scenario: What the new runs ran; None where a function made them.
    """

    name: str
    seeds: int
    alpha: float
    identical: bool
    figures: tuple[Judged, ...]
    scenario: Scenario | None = None

    @property
    def passed(self) -> bool:
        """Whether none was made worse beyond its margin."""
        return all(each.passed for each in self.figures)

    def lines(self) -> list[str]:
        """Tell it in plain text of 80 columns."""
        outcome = "passed" if self.passed else "FAILED"
        head = f"{self.name}: {outcome}, {self.seeds} seeds"
        if self.identical:
            return [f"{head}, each the same to the last bit"]
        share = self.alpha / len(self.figures)
        rows = [_ROW.format("", "old", "new", "change", "proven", "allowed", "p", "").rstrip()]
        rows += [_row(each, self.seeds) for each in self.figures]
        often = f"{1 / self.alpha:,.0f} changes"
        rows += [f"failed where p <= {share:.2g}: a false alarm at most once in {often}"]
        worst = (each for each in self.figures if not each.passed and each.worst is not None)
        return [head, *rows, *(line for each in worst for line in self._look(each))]

    def _look(self, each: Judged) -> Iterator[str]:
        """Name the seed that became worst, and the command that runs it where there is one."""
        yield f"look at seed {each.worst}, whose {each.name} grew most"
        if self.scenario is not None and each.worst is not None:
            yield "  " + command(replace(self.scenario, seed=each.worst), f"seed{each.worst}.mcap")

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        names = ("margin", "old", "new", "at_least", "p", "passed", "worst")
        figures = {
            each.name: {name: _plain(getattr(each, name)) for name in names}
            for each in self.figures
        }
        return {
            "name": self.name, "passed": self.passed, "seeds": self.seeds, "alpha": self.alpha,
            "identical": self.identical, "figures": figures,
        }  # fmt: skip


_ROW = "  {:20}{:>9}{:>9}{:>9}{:>9}{:>9}{:>8} {}"


def gate(
    new: Source | Figures,
    against: Source | Figures | Path | str,
    *,
    seeds: int | Iterable[int] = SEEDS,
    alpha: float = ALPHA,
    name: str = "gate",
    **margins: float,
) -> Verdict:
    r"""Judge whether new runs are worse than old ones by more than the margins.

        found = brrt.gate(new, old, seeds=20, cost=0.02, iterations=0.10)
        print(*found.lines(), sep="\n")

    Args:
        new: A scenario, a function that makes a run or its figures of a seed, or figures at hand.
        against: The same, or a file of `Figures`.
        seeds: How many, from 0 on, or which.
        alpha: Chance of a false alarm over all figures together.
        name: What the verdict calls it.
        margins: For each figure, the relative increase that is allowed: `cost` (of the final path)
            or any count or cost that `brrt plan --json` prints.

    Raises:
        BrrtError: A figure is unknown, the seeds are too few to find anything, or the two are
            runs of different problems.
    """
    numbers = list(range(seeds)) if isinstance(seeds, int) else list(seeds)
    check_question(numbers, alpha, margins)
    old = _figures(against, "the old runs", numbers)
    return judge(
        _figures(new, "the new runs", numbers), old, alpha=alpha, name=name, margins=margins
    )


def judge(
    new: Figures, old: Figures, *, alpha: float, name: str, margins: Mapping[str, float]
) -> Verdict:
    """Judge figures at hand; both have the seeds of the new ones."""
    _check_problem(new, old)
    seeds = list(new.runs)
    pairs = [(old.runs[seed], new.runs[seed]) for seed in seeds]
    found = [seed for seed, (a, b) in zip(seeds, pairs, strict=True) if a["solved"] and b["solved"]]
    share = alpha / (len(margins) + 1)
    judged = [_solved(pairs, share)]
    judged += [
        _judge(figure, margin, [(old.runs[n], new.runs[n]) for n in found], found, share)
        for figure, margin in margins.items()
    ]
    _check_solved(judged[0], len(seeds), margins, alpha)
    identical = all(a[figure] == b[figure] for a, b in pairs for figure in a.keys() & b.keys())
    scenario = None if new.scenario is None else Scenario.parse(new.scenario)
    return Verdict(name, len(seeds), alpha, identical, tuple(judged), scenario)


def _judge(
    name: str, margin: float, pairs: list[tuple[Any, Any]], seeds: list[int], share: float
) -> Judged:
    for run in (run for pair in pairs for run in pair):
        if name not in run:
            raise unknown("figure", name, run.keys() - {"solved"})
    if not pairs:
        return Judged(name, margin, math.nan, math.nan, -math.inf, 1.0, True, None)
    old, new = (np.array([pair[side][name] for pair in pairs], np.float64) for side in (0, 1))
    grown = ranks.log_ratios(old, new)
    with np.errstate(over="ignore"):
        proven = float(np.expm1(ranks.at_least(grown, share)))
    p = ranks.signed_rank(ranks.log_ratios(old, new / (1 + margin)))
    return Judged(
        name, margin, float(np.median(old)), float(np.median(new)),
        proven, p, p > share, seeds[int(np.argmax(grown))],
    )  # fmt: skip


def _solved(pairs: list[tuple[Any, Any]], share: float) -> Judged:
    old, new = ([bool(pair[side]["solved"]) for pair in pairs] for side in (0, 1))
    lost = sum(a and not b for a, b in zip(old, new, strict=True))
    p = ranks.sign_test(lost, sum(b and not a for a, b in zip(old, new, strict=True)))
    return Judged("solved", None, sum(old), sum(new), -math.inf, p, p > share, None)


def _figures(source: Source | Figures | Path | str, name: str, seeds: list[int]) -> Figures:
    if isinstance(source, Path | str):
        name, source = str(source), Figures.load(Path(source))
    if not isinstance(source, Figures):
        return Figures.of(source, seeds)
    for seed in seeds:
        if seed not in source.runs:
            raise BrrtError(f"{name}: no figures of seed {seed}; renew them with all seeds")
    return source.of_seeds(seeds)


def check_question(seeds: list[int], alpha: float, margins: Mapping[str, Any]) -> None:
    """Refuse a question that has no answer, before anything is run for it.

    Raises:
        BrrtError: The seeds are too few or the same, or a number is out of range.
    """
    if not 0 < alpha < 1:
        raise BrrtError(f"alpha must be a chance between 0 and 1, not {alpha!r}")
    for name, margin in margins.items():
        if not isinstance(margin, int | float) or not 0 <= margin < math.inf:
            raise BrrtError(f"margin of {name} must be from 0 on (0.02: 2 %), not {margin!r}")
    if len(set(seeds)) < len(seeds):
        raise BrrtError("seeds must differ from each other")
    least = _least(margins, alpha)
    if len(seeds) < least:
        raise BrrtError(
            f"{len(seeds)} seeds prove nothing at alpha={alpha:g} with {len(margins)} figures; "
            f"give at least {least}, better {SEEDS}"
        )


def _least(margins: Mapping[str, Any], alpha: float) -> int:
    """Return how many pairs it takes to fail at all, were each of them worse."""
    return math.ceil(math.log2((len(margins) + 1) / alpha))


def _check_solved(old: Judged, seeds: int, margins: Mapping[str, Any], alpha: float) -> None:
    """Refuse where too few pairs are to be expected in which both find a path, were all as before.

    Raises:
        BrrtError: They are too few.
    """
    least = _least(margins, alpha)
    if margins and old.old**2 < least * seeds:
        raise BrrtError(
            f"the old runs found a path with {old.old:.0f} of {seeds} seeds: too few pairs to "
            f"prove anything of {', '.join(margins)}; give more seeds or a larger budget"
        )


def _check_problem(new: Figures, old: Figures) -> None:
    if new.scenario is None or old.scenario is None:
        return
    for key in PROBLEM:
        if new.scenario.get(key) != old.scenario.get(key):
            ours, theirs = (f"{each.scenario.get(key)!r}" for each in (new, old) if each.scenario)
            raise BrrtError(f"two problems, not two planners: {key} {ours} against {theirs}")


def _row(each: Judged, seeds: int) -> str:
    mark = "" if each.passed else "FAIL"
    p = f"{each.p:.2g}"
    if each.margin is None:
        counts = (f"{count:.0f}/{seeds}" for count in (each.old, each.new))
        return _ROW.format(each.name, *counts, "", "", "", p, mark).rstrip()
    medians = ["no path" if math.isnan(m) else f"{m:.5g}" for m in (each.old, each.new)]
    change = _percent(each.new / each.old - 1) if each.old > 0 else ""
    proven = _percent(each.at_least) if math.isfinite(each.at_least) else ""
    return _ROW.format(each.name, *medians, change, proven, _percent(each.margin), p, mark).rstrip()


def _percent(ratio: float) -> str:
    return f"{100 * ratio:+.3g} %" if ratio < 100 else f"x{1 + ratio:.3g}"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
