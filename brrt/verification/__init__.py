"""What a recording proves: every promise is a rule, and every rule a function over the events.

A rule takes a `Context` and a `RuleResult`: it looks at the context and adds what it saw to the
result. One that yields is sent the events in windows, as they are read, and then None; one that
does not looks at what was kept of them. Its name and the first line of its docstring are what
people read. To add one, write it and put it into `RULES` at the end of its file.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from inspect import isgeneratorfunction
from itertools import chain, pairwise
from typing import Any

import numpy as np

from brrt.events import Events
from brrt.scenario.contract import Contract
from brrt.scenario.manifest import Manifest
from brrt.verification.context import Context, Windows
from brrt.verification.result import Finding, RuleResult
from brrt.verification.rules import (
    contracts,
    extension,
    lattice,
    log,
    lrta_star,
    moves,
    paths,
    rejects,
    rewiring,
    sampling,
    search,
    sequence,
    trees,
)
from brrt.worlds.world import World

Rule = Callable[[Context, RuleResult], Windows | None]

RULES: tuple[Rule, ...] = (
    *log.RULES, *contracts.RULES, *sequence.RULES, *sampling.RULES, *trees.RULES,
    *extension.RULES, *rewiring.RULES, *rejects.RULES, *paths.RULES, *moves.RULES, *lattice.RULES,
    *lrta_star.RULES, *search.RULES,
)  # fmt: skip


_WINDOW = 100_000
"""Events that rules look at together, at least, while a log is read."""


def examine(
    manifest: Manifest,
    world: World,
    events: Events | Iterable[Events],
    contract: Contract | None = None,
    *,
    cut: bool | Callable[[], bool] = False,
    figures: Mapping[str, Any] | None = None,
) -> list[RuleResult]:
    """Hold a run to all rules; return for each what it looked at and what it found.

    Rules that look at what this run does not have come back with nothing examined.

    Args:
        manifest: The run's.
        world: The run's.
        events: The whole log, at once or in batches, in order.
        contract: What the planner promises; by default what the recording states, or else the
            registered planner of that name; without either only what all planners promise.
        cut: Whether the log breaks off, or what says so once it was read; what is promised of the
            end is then left out.
        figures: Those that stand at the recording's end, under the names of `Metrics`.

    Raises:
        BrrtError: The manifest's query is of no use in its world.
    """
    context = Context.of(
        manifest, world, contract, cut if callable(cut) else lambda: bool(cut), figures
    )
    firsts = [first for first, _ in context.stretches[1:]]
    results, looking = [], []
    # A doctored log may hold anything, so arithmetic on it may overflow; that is no news.
    with np.errstate(all="ignore"):
        for rule in RULES:
            promise = (rule.__doc__ or "").partition("\n")[0]
            results.append(RuleResult(rule.__name__.replace("_", " "), promise))
            looking.append(rule(context, results[-1]) if isgeneratorfunction(rule) else None)
        for window in chain([None], _windows(events, firsts)):
            if window is not None:
                context.kept.take(window)
            for look in looking:
                if look is not None:
                    look.send(window)
        for rule, look, result in zip(RULES, looking, results, strict=True):
            if look is None:
                rule(context, result)
            else:
                next(look, None)
    return results


def _windows(events: Events | Iterable[Events], firsts: list[int]) -> Iterator[Events]:
    """Yield batches that are large enough to be worth the while, and none without an event.

    Args:
        events: The log.
        firsts: Events that begin a window in any case, in order.
    """
    some: list[Events] = []
    for batch in [events] if isinstance(events, Events) else events:
        some.append(batch)
        if sum(map(len, some)) >= _WINDOW:
            yield from _parts(Events.concat(batch.dof, some), firsts)
            some = []
    if sum(map(len, some)):
        yield from _parts(Events.concat(some[0].dof, some) if len(some) > 1 else some[0], firsts)


def _parts(window: Events, firsts: list[int]) -> Iterator[Events]:
    """Part a window ahead of events of these numbers."""
    for low, high in pairwise([-np.inf, *firsts, np.inf]) if firsts else [(-np.inf, np.inf)]:
        tables = {
            kind: table if not firsts else table[(low <= table["seq"]) & (table["seq"] < high)]
            for kind, table in window.tables.items()
        }
        part = Events(window.dof, {kind: table for kind, table in tables.items() if len(table)})
        if len(part):
            yield part


def check(
    manifest: Manifest,
    world: World,
    events: Events | Iterable[Events],
    contract: Contract | None = None,
    *,
    figures: Mapping[str, Any] | None = None,
) -> list[Finding]:
    """Return the promises that a run breaks, in the order of its events; of each rule the first.

    See `examine` for the arguments.

    Raises:
        BrrtError: The manifest's query is of no use in its world.
    """
    results = examine(manifest, world, events, contract, figures=figures)
    found = [f for result in results for f in result.findings]
    return sorted(found, key=lambda finding: finding.seq)


__all__ = ["RULES", "Context", "Finding", "Rule", "RuleResult", "check", "examine"]
