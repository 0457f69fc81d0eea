"""The metrics of a run as `brrt plan` and `brrt replay` print them for people."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from brrt.events import COUNTS, Kind
from brrt.replay.text import counted, seconds

from .console import print_pairs

_STYLES = {"solved": "bold green", "not solved": "bold red"}


def print_summary(metrics: Mapping[str, Any], branches: Iterable[str] = ()) -> None:
    """Print the metrics of a run.

    Args:
        metrics: What `Metrics.as_dict` returns.
        branches: From what the run branched off, and what it changed there.
    """
    print_pairs(
        (name, text, _STYLES.get(text.split(",")[0], "") if name == "outcome" else "")
        for name, text in _rows(metrics, branches)
    )


def _rows(m: Mapping[str, Any], branches: Iterable[str]) -> Iterator[tuple[str, str]]:
    yield "run", f"{m['planner']} · {m['robot']} · {m['world']} · seed {m['seed']}"
    for branch in branches:
        yield "branched", f"from {branch}"
    yield "outcome", _outcome(m)
    time = "" if m["plan_time_s"] is None else f" in {seconds(m['plan_time_s'])}"
    made, draws = m.get("counted_iterations", m["iterations"]), m["iterations"]
    failed = "" if made == draws else f", {counted(draws, 'draw')}"
    yield "planned", f"{counted(made, 'iteration')}{failed}{time}"
    counts = ", ".join(
        count.text(m[count.key])
        for kind, count in COUNTS.items()
        if count.key and m[count.key] and kind is not Kind.SHORTCUT  # counted by "smoothed"
    )
    yield "events", ": ".join(filter(None, [f"{m['events']:,}", counts]))
    if m["path"] is not None:
        yield "path", _path(m)
    if m["smoothed_path"] is not None:
        yield "smoothed", _smoothed(m)
    if m["max_move_time_s"] is not None:
        slowest = f"the slowest planned in {seconds(m['max_move_time_s'])}"
        late = f"{m['deadline_misses'] or 'none'} late"
        yield "driven", f"{counted(m['moves'], 'move')}, {slowest}, {late}"
        if m["deadline_misses"]:
            charged = f"a classic run charges {counted(m['charged_moves'], 'move')}"
            yield "", f"the robot stayed for {counted(m['stays'], 'deadline')}; {charged}"


def _outcome(m: Mapping[str, Any]) -> str:
    """Describe whether there is a path, and what ended the run if that was not the path."""
    if m["status"] == "running":
        return f"{'solved' if m['solved'] else 'not solved yet'}, still planning at this point"
    if m["solved"]:
        return "solved" if m["status"] == "solved" else f"solved, ended by: {m['status']}"
    if m["status"] == "no path":
        return (
            "not solved, no path on the lattice; smaller cells (--param cell=) or "
            "a longer move to the goal (--param max_move=) may give one"
        )
    return f"not solved, {m['status']}"


def _path(m: Mapping[str, Any]) -> str:
    first = ""
    if m["first_path_cost"] != m["path_cost"]:
        first = f" (first: {m['first_path_cost']:.6g} after {seconds(m['first_path_s'])})"
    return f"cost {m['path_cost']:.6g}{first}, {counted(len(m['path']) - 1, 'motion')}"


def _smoothed(m: Mapping[str, Any]) -> str:
    saved = 1 - m["smoothed_cost"] / m["path_cost"] if m["path_cost"] else 0.0
    motions = counted(len(m["smoothed_path"]) - 1, "motion")
    effort = counted(m["shortcuts"], "attempt")
    if m["smooth_time_s"] is not None:  # None if the log does not hold the phase's begin
        effort += f" in {seconds(m['smooth_time_s'])}"
    return f"cost {m['smoothed_cost']:.6g} ({saved:.1%} less), {motions}, {effort}"
