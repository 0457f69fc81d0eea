"""Collision geometry in numpy that shares no code with the planners' kernels."""
