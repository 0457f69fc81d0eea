"""What planners share: the problem, the budget, the interface, the compiled loop."""
