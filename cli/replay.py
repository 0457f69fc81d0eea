"""`brrt replay`: a run's figures and trees, from its recording alone."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import Code, note, out, print_json, print_lines, print_rows, print_summary
from .instants import At, AtEvent, AtIteration, beyond, feed, instant
from .saved import Saved

if TYPE_CHECKING:
    from brrt.events import Events
    from brrt.recording import Recording

_VERB = "replay them"


def replay(
    run: Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.")],
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    check: Annotated[
        Path | None,
        typer.Option(
            help="Compare with another recording, event by event without the times; "
            "exit 1 at the first difference.",
            metavar="GOLDEN",
        ),
    ] = None,
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording of it.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file.")] = False,
    partial: Annotated[
        bool, typer.Option("--partial", help="Take what is whole of a file that was cut.")
    ] = False,
    text: Annotated[
        bool,
        typer.Option(
            "--text", help="Tell the run in plain text without times: the same on every machine."
        ),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, as plan --json did.")
    ] = False,
) -> None:
    """Rebuild the trees and the figures of a run from its recording.

    brrt replay run.mcap

    brrt replay run.mcap --at 20ms

    brrt replay run.mcap --text

    brrt replay run.mcap --check recordings/circles2d-rrt.mcap

    brrt replay run.mcap --at-iteration 400 --rrd first400.rrd
    """
    from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast
    from brrt.recording import read  # noqa: PLC0415
    from brrt.replay.account import Account  # noqa: PLC0415
    from brrt.replay.metrics import Metrics  # noqa: PLC0415

    from .outputs import check_output  # noqa: PLC0415

    check_output(rrd, "--rrd", ".rrd", force=force)
    if text and as_json:
        raise BrrtError("give one of --text and --json")
    limits = instant(at, at_event, at_iteration)
    recording = read(run)
    metrics = Metrics(recording.manifest)
    trees = _Trees()
    told = Account(recording.manifest, recording.robot()) if text else None
    sinks: list[Any] = [metrics, *filter(None, [told])] if as_json or text else [metrics, trees]
    end = feed(Saved(recording, partial=partial, verb=_VERB), sinks, limits)
    if end is not None:
        late = beyond(limits, *end)
        if late is not None:
            note(f"{late}; this is how it stood then")
    if rrd is not None:
        from brrt.recording.rerun import RerunSink  # noqa: PLC0415 - costs half a second

        sink = RerunSink(recording.manifest, recording.world, path=rrd)
        try:
            feed(Saved(recording, partial=partial, verb=_VERB), [sink], limits)
        finally:
            sink.close(whole=recording.result is not None and not limits)
    golden = None if check is None else read(check)
    difference = None if golden is None else _difference(recording, golden, partial=partial)
    figures = metrics.as_dict()
    if as_json:
        verdict = {} if check is None else {"check": {"equal": not difference, "first": difference}}
        print_json({**figures, **verdict})
    else:
        if told is None:
            print_summary(figures)
            trees.show()
        else:
            print_lines(told.lines())
        if golden is not None:
            seeds = [each.manifest.scenario.seed for each in (recording, golden)]
            against = f"{run} (seed {seeds[0]}) and {check} (seed {seeds[1]})"
            outcome = f"part at {difference}" if difference else "are equal, event by event"
            out.print(f"{against} {outcome}", markup=False, soft_wrap=True)
    if difference:
        raise typer.Exit(Code.FAILED)


def _difference(recording: "Recording", golden: "Recording", *, partial: bool) -> str | None:
    from brrt.replay.diff import first_difference  # noqa: PLC0415

    found = first_difference(
        Saved(recording, partial=partial, verb=_VERB),
        Saved(golden, partial=False, verb=_VERB),
    )
    return None if found is None else str(found)


class _Trees:
    """Gathers what the forest is rebuilt from."""

    def __init__(self) -> None:
        self._batches: list[Events] = []
        self._dof = 0

    def write(self, events: "Events") -> None:
        """Keep the edges and rewires."""
        from brrt.events import Events, Kind  # noqa: PLC0415

        self._dof = events.dof
        kept = {k: t for k in (Kind.EDGE, Kind.REWIRE) if len(t := events[k])}
        if kept:
            self._batches.append(Events(events.dof, kept))

    def show(self) -> None:
        """Print a line a tree."""
        from brrt.events import Events  # noqa: PLC0415
        from brrt.replay.forest import forest  # noqa: PLC0415

        trees = forest(Events.concat(self._dof, self._batches))
        rows = [
            {
                "tree": str(number),
                "nodes": f"{len(tree):,}",
                "leaves": f"{tree.leaves:,}",
                "depth": f"{tree.depth:,}",
                "greatest cost-to-come": f"{tree.cost.max():.6g}",
            }
            for number, tree in trees.items()
        ]
        if rows:
            out.print()
            print_rows(rows)
