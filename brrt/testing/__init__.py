"""Regression tests for planners: golden runs, and gates on the metrics of many seeds."""
