"""What follows planning: shortcut smoothing and execution in moves."""
