"""Packages that only exports need: pip install 'brrt[data]'."""

from importlib import import_module
from typing import Any

from brrt.errors import BrrtError


def need(module: str) -> Any:
    """Import a module of an optional package.

    Raises:
        BrrtError: The package is missing.
    """
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise BrrtError(f"{package} is not installed; pip install 'brrt[data]'") from None
