"""Figures of runs by matplotlib, on white paper: trees, curves and animations."""
