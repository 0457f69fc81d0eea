"""Exact tests for paired samples: is the second of each pair larger?

Under the null hypothesis, the two of a pair are exchangeable. No distribution is assumed, and pairs
may differ from each other.
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def log_ratios(old: Floats, new: Floats) -> Floats:
    """Return log(new / old), shape (n,); 0 where both are 0 or both infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.log(new) - np.log(old)
    return np.where(old == new, 0.0, found)


def signed_rank_test(differences: Floats) -> float:
    """Return the one-sided p-value of Wilcoxon's signed-rank test (Wilcoxon 1945).

    The null distribution is computed exactly for the given ranks, including ties. Zeros are
    dropped; infinite differences rank above all others.

    Args:
        differences: Second minus first of each pair, shape (n,).
    """
    nonzero = differences[differences != 0]
    doubled = doubled_ranks(np.abs(nonzero))
    chance = rank_sum_distribution(doubled)
    return min(1.0, float(chance[int(doubled[nonzero > 0].sum()) :].sum()))


def doubled_ranks(sizes: Floats) -> NDArray[np.int64]:
    """Return twice the rank of each value, from 2; equal values share the mean of their ranks."""
    _, place, counts = np.unique(sizes, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((2 * last - counts + 1)[place], np.int64)


def rank_sum_distribution(doubled: NDArray[np.int64]) -> Floats:
    """Return the probability of each sum of ranks if each is included with probability 1/2."""
    chance = np.zeros(int(doubled.sum()) + 1)
    chance[0] = 1.0
    for rank in doubled.tolist():
        included = np.zeros_like(chance)
        included[rank:] = chance[: len(chance) - rank]
        chance = 0.5 * (chance + included)
    return chance


def lower_bound(differences: Floats, alpha: float) -> float:
    """Return the lower confidence bound, at level 1 - alpha, of the shift between pairs.

    It inverts `signed_rank_test` for differences without ties: an order statistic of the means of
    all pairs of differences (Hodges and Lehmann 1963). It is -inf if there are too few differences.

    Args:
        differences: Second minus first of each pair, shape (n,).
        alpha: Probability that the bound is above the true shift.
    """
    n = len(differences)
    tail = np.cumsum(rank_sum_distribution(2 * np.arange(1, n + 1))[::-1])[::-1][::2]
    enough = np.flatnonzero(tail <= alpha)
    if not len(enough):
        return -math.inf
    i, j = np.triu_indices(n)
    with np.errstate(invalid="ignore"):
        means = (differences[i] + differences[j]) / 2
    # The mean of +inf and -inf is undefined; -inf is the conservative choice.
    means = np.sort(np.where(np.isnan(means), -math.inf, means))
    return float(means[-int(enough[0])])


def sign_test(worse: int, better: int) -> float:
    """Return the one-sided p-value of McNemar's exact test (McNemar 1947).

    Args:
        worse: Number of pairs in which only the first succeeded.
        better: Number of pairs in which only the second succeeded.
    """
    n = worse + better
    return float(sum(math.comb(n, k) for k in range(worse, n + 1)) / 2**n)
