"""typer's classes of commands, with values converted here and errors that name the file."""

import re
from typing import Any, get_args

import typer
from typer.core import TyperCommand, TyperGroup

_MOST_DIGITS = 300
"""Of a number with an exponent."""


def whole_number(text: str) -> int:
    """Read a whole number, such as 5000 or 1e6.

    Raises:
        ValueError: The text is something else.
    """
    try:
        return int(text)
    except ValueError:
        from decimal import Decimal, InvalidOperation

        try:
            value = Decimal(text)
        except InvalidOperation:
            value = Decimal("nan")
        if not value.is_finite() or value.adjusted() > _MOST_DIGITS or value != int(value):
            raise
        return int(value)


_READERS = {int: (whole_number, "a whole number"), float: (float, "a number")}


class _Conversion:
    """Converts the text of one parameter.

    typer's own conversion goes through pydantic, whose import takes longer than most commands.

    Args:
        descriptor: What typer knows of the parameter: its type, and a range for numbers.
    """

    def __init__(self, descriptor: Any) -> None:
        kind = (get_args(descriptor.annotation) or (descriptor.annotation,))[0]
        self._read, self._name = _READERS.get(kind, (kind, ""))
        self._range = descriptor.parameter_info

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:  # noqa: ARG002 - typer's signature
        """Return a value as the parameter's type; what is not given stays None or empty."""
        if param.multiple or param.nargs == -1:
            return [self._convert(each) for each in value or ()]
        return None if value is None else self._convert(value)

    def _convert(self, value: Any) -> Any:
        try:
            found = self._read(value)
        except ValueError:
            raise typer.BadParameter(f"{value!r} is not {self._name}.") from None
        low, high = self._range.min, self._range.max
        if (low is not None and found < low) or (high is not None and found > high):
            raise typer.BadParameter(f"{value} is not between {low} and {high}.")
        return found


def _plain(params: list[Any]) -> list[Any]:
    """Give parameters the conversion above; a typer that has no such attribute ignores it."""
    for param in params:
        if getattr(param, "_runtime_param", param) is None:
            param._runtime_param = _Conversion(param.type_descriptor)  # noqa: SLF001
    return params


def _reflowed(text: str) -> str:
    """Join the lines of each paragraph, since typer keeps their breaks, but not indented lines."""
    return re.sub(r"\n +", "\n", re.sub(r"(?<=\S)\n(?=\S)", " ", text))


class Command(TyperCommand):
    """A command."""

    def __init__(self, *args: Any, **given: Any) -> None:
        super().__init__(*args, **given)
        self.help = _reflowed(self.help or "")

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, which convert their values as said above."""
        return _plain(super().get_params(ctx))

    def invoke(self, ctx: Any) -> Any:
        """Run the command; events that contradict each other are reported with their file."""
        from brrt.errors import BrrtError, LogError

        try:
            return super().invoke(ctx)
        except LogError as error:
            runs = ctx.params.get("runs") or [ctx.params["run"]]
            raise BrrtError(f"{' or '.join(map(str, runs))}: {error}; see brrt verify") from None


class Group(TyperGroup):
    """A group of commands."""

    def __init__(self, *args: Any, **given: Any) -> None:
        super().__init__(*args, **given)
        self.help = _reflowed(self.help or "")

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, which convert their values as said above."""
        return _plain(super().get_params(ctx))
