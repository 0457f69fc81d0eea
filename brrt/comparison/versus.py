"""Two runs compared, wherever they are: in files, opened already, or in memory."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from brrt.comparison.comparison import Comparison, Side, compare_sides
from brrt.errors import BrrtError
from brrt.events import Events
from brrt.formats import read
from brrt.recording import Memory, Recording
from brrt.runs.run import Run
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World

Log = Memory | Events | Iterable[Events]
"""What a run has told: kept by `Memory`, as one log, or in batches."""

Comparable = Path | str | Recording | tuple[Run, Log] | tuple[Manifest, World, Log]
"""A file, an open recording, or a run in memory: the run with its log, or what is known of it."""


def compare(
    a: Comparable,
    b: Comparable,
    *,
    names: tuple[str, str] | None = None,
    tolerance: float = 0.0,
) -> Comparison:
    """Compare two runs; their events are read up to the first difference and no further.

    A run whose figures stand nowhere, as one in memory or in a file that was cut, is read to its
    end for them.

    Args:
        a: The first run: the name of a file, what `brrt.read` returns, or `(run, log)`, a run that
            was made and the `Memory` that was its sink.
        b: The second run.
        names: What they are called; by default files are called as they are.
        tolerance: How far apart the events' numbers may be; by default every bit counts. It is
            relative to the greater of the two, and to 1 where both are less.

    Raises:
        BrrtError: It is no run.
        RecordingError: A file cannot be read, or is cut or damaged ahead of the first difference.
    """
    called = names or ("", "")
    return compare_sides(_side(a, called[0]), _side(b, called[1]), tolerance)


def _side(given: Comparable, name: str) -> Side:
    run: Any = given
    if isinstance(run, Path | str):
        name, run = name or str(run), read(run)
    if isinstance(run, Recording):
        name, cut = name or run.name, run.result is None
        return Side(name, run.manifest, run.world, run.batches(), run.result, run.counts, cut)
    if isinstance(run, tuple) and len(run) == 2 and isinstance(run[0], Run):
        run = run[0].manifest, run[0].problem.world, run[1]
    if not (isinstance(run, tuple) and len(run) == 3):
        raise _no_run(given)
    manifest, world, log = run
    batches = log.batches if isinstance(log, Memory) else [log] if isinstance(log, Events) else log
    known = isinstance(manifest, Manifest) and isinstance(world, World)
    if not known or isinstance(batches, str) or not isinstance(batches, Iterable):
        raise _no_run(given)
    return Side(name, manifest, world, batches)


def _no_run(given: Any) -> BrrtError:
    if isinstance(given, Run):
        what = "a run alone, which keeps no events"
    elif isinstance(given, Memory | Events):
        what = "a log alone, which does not say of what run"
    elif isinstance(given, tuple):
        what = f"({', '.join(type(each).__name__ for each in given)})"
    else:
        what = f"{type(given).__name__}"
    return BrrtError(
        "compare takes the name of a file, what brrt.read returns, or (run, log): a run that was "
        f"executed and the Memory that was its sink; not {what}"
    )
