"""Signs that rules go by: what figures say of a run as a whole."""

from brrt.explanation.clearance import at_most
from brrt.explanation.facts import Facts

_GROWING = 0.05
"""Of what was reached, the part that must have come in the last third of a run that grows."""

_FRESH = 0.2
"""Of the cells that were reached, the part with a single node in a tree that is young."""

_SCARCE = 0.1
"""Of the extensions, the part that is hardly any."""


def limited(f: Facts) -> bool:
    """Whether the budget ended the run."""
    return f.figures["status"] in ("iteration limit", "time limit")


def is_young(f: Facts) -> bool:
    """Whether the tree had reached little, and much of that by a single node."""
    c = f.coverage
    return c is not None and not f.cells and c.share < 0.5 and c.single >= _FRESH


def scarce(f: Facts) -> bool:
    """Whether hardly an extension was accepted, in little of the free space."""
    return is_young(f) and f.acceptance is not None and f.acceptance < _SCARCE


def stuck(f: Facts) -> bool:
    """Whether a passage parts start and goal, nodes came near, and none is behind it."""
    return f.narrow is not None and f.narrow.parts and f.narrow.near > 0 and not f.narrow.behind


def grows(f: Facts) -> bool:
    """Whether the run still reached new space in its last third."""
    return f.coverage is not None and f.coverage.late >= _GROWING


def step_of(f: Facts) -> float | None:
    """Return the longest edge that the planner makes; None where it makes none."""
    return f.contract.step


def fitting_step(f: Facts) -> float:
    """Return the step that suits the narrowest place: shorter ones only take longer."""
    assert f.narrow is not None  # noqa: S101 - the caller's
    return max(f.narrow.low, f.narrow.high / 4)


def width_of(f: Facts) -> str:
    """Write how wide the narrowest place is, where one is known: as measured, or as proven."""
    assert f.narrow is not None  # noqa: S101 - the caller's
    low, high, proven = max(f.narrow.low, 0), f.narrow.high, f.way.widest
    if proven is not None and low <= proven < high:
        return f"{low:.3g} to {at_most(proven)}"
    return f"{low:.3g} to {high:.3g}"
