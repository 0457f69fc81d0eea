"""Compare two runs: settings, figures, and the first event that differs."""
