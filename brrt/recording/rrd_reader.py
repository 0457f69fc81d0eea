"""Events out of .rrd, message by message from the front, so that a cut file gives what it has.

It is not read by rerun-sdk, whose reader (0.41) gives up on a cut file, ends the process on some
damage, and takes half a second to import.
"""

import json
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
from brrt.manifest import Manifest
from brrt.recording.recording import Recording
from brrt.recording.rrd_frames import opened, unpacked
from brrt.recording.rrd_outline import END, MANIFEST, WORLD, Outline, reason
from brrt.recording.sound import CutError, Numbering, head

pa: Any = pyarrow  # mypy knows none of its names

TIMELINES = {"iteration": "iteration", "event": "seq", "t": "t"}
"""The timelines, and the column of the events that each holds."""

_EVENTS_AT_ONCE = 1 << 16


def read_rerun(path: Path, *, in_parts: bool = False) -> Recording:
    """Open a recording that `RerunSink` wrote.

    Its batches raise `CutError` behind the last whole event of a file that was cut.

    Args:
        path: The file.
        in_parts: Where its checksum is wrong, take what the checksums of its parts say is sound.

    Raises:
        RecordingError: The file cannot be read, is damaged, or is no recording of brrt.
    """
    outline = Outline.of(path, in_parts=in_parts)
    if MANIFEST not in outline.texts or WORLD not in outline.texts:
        if isinstance(outline.stopped, CutError):
            raise CutError(f"{outline.stopped}, ahead of the first event: there is nothing to save")
        raise outline.stopped or RecordingError(
            f"{path}: a Rerun file, but not a recording of brrt (no {MANIFEST})"
        )
    try:
        texts = json.loads(outline.texts[MANIFEST]["json"])
        manifest, world = head(path, dict(texts), outline.texts[WORLD]["json"])
        end = outline.texts.get(END, {})
        figures = dict(json.loads(end["result"])) if "result" in end else None
        stated = dict(json.loads(end.get("counts", "{}")))
        counts = {kind: int(stated[kind.label]) for kind in Kind if kind.label in stated}
    except RecordingError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise RecordingError(f"{path}: damaged: {error!r}") from None
    batches = partial(_batches, outline, manifest, figures)
    whole = not outline.stopped
    return Recording(
        manifest, world, batches, figures if whole else None, counts if counts and whole else None
    )


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


def _batches(
    outline: Outline, manifest: Manifest, figures: Mapping[str, Any] | None
) -> Iterator[Events]:
    """Yield the events in order."""
    pool, numbering = _Pool(manifest.dof), Numbering()
    with outline.path.open("rb") as file:
        for kind, at, length in outline.places:
            file.seek(at)
            try:
                _, batches = opened(unpacked(file.read(length)))
                for batch in batches:
                    pool.add(kind, _table(kind, manifest.dof, batch))
                whole = pool.last + 1 == numbering.next + pool.count
                ready = _sliced(pool.take(), numbering) if whole else []
            except Exception as error:  # noqa: BLE001 - whatever damage leads pyarrow to
                raise outline.damaged(at, reason(error)) from None
            yield from ready
    try:
        rest = _sliced(_in_front(pool.take(), numbering.next), numbering)
    except BrrtError as error:
        raise RecordingError(f"{outline.path}: damaged: {error}") from None
    yield from rest
    _check_end(outline, numbering.next, figures, missing=pool.last >= numbering.next)


def _sliced(events: Events, numbering: Numbering) -> list[Events]:
    """Take in events, and return them in batches that are not too large."""
    first = numbering.next
    numbering.take(events)
    if len(events) <= _EVENTS_AT_ONCE:
        return [events] if len(events) else []
    parts = []
    for begin in range(first, numbering.next, _EVENTS_AT_ONCE):
        tables = {}
        for kind, table in events.tables.items():
            low, high = np.searchsorted(table["seq"], (begin, begin + _EVENTS_AT_ONCE))
            if low < high:
                tables[kind] = table[low:high]
        parts.append(Events(events.dof, tables))
    return parts


def _in_front(events: Events, first: int) -> Events:
    """Return the events from a number on, as far as none is missing."""
    n = len(events)
    present = np.zeros(n + 1, np.bool_)
    for table in events.tables.values():
        places = table["seq"] - first
        present[places[(places >= 0) & (places < n)]] = True
    return events.until(seq=first + int(present.argmin()) - 1)


def _check_end(
    outline: Outline, count: int, figures: Mapping[str, Any] | None, *, missing: bool
) -> None:
    """See that no event is missing at the end.

    Raises:
        CutError: The file was cut, or was made of one that was.
        RecordingError: It was not, and lacks events.
    """
    stated = outline.texts.get(END, {}).get("events")
    if stated is not None and (stated != str(count) or missing):
        raise RecordingError(
            f"{outline.path}: damaged: {stated} events were written, {count} are there"
        )
    if isinstance(outline.stopped, CutError):
        raise CutError(str(outline.stopped), figures)
    if outline.stopped is not None:
        raise outline.stopped
    if missing or stated is None:
        raise CutError(f"{outline.path}: was made of a file that was cut: the end is missing")
