"""`python -m brrt_cli` is `brrt`."""

from .app import main

main()
