"""Events out of .rrd, message by message from the front, so that a cut file gives what it has.

It is not read by rerun-sdk, whose reader (0.41) gives up on a cut file, ends the process on some
damage, and takes half a second to import.
"""

import json
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow  # noqa: ICN001 - it gets that name below
from numpy.typing import NDArray

from brrt.errors import BrrtError, RecordingError
from brrt.events import FIELDS, Events, Field, Kind, Table, table_dtype
from brrt.formats.integrity import (
    BrokenError,
    CutError,
    DamagedError,
    Numbering,
    ReplacedError,
    head,
    in_front,
)
from brrt.formats.rrd.frames import opened, unpacked
from brrt.formats.rrd.outline import END, MANIFEST, WORLD, Outline, reason
from brrt.recording import Recording
from brrt.scenario.manifest import Manifest

pa: Any = pyarrow  # mypy knows none of its names

TIMELINES = {"iteration": "iteration", "event": "seq", "t": "t"}
"""The timelines, and the column of the events that each holds."""

_EVENTS_AT_ONCE = 1 << 16


def read_rerun(path: Path) -> Recording:
    """Open a recording that `RerunSink` wrote.

    Its batches raise `CutError` behind the last event of a file that was cut that is proved whole,
    and `DamagedError` of one that is damaged.

    Raises:
        RecordingError: The file cannot be read, or is no recording of brrt.
    """
    outline = Outline.of(path)
    if MANIFEST not in outline.texts or WORLD not in outline.texts:
        raise outline.stopped or RecordingError(
            f"{path}: a Rerun file, but not a recording of brrt (no {MANIFEST})"
        )
    try:
        texts = json.loads(outline.texts[MANIFEST]["json"])
        manifest, world = head(path, dict(texts), outline.texts[WORLD]["json"])
        figures, counts = (None, None) if outline.stopped else _ending(outline)
    except RecordingError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise DamagedError(path, f"damaged: {error!r}") from None
    return Recording(manifest, world, partial(_batches, outline, manifest), figures, counts)


def _ending(outline: Outline) -> tuple[Mapping[str, Any] | None, Mapping[Kind, int] | None]:
    """Return the figures and the events of each kind, as far as they are there."""
    end = outline.texts.get(END, {})
    figures = dict(json.loads(end["result"])) if "result" in end else None
    stated = dict(json.loads(end.get("counts", "{}")))
    counts = {kind: int(stated[kind.label]) for kind in Kind if kind.label in stated}
    return figures, counts or None


def _table(kind: Kind, dof: int, batch: Any) -> Table:
    table = np.empty(batch.num_rows, table_dtype(kind, dof))
    for timeline, name in TIMELINES.items():
        times = batch.column(timeline)
        if times.null_count:
            raise BrrtError(f"{timeline}: an event without a time")
        table[name] = times.cast("int64").to_numpy()
    for each in FIELDS[kind]:
        table[each.name] = from_arrow(each, batch.column(f"brrt.{kind.label}:{each.name}"), dof)
    if (np.diff(table["seq"]) <= 0).any():
        table = table[np.argsort(table["seq"], kind="stable")]
    return table


def from_arrow(field: Field, column: Any, dof: int) -> NDArray[Any]:
    """Undo `to_arrow`; Rerun has wrapped each value into a list.

    Raises:
        ValueError: There is not one value a row, or it is of another type.
    """
    flat, rows = column.flatten(), len(column)
    if field.type == "q":
        if flat.type.list_size != dof:
            raise ValueError(f"{field.name}: {flat.type.list_size} numbers, and not {dof}")
        values, wanted = flat.flatten(), rows * dof
    elif field.type == "q[]":
        values, wanted = flat, len(flat)
    else:
        values, wanted = flat, rows
    kind = pa.float64() if field.type in ("q", "q[]") else _arrow_type(field)
    if values.type != kind or values.null_count or len(values) != wanted:
        raise ValueError(f"{field.name}: {len(values)} values of {values.type} in {rows} rows")
    numbers = np.asarray(values.to_numpy(zero_copy_only=False))
    if field.type == "q":
        return numbers.reshape(-1, dof)
    if field.type != "q[]":
        return numbers
    parts = np.empty(rows, object)
    ends = np.cumsum(np.asarray(column.value_lengths()))
    for i, part in enumerate(np.split(numbers, ends[:-1])):
        parts[i] = part.reshape(-1, dof)
    return parts


