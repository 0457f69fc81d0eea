"""`brrt verify`: whether a recording keeps what its planner promises."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from textwrap import TextWrapper
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import Code, announce_compilation, note, print_json, print_line, print_lines
from .options import Json, Run
from .progress import ProgressBar

if TYPE_CHECKING:
    from brrt.events import Events
    from brrt.recording import Recording
    from brrt.runs.reproduce import Reproduction
    from brrt.verification import RuleResult

_SHOWN = 3
_WIDTH = 80


def verify(
    run: Run,
    as_json: Json = False,
    partial: Annotated[
        bool,
        typer.Option(
            "--partial",
            help="Judge what is whole of a cut or damaged file; what is promised of a run's end "
            "is left out.",
        ),
    ] = False,
    rerun: Annotated[
        bool,
        typer.Option(
            "--rerun",
            help="Plan the run again as well, from what the recording says of it, and compare "
            "event by event.",
        ),
    ] = False,
    tolerance: Annotated[
        float | None,
        typer.Option(
            help="With --rerun: how far apart numbers may be, relative to the greater one, and "
            "to 1 below that. Default 1e-9; 0 wants every bit.",
        ),
    ] = None,
    long: Annotated[
        bool, typer.Option("--long", help="Write each promise out in full, below its rule.")
    ] = False,
) -> None:
    """Hold a recording to what its planner promises, by code that is not the planner's.

    Exit code 0: every promise is kept; 1: one is broken. Whether draws are as
    even and as biased as stated is judged by tests that wrong one sound
    recording in a million at most.

    brrt verify run.mcap

    brrt verify run.mcap --long

    brrt verify run.mcap --rerun
    """
    from brrt.errors import BrrtError
    from brrt.scenario.contracts import contracts_of

    from .run_file import open_run

    if tolerance is not None and (not rerun or not tolerance >= 0):
        raise BrrtError("--tolerance must be a number from 0 on, and goes with --rerun alone")
    recording = open_run(run, partial=partial)
    planner = recording.manifest.scenario.planner
    results, events, cut = _examine(recording, partial=partial)
    broken = sum(result.broken for result in results)
    known = contracts_of(recording.manifest, recording.world)[-1] is not None
    again = _reproduced(recording, tolerance) if rerun else None
    _note_differences(recording)
    if as_json:
        print_json(
            {
                "holds": not broken,
                "planner_known": known,
                "cut": cut,
                "events": events,
                "rules": _json(run, results),
                **({} if again is None else {"rerun": again.as_dict()}),
            }
        )
    else:
        if cut:
            note(f"{run} breaks off; what is promised of a run's end was left out")
        if not known:
            note(
                f"planner {planner} is not registered and the recording states no contract; only "
                "what all planners promise was checked"
            )
        _show(run, results, long=long)
        if again is not None:
            _show_again(again)
    if broken or (again is not None and not again.equal):
        raise typer.Exit(Code.FAILED)


def _note_differences(recording: "Recording") -> None:
    """Note where another version's planner stated another contract; no rule judges that."""
    from brrt.scenario.contracts import contract_differences
    from brrt.verification.rules.contracts import same_version

    manifest = recording.manifest
    if not same_version(manifest):
        made_by = manifest.made_by.get("brrt", "of unknown version")
        for difference in contract_differences(manifest, recording.world) or ():
            note(f"the contract is that of brrt {made_by}: {difference}")


def _examine(recording: "Recording", *, partial: bool) -> "tuple[list[RuleResult], int, bool]":
    """Return what each rule found, the number of events, and whether the run's end is missing."""
    from brrt.verification import examine

    count = 0

    def batches() -> "Iterator[Events]":
        nonlocal count
        for batch in recording.batches():
            count += len(batch)
            yield batch

    def is_cut() -> bool:
        if recording.result is None:  # as in a file that brrt recover made, though it is whole
            return True
        return partial and count < recording.result["events"]

    results = examine(
        recording.manifest, recording.world, batches(), cut=is_cut, figures=recording.result
    )
    return results, count, is_cut()


def _reproduced(recording: "Recording", tolerance: float | None) -> "Reproduction":
    """Plan the run again, with a progress bar."""
    from brrt.runs.reproduce import TOLERANCE, reproduce

    def watch(done: int, total: int) -> None:
        bar.total = total
        bar.update(done, "planning again", f"{done:,} of {total:,} events")

    announce_compilation()
    with ProgressBar(None, "preparing the planner").running() as bar:
        return reproduce(
            recording,
            tolerance=TOLERANCE if tolerance is None else tolerance,
            watch=watch,
        )


def _show_again(again: "Reproduction") -> None:
    """Print what differs, and in the last line, or the only one, whether the events are equal."""
    *details, verdict = again.lines()
    print_lines(details)
    style = "bold green" if again.equal else ""
    print_line(verdict, style=style)


def _look(run: Path, seq: int) -> str:
    """Say how to look at an event; at the log as a whole, how to look at its end."""
    at = ["--at-event", str(seq)] if seq >= 0 else []
    return shlex.join(["brrt", "view", str(run), *at])


def _json(run: Path, results: "list[RuleResult]") -> list[dict[str, Any]]:
    return [
        {
            "rule": result.rule,
            "promise": result.promise,
            "examined": result.examined,
            "broken": result.broken,
            "findings": [
                {
                    "seq": found.seq,
                    "t": found.t,
                    "message": found.message,
                    "view": _look(run, found.seq),
                }
                for found in result.findings
            ],
        }
        for result in results
    ]


def _show(run: Path, results: "list[RuleResult]", *, long: bool) -> None:
    """Print a line a rule that had anything to look at, broken ones first with what they found."""
    looked = sorted((t for t in results if t.examined), key=lambda result: not result.broken)
    name = max((len(result.rule) for result in looked), default=0)
    count = max((len(f"{result.examined:,}") for result in looked), default=0)
    for result in looked:
        times = "once" if result.broken == 1 else f"{result.broken:,} times"
        verdict = f"BROKEN {times}" if result.broken else "holds"
        line = f"{result.rule:{name}}  {result.examined:>{count},}  {verdict:6}"
        promise = "" if long or result.broken else _short(result.promise, _WIDTH - len(line) - 2)
        print_line(f"{line}  {promise}".rstrip(), style=_style(result))
        if long or result.broken:
            _tell(result.promise, style="dim")
        for found in result.findings[:_SHOWN]:
            where = "log" if found.seq < 0 else f"event {found.seq:,} at {found.t / 1e9:.6f} s"
            _tell(f"{where}: {found.message}")
        if result.broken > _SHOWN:
            print_line(f"  ... and {result.broken - _SHOWN:,} more")
        if result.findings:
            first = _look(run, result.findings[0].seq)
            print_line(f"  look: {first}")
    broken = sum(bool(result.broken) for result in looked)
    total = f"{len(looked)} rules, {broken} broken" if broken else f"all {len(looked)} rules hold"
    print_line(total, style="bold red" if broken else "bold green")


def _tell(text: str, style: str = "") -> None:
    """Print a sentence below its rule, no wider than a terminal."""
    whole = TextWrapper(_WIDTH, "  ", "    ", break_long_words=False, break_on_hyphens=False)
    for line in whole.wrap(text):
        print_line(line, style=style)


def _style(result: "RuleResult") -> str:
    return "bold red" if result.broken else ""


def _short(promise: str, room: int) -> str:
    """Cut a promise at a word, so that its line is no longer than a terminal."""
    if len(promise) <= room:
        return promise
    return promise[: room - 3].rpartition(" ")[0].rstrip(",;:") + " ..."
