"""`brrt planners`, `brrt robots`: what there is, and what can be set."""

from typing import Annotated, Any

import typer
from rich.markup import escape

from .console import out, print_json, print_rows

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")]


def planners(*, as_json: Json = False) -> None:
    """List the planners with their parameters, defaults and ranges (set by --param)."""
    from brrt.planners import PLANNERS  # noqa: PLC0415 - keep --help fast

    _print(dict(PLANNERS), as_json)


def robots(*, as_json: Json = False) -> None:
    """List the robots."""
    from brrt.robots import ROBOTS  # noqa: PLC0415

    _print(dict(ROBOTS), as_json)


def described(registry: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return for each class of a registry what it is about and what can be set."""
    return {
        name: {"about": (kind.__doc__ or "").split("\n")[0], "params": kind.describe()}
        for name, kind in registry.items()
    }


def print_described(entries: dict[str, dict[str, Any]]) -> None:
    """Print them as tables."""
    for name, entry in entries.items():
        out.print(f"[bold]{name}[/bold]  {escape(entry['about'])}")
        if entry["params"]:
            rows = [{**row, "name": f"  {row['name']}"} for row in entry["params"]]
            units = any(row["unit"] for row in rows)
            print_rows([{k: v for k, v in row.items() if units or k != "unit"} for row in rows])
        out.print()


def _print(registry: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print_json(described(registry))
    else:
        print_described(described(registry))
