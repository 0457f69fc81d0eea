"""Events into Rerun and back: exact columns to replay from, and a picture beside them."""

import hashlib
import importlib.util
import json
import shutil
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from brrt.errors import BrrtError, RecordingError
from brrt.events import FIELDS, Events, Field, Kind, Table, table_dtype
from brrt.recording.drain import Drain
from brrt.recording.drawing import Drawing, time_columns
from brrt.recording.recording import Recording
from brrt.recording.scene import blueprint, document
from brrt.replay.metrics import Metrics
from brrt.scenario import Manifest
from brrt.worlds.world import World

APPLICATION = "brrt"
_MAGIC = b"RRF2"
_EVENTS, _OURS = "/ev/", "/brrt/"
_MANIFEST, _WORLD, _END = "/brrt/manifest", "/brrt/world", "/brrt/end"
_PORT = 9876
_BATCH = 1 << 16


class RerunSink:
    """Writes every event, exactly, to an .rrd file or a live viewer, and draws what happens.

    Manifest and world come first; checksums and, if the run ended well, its figures come last.

    Args:
        manifest: The run's.
        world: The run's.
        path: The file; it is overwritten.
        view: Open Rerun's viewer, or use one that is open, and show the events as they come. A
            viewer that is closed meanwhile does not disturb the run.

    Raises:
        RecordingError: The file cannot be written, or there is no viewer.
    """

    def __init__(
        self, manifest: Manifest, world: World, *, path: Path | None = None, view: bool = False
    ) -> None:
        rr.set_strict_mode(True)  # otherwise Rerun drops what it does not understand
        self._manifest, self._view = manifest, view
        self._metrics, self._checksums = Metrics(manifest), Checksums()
        layout = blueprint(manifest, world)
        self._rec: Any = rr.RecordingStream(
            APPLICATION, recording_id=recording_id(manifest), send_properties=False
        )
        rr.set_log_time_enabled(False, recording=self._rec)
        if view:
            _open_viewer()
        self._drain = None if path is None else Drain(path)
        try:
            self._connect(layout)
            self._write_head(world)
            self._drawing = Drawing(self._rec, manifest, world)
            self._flush()
        except BaseException:
            self._rec.disconnect()
            raise

    def write(self, events: Events) -> None:
        """Write and draw a batch.

        Raises:
            RecordingError: The disk is full, or something else is wrong with the file.
        """
        for kind, table in events.tables.items():
            entity = f"{_EVENTS}{kind.label}"
            values = {field.name: _to_arrow(field, table[field.name]) for field in FIELDS[kind]}
            columns = rr.DynamicArchetype.columns(_archetype(entity), components=values)
            self._rec.send_columns(entity, time_columns(table), columns)
        self._drawing.write(events)
        self._metrics.write(events)
        self._checksums.write(events)
        self._flush()

    def close(self, *, whole: bool) -> None:
        """Write how it ended, and let go of file and viewer.

        Raises:
            RecordingError: The file did not take everything.
        """
        if self._rec is None:
            return
        try:
            end = {"checksums": self._checksums.to_json()}
            if whole:
                figures = self._metrics.as_dict()
                end["result"] = json.dumps(figures)
                self._document(document(self._manifest, figures))
            self._write_texts(_END, end)
            self._flush()
        finally:
            self._disconnect()

    def _connect(self, layout: Any) -> None:  # noqa: ANN401 - a blueprint
        sinks: list[Any] = []
        if self._view:
            sinks.append(rr.GrpcSink(f"rerun+http://127.0.0.1:{_PORT}/proxy"))
        if self._drain is None:
            self._rec.set_sinks(*sinks, default_blueprint=layout)
            return
        try:
            sinks.append(rr.FileSink(self._drain.inlet))
            self._rec.set_sinks(*sinks, default_blueprint=layout)
        finally:
            self._drain.seal()

    def _disconnect(self) -> None:
        try:
            self._rec.disconnect()
        finally:
            self._rec = None
            if self._drain is not None:
                self._drain.close()

    def _write_head(self, world: World) -> None:
        texts = {
            _MANIFEST: json.dumps(self._manifest.to_strings()),
            _WORLD: world.to_json(),
        }
        for entity, text in texts.items():
            self._write_texts(entity, {"json": text})
            self._checksums.add(entity, text.encode())
        self._document(document(self._manifest))

    def _write_texts(self, entity: str, texts: dict[str, str]) -> None:
        values = {name: pa.array([text]) for name, text in texts.items()}
        self._rec.log(entity, rr.DynamicArchetype(_archetype(entity), components=values), static=True)

    def _document(self, text: str) -> None:
        markdown = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        self._rec.log("/run", markdown, static=True)

    def _flush(self) -> None:
        """Hand everything on now: a killed run leaves all but its last batch."""
        try:
            self._rec.flush()
        except RuntimeError:
            if not self._view:
                raise
            # Someone has closed the viewer. The file, which has its own way out, goes on.
        if self._drain is not None:
            self._drain.check()


