"""Numbers as people type them."""

import typer


def whole_number(text: str) -> int:
    """Read a whole number, as 5000 or 1e6.

    Raises:
        typer.BadParameter: It is something else.
    """
    try:
        return int(text)
    except ValueError:
        pass
    try:
        value = float(text)
        if value.is_integer():
            return int(value)
    except ValueError:
        pass
    raise typer.BadParameter(f"{text!r} is not a whole number.")
