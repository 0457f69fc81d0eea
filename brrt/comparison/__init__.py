"""Two recordings compared: settings, versions, metrics, and the first event that differs."""
