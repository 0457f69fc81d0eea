"""A gate on the metrics of many seeds: does a change make a planner worse by more than a margin?

Runs with the same seed are pairs. Lost solutions are tested by McNemar's exact test. For pairs in
which both runs found a path, Wilcoxon's signed-rank test on the logarithms decides for each metric
whether the new value, divided by 1 + margin, is larger than the old one.

If a change does no harm beyond the margins (in each pair, the old and the scaled new value are
exchangeable, or the new one is smaller), the gate fails with a probability of at most alpha over
all tests (Bonferroni), whatever the distribution of the metrics. The same code always gets the same
verdict.

`benchmarks/gate.py` measures the rate of false alarms and the power.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from brrt.comparison.difference import plain
from brrt.errors import BrrtError, unknown
from brrt.scenario.command import command
from brrt.scenario.scenario import Scenario
from brrt.testing.paired_tests import log_ratios, lower_bound, sign_test, signed_rank_test
from brrt.testing.seed_metrics import PROBLEM, SeedMetrics, Source

ALPHA = 0.01
"""Default probability of a false alarm."""

SEEDS = 20


@dataclass(frozen=True, slots=True)
class MetricVerdict:
    """The outcome of one test.

    Attributes:
        name: The metric, or `solved`.
        margin: Relative increase that is allowed; None for `solved`, which has no margin.
        old: Median of the pairs in which both found a path, NaN if there are none; for `solved` the
            number of runs that found one.
        new: The same for the new runs.
        at_least: Relative increase that the data prove, at the confidence of this test.
        p: Probability of a result at least this bad if no harm was done.
        passed: Whether p is above this test's share of alpha.
        worst: Seed whose metric grew most.
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
    """The outcome of a gate.

    Attributes:
        name: What was judged.
        seeds: Number of pairs.
        alpha: Probability of a false alarm, over all tests.
        identical: Whether all metrics are equal to the last bit.
        metrics: One verdict for each test.
        scenario: The new runs' scenario; None if a function made them.
    """

    name: str
    seeds: int
    alpha: float
    identical: bool
    metrics: tuple[MetricVerdict, ...]
    scenario: Scenario | None = None

    @property
    def passed(self) -> bool:
        """Whether every test passed."""
        return all(each.passed for each in self.metrics)

    def lines(self) -> list[str]:
        """Write it as plain text of 80 columns."""
        outcome = "passed" if self.passed else "FAILED"
        head = f"{self.name}: {outcome}, {self.seeds} seeds"
        if self.identical:
            return [f"{head}, all equal to the last bit"]
        share = self.alpha / len(self.metrics)
        rows = [_ROW.format("", "old", "new", "change", "proven", "allowed", "p", "").rstrip()]
        rows += [_row(each, self.seeds) for each in self.metrics]
        changes = f"{1 / self.alpha:,.0f} changes"
        rows += [f"failed if p <= {share:.2g}: at most one false alarm in {changes}"]
        worst = (each for each in self.metrics if not each.passed and each.worst is not None)
        return [head, *rows, *(line for each in worst for line in self._worst_seed(each))]

    def _worst_seed(self, each: MetricVerdict) -> Iterator[str]:
        """Name the seed that got worst, and the command that runs it if there is one."""
        yield f"{each.name} grew most with seed {each.worst}"
        if self.scenario is not None and each.worst is not None:
            yield "  " + command(replace(self.scenario, seed=each.worst), f"seed{each.worst}.mcap")

    def as_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        rows = plain([asdict(each) for each in self.metrics])
        figures = {row.pop("name"): row for row in rows}
        return {
            "name": self.name, "passed": self.passed, "seeds": self.seeds, "alpha": self.alpha,
            "identical": self.identical, "figures": figures,
        }  # fmt: skip


_ROW = "  {:20}{:>9}{:>9}{:>9}{:>9}{:>9}{:>8} {}"


def gate(
    new: Source | SeedMetrics,
    against: Source | SeedMetrics | Path | str,
    *,
    seeds: int | Iterable[int] = SEEDS,
    alpha: float = ALPHA,
    name: str = "gate",
    **margins: float,
) -> Verdict:
    r"""Judge whether new runs are worse than old ones by more than the margins.

        verdict = brrt.gate(new, old, seeds=20, cost=0.02, iterations=0.10)
        print(*map(visible, verdict.lines()), sep="\n")

    Args:
        new: A scenario, a function of the seed that returns a run or its metrics, or metrics.
        against: The same, or a file of metrics.
        seeds: How many, from 0 on, or which.
        alpha: Probability of a false alarm over all metrics together.
        name: What the verdict calls it.
        margins: For each metric, the relative increase that is allowed: `cost` (of the final path)
            or any count or cost that `brrt plan --json` prints.

    Raises:
        BrrtError: A metric is unknown, the seeds are too few to prove anything, or the runs are of
            different problems.
    """
    numbers = list(range(seeds)) if isinstance(seeds, int | np.integer) else list(seeds)
    check_question(numbers, alpha, margins)
    old = _metrics_of(against, "the old runs", numbers)
    found = _metrics_of(new, "the new runs", numbers)
    return judge(found, old, alpha=alpha, name=name, margins=margins)


