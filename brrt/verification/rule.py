"""What a rule is: a promise, and the code that judges a recording by it."""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.scenario.contract import Contract, Growth, Lattice
from brrt.verification.context import Context
from brrt.verification.result import RuleResult
from brrt.verification.tree_history import TreeHistory

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ANY_PART = "any part"
"""What rules need that judge by a contract as a whole."""


class Rule:
    """A rule, made anew for each recording: `window` is called for its events, then `finish`.

    Attributes:
        name: The rule's name.
        promise: What it judges, in a sentence.
        needs: The part of a contract that it judges by, a field of `Contract` or `ANY_PART`; it
            skips recordings whose contract promises nothing of the kind. Empty if all planners
            promise it.
        assumes: What must be so for it to judge: names of claims whose default it takes for
            granted, and of other parts of `Context.unknown`.
        kind: Without events of this kind there is nothing to judge; None if that depends.
        of_end: Whether it judges the end of a run, which cut recordings lack.
        context: The recording.
        result: What the rule has found so far.
        left_out: What it could not judge, as `Verification.not_judged` states it; None for nothing.
        failed: Whether it raised an error, as only rules of plug-ins may.
    """

    name: ClassVar[str]
    promise: ClassVar[str]
    needs: ClassVar[str] = ""
    assumes: ClassVar[tuple[str, ...]] = ()
    kind: ClassVar[Kind | None] = None
    of_end: ClassVar[bool] = False

    def __init__(self, context: Context) -> None:
        self.context = context
        self.result = RuleResult(self.name, self.promise)
        self.left_out: str | None = None
        self.failed = False

    def window(self, events: Events, contract: Contract) -> None:
        """Judge the next events, all of which were made under one contract."""

    def finish(self) -> None:
        """Judge what the context has kept of all events."""

    def judge(self, table: Table, wrong: Flags, message: Callable[[int], str]) -> None:
        """Judge events; see `RuleResult.add`."""
        self.result.add(table, wrong, message)

    def judge_one(self, event: Any, message: str | None) -> None:
        """Judge an event, or the whole recording (None); without a message it is right."""
        self.result.examined += 1
        if message is not None:
            self.result.add_finding(event, message)

    def judge_free(
        self, table: Table, a: Floats, b: Floats, motion: str, field: str | None = None
    ) -> None:
        """Judge whether motions are free of obstacles.

        Args:
            table: Their events, shape (n,).
            a: Where they begin, shape (n, dof).
            b: Where they end, shape (n, dof).
            motion: What a message calls a motion.
            field: Field of the event that the message appends to that; None for no field.
        """
        hit = self.context.first_hits(a, b)

        def message(i: int) -> str:
            which = motion if field is None else f"{motion} {table[field][i]}"
            return f"{which} hits {self.context.hit_text(a[i], b[i], int(hit[i]))}"

        self.judge(table, hit >= 0, message)


class TreeRule(Rule):
    """A rule that judges one tree after another."""

    kind: ClassVar[Kind | None] = Kind.EDGE

    def finish(self) -> None:
        """Judge all trees."""
        for tree in self.context.trees:
            self.judge_tree(tree)

    def judge_tree(self, tree: TreeHistory) -> None:
        """Judge a tree."""
        raise NotImplementedError


class IterationRule(Rule):
    """A rule that judges the iterations of planners that grow trees, as soon as they end."""

    needs = "growth"
    assumes: ClassVar[tuple[str, ...]] = ("samples", "times")
    kind: ClassVar[Kind | None] = Kind.SAMPLE

    def window(self, events: Events, contract: Contract) -> None:  # noqa: ARG002
        """Judge the iterations that end in a window."""
        self._judge(contract, last=False)

    def finish(self) -> None:
        """Judge the last iteration."""
        self._judge(self.context.contract, last=True)

    def _judge(self, contract: Contract, *, last: bool) -> None:
        if contract.growth is not None and len(self.context.iterations):
            self.judge_rows(self.context.iterations, contract, contract.growth, last=last)

    def judge_rows(self, rows: Table, contract: Contract, growth: Growth, *, last: bool) -> None:
        """Judge whole iterations.

        Args:
            rows: Their events; see `brrt.verification.timeline`.
            contract: The contract that they were made under.
            growth: How trees grow by that contract.
            last: Whether the log ends with them.
        """
        raise NotImplementedError


class LatticeRule(Rule):
    """A rule that judges a search on a lattice once all events have been read."""

    needs = "lattice"
    assumes = ("motions", "costs", "times", "collisions", "bounds")
    kind = Kind.EXPAND

    def finish(self) -> None:
        """Judge the search."""
        lattice, table = self.context.contract.lattice, self.context.events[Kind.EXPAND]
        if lattice is not None and len(table):
            self.judge_search(lattice, table)

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        """Judge the search on a lattice; the table has its expansions, at least one."""
        raise NotImplementedError
