"""Settings: checked parameters of planners, robots, smoothers, world generators and loaders.

A setting is a field of a frozen dataclass, declared with `param`, which states its range, unit and
meaning. The declaration serves Python (`RRT(step=2)`), the command line (`--param step=2`), the
help texts and the manifest.
"""

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any, ClassVar, Literal, Self, get_args, get_origin, get_type_hints

import numpy as np

from brrt.digits import against_limits
from brrt.errors import BrrtError, unknown

MOST, MOST_WHOLE = 1e150, (1 << 63) - 1
"""Greatest number and whole number of a setting that declares none: squares do not overflow, and
kernels count with 64 bits. The least number above 0 is 1 / MOST."""

_TRUE, _FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")


def param(
    default: Any,
    doc: str,
    *,
    low: float | None = None,
    above: float | None = None,
    high: float | None = None,
    unit: str = "",
) -> Any:
    """Declare a setting: its default, its meaning, and its range from `low` or `above` to `high`.

    `low` and `high` are within the range, `above` is not.
    """
    return field(
        default=default,
        metadata={"doc": doc, "low": low, "above": above, "high": high, "unit": unit},
    )


@dataclass(frozen=True, slots=True)
class Settings:
    """Base class of frozen dataclasses whose fields are declared by `param`.

    Attributes:
        greatest_number: Greatest number of a setting that declares none; the least above 0 is its
            reciprocal.
    """

    greatest_number: ClassVar[float] = MOST

    def __post_init__(self) -> None:
        """Check every value against its declaration.

        Raises:
            BrrtError: A value has the wrong type or lies outside its range.
        """
        hints = _hints(type(self))
        for f in _params(self):
            value = _typed(f.name, getattr(self, f.name), hints[f.name])
            _check_range(f.name, value, f.metadata, self.greatest_number)
            object.__setattr__(self, f.name, value)

    @classmethod
    def parse(cls, owner: str, values: Mapping[str, Any]) -> Self:
        """Make settings from named values, which may be strings.

        Args:
            owner: What they configure, for messages ("planner rrt").
            values: Names and values, as from TOML, JSON or the command line.

        Raises:
            BrrtError: A name is unknown, or a value has the wrong type or is out of range.
        """
        names = [f.name for f in _params(cls)]
        for name in values:
            if name not in names:
                raise unknown(f"parameter of {owner}", name, names)
        hints = _hints(cls)
        return cls(**{name: _typed(name, value, hints[name]) for name, value in values.items()})

    def as_dict(self) -> dict[str, Any]:
        """Return names and values, as `parse` takes them."""
        return {f.name: getattr(self, f.name) for f in _params(self)}

    @classmethod
    def greatest_values(cls) -> dict[str, float]:
        """Return the greatest value of each setting that has one."""
        limits = {f.name: f.metadata["high"] for f in _params(cls)}
        return {name: high for name, high in limits.items() if high not in (None, math.inf)}

    @classmethod
    def describe(cls) -> list[dict[str, str]]:
        """Return one row for each setting: name, default, unit, range, doc."""
        hints = _hints(cls)
        return [
            {
                "name": f.name,
                "default": "auto" if f.default is None else _text(f.default),
                "unit": f.metadata["unit"],
                "range": _range_text(f.metadata, hints[f.name]),
                "doc": f.metadata["doc"],
            }
            for f in _params(cls)
        ]


def parse_pairs(owner: str, text: str) -> dict[str, str]:
    """Split `a=1,b=2` into names and values.

    Args:
        owner: What they configure, for messages.
        text: The pairs.

    Raises:
        BrrtError: A part is not `name=value`, or a name is repeated.
    """
    found: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        name, equals, value = part.partition("=")
        if not equals:
            raise BrrtError(f"{owner}: {part!r} must read name=value")
        if name.strip() in found:
            raise BrrtError(f"{owner}: {name.strip()} is given twice; give it once")
        found[name.strip()] = value.strip()
    return found


