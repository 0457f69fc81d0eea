"""The `brrt` command, installed as `brrt_cli`; only its entry point imports it."""
