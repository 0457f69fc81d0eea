"""`brrt verify`: whether a recording keeps what its planner promises."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import Code, note, out, print_json, print_rows

if TYPE_CHECKING:
    from brrt.replay.checks import Tally

_SHOWN = 10


def verify(
    run: Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.")],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the table.")
    ] = False,
) -> None:
    """Hold a recording to what its planner promises, by code that is not the planner's.

    Exit code 0: every promise is kept; 1: one is broken.

    brrt verify run.mcap
    """
    from brrt.planners import PLANNERS  # noqa: PLC0415 - keep --help fast
    from brrt.recording import read  # noqa: PLC0415
    from brrt.replay.checks import examine  # noqa: PLC0415

    recording = read(run)
    planner = recording.manifest.scenario.planner
    tallies = examine(recording.manifest, recording.world, recording.events())
    broken = sum(tally.broken for tally in tallies)
    if as_json:
        known = planner in PLANNERS
        print_json({"holds": not broken, "planner_known": known, "rules": _json(tallies)})
    else:
        if planner not in PLANNERS:
            note(f"planner {planner} is not known here; its special promises were not checked")
        _show(tallies)
    if broken:
        raise typer.Exit(Code.FAILED)


def _json(tallies: "list[Tally]") -> list[dict[str, Any]]:
    return [
        {
            "rule": tally.rule,
            "promise": tally.promise,
            "examined": tally.examined,
            "broken": tally.broken,
            "findings": [
                {"seq": found.seq, "t": found.t, "message": found.message}
                for found in tally.findings
            ],
        }
        for tally in tallies
    ]


def _show(tallies: "list[Tally]") -> None:
    """Print a line a rule that had anything to look at, then the first findings."""
    print_rows(
        [
            {
                "rule": tally.rule,
                "examined": f"{tally.examined:,}",
                "": f"{tally.broken:,} broken" if tally.broken else "holds",
                "promise": tally.promise,
            }
            for tally in tallies
            if tally.examined
        ]
    )
    findings = sorted((f for tally in tallies for f in tally.findings), key=lambda f: f.seq)
    if findings:
        out.print()
    for found in findings[:_SHOWN]:
        where = "log" if found.seq < 0 else f"event {found.seq:,} at {found.t / 1e9:.6f} s"
        out.print(f"{where}: {found.rule}: {found.message}", markup=False, soft_wrap=True)
    more = sum(tally.broken for tally in tallies) - min(len(findings), _SHOWN)
    if more:
        out.print(f"... and {more:,} more")
