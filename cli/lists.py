"""`brrt planners`, `brrt robots`, `brrt worlds`: what there is, and what can be set."""

from typing import Annotated

import typer

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


def worlds(*, as_json: Json = False) -> None:
    """List the world generators with their parameters, and the files that can be loaded."""
    from brrt.worlds import GENERATORS, LOADERS  # noqa: PLC0415

    _print(dict(GENERATORS), as_json)
    if not as_json:
        endings = ", ".join(dict.fromkeys(e for kind in LOADERS.values() for e in kind.endings))
        out.print(
            f"Use one as --world circles2d:n=80,seed=3, or give a file ({endings}).",
            markup=False,
        )


def _print(registry: dict[str, type], as_json: bool) -> None:
    described = {
        name: {"about": (kind.__doc__ or "").split("\n")[0], "params": kind.describe()}  # type: ignore[attr-defined]
        for name, kind in registry.items()
    }
    if as_json:
        print_json(described)
        return
    for name, entry in described.items():
        out.print(f"[bold]{name}[/bold]  {entry['about']}")
        if entry["params"]:
            print_rows([{**row, "name": f"  {row['name']}"} for row in entry["params"]])
        out.print()
