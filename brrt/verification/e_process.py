"""Tests by betting: how far draws are from what is promised of them, whenever one stops to look.

A gambler stakes 1 at the odds that the promise makes fair, and may never bet more than he has. If
the promise is kept, the chance that he ever owns m is at most 1 / m (Ville 1939; Shafer 2021,
"Testing by betting"). So the chance of a false alarm is stated, and exact in this sense, however
the run came to its end: a planner stops at the draw that solves its problem, and an ordinary test
of all draws up to that one would be biased by it. It may also be looked at as often as one likes.

Nobody knows how a promise will be broken. So he bets like one who expects shares as they were so
far, each cell counted half a draw more (Krichevsky and Trofimov 1981), on several ways of parting
what can be drawn into cells, and divides his stake among them.
"""

import math
from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ALARM = 1e-6
"""Chance that the draws of a sound recording are found unsound, over all tests of a recording."""

_FIRST, _GROWTH = 32, 1.25
"""The first look is at so many draws; then each time that they have grown by a quarter."""

_CELLS, _SIZES = 256, (2, 4, 8, 16, 32, 64, 128, 256)
"""Cells that are counted, and those that are bet on: these, or as many together."""

_ENDS, _STATES, _JOINT = (0.05, 1e-2, 1e-3, 1e-4), 8, 256
"""Parts of a range at its ends, what a draw is remembered by, and cells of all axes together."""

_HALF_LOG_TAU = 0.5 * math.log(2 * math.pi)


class Bet(Protocol):
    """A gambler: what he has seen, and what he owns."""

    def add(self, draws: Floats) -> None:
        """Take in draws."""

    def judge(self) -> tuple[float, str]:
        """Return the logarithm of what he owns, and what he owns it to, in words."""


def log_gamma(x: Floats) -> Floats:
    """Logarithm of the gamma function, x above 0: Stirling's series from x + 8 on."""
    y, lower = x + 8, np.ones_like(x)
    for k in range(8):
        lower = lower * (x + k)
    series = 1 / (12 * y) - 1 / (360 * y**3) + 1 / (1260 * y**5)
    return np.asarray((y - 0.5) * np.log(y) - y + _HALF_LOG_TAU + series - np.log(lower))


class Cells:
    """Ways of parting what can be drawn into cells, each with a gambler of its own.

    Args:
        chances: Of each way, what is promised of its cells, all above 0; each adds up to 1.
    """

    def __init__(self, chances: list[Floats]) -> None:
        sizes = np.array([len(some) for some in chances])
        self._first = np.cumsum(sizes) - sizes
        self._logs, self._half = np.log(np.concatenate(chances)), sizes / 2
        self._begun = log_gamma(self._half) - sizes * log_gamma(np.array(0.5))

    def wealth(self, counts: Floats) -> Floats:
        """Logarithm of what each gambler's stake of 1 becomes, shape (ways,).

        Args:
            counts: Draws in the cells of all ways, one after the other, shape (cells,).
        """
        n = np.add.reduceat(counts, self._first)
        seen = np.add.reduceat(log_gamma(counts + 0.5) - counts * self._logs, self._first)
        return np.asarray(self._begun + seen - log_gamma(n + self._half))


def together(logs: Floats) -> float:
    """Logarithm of what a stake becomes that was divided evenly, from those of its parts."""
    most = float(logs.max())
    return most + math.log(float(np.exp(logs - most).mean()))


class Tosses:
    """Tosses of a coin: 1 where it fell, else 0.

    Args:
        chance: Of its falling, above 0 and below 1.
        what: What a toss that fell is, in words.
    """

    def __init__(self, chance: float, what: str) -> None:
        self._chance, self._what, self._counts = chance, what, np.zeros(2)
        self._ways = Cells([np.array([1 - chance, chance])])

    def add(self, draws: Floats) -> None:
        """See `Bet.add`."""
        self._counts += np.bincount(draws.astype(np.int64), minlength=2)

    def judge(self) -> tuple[float, str]:
        """See `Bet.judge`."""
        n, fell = self._counts.sum(), self._counts[1]
        due = n * self._chance
        words = f"{fell:,.0f} of {n:,.0f} draws are {self._what}; {due:,.1f} are due"
        return float(self._ways.wealth(self._counts)[0]), words


