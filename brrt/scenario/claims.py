"""How a log was made: what a recorder of a foreign planner knows of it, and what it does not."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, Self

from brrt.errors import BrrtError
from brrt.settings import Settings, param


@dataclass(frozen=True, slots=True)
class Claims(Settings):
    """How a log was made; `brrt verify` leaves out what this excludes, and says so.

    brrt's own planners, and recordings that claim nothing, have the defaults.
    """

    motions: Literal["straight", "own"] = param(
        "straight",
        "straight: motions are those of the robot between two configurations; own: arcs, dynamics "
        "and the like, of which the log has only the ends",
    )
    costs: Literal["length", "own"] = param(
        "length", "length: costs are lengths of motions; own: any other cost"
    )
    edges: Literal["checked", "assumed"] = param(
        "checked",
        "checked: edges were found free before they were recorded; assumed: not yet, as by lazy "
        "planners",
    )
    goal_tolerance: float = param(
        0.0, "distance from the goal, in the robot's metric, within which paths may end", low=0
    )
    times: Literal["exact", "snapshot"] = param(
        "exact",
        "exact: each event was recorded when it happened; snapshot: the log was inferred from "
        "states of the planner, so that the order of events between two of them is not known",
    )
    samples: Literal["all", "none"] = param(
        "all", "all: each sample was recorded; none: not all of them were"
    )

    @classmethod
    def of(cls, given: Self | Mapping[str, Any] | None) -> Self:
        """Return claims from themselves, from names and values, or the default ones from None.

        Raises:
            BrrtError: A name is unknown, or a value is wrong.
        """
        if isinstance(given, cls):
            return given
        if given is not None and not isinstance(given, Mapping):
            raise BrrtError(f"claims must be a table of names and values, not {given!r:.60}")
        return cls.parse("claims", given or {})

    def stated(self) -> dict[str, Any]:
        """Return the claims that differ from the defaults, as `of` takes them."""
        return {
            f.name: getattr(self, f.name)
            for f in fields(self)
            if getattr(self, f.name) != f.default
        }
