"""`python -m brrt` is the command `brrt`; only here does the library run the command line."""

from importlib import import_module

if __name__ == "__main__":
    import_module("brrt_cli.start").main()
