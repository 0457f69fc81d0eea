"""Pictures of runs and worlds: Rerun, matplotlib, Foxglove."""
