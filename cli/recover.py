"""`brrt recover`: a whole file out of one that was cut or damaged."""

from pathlib import Path
from typing import Annotated

import typer

from .console import counted, out


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

    brrt recover cut.mcap --out whole.mcap

    brrt recover cut.rrd --out whole.rrd

    brrt recover cut.mcap --out whole.rrd
    """
    from brrt.recording.recover import recover  # noqa: PLC0415 - keep --help fast

    from .outputs import check_output  # noqa: PLC0415

    check_output(whole, "--out", (".mcap", ".rrd"), force=force)
    found = recover(cut, whole)
    events = f"{counted(found.events, 'event')} up to {found.until_s:.6f} s"
    if found.lost is None:
        text = f"{cut} is whole: {whole} holds its {events}"
    elif found.ended:
        text = f"{found.lost}; {whole} holds all of the run: {events}"
    elif found.events:
        text = f"{found.lost}; {whole} holds what is whole: {events}; what came later is lost"
    else:
        text = f"{found.lost}; {whole} holds the problem alone: no event is whole"
    out.print(text, markup=False, soft_wrap=True)
