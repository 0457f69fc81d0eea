"""A scenario as the command that runs it."""

import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from brrt.scenario import Scenario


def command(scenario: Scenario, out: str = "next.mcap") -> str:
    """Write a scenario as the command that runs it, and records to `out`."""
    words = ["brrt", "plan", *_options(scenario.as_dict(), Scenario().as_dict())]
    for name, value in scenario.params.items():
        if value is not None:
            words += ["--param", f"{name}={text(value)}"]
    return shlex.join([*words, "--out", out])


def _options(values: Mapping[str, Any], usual: Mapping[str, Any]) -> Iterator[str]:
    """Yield the options for what is not as usual; the seed always, and the world."""
    names = ("world", "robot", "planner", "start", "goal", "seed", "iterations", "time",
             "shortcuts", "max_move", "deadline")  # fmt: skip
    for name in names:
        value = values[name]
        if value is not None and (value != usual[name] or name in ("world", "seed")):
            given = value if isinstance(value, str) else text(value)
            option = f"--{name.replace('_', '-')}"
            # A value that begins with a minus would be taken for an option.
            yield from [f"{option}={given}"] if given.startswith("-") else [option, given]
    if not values["smooth"]:
        yield "--no-smooth"
    if values["execute"]:
        yield "--execute"


def text(value: Any) -> str:
    """Write a value as the command line reads it: numbers as short as they are exact."""
    if isinstance(value, list | tuple):
        return ",".join(text(x) for x in value)
    if isinstance(value, bool):
        return str(value).lower()
    short = f"{value:g}" if isinstance(value, float) else str(value)
    return short if isinstance(value, str) or float(short) == value else repr(value)
