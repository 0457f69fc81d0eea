"""`brrt planners`, `brrt robots`: the registered planners and robots, and their parameters."""

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from .console import console, print_json, print_line, print_rows
from .options import Json

Name = Annotated[str | None, typer.Argument(help="Show this one only.", show_default=False)]


def planners(name: Name = None, *, as_json: Json = False) -> None:
    """List the planners with their parameters, defaults and ranges.

    Set a parameter by brrt plan --param NAME=VALUE.

    Examples:
      brrt planners
      brrt planners rrt-star
    """
    from brrt.planners import PLANNERS

    _print("planner", PLANNERS, name, as_json=as_json)


def robots(name: Name = None, *, as_json: Json = False) -> None:
    """List the robots with their parameters, defaults and ranges.

    Set parameters by brrt plan --robot polygon:length=4,width=2.

    Examples:
      brrt robots
      brrt robots chain
    """
    from brrt.robots import ROBOTS

    _print("robot", ROBOTS, name, as_json=as_json)


def described(registry: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return what each class of a registry is, and its parameters."""
    return {
        name: {"about": (kind.__doc__ or "").split("\n")[0], "params": kind.describe()}
        for name, kind in registry.items()
    }


def chosen(what: str, name: str | None, entries: dict[str, Any]) -> dict[str, Any]:
    """Return all entries, or the named one alone.

    Raises:
        BrrtError: There is no entry of that name.
    """
    from brrt.errors import unknown

    if name is None:
        return entries
    if name not in entries:
        raise unknown(what, name, entries)
    return {name: entries[name]}


def print_described(entries: dict[str, dict[str, Any]]) -> None:
    """Print entries as tables."""
    from rich.markup import escape

    for name, entry in entries.items():
        console().print(f"[bold]{name}[/bold]  {escape(entry['about'])}")
        if entry["params"]:
            rows = [{**row, "name": f"  {row['name']}"} for row in entry["params"]]
            units = any(row["unit"] for row in rows)
            print_rows([{k: v for k, v in row.items() if units or k != "unit"} for row in rows])
        print_line()


def _print(what: str, registry: Mapping[str, Any], name: str | None, *, as_json: bool) -> None:
    entries = chosen(what, name, described(registry))
    if as_json:
        print_json(entries)
    else:
        print_described(entries)
