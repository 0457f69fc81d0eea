"""The base of planners: the problem, the budget, the interface, and running a compiled loop."""
