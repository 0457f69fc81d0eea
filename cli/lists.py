"""`brrt planners`, `brrt robots`: the registered planners and robots, and their parameters."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import console, print_json, print_line, print_rows
from .options import Json

if TYPE_CHECKING:
    from brrt.registry import Registry

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


def described(registry: "Registry[Any]", name: str | None) -> dict[str, dict[str, Any]]:
    """Return what each class of a registry is, the package it is from, and its parameters.

    Args:
        registry: The registry.
        name: Only this one; nothing is returned if there is none of this name.
    """
    if name is None:
        kinds = registry.working()
    else:
        kinds = {name: registry[name]} if name in registry else {}
    return {
        name: {
            "about": (kind.__doc__ or "").strip().split("\n")[0],
            "package": registry.package(name),
            "params": kind.describe(),
        }
        for name, kind in kinds.items()
    }


def print_described(entries: dict[str, dict[str, Any]]) -> None:
    """Print entries as tables."""
    from rich.markup import escape

    for name, entry in entries.items():
        console().print(f"[bold]{escape(name)}[/bold]  {escape(about(entry))}")
        if entry["params"]:
            rows = [{**row, "name": f"  {row['name']}"} for row in entry["params"]]
            units = any(row["unit"] for row in rows)
            print_rows([{k: v for k, v in row.items() if units or k != "unit"} for row in rows])
        print_line()


def about(entry: dict[str, Any]) -> str:
    """Return what an entry is, in a line; a plug-in's with its package."""
    package = "" if entry["package"] == "brrt" else f" (from {entry['package']})"
    return f"{entry['about']}{package}"


def _print(what: str, registry: "Registry[Any]", name: str | None, *, as_json: bool) -> None:
    from brrt.errors import unknown

    entries = described(registry, name)
    if name is not None and not entries:
        raise unknown(what, name, registry)
    if as_json:
        print_json(entries)
    else:
        print_described(entries)
