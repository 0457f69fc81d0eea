"""`brrt replay`: a run's figures and trees, from its recording alone."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import Code, note, out, print_json, print_lines, print_rows, print_summary
from .instants import At, AtEvent, AtIteration, Counted, beyond, instant
from .node import show_node, tree_number
from .saved import Saved, opened

if TYPE_CHECKING:
    from brrt.comparison.difference import Difference
    from brrt.events import Instant
    from brrt.recording import Recording
    from brrt.replay.tree_stats import TreeFigures

_VERB = "replay them"
_FEW = 3
"""Events that are told ahead of the one that --check finds; `brrt diff` has more of them."""


def replay(
    run: Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.")],
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    node: Annotated[
        int | None,
        typer.Option(
            help="Tell what became of this node: born, rewired, its descendants, what was "
            "rejected; with a planner on a lattice, of this cell.",
        ),
    ] = None,
    tree: Annotated[
        str | None,
        typer.Option(help="The node's tree: start (default), goal, or its number.", metavar="TREE"),
    ] = None,
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
        bool, typer.Option("--partial", help="Take what is whole of a cut or damaged file.")
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

    With --at-event the event itself is told as well, and the ones ahead of it.

    brrt replay run.mcap

    brrt replay run.mcap --at 20ms

    brrt replay run.mcap --at-event 403

    brrt replay run.mcap --text

    brrt replay run.mcap --check recordings/circles2d-rrt.mcap

    brrt replay run.mcap --at-iteration 400 --rrd first400.rrd

    brrt replay run.mcap --node 80 --at-iteration 400
    """
    from brrt.comparison.difference import event_lines  # noqa: PLC0415
    from brrt.comparison.events import RecentEvents  # noqa: PLC0415
    from brrt.replay.fold import feed  # noqa: PLC0415
    from brrt.replay.metrics import Metrics  # noqa: PLC0415
    from brrt.replay.transcript import Transcript  # noqa: PLC0415
    from brrt.replay.tree_stats import TreeStats  # noqa: PLC0415
    from brrt.scenario.contracts import origins_of  # noqa: PLC0415

    from .outputs import check_output  # noqa: PLC0415

    check_output(rrd, "--rrd", ".rrd", force=force)
    _check_together(
        text_and_json=text and as_json,
        lone_tree=tree is not None and node is None,
        node_and_more=node is not None and bool(text or check or rrd),
    )
    limits = instant(at, at_event, at_iteration)
    number = tree_number(tree)
    recording = opened(run, partial=partial)
    if node is not None:
        _tell_of(node, number, recording, limits, partial=partial, as_json=as_json)
        return
    metrics = Metrics(recording.manifest)
    trees = TreeStats(recording.robot().distance)
    recent = [] if at_event is None else [RecentEvents()]
    told = Transcript(recording.manifest, recording.robot()) if text else None
    folds: list[Any] = [told] if told else [] if as_json else [trees, *recent]
    end = feed(Saved(recording, partial=partial, verb=_VERB), [metrics, *folds], limits)
    if end is not None:
        _note_end(limits, *end)
    if rrd is not None:
        _draw(recording, rrd, limits, partial=partial)
    golden = None if check is None else opened(check, partial=False)
    first = None if golden is None else _difference(recording, golden, partial=partial)
    figures = metrics.as_dict()
    if as_json:
        verdict = {"equal": first is None, "first": None if first is None else str(first)}
        print_json(figures if check is None else {**figures, "check": verdict})
    elif told is None:
        grown = trees.figures()  # where they are no trees, nothing is told of the run
        print_summary(figures, origins_of(recording.manifest))
        _show_trees(grown)
        for each in recent:
            print_lines(event_lines(each.before(each.next)))
    else:
        print_lines(told.lines())
    if golden is not None and not as_json:
        print_lines(_verdict((str(run), str(check)), (recording, golden), first))
    raise typer.Exit(Code.FAILED if first is not None else Code.DONE)


def _check_together(*, text_and_json: bool, lone_tree: bool, node_and_more: bool) -> None:
    """See that the options go together.

    Raises:
        BrrtError: They do not.
    """
    from brrt.errors import BrrtError  # noqa: PLC0415

    if text_and_json:
        raise BrrtError("give one of --text and --json")
    if lone_tree:
        raise BrrtError("--tree is that of a node; add --node NUMBER")
    if node_and_more:
        raise BrrtError("--node goes with --at, --tree and --json alone")


def _note_end(limits: dict[str, int], count: int, last: "Instant") -> None:
    late = beyond(limits, count, last)
    if late is not None:
        note(f"{late}; this is how it stood then")


def _draw(recording: "Recording", rrd: Path, limits: dict[str, int], *, partial: bool) -> None:
    from brrt.replay.fold import feed  # noqa: PLC0415
    from brrt.views.rerun.sink import RerunSink  # noqa: PLC0415 - costs half a second

    sink = RerunSink(recording.manifest, recording.world, path=rrd)
    try:
        feed(Saved(recording, partial=partial, verb=_VERB), [sink], limits)
    finally:
        sink.close(None if limits else recording.result)


def _tell_of(
    node: int,
    tree: int,
    recording: "Recording",
    limits: dict[str, int],
    *,
    partial: bool,
    as_json: bool,
) -> None:
    from dataclasses import replace  # noqa: PLC0415

    from brrt.replay.snapshot import Snapshot  # noqa: PLC0415

    batches = Counted(Saved(recording, partial=partial, verb=_VERB))
    moment = Snapshot(replace(recording, batches=lambda: iter(batches)), limits)
    show_node(moment, node, tree, as_json=as_json)
    _note_end(limits, batches.count, batches.last)


def _difference(
    recording: "Recording", golden: "Recording", *, partial: bool
) -> "Difference | None":
    from brrt.comparison.events import first_difference  # noqa: PLC0415

    return first_difference(
        Saved(recording, partial=partial, verb=_VERB),
        Saved(golden, partial=False, verb=_VERB),
    )


def _verdict(
    names: tuple[str, str],
    recordings: "tuple[Recording, Recording]",
    first: "Difference | None",
) -> Iterator[str]:
    """Say whether a run is what another one was, and if not, where they part."""
    from dataclasses import replace  # noqa: PLC0415

    a, b = (
        f"{name} (seed {each.manifest.scenario.seed})"
        for name, each in zip(names, recordings, strict=True)
    )
    yield ""
    if first is None:
        yield f"{a} and {b} are equal, event by event"
        return
    yield from (f"A  {a}", f"B  {b}")
    few = replace(first, before=first.before[-_FEW:])
    yield from few.lines(("A", "B"), (recordings[0].result is None, recordings[1].result is None))


def _show_trees(trees: "list[TreeFigures]") -> None:
    """Print a line a tree."""
    rows = [
        {
            "tree": str(tree.tree),
            "nodes": f"{tree.nodes:,}",
            "leaves": f"{tree.leaves:,}",
            "depth": f"{tree.depth:,}",
            "greatest cost-to-come": f"{tree.greatest_cost:.6g}",
        }
        for tree in trees
    ]
    if rows:
        out.print()
        print_rows(rows)
