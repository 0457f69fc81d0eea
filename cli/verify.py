"""`brrt verify`: whether a recording keeps what its planner promises."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from textwrap import TextWrapper
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brrt.shell import file_word, join

from .console import Code, announce_compilation, note, print_json, print_line, print_lines
from .options import Force, Json
from .progress import ProgressBar

if TYPE_CHECKING:
    from brrt.recording import Recording
    from brrt.runs.reproduce import Reproduction
    from brrt.verification.result import RuleResult
    from brrt.verification.verification import Verification

_SHOWN, _NAMED = 3, 6
"""Findings of a rule, and rules for each reason not to judge, that are printed without `--long`."""
_WIDTH = 80


_ALONE = "A path alone"


def verify(
    run: Annotated[
        Path | None, typer.Argument(help="A recording, .mcap or .rrd.", show_default=False)
    ] = None,
    as_json: Json = False,
    partial: Annotated[
        bool,
        typer.Option(
            "--partial",
            help="Judge a cut or damaged file up to the fault; the run's end is not judged.",
        ),
    ] = False,
    rerun: Annotated[
        bool,
        typer.Option(
            "--rerun",
            help="Also plan the run again, by the recorded scenario, and compare event by event.",
        ),
    ] = False,
    tolerance: Annotated[
        float | None,
        typer.Option(
            help="With --rerun: by how much numbers may differ, relative to the greater one, or "
            "to 1 if both are less. Default 1e-9; 0 compares every bit. With --path: how far its "
            "ends may be from start and goal. Default 0.",
        ),
    ] = None,
    long: Annotated[
        bool,
        typer.Option(
            "--long",
            help="Print each promise in full, and the names of all rules that could not judge.",
        ),
    ] = False,
    path: Annotated[
        Path | None,
        typer.Option(
            help="Judge a path instead of a recording: a .csv, .txt, .json or .npy file with one "
            "configuration a row, columns by name or in the robot's order.",
            rich_help_panel=_ALONE,
        ),
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(help="The world that it leads through, as in plan.", rich_help_panel=_ALONE),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(help="The robot, as in plan. Default point.", rich_help_panel=_ALONE),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(help="Where it must begin.", metavar="X,Y[,Z]", rich_help_panel=_ALONE),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(help="Where it must end.", metavar="X,Y[,Z]", rich_help_panel=_ALONE),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Draw it into a .png, .svg or .pdf file.", rich_help_panel=_ALONE
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Check whether a recording keeps what its planner promises, or a path is free.

    The rules share no code with the planners. Exit code 0: all rules hold; 1:
    one is broken. Tests of whether draws are uniform, and as biased as stated,
    falsely accuse at most one recording in a million.

    brrt verify run.mcap

    brrt verify run.mcap --long

    brrt verify run.mcap --rerun

    brrt verify --path path.csv --world map.yaml --robot lorry.json
    """
    from brrt.errors import BrrtError

    alone = {"--world": world, "--robot": robot, "--start": start, "--goal": goal, "--out": picture}
    of_run = {"a recording": run, "--partial": partial, "--rerun": rerun, "--long": long}
    _check_fit(path, alone, of_run)
    if tolerance is not None and (not (rerun or path) or not tolerance >= 0):
        raise BrrtError("--tolerance must be a number from 0 on, and needs --rerun or --path")
    if path is not None:
        from .path import judge_path

        ends = {"start": start, "goal": goal}
        judge_path(
            path, world, robot or "point", ends, tolerance, picture, force=force, as_json=as_json
        )
        return
    if run is None:
        raise BrrtError("name a recording, or a path with --path path.csv --world map.yaml")
    from brrt.verification.verification import verify

    from .run_file import open_run

    recording = open_run(run, partial=partial)
    if partial and _lacks_events(recording):
        recording = replace(recording, result=None)
    with _naming(run), ProgressBar(None, "judging").running():
        found = verify(recording)
    again = _reproduced(recording, tolerance) if rerun else None
    _note_differences(recording)
    if as_json:
        print_json(
            {
                "holds": found.holds,
                "planner_known": found.has_contract,
                "cut": found.is_cut,
                "events": found.events,
                "rules": [_json(run, result) for result in found.results],
                "not_judged": found.not_judged,
                "has_tree": found.has_tree,
                **({} if again is None else {"rerun": again.as_dict()}),
            }
        )
    else:
        if found.is_cut:
            note(f"{run} lacks the run's end, which is not judged")
        _show(run, found, long=long)
        if again is not None:
            _show_again(again)
    if not found.holds or (again is not None and not again.equal):
        raise typer.Exit(Code.FAILED)


def _check_fit(path: Path | None, alone: Mapping[str, Any], of_run: Mapping[str, Any]) -> None:
    """Check that only options are given that go with a path, or with a recording.

    Raises:
        BrrtError: An option is given that does not.
    """
    from brrt.errors import BrrtError

    for name, value in (alone if path is None else of_run).items():
        if value:
            side = "needs --path" if path is None else "does not go with --path"
            raise BrrtError(f"{name} {side}; leave it out or see brrt verify --help")


