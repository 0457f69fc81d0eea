"""What is tested of draws: how often, how uniform, how even, and whether they are related.

Every test is an e-process (`brrt.verification.e_process`): given the draws before, the chances at
which it bets on the next one are exact under the promise.
"""

import math
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from brrt.verification.e_process import Partitions, log_gamma, log_mean

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_CELLS, _SIZES = 256, (2, 4, 8, 16, 32, 64, 128, 256)
"""Cells in which draws are counted, and the sizes of the partitions that are made of them."""

_TAILS, _STATES, _JOINT_CELLS = (0.05, 1e-2, 1e-3, 1e-4), 8, 256
"""Parts of a range at its ends, states for the dependence of draws, and cells of all axes."""

_ODDS = 2.0 ** (np.arange(-24, 25) / 4)
"""Factors by which the odds of an event may differ from those that are promised."""

_EVEN_CELLS = (8, 64, 512), (16, 256, 4096)
"""Cells of one axis, and of several, for tests of evenness."""

_GREATEST_FACTOR, _RELATED, _FRACTIONS = 9, 512, 16
"""Factors in relations, draws in which they are sought, and cells of their fractional parts."""

_FRACTION_SHIFT = np.uint32(32 - 4)
"""Bits of a fractional part that follow those of its cell."""


def cells_of(draws: Floats, size: int) -> Ints:
    """Return the cells that numbers in [0, 1) are in; others are in the first or last one."""
    return np.clip(np.nan_to_num(draws * size), 0, size - 1).astype(np.int64)


class FrequencyTest:
    """Tests how often an event occurs whose chance may differ from draw to draw.

    Args:
        event: What the event is, in words.
    """

    def __init__(self, event: str) -> None:
        self._event, self._logs = event, np.zeros(len(_ODDS))
        self._draws = self._count = self._expected = 0.0

    def add(self, draws: Floats) -> None:
        """See `EProcess.add`; whether the event occurs (1 or 0), and its chance, shape (n, 2)."""
        occurs, chance = draws.T
        self._logs += occurs.sum() * np.log(_ODDS)
        self._logs -= np.log1p(chance[:, None] * (_ODDS - 1)).sum(axis=0)
        self._draws += len(draws)
        self._count += occurs.sum()
        self._expected += chance.sum()

    def log_wealth(self) -> tuple[float, str]:
        """See `EProcess.log_wealth`."""
        words = f"{self._count:,.0f} of {self._draws:,.0f} draws are {self._event}"
        return log_mean(self._logs), f"{words}; expected {self._expected:,.1f}"


class ChanceTest:
    """Tests how often an event occurs, and whether that depends on when it last did.

    Args:
        event: What the event is, in words.
    """

    def __init__(self, event: str) -> None:
        when = ("", " right after the last", " soon after the last", " long after the last")
        self._tests = [FrequencyTest(event + words) for words in when]
        self._age = 1 << 40

    def add(self, draws: Floats) -> None:
        """See `FrequencyTest.add`."""
        row = np.arange(len(draws))
        last = np.maximum.accumulate(np.where(draws[:, 0] > 0, row, -1))
        before = np.append(-1, last[:-1])[: len(row)]
        age = np.where(before >= 0, row - before, self._age + row + 1)
        soon = age * draws[:, 1] < 1
        every = np.ones(len(row), bool)
        for test, chosen in zip(self._tests, (every, age == 1, soon, ~soon), strict=True):
            test.add(draws[chosen])
        if len(row):
            self._age = int(len(row) - 1 - last[-1] if last[-1] >= 0 else self._age + len(row))

    def log_wealth(self) -> tuple[float, str]:
        """See `EProcess.log_wealth`."""
        found = [test.log_wealth() for test in self._tests]
        return log_mean(np.array([log for log, _ in found])), max(found)[1]


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
        cell = cells_of(draws, _CELLS)
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
        cells = cells_of(draws[:, : self._dof], self._side)
        place = cells @ self._side ** np.arange(self._dof)[::-1]
        self._counts += np.bincount(place, minlength=len(self._counts))

    def log_wealth(self) -> tuple[float, str]:
        """See `EProcess.log_wealth`."""
        expected = self._counts.sum() / len(self._counts)
        at = int(np.abs(self._counts - expected).argmax())
        words = f"{self._counts[at]:,.0f} draws are in cell {at} of {len(self._counts)}"
        log = float(self._partitions.log_wealths(self._counts)[0])
        return log, f"{words}; expected {expected:,.1f}"


