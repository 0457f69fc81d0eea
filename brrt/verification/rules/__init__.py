"""All rules, one file for each subject. To add one, see `brrt.verification.rule`."""

from brrt.verification.rule import Rule
from brrt.verification.rules import (
    extension,
    lattice,
    log,
    lrta_star,
    moves,
    paths,
    phases,
    rejects,
    rewiring,
    sampling,
    search,
    sequence,
    trees,
)

RULES: tuple[type[Rule], ...] = (
    *log.RULES, *phases.RULES, *sequence.RULES, *sampling.RULES, *trees.RULES, *extension.RULES,
    *rewiring.RULES, *rejects.RULES, *paths.RULES, *moves.RULES, *lattice.RULES, *lrta_star.RULES,
    *search.RULES,
)  # fmt: skip
