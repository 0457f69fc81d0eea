"""Runs: plan a scenario, branch off a recorded run, reproduce one."""