def recording_id(manifest: Manifest) -> str:
    """Name a recording: equal for runs that are the same in everything, the clock included."""
    digest = hashlib.sha256(json.dumps(manifest.to_strings()).encode()).hexdigest()
    return f"{manifest.scenario.planner}-{digest[:16]}"


def _open_viewer() -> None:
    own = importlib.util.find_spec("rerun_cli")
    folder = None if own is None or own.origin is None else str(Path(own.origin).parent)
    # Rerun looks for its viewer on the PATH alone, where a venv that is not activated is missing.
    program = shutil.which("rerun", path=folder) or shutil.which("rerun")
    try:
        rr.spawn(port=_PORT, connect=False, hide_welcome_screen=True, executable_path=program)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[0]
        raise RecordingError(f"cannot open the Rerun viewer: {reason}") from None


class Checksums:
    """CRC-32 of each column of the events, however they are cut into batches.

    Rerun's format has no checksums: of 300 flipped bits, 201 went by without an error.
    """

    def __init__(self) -> None:
        self._sums: dict[str, int] = {}

    def add(self, name: str, data: Any) -> None:  # noqa: ANN401 - bytes, or an array
        """Take in the next bytes of a column."""
        self._sums[name] = zlib.crc32(data, self._sums.get(name, 0))

    def write(self, events: Events) -> None:
        """Take in a batch."""
        for kind, table in events.tables.items():
            for column in table.dtype.names or ():
                name = f"{kind.label}.{column}"
                if table.dtype[column] == object:
                    for row in table[column]:
                        self.add(f"{name} sizes", row.size.to_bytes(8, "little"))
                        self.add(name, np.ascontiguousarray(row))
                else:
                    self.add(name, np.ascontiguousarray(table[column]))

    def to_json(self) -> str:
        """Return the sums as text."""
        return json.dumps(self._sums, sort_keys=True)


def _archetype(entity: str) -> str:
    """`brrt.edge` for `/ev/edge`."""
    return f"brrt.{entity.rsplit('/', 1)[-1]}"


def _to_arrow(field: Field, values: Any) -> Any:  # noqa: ANN401 - numpy to pyarrow
    """One value a row, of a field of any type."""
    if field.type == "q[]":
        flat = [np.ravel(row) for row in values]
        offsets = np.cumsum([0, *map(len, flat)], dtype=np.int32)
        return pa.ListArray.from_arrays(offsets, pa.array(np.concatenate(flat), pa.float64()))
    values = np.ascontiguousarray(values)
    if field.type == "q":
        return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])
    return pa.array(values)


def read_rerun(path: Path) -> Recording:
    """Read a recording that `RerunSink` wrote; its events are held in memory.

    Of a run that was killed, the events up to the first one that is missing are there.

    Raises:
        RecordingError: The file cannot be read, is cut or damaged, or is no recording of brrt.
    """
    chunks = _load(path)
    try:
        texts = {entity: _text(chunks, entity, "json") for entity in (_MANIFEST, _WORLD)}
        if None in texts.values():
            raise BrrtError("a Rerun file, but not a recording of brrt (no /brrt/manifest in it)")
        manifest = Manifest.from_strings(json.loads(str(texts[_MANIFEST])))
        world = World.from_json(str(texts[_WORLD]))
        events = _events(chunks, manifest.dof)
        expected, result = (_text(chunks, _END, name) for name in ("checksums", "result"))
        if expected is not None:
            sums = Checksums()
            for entity, text in texts.items():
                sums.add(entity, str(text).encode())
            sums.write(events)
            if sums.to_json() != expected:
                raise BrrtError("damaged: the checksums do not match")
        figures = None if result is None else json.loads(result)
    except BrrtError as error:
        raise RecordingError(f"{path}: {error}") from None
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as error:
        raise RecordingError(f"{path}: damaged: {error!r}") from None
    return Recording(manifest, world, lambda: _batches(events), figures)


