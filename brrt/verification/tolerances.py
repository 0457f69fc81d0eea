"""By how much lengths and costs may differ because they are rounded."""

CLOSE = 1e-9
"""Relative tolerance of lengths and costs, far above their rounding."""

ROUNDING = 1e-14
"""Tolerance relative to the coordinates: a short motion far from the origin is rounded most."""
