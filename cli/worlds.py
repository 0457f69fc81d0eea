"""`brrt worlds`: list the generators and file formats, show a world, save one."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brrt.digits import digits_within, join_numbers
from brrt.replay.text import counted
from brrt.shell import file_argument

from .command import Command, Group
from .console import (
    console,
    note,
    print_json,
    print_line,
    print_lines,
    print_pairs,
    print_rows,
)
from .lists import about, described, print_described
from .options import Force, Json
from .progress import ProgressBar

if TYPE_CHECKING:
    from brrt.worlds import World

app = typer.Typer(name="worlds", cls=Group, invoke_without_command=True, add_completion=False)
Named = Annotated[
    str,
    typer.Argument(
        metavar="WORLD",
        help="A generator with parameters, such as circles2d:n=80,seed=3, or a file.",
        show_default=False,
    ),
]
Start = Annotated[
    str | None, typer.Option(help="Start, instead of the world's own.", metavar="X,Y[,Z]")
]
Goal = Annotated[
    str | None, typer.Option(help="Goal, instead of the world's own.", metavar="X,Y[,Z]")
]
PICTURES = (".png", ".svg", ".pdf")


@app.callback()
def worlds(context: typer.Context, *, as_json: Json = False) -> None:
    """List the world generators, show a world, or save one.

    brrt worlds list circles2d

    brrt worlds show circles2d:n=80,seed=3

    brrt worlds make circles2d:n=80,seed=3 --out w.json
    """
    if context.invoked_subcommand is None:
        list_worlds(None, as_json=as_json)


@app.command("list", cls=Command)
def list_worlds(
    name: Annotated[
        str | None, typer.Argument(help="Only this generator or format.", show_default=False)
    ] = None,
    *,
    as_json: Json = False,
) -> None:
    """List the world generators with their parameters, and the files that can be loaded."""
    from brrt.errors import unknown
    from brrt.worlds import GENERATORS, LOADERS

    generators = {} if name in LOADERS.own else described(GENERATORS, name)
    files = {} if name in GENERATORS.own else described(LOADERS, name)
    for key, entry in files.items():
        entry |= {"endings": list(LOADERS[key].endings), "query": LOADERS[key].queries}
    entries = {**generators, **files}
    if name is not None and not entries:
        raise unknown("world", name, [*GENERATORS, *LOADERS])
    if as_json:
        print_json(entries)
        return
    if name is None:
        _print_overview(generators, files)
    print_described({key: entry for key, entry in entries.items() if entry["params"] or name})
    if name is None:
        for line in (
            "Show one: brrt worlds show circles2d:n=80,seed=3, or map.yaml:unknown=free",
            "Plan in one: brrt plan --world arena.map.scen#12",
            "Obstacles are the same for all robots and queries, except that scattered ones and",
            "trees closer to the robot at start or goal than 1 % of the size are left out.",
        ):
            print_line(line)


def _print_overview(generators: dict[str, Any], files: dict[str, Any]) -> None:
    print_rows([{"name": key, "about": about(entry)} for key, entry in generators.items()], whole=1)
    print_line()
    rows = [
        {"file": key, "about": about(f), "endings": " ".join(f["endings"])}
        for key, f in files.items()
    ]
    print_rows(rows, whole=1)
    print_line()


@app.command(cls=Command)
def show(
    world: Named,
    *,
    start: Start = None,
    goal: Goal = None,
    picture: Annotated[
        Path | None, typer.Option("--out", help="Draw it into a .png, .svg or .pdf file.")
    ] = None,
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun file of it.")] = None,
    view: Annotated[bool, typer.Option("--view", help="Open it in the Rerun viewer.")] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Draw a world, with its obstacles, its free share, and whether start and goal connect.

    brrt worlds show circles2d:n=80,seed=3

    brrt worlds show map.txt --start 0,0,1 --goal 12,12,5 --out map.png
    """
    from brrt.worlds.free_space import connected, free_fraction

    from .output_file import check_display, check_output

    check_output(picture, "--out", PICTURES, force=force)
    check_output(rrd, "--rrd", ".rrd", force=force)
    check_display(view=view)
    with ProgressBar(None, "making the world").running() as watch:
        made = _made(world, start, goal)
        figures = _figures(made)
        watch.update(0, "measuring the free share", "")
        figures["free"], figures["free_error"] = free_fraction(made)
        if made.start is not None and made.goal is not None:
            watch.update(0, "searching a path", "")
            found = connected(made, made.start, made.goal)
            figures |= {"connected": found.connected, "cell": found.cell, "way": found.reason}
        watch.update(0, "drawing", "")
        drawing = None if as_json else _drawing(made)
        _write(made, picture, rrd, view=view)
    if as_json:
        print_json(figures)
        return
    console().print(drawing, soft_wrap=True)
    print_pairs(_rows(figures))
    if picture is not None:
        print_lines(["", f"{picture}: the picture"])
    if rrd is not None:
        print_lines(["", f"{rrd}: open it with rerun {file_argument(rrd)}"])