def _load(path: Path) -> dict[str, list[Any]]:
    """Read the record batches of the entities that are not for the eye."""
    try:
        with path.open("rb") as file:
            magic = file.read(len(_MAGIC))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    if magic != _MAGIC:
        raise RecordingError(f"{path}: not a Rerun recording")
    found: dict[str, list[Any]] = {}
    try:
        with warnings.catch_warnings():
            # The file of a killed run has no footer; Rerun then warns of an old format.
            warnings.simplefilter("ignore")
            for chunk in RrdReader(path).stream():
                if chunk.entity_path.startswith((_EVENTS, _OURS)):
                    found.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
    except Exception as error:  # noqa: BLE001 - whatever a damaged file leads Rerun to
        reason = str(error).replace(f"Failed to read RRD file at {path}: ", "").splitlines()[0]
        raise RecordingError(
            f"{path}: cut or damaged ({reason}); "
            f"`rerun rrd merge {path} -o whole.rrd` saves what is whole"
        ) from None
    return found


def _text(chunks: dict[str, list[Any]], entity: str, name: str) -> str | None:
    for batch in chunks.get(entity, ()):
        column = f"{_archetype(entity)}:{name}"
        if column in batch.schema.names:
            return str(batch.column(column)[0].as_py()[0])
    return None


def _events(chunks: dict[str, list[Any]], dof: int) -> Events:
    """Gather the events, as far as none is missing."""
    tables = {}
    for kind in Kind:
        batches = chunks.get(f"{_EVENTS}{kind.label}", [])
        if batches:
            tables[kind] = _table(kind, dof, batches)
    total = sum(map(len, tables.values()))
    present = np.zeros(total + 1, np.bool_)
    for table in tables.values():
        numbers = table["seq"]
        present[numbers[(numbers >= 0) & (numbers < total)]] = True
    return Events(dof, tables).until(seq=int(present.argmin()) - 1)


def _table(kind: Kind, dof: int, batches: list[Any]) -> Table:
    table = np.empty(sum(batch.num_rows for batch in batches), table_dtype(kind, dof))
    end = 0
    for batch in batches:
        begin, end = end, end + batch.num_rows
        part = table[begin:end]
        for name, timeline in (("seq", "event"), ("t", "t"), ("iteration", "iteration")):
            part[name] = batch.column(timeline).cast(pa.int64()).to_numpy()
        for field in FIELDS[kind]:
            column = batch.column(f"brrt.{kind.label}:{field.name}")
            part[field.name] = _from_arrow(field, column, dof)
    if (np.diff(table["seq"]) <= 0).any():
        table = table[np.argsort(table["seq"], kind="stable")]
    return table


def _from_arrow(field: Field, column: Any, dof: int) -> Any:  # noqa: ANN401 - pyarrow to numpy
    """Undo `_to_arrow`; Rerun has wrapped each value into a list of its own."""
    flat = column.flatten()
    if field.type == "q[]":
        sizes = np.asarray(column.value_lengths())
        rows = np.empty(len(sizes), object)
        for i, row in enumerate(np.split(flat.to_numpy(), np.cumsum(sizes)[:-1])):
            rows[i] = row.reshape(-1, dof)
        return rows
    if len(flat) != len(column):
        raise ValueError(f"{field.name} has {len(flat)} values in {len(column)} rows")
    if field.type == "q":
        return flat.flatten().to_numpy().reshape(-1, dof)
    return flat.to_numpy(zero_copy_only=False)


def _batches(events: Events) -> Iterator[Events]:
    for first in range(0, len(events), _BATCH):
        tables = {}
        for kind, table in events.tables.items():
            begin, end = np.searchsorted(table["seq"], (first, first + _BATCH))
            if begin < end:
                tables[kind] = table[begin:end]
        yield Events(events.dof, tables)
