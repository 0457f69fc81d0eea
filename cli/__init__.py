"""The `brrt` command and the plugin for pytest; installed as `brrt_cli`.

PYTEST_DONT_REWRITE: see `brrt`.
"""
