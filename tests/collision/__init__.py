"""Tests of the collision geometry of the reading wing."""
