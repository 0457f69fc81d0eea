"""The Rerun viewer as a process: start it, steer it, serve it to a browser."""