class Evenness:
    """Numbers that are even in [0, 1): in equal cells, at both ends, and after one another.

    Args:
        name: Of what was drawn, in words.
        low: What 0 stands for, in words of a finding.
        high: What 1 stands for.
    """

    def __init__(self, name: str, low: float = 0.0, high: float = 1.0) -> None:
        self._name, self._low, self._high = name, low, high
        self._cells, self._after = np.zeros(_CELLS), np.zeros((_STATES, _STATES))
        self._ends, self._last = np.zeros((2, len(_ENDS))), -1
        even = [np.full(size, 1 / size) for size in _SIZES]
        ends = [np.array([part, 1 - part]) for part in _ENDS]
        states = np.full(_STATES, 1 / _STATES)
        self._ways = Cells([*even, *ends, *ends, *[states] * _STATES])

    def add(self, draws: Floats) -> None:
        """See `Bet.add`."""
        cell = np.clip(np.nan_to_num(draws * _CELLS), 0, _CELLS - 1).astype(np.int64)
        self._cells += np.bincount(cell, minlength=_CELLS)
        for i, part in enumerate(_ENDS):
            self._ends[:, i] += (draws < part).sum(), (draws >= 1 - part).sum()
        state = cell * _STATES // _CELLS
        before = np.concatenate([[self._last], state[:-1]])[: len(state)]
        pairs = (before * _STATES + state)[before >= 0]
        self._after += np.bincount(pairs, minlength=_STATES**2).reshape(_STATES, _STATES)
        self._last = int(state[-1]) if len(state) else self._last

    def judge(self) -> tuple[float, str]:
        """See `Bet.judge`."""
        n = self._cells.sum()
        even = [self._cells.reshape(size, -1).sum(axis=1) for size in _SIZES]
        ends = np.stack([self._ends, n - self._ends], axis=2)
        logs = self._ways.wealth(np.concatenate([*even, ends.ravel(), self._after.ravel()]))
        # Those that bet on what comes after each state go on with what the one before has won.
        owned = np.append(logs[:-_STATES], logs[-_STATES:].sum())
        best = int(owned.argmax())
        if best < len(_SIZES):
            words = self._cell(even[best])
        elif best < len(owned) - 1:
            high, i = divmod(best - len(_SIZES), len(_ENDS))
            part = _ENDS[i]
            where = (1 - part, 1.0) if high else (0.0, part)
            words = self._say(self._ends[high, i], n * part, *where)
        else:
            words = f"{self._name} of one draw tells of the next one's"
        return together(owned), words

    def _cell(self, counts: Floats) -> str:
        """Tell of the cell that is farthest from its share."""
        size, due = len(counts), counts.sum() / len(counts)
        at = int(np.abs(counts - due).argmax())
        return self._say(counts[at], due, at / size, (at + 1) / size)

    def _say(self, count: float, due: float, low: float, high: float) -> str:
        ends = [self._low + part * (self._high - self._low) for part in (low, high)]
        return (
            f"{count:,.0f} of {self._cells.sum():,.0f} draws have {self._name} "
            f"from {ends[0]:.6g} to {ends[1]:.6g}; {due:,.1f} are due"
        )


class Together:
    """Numbers that are even in [0, 1) for each of several axes, and have nothing to do with others.

    Args:
        dof: Axes, 2 or more; of more than 8 the first 8 are looked at.
    """

    def __init__(self, dof: int) -> None:
        self._dof = min(dof, 8)
        self._side = int(_JOINT ** (1 / self._dof) + 1e-9)
        cells = self._side**self._dof
        self._counts, self._ways = np.zeros(cells), Cells([np.full(cells, 1 / cells)])

    def add(self, draws: Floats) -> None:
        """See `Bet.add`; shape (n, dof)."""
        cells = np.clip(np.nan_to_num(draws * self._side), 0, self._side - 1).astype(np.int64)
        place = np.zeros(len(draws), np.int64)
        for k in range(self._dof):
            place = place * self._side + cells[:, k]
        self._counts += np.bincount(place, minlength=len(self._counts))

    def judge(self) -> tuple[float, str]:
        """See `Bet.judge`."""
        due = self._counts.sum() / len(self._counts)
        at = int(np.abs(self._counts - due).argmax())
        words = f"cell {at} of {len(self._counts)} holds {self._counts[at]:,.0f} draws"
        return float(self._ways.wealth(self._counts)[0]), f"{words}; {due:,.1f} are due"


class Watch:
    """Follows a bet through a log; finds where the gambler became too rich for the promise.

    Args:
        bet: The bet.
        tests: Bets that share the chance of a false alarm.
        alarm: That chance; `ALARM` by default.
    """

    def __init__(self, bet: Bet, tests: int = 1, alarm: float | None = None) -> None:
        self._bet, self._rich = bet, math.log(tests / (ALARM if alarm is None else alarm))
        self._seen, self._next, self.found = 0, _FIRST, False

    def follow(self, draws: Floats) -> Iterator[tuple[int, str]]:
        """Take in draws; yield, once in a log, after which row all is lost, and why."""
        done = 0
        while done < len(draws):
            part = draws[done : done + self._next - self._seen]
            self._bet.add(part)
            self._seen, done = self._seen + len(part), done + len(part)
            if self._seen == self._next:
                self._next = max(self._next + 1, int(self._next * _GROWTH))
                yield from self._look(done - 1)

    def close(self) -> Iterator[tuple[int, str]]:
        """Look once more, at the end of the log; the row is -1."""
        if self._seen:
            yield from self._look(-1)

    def _look(self, row: int) -> Iterator[tuple[int, str]]:
        if self.found:
            return
        wealth, words = self._bet.judge()
        if wealth >= self._rich:
            self.found = True
            chance = f"10^{-wealth / math.log(10):.0f}"
            yield row, f"{words}: by chance, in less than {chance} of all runs"
