"""`brrt verify --path`: a path alone, judged and printed."""

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import typer

from brrt.digits import against_limits, digits_within, join_numbers
from brrt.errors import BrrtError
from brrt.replay.text import counted

from .console import Code, note, print_json, print_line, print_pairs
from .output_file import check_output
from .progress import ProgressBar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from brrt.verification.path_check import PathCheck

_WIDTH = 80
_SHOWN = 12
"""Motions, or coordinates, that are printed one by one."""

PICTURES = (".png", ".svg", ".pdf")


def judge_path(
    path: Path,
    world: str | None,
    robot: str,
    ends: dict[str, str | None],
    tolerance: float | None,
    picture: Path | None,
    *,
    force: bool,
    as_json: bool,
) -> None:
    """Judge a path, print what was found, and end with exit code 1 if it does not hold."""
    if world is None:
        raise BrrtError("--path needs the world that it leads through; give --world map.yaml")
    check_output(picture, "--out", PICTURES, force=force)
    from brrt.verification.path_check import check_path
    from brrt.worlds import make_world

    with ProgressBar(None, "making the world").running() as watch:
        made = make_world(world)
        for line in made.notes:
            note(line)
        watch.update(0, "judging the path", "")
        found = check_path(
            path, world=made, robot=robot, tolerance=tolerance or 0.0,
            **{name: _numbers(f"--{name}", text) for name, text in ends.items()},
        )  # fmt: skip
        if picture is not None:
            from brrt.views.matplotlib.path_picture import save_path

            watch.update(0, "drawing", "")
            save_path(found, picture)
    if as_json:
        print_json({"path": str(path), "world": made.name, **found.as_dict()})
    else:
        _show(path, found)
        if picture is not None:
            print_line(f"{picture}: the picture")
    if not found.holds:
        raise typer.Exit(Code.FAILED)


def _numbers(option: str, text: str | None) -> list[float] | None:
    try:
        return None if text is None else [float(part) for part in text.split(",")]
    except ValueError:
        raise BrrtError(f"{option} must be numbers like 1,2, not {text!r}") from None


def _show(path: Path, found: "PathCheck") -> None:
    """Print what is true of the path, its motions, and the verdict."""
    print_pairs((name, text, style) for name, text, style in _rows(path, found))
    print_line()
    blocked = {hit.motion: hit for hit in found.hits}
    few = len(found.lengths) <= _SHOWN
    shown = list(range(len(found.lengths))) if few else sorted(blocked)[:_SHOWN]
    if shown:
        print_line(f"{'motion':>8} {'length':>10} {'clearance':>10}  nearest, or what it hits")
    for i in shown:
        hit = blocked.get(i)
        where = f"{found.nearest[i]}" if hit is None else _hit_text(found, hit)
        near = found.clearance[i]
        distance = "BLOCKED" if hit is not None else f"{near:.6g}" if near < float("inf") else "-"
        line = f"{i:>8,} {found.lengths[i]:>10.6g} {distance:>10}  {where}"
        _print_wrapped(line, 32, "bold red" if hit else "")
    if len(blocked) > len(shown):
        print_line(f"     ... and {len(blocked) - len(shown):,} more that are blocked")
    _print_wrapped(_verdict(found), 2, "bold green" if found.holds else "bold red")


def _print_wrapped(line: str, indent: int, style: str) -> None:
    for part in wrap(line, _WIDTH, subsequent_indent=" " * indent, break_on_hyphens=False):
        print_line(part, style=style)


def _rows(path: Path, found: "PathCheck") -> "Iterator[tuple[str, str, str]]":
    kind = found.robot.kind
    yield "path", f"{path}: {counted(len(found.q), 'waypoint')} of a {kind}", ""
    yield "world", found.world.name, ""
    yield "length", f"{found.length:.6g}", ""
    turns = found.turns
    if turns is not None:
        text = f"{_degrees(turns.sum)} in all"
        if turns.sum > 0:
            text += f", the sharpest {_degrees(turns.sharpest)} at waypoint {turns.waypoint:,}"
        yield "turns", text, ""
    near = found.tightest
    if near is not None:
        where = f"from {near.obstacle}, in motion {near.motion:,} at {_text(found, near.q)}"
        yield "clearance", f"{near.distance:.6g} {where}", ""
    for end in found.ends:
        ok = "as given" if end.equal else f"{end.distance:.6g} from the one given"
        yield end.name, ok, "" if end.equal else "bold red"
    for i, name, value, low, high in found.outside[:_SHOWN]:
        at, least, most = against_limits(value, low, high)
        yield "outside", f"waypoint {i:,}: {name} is {at}, not {least} to {most}", "bold red"
    if len(found.outside) > _SHOWN:
        yield "", f"... and {len(found.outside) - _SHOWN:,} more", "bold red"


def _hit_text(found: "PathCheck", hit: Any) -> str:
    return f"{hit.obstacle}, {100 * hit.part:.4g} % along, at {_text(found, hit.q)}"


def _text(found: "PathCheck", q: tuple[float, ...]) -> str:
    lower, upper = found.robot.bounds(found.world)
    return f"({join_numbers(q, digits_within(lower, upper))})"


def _degrees(angle: float) -> str:
    from math import degrees

    return f"{degrees(angle):.4g} deg"


def _verdict(found: "PathCheck") -> str:
    """Return the last line: what is wrong, or that nothing is."""
    motions = counted(len(found.lengths), "motion")
    wrong = []
    if found.hits:
        wrong.append(f"{len(found.hits):,} of {motions} hit something")
    if found.outside:
        wrong.append(f"{counted(len(found.outside), 'coordinate')} out of bounds or limits")
    wrong += [f"the {end.name} differs" for end in found.ends if not end.equal]
    return (
        f"the path does not hold: {', '.join(wrong)}"
        if wrong
        else f"the path holds: {motions} free"
    )
