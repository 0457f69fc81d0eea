"""Regression tests for planners: golden runs, and gates on the figures of many seeds."""
