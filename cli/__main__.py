"""`python -m brrt_cli` does what `brrt` does."""

from .app import main

main()