def _arrow_type(field: Field) -> Any:
    return pa.from_numpy_dtype(np.dtype(field.type))


@dataclass(slots=True)
class _Pool:
    """Events that wait for the ones before them: each kind comes in messages of its own."""

    dof: int
    tables: dict[Kind, list[Table]] = field(default_factory=dict)
    count: int = 0
    last: int = -1

    def add(self, kind: Kind, table: Table) -> None:
        self.tables.setdefault(kind, []).append(table)
        self.count += len(table)
        self.last = max(self.last, int(table["seq"].max(initial=-1)))

    def take(self) -> Events:
        """Hand out all that waits, in order."""
        tables = {kind: np.concatenate(parts) for kind, parts in sorted(self.tables.items())}
        for kind, table in tables.items():
            if (np.diff(table["seq"]) < 0).any():
                tables[kind] = table[np.argsort(table["seq"], kind="stable")]
        self.tables, self.count = {}, 0
        return Events(self.dof, tables)


def _batches(outline: Outline, manifest: Manifest) -> Iterator[Events]:
    """Yield the events in order, up to the first that is missing or not sound."""
    pool, numbering = _Pool(manifest.dof), Numbering()
    wrong: BrokenError | None = None
    for kind, at, message in _messages(outline):
        try:
            _, batches = opened(unpacked(message))
            for batch in batches:
                pool.add(kind, _table(kind, manifest.dof, batch))
        except Exception as error:  # noqa: BLE001 - whatever damage leads pyarrow to
            wrong = outline.damaged(at, reason(error))
            break
        if pool.last + 1 == numbering.next + pool.count:
            ready, unsound = numbering.beginning(pool.take())
            yield from _sliced(ready)
            if unsound is not None:
                wrong = outline.damaged(at, str(unsound))
                break
    first, waiting = numbering.next, pool.count
    rest, unsound = numbering.beginning(in_front(pool.take(), first))
    yield from _sliced(rest)
    missing = pool.last >= numbering.next
    if unsound is None and not missing and waiting > numbering.next - first:
        unsound = BrrtError("events are there twice")
    if unsound is not None:
        wrong = wrong or DamagedError(outline.path, f"damaged: {unsound}")
    _check_end(outline, numbering.next, missing=missing, wrong=wrong)


def _messages(outline: Outline) -> Iterator[tuple[Kind, int, bytes]]:
    """Read the messages that hold events.

    Raises:
        RecordingError: They cannot be read, or are not those that were looked at.
    """
    try:
        with outline.path.open("rb") as file:
            for kind, at, length, crc in outline.places:
                file.seek(at)
                message = file.read(length)
                if zlib.crc32(message) != crc:
                    raise ReplacedError(outline.path)
                yield kind, at, message
    except OSError as error:
        raise RecordingError(f"{outline.path}: {error.strerror or error}") from None


def _sliced(events: Events) -> Iterator[Events]:
    """Divide events, of which none is missing, into batches that are not too large."""
    if len(events) <= _EVENTS_AT_ONCE:
        if len(events):
            yield events
        return
    first, _ = events.kinds_in_order()
    for begin in range(first, first + len(events), _EVENTS_AT_ONCE):
        tables = {}
        for kind, table in events.tables.items():
            low, high = np.searchsorted(table["seq"], (begin, begin + _EVENTS_AT_ONCE))
            if low < high:
                tables[kind] = table[low:high]
        yield Events(events.dof, tables)


def _check_end(outline: Outline, count: int, *, missing: bool, wrong: BrokenError | None) -> None:
    """See that the file is whole, and no event missing at the end.

    Raises:
        CutError: The file was cut, or was made of one that was.
        DamagedError: It is damaged, or lacks events.
    """
    end = outline.texts.get(END, {})
    stated = end.get("events")
    wrong = wrong or outline.stopped
    if stated is not None and not wrong and (stated != str(count) or missing):
        why = f"damaged: {stated} events were written, {count} are there"
        wrong = DamagedError(outline.path, why)
    if wrong is None and (missing or stated is None):
        wrong = CutError(outline.path, "was made of a file that was cut: the end is missing")
    if wrong is not None:
        complete = stated == str(count) and not missing
        raise wrong.judged(complete=complete, ended="result" in end)