def judge(
    new: SeedMetrics, old: SeedMetrics, *, alpha: float, name: str, margins: Mapping[str, float]
) -> Verdict:
    """Judge metrics; the old ones must include the seeds of the new ones."""
    _check_problem(new, old)
    seeds = list(new.runs)
    pairs = [(old.runs[seed], new.runs[seed]) for seed in seeds]
    both = [seed for seed, (a, b) in zip(seeds, pairs, strict=True) if a["solved"] and b["solved"]]
    share = alpha / (len(margins) + 1)
    shared = [(old.runs[seed], new.runs[seed]) for seed in both]
    verdicts = [_judge_solved(pairs, share)]
    verdicts += [_judge_metric(*each, shared, both, share) for each in margins.items()]
    _check_solved(verdicts[0], len(seeds), margins, alpha)
    identical = all(a[metric] == b[metric] for a, b in pairs for metric in a.keys() & b.keys())
    scenario = None if new.scenario is None else Scenario.parse(new.scenario)
    return Verdict(name, len(seeds), alpha, identical, tuple(verdicts), scenario)


def _judge_metric(
    name: str, margin: float, pairs: list[tuple[Any, Any]], seeds: list[int], share: float
) -> MetricVerdict:
    for run in chain(*pairs):
        if name not in run:
            raise unknown("metric", name, run.keys() - {"solved"})
    if not pairs:
        return MetricVerdict(name, margin, math.nan, math.nan, -math.inf, 1.0, True, None)
    old, new = (np.array([pair[side][name] for pair in pairs], np.float64) for side in (0, 1))
    growth = log_ratios(old, new)
    with np.errstate(over="ignore"):
        proven = float(np.expm1(lower_bound(growth, share)))
    p = signed_rank_test(log_ratios(old, new / (1 + margin)))
    return MetricVerdict(
        name, margin, float(np.median(old)), float(np.median(new)),
        proven, p, p > share, seeds[int(np.argmax(growth))],
    )  # fmt: skip


def _judge_solved(pairs: list[tuple[Any, Any]], share: float) -> MetricVerdict:
    old, new = ([bool(pair[side]["solved"]) for pair in pairs] for side in (0, 1))
    lost = sum(a and not b for a, b in zip(old, new, strict=True))
    p = sign_test(lost, sum(b and not a for a, b in zip(old, new, strict=True)))
    return MetricVerdict("solved", None, sum(old), sum(new), -math.inf, p, p > share, None)


def _metrics_of(
    source: Source | SeedMetrics | Path | str, name: str, seeds: list[int]
) -> SeedMetrics:
    if isinstance(source, Path | str):
        name, source = str(source), SeedMetrics.load(Path(source))
    if not isinstance(source, SeedMetrics):
        return SeedMetrics.of(source, seeds)
    for seed in seeds:
        if seed not in source.runs:
            raise BrrtError(f"{name}: no metrics of seed {seed}; run all seeds again")
    return source.of_seeds(seeds)


def check_question(seeds: list[int], alpha: float, margins: Mapping[str, Any]) -> None:
    """Check that a gate can be decided, before anything is run.

    Raises:
        BrrtError: The seeds are too few or repeated, or a number is out of range.
    """
    if not 0 < alpha < 1:
        raise BrrtError(f"alpha must be a probability between 0 and 1, not {alpha!r}")
    for name, margin in margins.items():
        if not isinstance(margin, int | float | np.number) or not 0 <= margin < math.inf:
            raise BrrtError(f"margin of {name} must be from 0 on (0.02: 2 %), not {margin!r}")
    if len(set(seeds)) < len(seeds):
        raise BrrtError("seeds must be different from each other")
    least = _fewest_pairs(margins, alpha)
    if len(seeds) < least:
        raise BrrtError(
            f"{len(seeds)} seeds are too few to prove anything at alpha={alpha:g} with "
            f"{len(margins)} metrics; give at least {least}, better {SEEDS}"
        )


def _fewest_pairs(margins: Mapping[str, Any], alpha: float) -> int:
    """Return the number of pairs below which the gate passes even if each of them is worse."""
    return math.ceil(math.log2((len(margins) + 1) / alpha))


def _check_solved(
    solved: MetricVerdict, seeds: int, margins: Mapping[str, Any], alpha: float
) -> None:
    """Raise unless enough pairs with two solutions are to be expected if nothing has changed."""
    least = _fewest_pairs(margins, alpha)
    if margins and solved.old**2 < least * seeds:
        raise BrrtError(
            f"the old runs found a path with {solved.old:.0f} of {seeds} seeds: too few pairs to "
            f"prove anything about {', '.join(margins)}; give more seeds or more iterations"
        )


def _check_problem(new: SeedMetrics, old: SeedMetrics) -> None:
    if new.scenario is None or old.scenario is None:
        return
    for key in PROBLEM:
        ours, theirs = new.scenario.get(key), old.scenario.get(key)
        if ours != theirs:
            raise BrrtError(f"the runs solve different problems: {key} {ours!r} against {theirs!r}")


def _row(each: MetricVerdict, seeds: int) -> str:
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
