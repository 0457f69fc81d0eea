"""`brrt replay`: the metrics and the trees of a run, from its recording alone."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import Code, print_json, print_line, print_lines, print_rows
from .options import At, AtEvent, AtIteration, Force, Partial, Run, instant

if TYPE_CHECKING:
    from brrt.comparison.difference import Difference
    from brrt.recording import Limits, Recording
    from brrt.replay.tree_stats import TreeFigures

_EVENTS_BEFORE = 3
"""Events that are printed before a difference; `brrt diff` prints more."""


def replay(
    run: Run,
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    node: Annotated[
        int | None,
        typer.Option(
            help="Print the history of this node: birth, rewires, descendants, rejected "
            "extensions; of a lattice planner, of this cell.",
        ),
    ] = None,
    tree: Annotated[
        str | None,
        typer.Option(
            help="The tree of --node: start (the default), goal, or a number.", metavar="TREE"
        ),
    ] = None,
    check: Annotated[
        Path | None,
        typer.Option(
            help="Compare with another recording, event by event without times; exit code 1 if "
            "they differ.",
            metavar="GOLDEN",
        ),
    ] = None,
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording of the run.")] = None,
    force: Force = False,
    partial: Partial = False,
    text: Annotated[
        bool,
        typer.Option(
            "--text", help="Print a transcript without times, which is equal on every machine."
        ),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, the same as plan --json.")
    ] = False,
) -> None:
    """Rebuild the metrics and the trees of a run from its recording.

    With --at-event, the event and those before it are printed as well.

    A cut or damaged file is replayed up to the fault, which is reported on stderr; --check
    refuses it unless --partial is given.

    Examples:
      brrt replay run.mcap
      brrt replay run.mcap --at 20ms
      brrt replay run.mcap --at-event 403
      brrt replay run.mcap --text
      brrt replay run.mcap --check recordings/circles2d-rrt.mcap
      brrt replay run.mcap --at-iteration 400 --rrd first400.rrd
      brrt replay run.mcap --node 80 --at-iteration 400
    """
    from .output_file import check_output
    from .run_file import open_run

    check_output(rrd, "--rrd", ".rrd", force=force)
    _check_together(
        text_and_json=text and as_json,
        lone_tree=tree is not None and node is None,
        node_and_more=node is not None and bool(text or check or rrd),
    )
    limits = instant(at, at_event, at_iteration)
    recording = open_run(run, limits, partial=partial or check is None, watched=not text)
    if node is not None:
        from .node import print_node, tree_number

        print_node(recording, limits, node, tree_number(tree), as_json=as_json)
        return
    if rrd is not None:
        _draw(recording, limits, rrd)
    golden = None if check is None else open_run(check, partial=partial)
    first = None if golden is None else _first_difference(recording, golden)
    if as_json:
        verdict = {"check": {"equal": first is None, "first": first and str(first)}}
        print_json({**_metrics(recording, limits), **({} if golden is None else verdict)})
        raise typer.Exit(Code.FAILED if first else Code.DONE)
    if text:
        _print_transcript(recording, limits)
    else:
        _print_metrics(recording, limits, events=at_event is not None)
    if golden is not None:
        print_lines(_verdict((str(run), str(check)), (recording, golden), first))
    raise typer.Exit(Code.FAILED if first else Code.DONE)


def _check_together(*, text_and_json: bool, lone_tree: bool, node_and_more: bool) -> None:
    """Raise if options exclude each other.

    Raises:
        BrrtError: They do.
    """
    from brrt.errors import BrrtError

    if text_and_json:
        raise BrrtError("give one of --text and --json")
    if lone_tree:
        raise BrrtError("--tree names the tree of a node; add --node NUMBER")
    if node_and_more:
        raise BrrtError("--node excludes --text, --check and --rrd")


def _draw(recording: "Recording", limits: "Limits", rrd: Path) -> None:
    from brrt.files import replacing
    from brrt.replay.fold import feed
    from brrt.views.rerun.sink import RerunSink

    with replacing(rrd) as unfinished:
        sink = RerunSink(recording.manifest, recording.world, path=unfinished)
        try:
            feed(recording.batches(), [sink], limits)
        finally:
            sink.close(None if limits else recording.result)


def _first_difference(recording: "Recording", golden: "Recording") -> "Difference | None":
    from brrt.comparison.events import first_difference

    return first_difference(recording.batches(), golden.batches())


def _metrics(recording: "Recording", limits: "Limits") -> dict[str, Any]:
    from brrt.replay.fold import feed
    from brrt.replay.metrics import Metrics

    metrics = Metrics(recording.manifest)
    feed(recording.batches(), [metrics], limits)
    return metrics.as_dict()


def _print_transcript(recording: "Recording", limits: "Limits") -> None:
    from brrt.replay.fold import feed
    from brrt.replay.transcript import Transcript

    transcript = Transcript(recording.manifest, recording.robot(), recording.world)
    feed(recording.batches(), [transcript], limits)
    print_lines(transcript.lines())


def _print_metrics(recording: "Recording", limits: "Limits", *, events: bool) -> None:
    """Print the metrics and a line for each tree, and the last events if asked for."""
    from brrt.comparison.difference import event_lines
    from brrt.comparison.events import RecentEvents
    from brrt.replay.fold import feed
    from brrt.replay.metrics import Metrics
    from brrt.replay.tree_stats import TreeStats
    from brrt.scenario.contracts import origins_of

    from .summary import print_summary

    trees = TreeStats(recording.robot().distance)
    metrics, recent = Metrics(recording.manifest), RecentEvents()
    feed(recording.batches(), [metrics, trees, *([recent] if events else [])], limits)
    rows = list(_rows_of(trees.figures()))  # raises if the events do not make trees
    print_summary(metrics.as_dict(), origins_of(recording.manifest))
    if rows:
        print_line()
        print_rows(rows)
    if events:
        print_lines(event_lines(recent.before(recent.next)))


def _rows_of(trees: "list[TreeFigures]") -> Iterator[dict[str, str]]:
    """Yield the row of each tree, with its links if any tree has some."""
    for tree in trees:
        links = {"links": f"{tree.links:,}"} if any(each.links for each in trees) else {}
        cost = f"{tree.greatest_cost:.6g}" if tree.greatest_cost > -math.inf else "none"
        yield {
            "tree": str(tree.tree),
            "nodes": f"{tree.nodes:,}",
            **links,
            "leaves": f"{tree.leaves:,}",
            "depth": f"{tree.depth:,}",
            "greatest cost-to-come": cost,
        }


def _verdict(
    names: tuple[str, str],
    recordings: "tuple[Recording, Recording]",
    first: "Difference | None",
) -> Iterator[str]:
    """Describe whether two runs are equal, and if not, their first difference."""
    from dataclasses import replace

    a, b = (
        f"{name} (seed {each.manifest.scenario.seed})"
        for name, each in zip(names, recordings, strict=True)
    )
    yield ""
    if first is None:
        yield f"{a} and {b} are equal, event by event"
        return
    yield from (f"A  {a}", f"B  {b}")
    shown = replace(first, before=first.before[-_EVENTS_BEFORE:])
    cut = (recordings[0].result is None, recordings[1].result is None)
    yield from shown.lines(("A", "B"), cut)
