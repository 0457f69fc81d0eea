"""Colours that all pictures share: red, green, blue, from 0 to 255."""

Colour = tuple[int, int, int]

FREE: Colour = (34, 37, 45)
"""Free space on a dark ground: not black, so that dark obstacles stand out against it."""
OBSTACLE: Colour = (10, 11, 14)
OBSTACLE_3D: Colour = (112, 120, 137)
OUTLINE: Colour = (96, 103, 118)
START: Colour = (255, 145, 30)
GOAL: Colour = (60, 215, 100)
