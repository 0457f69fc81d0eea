"""The arguments and options that several commands share."""

import re
from pathlib import Path
from typing import Annotated

import typer

Run = Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.")]
At = Annotated[
    str | None,
    typer.Option(
        help="The run after this time, such as 1.5s, 20ms or 300us.",
        metavar="TIME",
        rich_help_panel="Instant",
    ),
]
AtEvent = Annotated[
    int | None,
    typer.Option(help="The run after the event of this number.", rich_help_panel="Instant"),
]
AtIteration = Annotated[
    int | None, typer.Option(help="The run after this iteration.", rich_help_panel="Instant")
]
Partial = Annotated[
    bool,
    typer.Option(
        "--partial", help="Accept a cut or damaged file, and take the events before the fault."
    ),
]
Accepted = Annotated[bool, typer.Option("--partial", hidden=True)]
"""`--partial` for commands that take cut and damaged files without it."""
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")]


def instant(at: str | None, event: int | None, iteration: int | None) -> dict[str, int]:
    """Return the instant that the three options name, as `Events.until` takes it.

    Raises:
        BrrtError: More than one option is given, or a value is not a time or number from 0 on.
    """
    from brrt import recording
    from brrt.errors import BrrtError

    if sum(value is not None for value in (at, event, iteration)) > 1:
        raise BrrtError("give one of --at, --at-event and --at-iteration")
    if any(value is not None and value < 0 for value in (event, iteration)):
        raise BrrtError("--at-event and --at-iteration count from 0")
    time = None if at is None else _seconds(at)
    return recording.instant(time=time, event=event, iteration=iteration)


def _seconds(text: str) -> float:
    from brrt.errors import BrrtError

    match = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*(s|ms|us|ns)?", text.strip())
    if match is None:
        raise BrrtError(f"--at must be a time such as 1.5s, 20ms or 300us, not {text!r}")
    return float(match[1]) * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[match[2] or "s"]
