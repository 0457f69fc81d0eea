"""Rerun's viewer: its processes, control of a window, and a server for the browser."""
