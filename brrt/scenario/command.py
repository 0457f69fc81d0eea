"""Scenarios as `brrt plan` commands."""

from collections.abc import Iterator, Mapping
from typing import Any

from brrt.scenario.scenario import Scenario
from brrt.shell import file_word, join


def command(scenario: Scenario, out: str = "next.mcap") -> str:
    """Return the command that runs a scenario and records it to `out`."""
    return join([*plan_words(scenario), "--out", file_word(out)])


def plan_words(scenario: Scenario) -> list[str]:
    """Return the words of the command that runs a scenario, without its outputs."""
    values, usual = scenario.as_dict(), Scenario().as_dict()
    given = {
        name: values[name]
        for name in values
        if name in ("world", "seed") or values[name] not in (None, usual[name])
    }
    return ["brrt", "plan", *setting_words(given, scenario.params)]


def setting_words(settings: Mapping[str, Any], params: Mapping[str, Any]) -> list[str]:
    """Return the options for fields of a scenario and parameters of its planner."""
    words = list(_options(settings))
    for name, value in params.items():
        if value is not None:
            words += ["--param", f"{name}={text(value)}"]
    return words


def _options(values: Mapping[str, Any]) -> Iterator[str]:
    for name in ("world", "robot", "planner", "start", "goal", "seed", "iterations", "time",
                 "shortcuts", "max_move", "deadline"):  # fmt: skip
        if name in values:
            given = text(values[name])
            option = f"--{name.replace('_', '-')}"
            # A separate word that begins with a minus would be read as an option.
            yield from [f"{option}={given}"] if given.startswith("-") else [option, given]
    for name in ("smooth", "execute"):
        if name in values:
            yield f"--{name}" if values[name] else f"--no-{name}"


def text(value: Any) -> str:
    """Return a value as the command line reads it: numbers as short as exactness allows."""
    if isinstance(value, list | tuple):
        return ",".join(text(x) for x in value)
    if isinstance(value, bool):
        return str(value).lower()
    short = f"{value:g}" if isinstance(value, float) else str(value)
    return short if isinstance(value, str) or float(short) == value else repr(value)
