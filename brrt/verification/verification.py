"""`verify`: judge a recording by rules."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from brrt.errors import BrrtError
from brrt.events import Events, Kind
from brrt.recording import Recording
from brrt.registry import report_broken
from brrt.scenario.contract import Contract
from brrt.verification.context import Context
from brrt.verification.result import Finding, RuleResult
from brrt.verification.rule import ANY_PART, Rule
from brrt.verification.rules import REGISTERED, RULES

_WINDOW = 100_000
"""Events that rules judge together, at least."""

_MADE_BY = {
    "draws": Kind.SAMPLE, "growth": Kind.SAMPLE, "near": Kind.REWIRE, "lattice": Kind.EXPAND,
}  # fmt: skip
"""Parts of a contract, and events of planners that could promise them."""

NO_TREE = "without edges the log proves nothing of a tree"

_GROWS_BY_EDGES = ("growth", "near")
"""Parts of a contract whose rules judge trees that edges and rewires alone change."""

_PRUNED = {Kind.VERTEX: "vertices", Kind.CUT: "cuts", Kind.REMOVE: "removals"}
"""Kinds of events that change trees besides."""

_PARTS = {Kind.SAMPLE: "samples", Kind.EDGE: "edges", Kind.EXPAND: "expanded cells"}
"""Kinds of events without which a planner's work cannot be judged."""


@dataclass(frozen=True, slots=True)
class Verification:
    """What the rules found.

    Attributes:
        results: What each rule found; one without anything to judge has examined nothing.
        not_judged: Names of rules that could not judge, for each reason.
        events: How many events were judged.
        has_contract: Whether there is a contract; without one only what all planners promise is
            judged.
        is_cut: Whether the run's end is missing; then no rule judges it.
        has_tree: Whether there are edges, links or expanded cells; a log without them proves
            nothing of a tree.
    """

    results: list[RuleResult]
    not_judged: Mapping[str, list[str]]
    events: int
    has_contract: bool
    is_cut: bool
    has_tree: bool

    def __str__(self) -> str:
        judged = [result for result in self.results if result.examined]
        broken = [result for result in judged if result.broken]
        lines = [f"{each.rule}: broken {each.broken:,} times: {each.promise}" for each in broken]
        lines += [f"  event {each.seq:,}: {each.message}" for each in self.findings]
        lines += [
            f"not judged, {why}: {', '.join(names)}" for why, names in self.not_judged.items()
        ]
        return "\n".join([*lines, self.summary])

    @property
    def summary(self) -> str:
        """How many rules hold, are broken and could not be judged."""
        judged = sum(result.examined > 0 for result in self.results)
        broken = sum(result.broken > 0 for result in self.results)
        rest = sum(map(len, self.not_judged.values()))
        count = f"{judged - broken} rules hold, {broken} broken, {rest} could not be judged"
        return count if self.has_tree else f"{count}; {NO_TREE}"

    @property
    def holds(self) -> bool:
        """Whether no rule is broken."""
        return not any(result.broken for result in self.results)

    @property
    def findings(self) -> list[Finding]:
        """The findings that each rule kept, in the order of their events."""
        found = [finding for result in self.results for finding in result.findings]
        return sorted(found, key=lambda finding: finding.seq)


def verify(
    recording: Recording,
    *,
    contract: Contract | None = None,
    rules: Sequence[type[Rule]] | None = None,
) -> Verification:
    """Judge a recording by rules.

    Args:
        recording: The recording; if its `result` is None, the run's end is not judged.
        contract: What the planner promises; by default what the recording states, or else the
            registered planner of that name; without either only what all planners promise.
        rules: The rules; by default all of brrt's and those of plug-ins.

    Raises:
        BrrtError: Start or goal is not free in the world, or the recording is damaged.
    """
    context = Context(recording, contract)
    if rules is None:
        rules = (*RULES, *REGISTERED.plugins().values())
    made = [rule for rule in (_made(kind, context) for kind in rules) if rule is not None]
    active = [rule for rule in made if _applies(rule) and _unknown(rule) is None]
    firsts = [first for first, _ in context.stretches[1:]]
    with np.errstate(all="ignore"):  # a log may hold any numbers
        for events in _windows(recording.batches(), firsts):
            contract_now = context.advance(events)
            for rule in active:
                _call(rule, rule.window, events, contract_now)
        context.end()
        for rule in active:
            if _other_changes(rule):
                rule.result = RuleResult(rule.name, rule.promise)
            else:
                _call(rule, rule.finish)
    results = [rule.result for rule in made]
    missing, kept = _not_judged(made), context.kept
    has_tree = not kept.kinds.isdisjoint({Kind.EDGE, Kind.LINK, Kind.EXPAND})
    return Verification(
        results, missing, kept.count, context.has_contract, context.is_cut, has_tree
    )


