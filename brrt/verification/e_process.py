"""Tests by e-processes: how unlikely draws are under a promise, whenever one stops to test.

An e-process is the wealth of a bettor who begins with 1 and bets on the draws at odds that are
fair under the promise, never more than he owns. If the promise holds, the probability that the
wealth ever reaches m is at most 1 / m (Ville 1939; Shafer 2021, "Testing by betting"). So the rate
of false alarms is exact however a run ends: a planner stops at the draw that solves its problem,
which would bias an ordinary test of all draws. The test may be repeated after any draw.

How a promise is broken is not known beforehand. So the bettor expects frequencies as they were so
far, with half a draw more in each cell (Krichevsky and Trofimov 1981), on several partitions of
what can be drawn, and divides the stake among them.
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

_CELLS, _SIZES = 256, (2, 4, 8, 16, 32, 64, 128, 256)
"""Cells in which draws are counted, and the sizes of the partitions that are made of them."""

_TAILS, _STATES, _JOINT_CELLS = (0.05, 1e-2, 1e-3, 1e-4), 8, 256
"""Parts of a range at its ends, states for the dependence of draws, and cells of all axes."""

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


class BernoulliTest:
    """Tests how often an event occurs: draws are 1 where it does, else 0.

    Args:
        probability: That of the event, above 0 and below 1.
        event: What it is, in words.
    """

    def __init__(self, probability: float, event: str) -> None:
        self._probability, self._event, self._counts = probability, event, np.zeros(2)
        self._partitions = Partitions([np.array([1 - probability, probability])])

    def add(self, draws: Floats) -> None:
        """See `EProcess.add`."""
        self._counts += np.bincount(draws.astype(np.int64), minlength=2)

    def log_wealth(self) -> tuple[float, str]:
        """See `EProcess.log_wealth`."""
        n, count = self._counts.sum(), self._counts[1]
        expected = n * self._probability
        words = f"{count:,.0f} of {n:,.0f} draws are {self._event}; expected {expected:,.1f}"
        return float(self._partitions.log_wealths(self._counts)[0]), words


class UniformityTest:
    """Tests whether numbers are uniform in [0, 1) and independent of the number before.

    Args:
        name: What the numbers are, in words.
        low: What 0 stands for in a message.
        high: What 1 stands for.
    """

    def __init__(self, name: str, low: float = 0.0, high: float = 1.0) -> None:
        self._name, self._low, self._high = name, low, high
        self._cells, self._after = np.zeros(_CELLS), np.zeros((_STATES, _STATES))
        self._tails, self._last = np.zeros((2, len(_TAILS))), -1
        uniform = [np.full(size, 1 / size) for size in _SIZES]
        tails = [np.array([part, 1 - part]) for part in _TAILS]
        states = np.full(_STATES, 1 / _STATES)
        self._partitions = Partitions([*uniform, *tails, *tails, *[states] * _STATES])

    def add(self, draws: Floats) -> None:
        """See `EProcess.add`."""
        cell = np.clip(np.nan_to_num(draws * _CELLS), 0, _CELLS - 1).astype(np.int64)
        self._cells += np.bincount(cell, minlength=_CELLS)
        for i, part in enumerate(_TAILS):
            self._tails[:, i] += (draws < part).sum(), (draws >= 1 - part).sum()
        state = cell * _STATES // _CELLS
        before = np.concatenate([[self._last], state[:-1]])[: len(state)]
        pairs = (before * _STATES + state)[before >= 0]
        self._after += np.bincount(pairs, minlength=_STATES**2).reshape(_STATES, _STATES)
        self._last = int(state[-1]) if len(state) else self._last

    def log_wealth(self) -> tuple[float, str]:
        """See `EProcess.log_wealth`."""
        n = self._cells.sum()
        uniform = [self._cells.reshape(size, -1).sum(axis=1) for size in _SIZES]
        tails = np.stack([self._tails, n - self._tails], axis=2)
        counts = np.concatenate([*uniform, tails.ravel(), self._after.ravel()])
        logs = self._partitions.log_wealths(counts)
        # The bets on the successors of the states share one stake.
        logs = np.append(logs[:-_STATES], logs[-_STATES:].sum())
        best = int(logs.argmax())
        if best < len(_SIZES):
            words = self._worst_cell(uniform[best])
        elif best < len(logs) - 1:
            high, i = divmod(best - len(_SIZES), len(_TAILS))
            part = _TAILS[i]
            low, end = (1 - part, 1.0) if high else (0.0, part)
            words = self._words(self._tails[high, i], n * part, low, end)
        else:
            words = f"{self._name} of a draw depends on that of the draw before"
        return log_mean(logs), words

    def _worst_cell(self, counts: Floats) -> str:
        """Describe the cell whose count is farthest from the expected one."""
        size, expected = len(counts), counts.sum() / len(counts)
        at = int(np.abs(counts - expected).argmax())
        return self._words(counts[at], expected, at / size, (at + 1) / size)

    def _words(self, count: float, expected: float, low: float, high: float) -> str:
        ends = [self._low + part * (self._high - self._low) for part in (low, high)]
        return (
            f"{count:,.0f} of {self._cells.sum():,.0f} draws have {self._name} "
            f"from {ends[0]:.6g} to {ends[1]:.6g}; expected {expected:,.1f}"
        )


class JointUniformityTest:
    """Tests whether numbers are uniform in [0, 1) on several axes at once.

    Args:
        dof: Axes, 2 or more; of more than 8 the first 8 are tested.
    """

    def __init__(self, dof: int) -> None:
        self._dof = min(dof, 8)
        self._side = int(_JOINT_CELLS ** (1 / self._dof) + 1e-9)
        cells = self._side**self._dof
        self._counts, self._partitions = np.zeros(cells), Partitions([np.full(cells, 1 / cells)])

    def add(self, draws: Floats) -> None:
        """See `EProcess.add`; shape (n, dof)."""
        cells = np.clip(np.nan_to_num(draws * self._side), 0, self._side - 1).astype(np.int64)
        place = np.zeros(len(draws), np.int64)
        for k in range(self._dof):
            place = place * self._side + cells[:, k]
        self._counts += np.bincount(place, minlength=len(self._counts))

    def log_wealth(self) -> tuple[float, str]:
        """See `EProcess.log_wealth`."""
        expected = self._counts.sum() / len(self._counts)
        at = int(np.abs(self._counts - expected).argmax())
        words = f"{self._counts[at]:,.0f} draws are in cell {at} of {len(self._counts)}"
        log = float(self._partitions.log_wealths(self._counts)[0])
        return log, f"{words}; expected {expected:,.1f}"


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