@app.command(cls=Command)
def make(
    world: Named,
    *,
    file: Annotated[
        Path, typer.Option("--out", help="The .json file to write.", show_default=False)
    ],
    start: Start = None,
    goal: Goal = None,
    force: Force = False,
) -> None:
    """Save a world as brrt's own JSON, for plan --world.

    brrt worlds make circles2d:n=80,seed=3 --out w.json
    """
    from .output_file import check_output

    check_output(file, "--out", ".json", force=force)
    with ProgressBar(None, "making the world").running():
        made = _made(world, start, goal)
        made.save(file)
    what = ", ".join(_counts(_figures(made))) or "no obstacles"
    text = f"{file}: {made.dim}D, {what}; plan in it with --world {file_argument(file)}"
    print_line(text)


def _made(spec: str, start: str | None, goal: str | None) -> "World":
    from dataclasses import replace

    from brrt.worlds import make_world

    ends = {"start": _point("--start", start), "goal": _point("--goal", goal)}
    world = make_world(spec, **ends)
    for line in world.notes:
        note(line)
    return replace(world, **{name: end for name, end in ends.items() if end is not None})


def _point(option: str, text: str | None) -> Any:
    import numpy as np

    from brrt.errors import BrrtError

    try:
        return None if text is None else np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise BrrtError(f"{option} must be numbers like 1,2, not {text!r}") from None


def _drawing(world: "World") -> Any:
    from .draw_world import draw_world

    out = console()
    try:
        "█░┌".encode(out.encoding)
        blocks = True
    except (UnicodeEncodeError, LookupError):
        blocks = False
    # A pipe or a file has no height; 42 lines is a page.
    rows = max(out.size.height - 2, 20) if out.is_terminal else 42
    return draw_world(world, max(out.size.width, 24), rows, blocks=blocks)


def _write(world: "World", picture: Path | None, rrd: Path | None, *, view: bool) -> None:
    if picture is not None:
        from brrt.views.matplotlib.draw_world import save_world

        save_world(world, picture)
    if rrd is not None or view:
        from brrt.views.rerun.draw_world import show_world

        show_world(world, path=rrd, view=view)


def _figures(world: "World") -> dict[str, Any]:
    """Return the world's properties under the names that `--json` prints."""
    segments = sum(len(polygon) == 2 for polygon in world.polygons)
    grid = None
    if world.grid is not None:
        rows, columns = world.grid.cells.shape
        grid = {
            "rows": rows,
            "columns": columns,
            "resolution": world.grid.resolution,
            "yaw": world.grid.yaw,
            "blocked": int(world.grid.cells.sum()),
        }
    return {
        "world": world.name,
        "dim": world.dim,
        "lower": world.lower.tolist(),
        "upper": world.upper.tolist(),
        "balls": len(world.balls),
        "boxes": len(world.boxes),
        "polygons": len(world.polygons) - segments,
        "segments": segments,
        "grid": grid,
        "free": None,
        "free_error": None,
        "start": None if world.start is None else world.start.tolist(),
        "goal": None if world.goal is None else world.goal.tolist(),
        "connected": None,
        "cell": None,
        "way": None,
        "notes": list(world.notes),
    }


def _counts(figures: dict[str, Any]) -> Iterator[str]:
    """Yield the number of obstacles of each shape that there are."""
    flat = figures["dim"] == 2
    names = {
        "balls": ("circle", "circles") if flat else ("sphere", "spheres"),
        "boxes": ("rectangle", "rectangles") if flat else ("box", "boxes"),
        "polygons": ("polygon", "polygons"),
        "segments": ("line segment", "line segments"),
    }
    for key, (one, several) in names.items():
        if figures[key]:
            yield counted(figures[key], one, several)
    grid = figures["grid"]
    if grid is not None:
        turned = f", turned by {grid['yaw']:.4g} rad" if grid["yaw"] else ""
        yield (
            f"a grid of {grid['columns']:,} x {grid['rows']:,} cells of {grid['resolution']:g}"
            f"{turned}, {grid['blocked']:,} of them blocked"
        )


def _rows(f: dict[str, Any]) -> Iterator[tuple[str, str, str]]:
    yield "world", f["world"], ""
    digits = digits_within(f["lower"], f["upper"])
    corners = (join_numbers(f[name], digits, " ").split() for name in ("lower", "upper"))
    sides = zip(*corners, strict=True)
    yield "bounds", f"{f['dim']}D, " + " x ".join(f"[{a}, {b}]" for a, b in sides), ""
    yield "obstacles", ", ".join(_counts(f)) or "none", ""
    yield "free", _share(f["free"], f["free_error"]), ""
    for name in ("start", "goal"):
        yield name, "none" if f[name] is None else join_numbers(f[name], digits), ""
    if f["way"] is not None:
        style = {True: "bold green", False: "bold red", None: "bold yellow"}[f["connected"]]
        word = {True: "yes", False: "no", None: "unknown"}[f["connected"]]
        yield "connected", f"{word}, {f['way']}", style


def _share(share: float, error: float) -> str:
    if error == 0:
        return f"{100 * share:.6g} %"
    # Two digits of the error, and as many decimals of the share.
    digits = max(0, 1 - int(f"{100 * error:e}".partition("e")[2]))
    return f"{100 * share:.{digits}f} %, standard error {100 * error:.{digits}f} %"
