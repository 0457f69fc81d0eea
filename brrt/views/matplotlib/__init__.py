"""Pictures of runs by matplotlib, on white paper: trees, curves, and trees as they grow."""
