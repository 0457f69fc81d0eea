"""The gate: exact p-values, few false alarms, and files of metrics."""

import json
import math
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import brrt
from brrt.testing import paired_tests
from brrt.testing.gate import Verdict, gate, judge
from brrt.testing.seed_metrics import SeedMetrics

NUMBERS = st.one_of(
    st.floats(-3, 3, allow_subnormal=False), st.sampled_from([-2.0, -1.0, 0.0, 1.0, math.inf])
)
VERSIONS = {"brrt": "0.1.0"}


def naive_ranks(sizes: list[float]) -> list[float]:
    """Return the mean rank of each value, from 1."""
    return [
        sum(a < size for a in sizes) + (1 + sum(a == size for a in sizes)) / 2 for size in sizes
    ]


@given(st.lists(NUMBERS, max_size=9))
def test_signed_rank_counts_all_signs(differences: list[float]) -> None:
    """The p-value is the share of all sign assignments with at least this rank sum."""
    told = [each for each in differences if each]
    places = naive_ranks([abs(each) for each in told])
    seen = sum(rank for rank, each in zip(places, told, strict=True) if each > 0)
    sums = [
        sum(rank for rank, sign in zip(places, signs, strict=True) if sign)
        for signs in product((False, True), repeat=len(told))
    ]
    expected = sum(each >= seen for each in sums) / len(sums)
    p = paired_tests.signed_rank_test(np.array(differences))
    assert p == pytest.approx(expected, abs=1e-12)


@given(st.integers(0, 30), st.integers(0, 30))
def test_sign_test_counts_all_tosses(worse: int, better: int) -> None:
    """P(at least k) and P(fewer than k) add up to 1."""
    assert paired_tests.sign_test(worse, better) == pytest.approx(
        1 - (paired_tests.sign_test(better + 1, worse - 1) if worse else 0)
    )
    assert paired_tests.sign_test(5, 0) == 1 / 32


@given(st.integers(0, 10**6), st.integers(6, 25), st.sampled_from([0.01, 0.05]))
def test_what_is_proven_is_what_the_test_rejects(seed: int, n: int, alpha: float) -> None:
    """The test rejects a shift below the confidence bound and not one above it."""
    differences = np.random.default_rng(seed).normal(0.3, 1, n)
    bound = paired_tests.lower_bound(differences, alpha)
    if not math.isfinite(bound):
        assert 0.5**n > alpha
        return
    assert paired_tests.signed_rank_test(differences - (bound - 1e-9)) <= alpha
    assert paired_tests.signed_rank_test(differences - (bound + 1e-9)) > alpha


def test_log_ratios_at_the_ends() -> None:
    """Zero and infinity are valid; equal values have ratio 1."""
    old, new = np.array([0, 0, 1, 1, np.inf, np.inf]), np.array([0, 1, 0, np.inf, 1, np.inf])
    inf = math.inf
    assert paired_tests.log_ratios(old, new).tolist() == [0, inf, -inf, inf, -inf, 0]


def made(columns: dict[str, Any]) -> SeedMetrics:
    """Make metrics from columns; all runs are solved by default."""
    n = len(next(iter(columns.values())))
    columns = {"solved": [True] * n, **columns}
    runs = {i: {name: values[i] for name, values in columns.items()} for i in range(n)}
    return SeedMetrics(runs, None, VERSIONS)


def drawn(rng: np.random.Generator, n: int, scale: float, shared: Any) -> SeedMetrics:
    """Draw a skewed cost, a correlated heavy-tailed count with ties, and some unsolved runs."""
    noise = rng.normal(size=n)
    return made(
        {
            "solved": (rng.random(n) < 0.95).tolist(),
            "cost": (100 * scale * np.exp(0.1 * noise + shared)).tolist(),
            "count": (scale * np.ceil(np.exp(rng.normal(2, 1, n) + noise))).tolist(),
        }
    )


def judged(new: SeedMetrics, old: SeedMetrics, alpha: float, margin: float) -> Verdict:
    """Judge both metrics of `drawn`."""
    return judge(new, old, alpha=alpha, name="it", margins={"cost": margin, "count": margin})


@pytest.mark.parametrize("paired", [False, True])
def test_false_alarms_are_as_rare_as_stated(*, paired: bool) -> None:
    """Runs that are worse by just the margin fail with the chance alpha, at most.

    `benchmarks/gate.py` does the same with runs of planners, and many more of them.
    """
    rng, runs, n, alpha, margin = np.random.default_rng(5), 500, 15, 0.1, 0.25
    alarms = 0
    for _ in range(runs):
        shared = rng.normal(0, 0.5, n) if paired else 0.0
        old, new = drawn(rng, n, 1.0, shared), drawn(rng, n, 1 + margin, shared)
        alarms += not judged(new, old, alpha, margin).passed
    # Beyond four standard deviations of what is allowed once in 30,000 times, were it so.
    assert alarms <= runs * alpha + 4 * math.sqrt(runs * alpha * (1 - alpha))
    assert alarms > 0