@contextmanager
def _naming(run: Path) -> Iterator[None]:
    """Let errors name the recording."""
    from brrt.errors import BrrtError, RecordingError

    try:
        yield
    except RecordingError:
        raise  # it does
    except BrrtError as error:
        raise BrrtError(f"{run}: {error}") from None


def _lacks_events(recording: "Recording") -> bool:
    """Whether fewer events can be read than the metrics at the end state."""
    stated: int = (recording.result or {}).get("events", 0)
    return sum(map(len, recording.batches())) < stated


def _note_differences(recording: "Recording") -> None:
    """Note where another version's planner stated another contract; no rule judges that."""
    from brrt.scenario.contracts import contract_differences
    from brrt.verification.rules.log import same_version

    manifest = recording.manifest
    if not same_version(manifest):
        made_by = manifest.made_by.get("brrt", "of unknown version")
        for difference in contract_differences(manifest, recording.world) or ():
            note(f"the contract is that of brrt {made_by}: {difference}")


def _reproduced(recording: "Recording", tolerance: float | None) -> "Reproduction":
    """Plan the run again, with a progress bar."""
    from brrt.runs.reproduce import TOLERANCE, reproduce

    def watch(done: int, total: int) -> None:
        bar.total = total
        bar.update(done, "planning again", f"{done:,} of {total:,} events")

    announce_compilation()
    with ProgressBar(None, "preparing the planner").running() as bar:
        return reproduce(
            recording, tolerance=TOLERANCE if tolerance is None else tolerance, watch=watch
        )


def _show_again(again: "Reproduction") -> None:
    """Print what differs, and in the last line, or the only one, whether the events are equal."""
    *details, verdict = again.lines()
    print_lines(details)
    print_line(verdict, style="bold green" if again.equal else "")


def _view(run: Path, seq: int) -> str:
    """Return the command that shows an event; for the recording as a whole, its end."""
    at = ["--at-event", str(seq)] if seq >= 0 else []
    return join(["brrt", "view", file_word(run), *at])


def _json(run: Path, result: "RuleResult") -> dict[str, Any]:
    findings = [
        {"seq": each.seq, "t": each.t, "message": each.message, "view": _view(run, each.seq)}
        for each in result.findings
    ]
    return {**asdict(result), "findings": findings}


def _show(run: Path, found: "Verification", *, long: bool) -> None:
    """Print a line for each rule that had something to judge, broken ones first."""
    judged = sorted((r for r in found.results if r.examined), key=lambda result: not result.broken)
    name = max((len(result.rule) for result in judged), default=0)
    count = max((len(f"{result.examined:,}") for result in judged), default=0)
    for result in judged:
        times = "once" if result.broken == 1 else f"{result.broken:,} times"
        verdict = f"BROKEN {times}" if result.broken else "holds"
        line = f"{result.rule:{name}}  {result.examined:>{count},}  {verdict:6}"
        promise = "" if long or result.broken else _short(result.promise, _WIDTH - len(line) - 2)
        print_line(f"{line}  {promise}".rstrip(), style="bold red" if result.broken else "")
        if long or result.broken:
            _print_wrapped(result.promise, style="dim")
        _show_findings(run, result)
    for reason, names in found.not_judged.items():
        few = long or len(names) <= _NAMED
        listed = ", ".join(names) if few else f"{len(names)} rules, which --long names"
        _print_wrapped(f"not judged, {reason}: {listed}", indent="")
    green = "bold green" if found.has_tree else ""
    _print_wrapped(
        _total(len(judged), found), indent="", style=green if found.holds else "bold red"
    )


def _total(judged: int, found: "Verification") -> str:
    if found.not_judged or not found.has_tree:
        return found.summary
    broken = sum(bool(result.broken) for result in found.results)
    return f"{judged} rules, {broken} broken" if broken else f"all {judged} rules hold"


def _show_findings(run: Path, result: "RuleResult") -> None:
    for finding in result.findings[:_SHOWN]:
        event = f"event {finding.seq:,} at {finding.t / 1e9:.6f} s"
        _print_wrapped(f"{event if finding.seq >= 0 else 'log'}: {finding.message}")
    if result.broken > _SHOWN:
        print_line(f"  ... and {result.broken - _SHOWN:,} more")
    if result.findings:
        print_line(f"  view: {_view(run, result.findings[0].seq)}")


def _print_wrapped(text: str, *, indent: str = "  ", style: str = "") -> None:
    """Print a sentence, no wider than a terminal."""
    wrapper = TextWrapper(
        _WIDTH, indent, f"{indent}  ", break_long_words=False, break_on_hyphens=False
    )
    for line in wrapper.wrap(text):
        print_line(line, style=style)


def _short(promise: str, room: int) -> str:
    """Cut a promise at a word, so that its line is no longer than a terminal."""
    if len(promise) <= room:
        return promise
    return promise[: room - 3].rpartition(" ")[0].rstrip(",;:. ") + " ..."
