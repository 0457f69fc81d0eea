"""Recordings judged by what their planners promise, without any code of the planners."""
