"""`brrt recover`: a whole file out of one that was cut or damaged."""

from pathlib import Path
from typing import Annotated

import typer

from brrt.replay.text import counted

from .console import Code, out


def recover(
    cut: Annotated[
        Path, typer.Argument(help="A recording as it was left, .mcap or .rrd.", metavar="CUT")
    ],
    whole: Annotated[
        Path,
        typer.Option(
            "--out", help="Write what is whole of it here, .mcap or .rrd.", metavar="WHOLE"
        ),
    ],
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file.")] = False,
) -> None:
    """Make a whole file of a recording that was cut or damaged: by a kill, a full disk, a fault.

    Exit code 1: no event is whole, and the file holds the problem alone: world, start, goal and
    settings.

    brrt recover cut.mcap --out whole.mcap

    brrt recover cut.rrd --out whole.rrd

    brrt recover cut.mcap --out whole.rrd
    """
    from brrt.formats.recover import recover  # noqa: PLC0415 - keep --help fast

    from .outputs import check_output  # noqa: PLC0415

    check_output(whole, "--out", (".mcap", ".rrd"), force=force)
    found = recover(cut, whole)
    events = f"{counted(found.events, 'event')} up to {found.until_s:.6f} s"
    if found.lost is None:
        text = f"{cut} is whole: {whole} holds its {events}"
    elif found.complete:
        text = f"{found.lost}; no event is lost: {whole} holds all {events}"
    elif found.events:
        text = f"{found.lost}; {whole} holds what is whole: {events}; anything later is lost"
    else:
        text = f"{found.lost}; no event is whole: {whole} holds the problem alone"
    out.print(text, markup=False, soft_wrap=True)
    if not (found.events or found.complete):
        raise typer.Exit(Code.FAILED)
