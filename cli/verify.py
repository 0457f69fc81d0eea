"""`brrt verify`: whether a recording keeps what its planner promises."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import Code, note, out, print_json
from .saved import Saved

if TYPE_CHECKING:
    from brrt.replay.checks import Tally

_SHOWN = 3
_WIDTH = 80


def verify(
    run: Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.")],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the table.")
    ] = False,
    partial: Annotated[
        bool,
        typer.Option(
            "--partial",
            help="Judge what is whole of a file that was cut; what is promised of a run's end "
            "is left out.",
        ),
    ] = False,
    long: Annotated[
        bool, typer.Option("--long", help="Write each promise out in full, below its rule.")
    ] = False,
) -> None:
    """Hold a recording to what its planner promises, by code that is not the planner's.

    Exit code 0: every promise is kept; 1: one is broken. Whether draws are as even and as biased
    as stated is judged by tests that wrong one sound recording in a million at most.

    brrt verify run.mcap

    brrt verify run.mcap --long
    """
    from brrt.planners import PLANNERS  # noqa: PLC0415 - keep --help fast
    from brrt.recording import read  # noqa: PLC0415
    from brrt.replay.checks import examine  # noqa: PLC0415

    recording = read(run)
    planner = recording.manifest.scenario.planner
    saved = Saved(recording, partial=partial, verb="verify them")
    tallies = examine(recording.manifest, recording.world, saved, cut=lambda: saved.cut)
    broken = sum(tally.broken for tally in tallies)
    if as_json:
        known = planner in PLANNERS
        print_json(
            {
                "holds": not broken,
                "planner_known": known,
                "cut": saved.cut,
                "events": saved.events,
                "rules": _json(run, tallies),
            }
        )
    else:
        if planner not in PLANNERS:
            note(f"planner {planner} is not known here; its special promises were not checked")
        _show(run, tallies, long=long)
    if broken:
        raise typer.Exit(Code.FAILED)


def _look(run: Path, seq: int) -> str:
    """Say how to look at an event; at the log as a whole, how to look at its end."""
    at = ["--at-event", str(seq)] if seq >= 0 else []
    return shlex.join(["brrt", "view", str(run), *at])


def _json(run: Path, tallies: "list[Tally]") -> list[dict[str, Any]]:
    return [
        {
            "rule": tally.rule,
            "promise": tally.promise,
            "examined": tally.examined,
            "broken": tally.broken,
            "findings": [
                {
                    "seq": found.seq,
                    "t": found.t,
                    "message": found.message,
                    "view": _look(run, found.seq),
                }
                for found in tally.findings
            ],
        }
        for tally in tallies
    ]


def _show(run: Path, tallies: "list[Tally]", *, long: bool) -> None:
    """Print a line a rule that had anything to look at, broken ones first with what they found."""
    looked = sorted((t for t in tallies if t.examined), key=lambda tally: not tally.broken)
    name = max((len(tally.rule) for tally in looked), default=0)
    count = max((len(f"{tally.examined:,}") for tally in looked), default=0)
    for tally in looked:
        times = "once" if tally.broken == 1 else f"{tally.broken:,} times"
        verdict = f"BROKEN {times}" if tally.broken else "holds"
        line = f"{tally.rule:{name}}  {tally.examined:>{count},}  {verdict:6}"
        promise = "" if long or tally.broken else _short(tally.promise, _WIDTH - len(line) - 2)
        out.print(f"{line}  {promise}".rstrip(), style=_style(tally), markup=False, soft_wrap=True)
        if long or tally.broken:
            out.print(f"  {tally.promise}", style="dim", markup=False, soft_wrap=True)
        for found in tally.findings[:_SHOWN]:
            where = "log" if found.seq < 0 else f"event {found.seq:,} at {found.t / 1e9:.6f} s"
            out.print(f"  {where}: {found.message}", markup=False, soft_wrap=True)
        if tally.broken > _SHOWN:
            out.print(f"  ... and {tally.broken - _SHOWN:,} more")
        if tally.findings:
            first = _look(run, tally.findings[0].seq)
            out.print(f"  look: {first}", markup=False, soft_wrap=True)
    broken = sum(bool(tally.broken) for tally in looked)
    total = f"{len(looked)} rules, {broken} broken" if broken else f"all {len(looked)} rules hold"
    out.print(total, style="bold red" if broken else "bold green")


def _style(tally: "Tally") -> str:
    return "bold red" if tally.broken else ""


def _short(promise: str, room: int) -> str:
    """Cut a promise at a word, so that its line is no longer than a terminal."""
    if len(promise) <= room:
        return promise
    return promise[: room - 3].rpartition(" ")[0].rstrip(",;:") + " ..."