class EvennessTest:
    """Tests whether draws fall where others have just been as often as chance has it.

    Stratified draws and sequences of low discrepancy avoid such places; others return to them.

    Args:
        name: What is drawn, in words.
        dof: Numbers in a draw; of more than 8 the first 8 are tested.
    """

    def __init__(self, name: str, dof: int = 1) -> None:
        self._dof, sizes = min(dof, 8), _EVEN_CELLS[dof > 1]
        self._sides = sorted({max(2, int(size ** (1 / self._dof) + 1e-9)) for size in sizes})
        self._last: list[Ints] = [np.empty(0, np.int64)] * len(self._sides)
        self._tests = [
            FrequencyTest(f"where {name} of one of the {side**self._dof // 2:,} before was")
            for side in self._sides
        ]

    def add(self, draws: Floats) -> None:
        """See `EProcess.add`; shape (n,) or (n, dof)."""
        rows = draws.reshape(len(draws), -1)[:, : self._dof]
        for i, side in enumerate(self._sides):
            cells = side**self._dof
            new = cells_of(rows, side) @ side ** np.arange(self._dof)
            places, first = np.concatenate([self._last[i], new]), len(self._last[i])
            returns, visited = _returns(places, cells // 2)
            self._tests[i].add(np.stack([returns, visited / cells], axis=1)[first:])
            self._last[i] = places[-(cells // 2) :]

    def log_wealth(self) -> tuple[float, str]:
        """See `EProcess.log_wealth`."""
        found = [test.log_wealth() for test in self._tests]
        return log_mean(np.array([log for log, _ in found])), max(found)[1]


def _returns(places: Ints, memory: int) -> tuple[NDArray[np.bool_], Ints]:
    """Return whether each draw is at the place of one of those just before, and how many places.

    Args:
        places: The cell of each draw, shape (n,).
        memory: Draws before each that are looked at.
    """
    order, row = np.argsort(places, kind="stable"), np.arange(len(places))
    same = places[order[1:]] == places[order[:-1]]
    before = np.full(len(places), -memory - 1)
    before[order[1:][same]] = order[:-1][same]
    returns = row - before <= memory
    # Two draws at one place are one place while both are remembered.
    change = np.zeros(len(places) + 1, np.int64)
    change[row[returns] + 1] = 1
    np.subtract.at(change, np.minimum(before[returns] + memory + 1, len(places)), 1)
    return returns, np.minimum(row, memory) - np.cumsum(change)[:-1]


class RelationTest:
    """Tests whether sums of numbers with whole factors, of this draw and the last, are uniform.

    Numbers of a poor generator lie on few planes (Marsaglia 1968), and so do draws that reuse
    numbers: a combination of them with small factors is always nearly a whole number. Three numbers
    that follow each other are combined, and each with every number of the last draw.

    Args:
        names: Names of the numbers in a draw; of more than 4 the first 4 are combined.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        names = names[:4]
        self._dof = dof = len(names)
        self._names = [*(f"the last {name}" for name in names), *names]
        self._factors = _relations(dof)
        self._counts = np.zeros((len(self._factors), _FRACTIONS), np.int64)
        self._last: Floats = np.empty((0, dof))
        self._n = 0
        table = log_gamma(np.arange(_RELATED + 1, dtype=np.float64) + 0.5)
        self._gain = table - table[0] + np.arange(_RELATED + 1) * math.log(_FRACTIONS)

    def add(self, draws: Floats) -> None:
        """See `EProcess.add`; shape (n, dof). Those beyond the first `_RELATED` are ignored."""
        if self._n == _RELATED:
            return
        rows = np.concatenate([self._last, draws[:, : self._dof]])
        self._last = rows[-1:]
        pairs = np.concatenate([rows[:-1], rows[1:]], axis=1)[: _RELATED - self._n]
        self._n += len(pairs)
        # In units of 2^-32 the sums of 32-bit numbers overflow to their fractional parts.
        units = np.clip(np.nan_to_num(pairs) * 2.0**32, 0, 2**32 - 1).astype(np.uint32)
        cells = (units @ self._factors.T.astype(np.uint32)) >> _FRACTION_SHIFT
        places = np.arange(len(self._factors)) * _FRACTIONS + cells
        counts = np.bincount(places.ravel(), minlength=self._counts.size)
        self._counts += counts.reshape(self._counts.shape)

    def log_wealth(self) -> tuple[float, str]:
        """See `EProcess.log_wealth`."""
        half = _FRACTIONS / 2
        logs = self._gain[self._counts].sum(axis=1)
        logs += math.lgamma(half) - math.lgamma(self._n + half)
        terms = zip(self._factors[logs.argmax()], self._names, strict=True)
        words = " ".join(f"{factor:+d} {name}" for factor, name in terms if factor)
        return log_mean(logs), f"the fractional part of {words} is not uniform, in parts of ranges"


@cache
def _relations(dof: int) -> NDArray[np.int32]:
    """Return the factors of all combinations that a `RelationTest` tests, shape (n, 2 dof)."""
    most = _GREATEST_FACTOR
    triples = [range(max(0, last - 2), last + 1) for last in range(dof, 2 * dof)]
    pairs = [(before, now) for before in range(dof) for now in range(dof, 2 * dof)]
    found = set()
    for places in [*triples, *pairs]:
        for factors in product(range(-most, most + 1), repeat=len(places) - 1):
            for last in range(1, most + 1):
                row = [0] * (2 * dof)
                for place, factor in zip(places, (*factors, last), strict=True):
                    row[place] = factor
                if math.gcd(*row) == 1 and sum(map(bool, row)) > 1:
                    found.add(tuple(row))
    return np.array(sorted(found), np.int32)
