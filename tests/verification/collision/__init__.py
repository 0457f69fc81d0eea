"""Tests of the geometry of `verify`."""
