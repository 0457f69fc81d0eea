"""What a package adds to brrt; `pyproject.toml` names it."""
