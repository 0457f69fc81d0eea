"""Tests by e-processes: how unlikely draws are under a promise, whenever one stops to test.

An e-process is the wealth of a bettor who begins with 1 and bets on the draws at odds that are
fair under the promise, never more than he owns. If the promise holds, the probability that the
wealth ever reaches m is at most 1 / m (Ville 1939; Shafer 2021, "Testing by betting"). So the rate
of false alarms is exact however a run ends: a planner stops at the draw that solves its problem,
which would bias an ordinary test of all draws. The test may be repeated after any draw.

How a promise is broken is not known beforehand. So the bettor expects frequencies as they were so
far, with half a draw more in each cell (Krichevsky and Trofimov 1981), on several partitions of
what can be drawn, and divides the stake among them: see `brrt.verification.draw_tests`.
"""

import math
from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FALSE_ALARM = 1e-6
"""Probability that any test of a recording rejects draws that are as promised."""

_FIRST, _GROWTH = 32, 1.25
"""The first test is after so many draws; the next ones whenever these have grown by a quarter."""

_HALF_LOG_TAU = 0.5 * math.log(2 * math.pi)


class EProcess(Protocol):
    """A test that accumulates draws."""

    def add(self, draws: Floats) -> None:
        """Take draws."""

    def log_wealth(self) -> tuple[float, str]:
        """Return the logarithm of the wealth, and what about the draws is most unlikely."""


def log_gamma(x: Floats) -> Floats:
    """Return the logarithm of the gamma function, x above 0: Stirling's series from x + 8 on."""
    y, lower = x + 8, np.ones_like(x)
    for k in range(8):
        lower = lower * (x + k)
    series = 1 / (12 * y) - 1 / (360 * y**3) + 1 / (1260 * y**5)
    return np.asarray((y - 0.5) * np.log(y) - y + _HALF_LOG_TAU + series - np.log(lower))


class Partitions:
    """Partitions of what can be drawn into cells, each with a stake of its own.

    Args:
        probabilities: Those of the cells of each partition, all above 0; each adds up to 1.
    """

    def __init__(self, probabilities: list[Floats]) -> None:
        sizes = np.array([len(cells) for cells in probabilities])
        self._first = np.cumsum(sizes) - sizes
        self._logs, self._half = np.log(np.concatenate(probabilities)), sizes / 2
        self._start = log_gamma(self._half) - sizes * log_gamma(np.array(0.5))

    def log_wealths(self, counts: Floats) -> Floats:
        """Return the logarithm of what each partition's stake of 1 has become, shape (p,).

        Args:
            counts: Draws in the cells of all partitions, one after the other, shape (cells,).
        """
        n = np.add.reduceat(counts, self._first)
        terms = np.add.reduceat(log_gamma(counts + 0.5) - counts * self._logs, self._first)
        return np.asarray(self._start + terms - log_gamma(n + self._half))


def log_mean(logs: Floats) -> float:
    """Return the logarithm of the mean of numbers that are given as logarithms."""
    most = float(logs.max())
    return most + math.log(float(np.exp(logs - most).mean()))


class Monitor:
    """Applies a test along a log, and finds where it rejects the promise.

    Args:
        test: The test.
        tests: Tests that share the probability of a false alarm.
        false_alarm: That probability; `FALSE_ALARM` by default.
    """

    def __init__(self, test: EProcess, tests: int = 1, false_alarm: float | None = None) -> None:
        limit = FALSE_ALARM if false_alarm is None else false_alarm
        self._test, self._threshold = test, math.log(tests / limit)
        self._seen, self._next, self.rejected = 0, _FIRST, False

    def follow(self, draws: Floats) -> Iterator[tuple[int, str]]:
        """Take draws; yield, once in a log, the row at which the test rejects, and why."""
        done = 0
        while done < len(draws):
            part = draws[done : done + self._next - self._seen]
            self._test.add(part)
            self._seen, done = self._seen + len(part), done + len(part)
            if self._seen == self._next:
                self._next = max(self._next + 1, int(self._next * _GROWTH))
                for message in self._judge():
                    yield done - 1, message

    def close(self) -> Iterator[str]:
        """Test once more at the end of the log; yield why the test rejects, if it does."""
        if self._seen:
            yield from self._judge()

    def _judge(self) -> Iterator[str]:
        if self.rejected:
            return
        wealth, words = self._test.log_wealth()
        if wealth >= self._threshold:
            self.rejected = True
            yield f"{words}: chance below 10^{-wealth / math.log(10):.0f}"
