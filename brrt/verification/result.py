"""What rules find in a recording."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Table

_MOST = 20
"""Findings of a rule that are kept; all are counted."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A broken promise.

    Attributes:
        rule: Name of the rule.
        seq: Number of the event that breaks it; -1 for the recording as a whole.
        t: Time of the event in ns.
        message: What is wrong.
    """

    rule: str
    seq: int
    t: int
    message: str


@dataclass(slots=True)
class RuleResult:
    """What a rule examined and found.

    Attributes:
        rule: Name of the rule.
        promise: What it judges.
        examined: Events, or other items, that it judged.
        broken: Those of them that break the promise.
        findings: The first of those, in the order in which they were found.
    """

    rule: str
    promise: str
    examined: int = 0
    broken: int = 0
    findings: list[Finding] = field(default_factory=list)

    def add(self, table: Table, wrong: NDArray[np.bool_], message: Callable[[int], str]) -> None:
        """Add judged events.

        Args:
            table: The events, shape (n,).
            wrong: Which of them break the promise, shape (n,).
            message: Returns what is wrong with the event in a row.
        """
        self.examined += len(table)
        rows = np.flatnonzero(wrong)
        self.broken += len(rows)
        for i in rows[: _MOST - len(self.findings)].tolist():
            event = table[i]
            self.findings.append(Finding(self.rule, int(event["seq"]), int(event["t"]), message(i)))

    def add_finding(self, event: Any, message: str) -> None:
        """Add a finding on an event that is counted already, or on the whole recording (None)."""
        self.broken += 1
        if len(self.findings) < _MOST:
            seq, t = (-1, 0) if event is None else (int(event["seq"]), int(event["t"]))
            self.findings.append(Finding(self.rule, seq, t, message))