def _made(kind: type[Rule], context: Context) -> Rule | None:
    """Make a rule for a recording; None if it is a plug-in's that raises."""
    try:
        return kind(context)
    except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
        _check_plugin(kind, error)
        return None


def _call(rule: Rule, judge: Callable[..., None], *given: Any) -> None:
    """Let a rule judge; one of a plug-in that raises is left out, and the others go on."""
    if rule.failed:
        return
    try:
        judge(*given)
    except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
        _check_plugin(type(rule), error)
        rule.failed, rule.result = True, RuleResult(rule.name, rule.promise)
        rule.left_out = "the rule itself fails"


def _check_plugin(kind: type[Rule], error: Exception) -> None:
    """Report an error of a plug-in's rule; raise that of a rule of brrt, or about the recording."""
    if isinstance(error, BrrtError) or kind in RULES:
        raise error
    why = " ".join(f"it raises {error!r:.200}".split())
    report_broken(f"rule {kind.name!r} of {kind.__module__} is left out: {why}")


def _windows(batches: Iterable[Events], firsts: list[int]) -> Iterator[Events]:
    """Yield the events in windows that are large enough to be judged fast, and never empty.

    Args:
        batches: The log.
        firsts: Numbers of events that begin a window in any case, in order.
    """
    waiting: list[Events] = []
    for batch in batches:
        waiting.append(batch)
        if sum(map(len, waiting)) >= _WINDOW:
            yield from _split(Events.concat(batch.dof, waiting), firsts)
            waiting = []
    if sum(map(len, waiting)):
        last = waiting[0] if len(waiting) == 1 else Events.concat(waiting[0].dof, waiting)
        yield from _split(last, firsts)


def _split(window: Events, firsts: list[int]) -> Iterator[Events]:
    """Split a window before events of these numbers."""
    for low, high in pairwise([-np.inf, *firsts, np.inf]):
        tables = window.tables
        if firsts:
            tables = {k: t[(low <= t["seq"]) & (t["seq"] < high)] for k, t in tables.items()}
        part = Events(window.dof, {kind: table for kind, table in tables.items() if len(table)})
        if len(part):
            yield part


def _applies(rule: Rule) -> bool:
    """Whether the planner promises what a rule judges."""
    if rule.needs in ("", ANY_PART):
        return not rule.needs or rule.context.has_contract
    return any(getattr(contract, rule.needs) is not None for _, contract in rule.context.stretches)


def _unknown(rule: Rule) -> str | None:
    """Return why something is not so that a rule takes for granted; None if all is."""
    unknown = rule.context.unknown
    return next((unknown[name] for name in rule.assumes if name in unknown), None)


def _not_judged(rules: list[Rule]) -> dict[str, list[str]]:
    """Return the names of the rules that could not judge, for each reason."""
    found: dict[str, list[str]] = {}
    for rule in rules:
        reason = rule.left_out or (None if rule.result.examined else _reason(rule))
        if reason is not None:
            found.setdefault(reason, []).append(rule.name)
    return found


def _other_changes(rule: Rule) -> list[str]:
    """Return what changes the trees besides edges and rewires, if the rule knows only these."""
    if rule.needs not in _GROWS_BY_EDGES:
        return []
    return [name for kind, name in _PRUNED.items() if kind in rule.context.kept.kinds]


def _reason(rule: Rule) -> str | None:
    """Return why a rule that has examined nothing could not judge; None if that is in order."""
    context = rule.context
    if rule.needs and not context.has_contract:
        planner = context.manifest.scenario.planner
        return f"the recording states no contract and planner {planner} is not registered"
    if rule.of_end and context.is_cut:
        return "the run's end is missing"
    changes = _other_changes(rule)
    if changes and _applies(rule):
        return f"{' and '.join(changes)} change the trees, which the rules do not know"
    part = rule.needs
    if part in _MADE_BY and not context.contract.planner.registered and not _applies(rule):
        # A registered planner promises nothing of the kind; another one may have left it out.
        made = _MADE_BY[part] in context.kept.kinds
        return f"the contract states no {part}" if made else None
    unknown = _unknown(rule)
    if unknown is not None:
        return unknown if _applies(rule) else None
    if rule.kind not in _PARTS or rule.kind in context.kept.kinds or not _applies(rule):
        return None
    searches = context.contract.lattice is not None or Kind.EXPAND in context.kept.kinds
    if searches and rule.kind is not Kind.EXPAND:  # on a lattice, without samples and trees
        return None
    return f"no {_PARTS[rule.kind]}"
