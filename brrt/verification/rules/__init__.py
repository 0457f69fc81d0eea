"""All rules, one file for each subject. To add one, see `brrt.verification.rule`."""

from brrt.registry import Registry
from brrt.verification.rule import Rule
from brrt.verification.rules import (
    graph,
    log,
    long_run,
    moves,
    own_motions,
    paths,
    phases,
    rejects,
    sampling,
    sequence,
)
from brrt.verification.rules.growth import extension, rewiring, trees
from brrt.verification.rules.lattice import cells, lookahead, lrta_star, search

_MODULES = (
    log, phases, sequence, sampling, long_run, trees, extension, rewiring, rejects, graph,
    paths, moves, own_motions, cells, lookahead, lrta_star, search,
)  # fmt: skip

RULES: tuple[type[Rule], ...] = tuple(rule for module in _MODULES for rule in module.RULES)

REGISTERED: Registry[type[Rule]] = Registry(
    {rule.name: f"{rule.__module__}:{rule.__qualname__}" for rule in RULES},
    group="brrt.rules",
    base="brrt.verification.rule:Rule",
    label="name",
)
"""The rules by name, with those of plug-ins."""
