"""Exact tests for pairs: was the second of each made worse?

Both take pairs under the hypothesis that the two of a pair could as well have been swapped, and
nothing else: no distribution is assumed, and the pairs may differ from each other as they like.
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


def signed_rank(differences: Floats) -> float:
    """Return P(a rank sum as large as this | each sign is a coin's), one-sided.

    Wilcoxon 1945. The distribution is that of these very ranks, ties and all, not a table's; zeros
    say nothing and are left out. Infinite differences rank above all others.

    Args:
        differences: Of each pair; positive where the second was larger. Shape (n,).
    """
    told = differences[differences != 0]
    doubled = doubled_ranks(np.abs(told))
    chance = rank_sums(doubled)
    return min(1.0, float(chance[int(doubled[told > 0].sum()) :].sum()))


def doubled_ranks(sizes: Floats) -> NDArray[np.int64]:
    """Return twice the rank of each, from 2 on; equal ones share the mean of their ranks."""
    _, place, counts = np.unique(sizes, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((2 * last - counts + 1)[place], np.int64)


def rank_sums(doubled: NDArray[np.int64]) -> Floats:
    """Return the chance of each sum of some of these ranks, each of them in it by a coin's toss."""
    chance = np.zeros(int(doubled.sum()) + 1)
    chance[0] = 1.0
    for rank in doubled.tolist():
        with_it = np.zeros_like(chance)
        with_it[rank:] = chance[: len(chance) - rank]
        chance = 0.5 * (chance + with_it)
    return chance


def at_least(differences: Floats, alpha: float) -> float:
    """Return the shift that the differences exceed at the confidence 1 - alpha.

    It is the largest one that `signed_rank`, of the differences less the shift, calls exceeded
    (for differences without ties): an order statistic of the means of all pairs of them.
    """
    n = len(differences)
    tail = np.cumsum(rank_sums(2 * np.arange(1, n + 1))[::-1])[::-1][::2]
    enough = np.flatnonzero(tail <= alpha)
    if not len(enough):
        return -math.inf
    i, j = np.triu_indices(n)
    with np.errstate(invalid="ignore"):
        means = (differences[i] + differences[j]) / 2
    # One that got infinitely better and one infinitely worse say nothing together.
    means = np.sort(np.where(np.isnan(means), -math.inf, means))
    return float(means[-int(enough[0])])


def sign_test(worse: int, better: int) -> float:
    """Return P(as many worse | each of those that changed was a coin's toss); McNemar 1947."""
    n = worse + better
    return float(sum(math.comb(n, k) for k in range(worse, n + 1)) / 2**n)
