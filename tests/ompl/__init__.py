"""Tests of recording OMPL; they are skipped where ompl is not installed."""
