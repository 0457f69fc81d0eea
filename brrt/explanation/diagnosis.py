"""What the facts say of a run as a whole; rules and texts go by it."""

from brrt.explanation.clearance import at_most
from brrt.explanation.facts import Facts

_GROWING = 0.05
"""Share of the reached cells that a growing run reaches in its last third."""

_SINGLE = 0.2
"""Share of the reached cells that hold a single node while a tree still spreads."""

_SCARCE = 0.1
"""Share of accepted extensions below which they are scarce."""


def ended_by_budget(f: Facts) -> bool:
    """Whether the budget ended the run."""
    return f.figures["status"] in ("iteration limit", "time limit")


def is_spreading(f: Facts) -> bool:
    """Whether the trees reached little of the free space, and much of that with a single node."""
    c = f.coverage
    return c is not None and not f.cells and c.share < 0.5 and c.single >= _SINGLE


def is_scarce(f: Facts) -> bool:
    """Whether few extensions were accepted, in little of the free space."""
    return is_spreading(f) and f.acceptance is not None and f.acceptance < _SCARCE


def is_stuck(f: Facts) -> bool:
    """Whether nodes are near a passage that separates start and goal, and none is beyond it."""
    return f.narrow is not None and f.narrow.parts and f.narrow.near > 0 and not f.narrow.behind


def is_growing(f: Facts) -> bool:
    """Whether the run reached new space in its last third."""
    return f.coverage is not None and f.coverage.late >= _GROWING


def fitting_step(f: Facts) -> float:
    """Return a step that suits the narrowest place; shorter ones only take longer."""
    assert f.narrow is not None  # noqa: S101 - the caller's
    return max(f.narrow.low, f.narrow.high / 4)


def width_of(f: Facts) -> str:
    """Write the width of the narrowest place: two bounds, measured or proven."""
    assert f.narrow is not None  # noqa: S101 - the caller's
    low, high, proven = max(f.narrow.low, 0), f.narrow.high, f.clearance.widest
    if proven is not None and low <= proven < high:
        return f"{low:.3g} to {at_most(proven)}"
    return f"{low:.3g} to {high:.3g}"
