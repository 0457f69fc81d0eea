"""A robot that extends one of brrt's, so that all of brrt's planners can move it."""

from dataclasses import dataclass
from typing import ClassVar

from brrt import Polygon
from brrt.settings import param


@dataclass(frozen=True, slots=True, eq=False)
class Truck(Polygon):
    """A lorry, seen from above: a rectangle that moves and turns in the plane."""

    kind: ClassVar[str] = "truck"  # its name in recordings, the same as that of the entry point

    length: float = param(7.5, "bumper to bumper", above=0)
    width: float = param(2.5, "from side to side", above=0)