def test_what_is_worse_is_found() -> None:
    """With 20 seeds the gate finds costs 40 % higher, and half of the paths lost."""
    rng = np.random.default_rng(2)
    old = drawn(rng, 20, 1.0, 0.0)
    found = judged(drawn(rng, 20, 1.4, 0.0), old, 0.01, 0.02)
    assert [each.name for each in found.metrics if not each.passed] == ["cost"]
    assert "  cost" in "\n".join(found.lines())
    lost = made({"solved": [i % 2 == 0 for i in range(20)], "cost": [9.0] * 20})
    whole = made({"cost": [1.0] * 20})
    verdict = judge(lost, whole, alpha=0.01, name="it", margins={"cost": 0.5})
    assert not any(each.passed for each in verdict.metrics)
    # A run without a path has no cost: it hides nothing that the others prove.
    some = {"solved": [i % 5 != 0 for i in range(20)]}
    few, worse = (made({**some, "cost": [cost] * 20}) for cost in (1.0, 9.0))
    verdict = judge(worse, few, alpha=0.01, name="it", margins={"cost": 0.5})
    assert [each.passed for each in verdict.metrics] == [True, False]
    assert judge(whole, few, alpha=0.01, name="it", margins={"cost": 0.5}).passed
    verdict = judge(NONE, whole, alpha=0.01, name="it", margins={"cost": 0.5})
    assert [each.passed for each in verdict.metrics] == [False, True]
    assert "no path" in "\n".join(verdict.lines())


def test_the_same_pass_at_once() -> None:
    """Equal metrics pass with any margin, and the verdict is one line."""
    scenario = brrt.Scenario(world="circles2d:n=40,seed=3", smooth=False)
    found = gate(scenario, scenario, seeds=12, cost=0, iterations=0, alpha=0.01)
    assert found.passed
    assert found.identical
    assert found.lines() == ["gate: passed, 12 seeds, all equal to the last bit"]
    assert all(each.p == 1 for each in found.metrics)


def test_lines_fit_the_screen_and_json_is_json() -> None:
    """Numbers may be large, zero or missing."""
    new = made({"solved": [i > 3 for i in range(20)], "cost": [1e300] * 20, "rewires": [0] * 20})
    old = made({"cost": [1e-300] * 20, "rewires": [0] * 20})
    verdict = judge(new, old, alpha=1e-3, name="it", margins={"cost": 9.99, "rewires": 0})
    assert all(len(line) <= 80 for line in verdict.lines())
    assert json.loads(json.dumps(verdict.as_dict(), allow_nan=False))["passed"] is False


def test_figures_are_kept(tmp_path: Path) -> None:
    """A saved file is read back equal and has one line for each seed."""
    figures = SeedMetrics.of(lambda seed: brrt.Run(brrt.Scenario(seed=seed, smooth=False)), [3, 1])
    path = tmp_path / "new" / "figures.json"
    figures.save(path)
    assert SeedMetrics.load(path) == figures
    assert SeedMetrics.load(path).contains(figures.of_seeds([1]))
    assert [line[:6] for line in path.read_text().splitlines() if "iterations" in line] == [
        '  "3":', '  "1":'
    ]  # fmt: skip
    assert figures.runs[3]["cost"] == figures.runs[3]["path_cost"]
    assert not any(name.endswith("_s") for name in figures.runs[3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not a file of metrics"),
        ("[]", "not a file of metrics"),
        ('{"schema": "else", "version": 1}', r"not brrt\.figures of version 1"),
        ('{"schema": "brrt.figures", "version": 1, "runs": {"x": {}}}', "not a file of metrics"),
        (
            '{"schema": "brrt.figures", "version": 1, "runs": {"7": {"cost": NaN}}}',
            "7: cost must be a number from 0 on",
        ),
        ("[" * 100_000, "not a file of metrics"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    """The error is one line that names the file."""
    path = tmp_path / "figures.json"
    path.write_text(text)
    with pytest.raises(brrt.BrrtError, match=message) as error:
        SeedMetrics.load(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


WHOLE, NONE = made({"cost": [1.0] * 20}), made({"solved": [False] * 20})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: gate(brrt.Scenario(), "none.json", cost=0.1), r"none\.json: No such file"),
        (
            lambda: gate(brrt.Scenario(time=1.0), brrt.Scenario(), cost=0.1),
            "a time limit",
        ),
        (lambda: gate(None, brrt.Scenario(), cost=0.1), "give a scenario or a function"),  # type: ignore[arg-type]
        (lambda: gate(lambda seed: seed, brrt.Scenario(), cost=0.1), "seed 0: give a Scenario"),
        (
            lambda: gate(made({"a": [1]}), made({"a": [1]}), a=0.1),
            "the old runs: no metrics of seed 1;",
        ),
        (
            lambda: judge(WHOLE, NONE, alpha=0.01, name="it", margins={"cost": 0.5}),
            "the old runs found a path with 0 of 20 seeds: too few pairs to prove anything",
        ),
        (
            lambda: judge(WHOLE, WHOLE, alpha=0.01, name="it", margins={"cots": 0.5}),
            "unknown metric 'cots'; did you mean 'cost'",
        ),
        (lambda: gate(brrt.Scenario(), brrt.Scenario(), seeds=[1] * 20), "must be different"),
        (lambda: gate(brrt.Scenario(), brrt.Scenario(), cost=-0.1), "margin of cost must be"),
        (lambda: gate(brrt.Scenario(), brrt.Scenario(), alpha=0, cost=0.1), "alpha must be"),
        (
            lambda: gate(brrt.Scenario(), brrt.Scenario(world="maze2d"), seeds=8, cost=0.1),
            "the runs solve different problems: world 'circles2d' against 'maze2d'",
        ),
    ],
)
def test_bad_questions_are_refused(call: Callable[[], Verdict], message: str) -> None:
    """The error is one line."""
    with pytest.raises(brrt.BrrtError, match=message):
        call()
