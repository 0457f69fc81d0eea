"""`python -m brrt_cli` is `brrt`."""

from .start import main

main()