_HINTS: dict[type, dict[str, Any]] = {}


def _hints(settings: type) -> dict[str, Any]:
    """Return the types of the fields; working them out takes longer than making most settings."""
    if settings not in _HINTS:
        _HINTS[settings] = get_type_hints(settings)
    return _HINTS[settings]


def _params(settings: Any) -> list[Field[Any]]:
    """Return the fields that are declared by `param`; a class may have other fields."""
    return [f for f in fields(settings) if "doc" in f.metadata]


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _range_text(meta: Mapping[str, Any], hint: Any) -> str:
    if get_origin(hint) is Literal:
        return " | ".join(map(str, get_args(hint)))
    if hint is bool:
        return "true | false"
    parts = []
    if meta["low"] is not None:
        parts.append(f">= {meta['low']:g}")
    if meta["above"] is not None:
        parts.append(f"> {meta['above']:g}")
    if meta["high"] is not None and meta["high"] < math.inf:
        parts.append(f"<= {meta['high']:g}")
    return ", ".join(parts)


def _typed(name: str, value: Any, hint: Any) -> Any:
    """Convert `value` to the type of `hint`."""
    if type(None) in get_args(hint):
        if value is None or value in ("auto", ""):
            return None
        (hint,) = (a for a in get_args(hint) if a is not type(None))
    if get_origin(hint) is Literal:
        if value not in get_args(hint):
            raise unknown(f"value of {name}", str(value), map(str, get_args(hint)))
        return value
    if hint is str:
        if not isinstance(value, str):
            raise BrrtError(f"{name} must be a text, not {value!r}")
        return value
    return _as_bool(name, value) if hint is bool else _as_number(name, value, hint)


def _as_number(name: str, value: Any, hint: Any) -> Any:
    try:
        if isinstance(value, bool | np.bool_):
            raise TypeError  # noqa: TRY301 - bool is a subclass of int
        number = hint(float(value)) if hint is int and _is_scientific(value) else hint(value)
    except (TypeError, ValueError, OverflowError):
        kind = "a whole number" if hint is int else "a number"
        raise BrrtError(f"{name} must be {kind}, not {value!r:.60}") from None
    inexact = isinstance(value, float | np.floating) or _is_scientific(value)
    if hint is int and inexact and float(value) != number:
        raise BrrtError(f"{name} must be a whole number, not {value!r:.60}")
    return number


def _is_scientific(value: Any) -> bool:
    return isinstance(value, str) and "e" in value.lower()


def _as_bool(name: str, value: Any) -> bool:
    if isinstance(value, bool):
        return value
    text = str(value).lower()
    if text not in _TRUE + _FALSE:
        raise BrrtError(f"{name} must be true or false, not {value!r}")
    return text in _TRUE


def _check_range(name: str, value: Any, meta: Mapping[str, Any], greatest: float) -> None:
    if not isinstance(value, int | float):
        return
    if isinstance(value, float) and not math.isfinite(value):
        raise BrrtError(f"{name} must be a finite number, not {value}")
    whole = isinstance(value, int)
    most_of_all = MOST_WHOLE if whole else greatest
    low, above, high = meta["low"], meta["above"], meta["high"]
    high = most_of_all if high is None else high
    if low is None:
        low = -most_of_all if above is None else 1 / greatest if above == 0 else above
    text = f"{_text(value):.60}"
    if above is not None and value <= above:
        raise BrrtError(f"{name} must be above {above:g}, not {text}")
    least, most = (f"{limit:,}" for limit in (low, high))
    if not whole:
        text, least, most = against_limits(value, low, high)
    if value < low:
        remedy = "; choose a smaller unit" if low == 1 / greatest else ""
        raise BrrtError(f"{name} must be at least {least}, not {text}{remedy}")
    if value > high:
        raise BrrtError(f"{name} must be at most {most}, not {text}")
