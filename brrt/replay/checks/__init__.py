"""What a recording proves: every promise is a rule, and every rule a function over the events.

A rule takes a `Case` and a `Tally`: it looks at the case and tells the tally what it saw. Its name
and the first line of its docstring are what people read. To add one, write it and put it into
`RULES` at the end of its file.
"""

from collections.abc import Callable

import numpy as np

from brrt.events import Events
from brrt.planners.contract import Contract
from brrt.replay.checks import lattice, log, moves, paths, rejects, trees
from brrt.replay.checks.case import Case, Finding, Tally
from brrt.scenario import Manifest
from brrt.worlds.world import World

Rule = Callable[[Case, Tally], None]

RULES: tuple[Rule, ...] = (
    *log.RULES, *trees.RULES, *rejects.RULES, *paths.RULES, *moves.RULES, *lattice.RULES,
)  # fmt: skip


def examine(
    manifest: Manifest,
    world: World,
    events: Events,
    contract: Contract | None = None,
    *,
    cut: bool = False,
) -> list[Tally]:
    """Hold a run to all rules; return for each what it looked at and what it found.

    Rules that look at what this run does not have come back with nothing examined.

    Args:
        manifest: The run's.
        world: The run's.
        events: The whole log.
        contract: What the planner promises; by default what the registered one of that name does,
            and of one that is not known here only what all planners do.
        cut: Whether the log breaks off; what is promised of the end is then left out.

    Raises:
        BrrtError: The manifest's query is of no use in its world.
    """
    case = Case.of(manifest, world, events, contract, cut=cut)
    tallies = []
    # A doctored log may hold anything, so arithmetic on it may overflow; that is no news.
    with np.errstate(all="ignore"):
        for rule in RULES:
            promise = (rule.__doc__ or "").partition("\n")[0]
            tally = Tally(rule.__name__.replace("_", " "), promise)
            rule(case, tally)
            tallies.append(tally)
    return tallies


def check(
    manifest: Manifest, world: World, events: Events, contract: Contract | None = None
) -> list[Finding]:
    """Return the promises that a run breaks, in the order of its events; of each rule the first.

    See `examine` for the arguments.

    Raises:
        BrrtError: The manifest's query is of no use in its world.
    """
    found = [f for tally in examine(manifest, world, events, contract) for f in tally.findings]
    return sorted(found, key=lambda finding: finding.seq)


__all__ = ["RULES", "Case", "Finding", "Rule", "Tally", "check", "examine"]
