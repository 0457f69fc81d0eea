"""The `brrt` command, installed as `brrt_cli`; only its entry point imports it.

PYTEST_DONT_REWRITE: see `brrt`.
"""
