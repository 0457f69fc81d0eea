"""Steps after planning: shortcut smoothing and execution in moves."""
