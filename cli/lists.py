"""`brrt planners`, `brrt robots`: what there is, and what can be set."""

from typing import Annotated, Any

import typer
from rich.markup import escape

from .console import out, print_json, print_rows

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")]
Name = Annotated[str | None, typer.Argument(help="One of them alone.", show_default=False)]


def planners(name: Name = None, *, as_json: Json = False) -> None:
    """List the planners with their parameters, defaults and ranges (set by --param).

    brrt planners

    brrt planners rrt-star
    """
    from brrt.planners import PLANNERS  # noqa: PLC0415 - keep --help fast

    _print("planner", dict(PLANNERS), name, as_json=as_json)


def robots(name: Name = None, *, as_json: Json = False) -> None:
    """List the robots."""
    from brrt.robots import ROBOTS  # noqa: PLC0415

    _print("robot", dict(ROBOTS), name, as_json=as_json)


def described(registry: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return for each class of a registry what it is about and what can be set."""
    return {
        name: {"about": (kind.__doc__ or "").split("\n")[0], "params": kind.describe()}
        for name, kind in registry.items()
    }


def chosen(what: str, name: str | None, entries: dict[str, Any]) -> dict[str, Any]:
    """Return all entries, or the one that was asked for.

    Raises:
        BrrtError: There is no such one.
    """
    from brrt.errors import unknown  # noqa: PLC0415 - keep --help fast

    if name is None:
        return entries
    if name not in entries:
        raise unknown(what, name, entries)
    return {name: entries[name]}


def print_described(entries: dict[str, dict[str, Any]]) -> None:
    """Print them as tables."""
    for name, entry in entries.items():
        out.print(f"[bold]{name}[/bold]  {escape(entry['about'])}")
        if entry["params"]:
            rows = [{**row, "name": f"  {row['name']}"} for row in entry["params"]]
            units = any(row["unit"] for row in rows)
            print_rows([{k: v for k, v in row.items() if units or k != "unit"} for row in rows])
        out.print()


def _print(what: str, registry: dict[str, Any], name: str | None, *, as_json: bool) -> None:
    entries = chosen(what, name, described(registry))
    if as_json:
        print_json(entries)
    else:
        print_described(entries)
