"""Robots: one file and one line here adds one."""

from collections.abc import Mapping

from brrt.robots.point import Point

ROBOTS: Mapping[str, type[Point]] = {"point": Point}

__all__ = ["ROBOTS", "Point"]
