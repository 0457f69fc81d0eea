"""What is run: the scenario, the manifest of a recording, the planner's contract."""
