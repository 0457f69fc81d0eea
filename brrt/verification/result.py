"""How rules say what they found."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Table

_SHOWN = 20


@dataclass(frozen=True, slots=True)
class Finding:
    """A promise that an event breaks.

    Attributes:
        rule: Name of the rule.
        seq: The event's number; -1 where the whole log is meant.
        t: Its time in ns.
        message: What is wrong with it.
    """

    rule: str
    seq: int
    t: int
    message: str


@dataclass(slots=True)
class RuleResult:
    """What a rule looked at; of many findings the first are kept, all are counted.

    Attributes:
        rule: Name of the rule.
        promise: What it holds a run to.
        examined: Things looked at.
        broken: Things that break the promise.
        findings: The first of those.
    """

    rule: str
    promise: str
    examined: int = 0
    broken: int = 0
    findings: list[Finding] = field(default_factory=list)

    def look(self, table: Table, wrong: NDArray[np.bool_], say: Callable[[int], str]) -> None:
        """Take in rows of a table.

        Args:
            table: Events, shape (n,).
            wrong: Which of them break the promise, shape (n,).
            say: What is wrong with the row of that number.
        """
        self.examined += len(table)
        at = np.flatnonzero(wrong)
        self.broken += len(at)
        for i in at[: _SHOWN - len(self.findings)].tolist():
            row = table[i]
            self.findings.append(Finding(self.rule, int(row["seq"]), int(row["t"]), say(i)))

    def one(self, event: Any, message: str | None) -> None:
        """Take in one event, or None for the log as a whole; no message where all is well."""
        self.examined += 1
        if message is not None:
            self.fault(event, message)

    def fault(self, event: Any, message: str) -> None:
        """Find fault with an event, or with the log as a whole, that was looked at before."""
        self.broken += 1
        if len(self.findings) < _SHOWN:
            seq, t = (-1, 0) if event is None else (int(event["seq"]), int(event["t"]))
            self.findings.append(Finding(self.rule, seq, t, message))
