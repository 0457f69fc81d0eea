"""Events into Rerun: exact columns to replay from, and a drawing beside them."""

import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import rerun as rr

from brrt.errors import RecordingError
from brrt.events import GRAPH_KINDS, Events, Kind
from brrt.formats.batching import Batching
from brrt.formats.rrd.columns import (
    END,
    EVENTS,
    MANIFEST,
    OURS,
    WORLD,
    archetype,
    event_columns,
    time_columns,
)
from brrt.recording import Result
from brrt.scenario.manifest import Manifest
from brrt.views.rerun.drawing import RunDrawing
from brrt.views.rerun.layout import application, blueprint, recording_id
from brrt.views.rerun.pipe import FilePipe
from brrt.views.rerun.stream import connect, new_stream
from brrt.views.viewer import process
from brrt.worlds.world import World

_BATCH, _FILE_S, _VIEW_S = 1 << 14, 0.2, 0.1
"""Events that are written together, and seconds that one may wait for that, on its way to a file
and to a viewer."""

_WINDOW = 1 << 16
"""How many bytes back the compression of Rerun's files (LZ4) finds repetitions. Each column of a
chunk begins with the same offsets, 4 bytes a row, which so take space in the first column only."""


class RerunSink:
    """Writes every event, exactly, to an .rrd file or a live viewer, and draws what happens.

    Batches are joined as in `McapSink`. brrt reads the file once it is closed: the MCAP file of a
    run is the one that survives a kill. A full disk is an error, although Rerun hangs on it.

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
        self,
        manifest: Manifest,
        world: World,
        *,
        path: Path | str | None = None,
        view: bool = False,
    ) -> None:
        self._view, self._layout, self._manifest = view, blueprint(manifest, world), manifest
        self._counts = dict.fromkeys(Kind, 0)
        self._batching = Batching(manifest.dof, _BATCH, _VIEW_S if view else _FILE_S)
        self._rows = max(256, _WINDOW // (8 * manifest.dof + 5))
        self._rec: Any = new_stream(recording_id(manifest), application(manifest, world))
        if view:
            process.open_viewer()
        self._pipe = None if path is None else FilePipe(Path(path))
        try:
            first = blueprint(manifest, world, live=True) if view else self._layout
            connect(self._rec, first, self._pipe, view=view)
            self._write_manifest()
            self._write_texts(WORLD, {"json": world.to_json()})
            self._drawing = RunDrawing(self._rec, manifest, world)
            self._flush()
        except BaseException:
            if self._pipe is not None:
                self._pipe.discard()
            with suppress(RecordingError):
                self._disconnect()
            raise

    def write(self, events: Events) -> None:
        """Take a batch; small ones are joined, then written and drawn.

        Raises:
            RecordingError: The disk is full, or the file cannot be written for another reason.
        """
        self._write(self._batching.add(events))

    def annotate(self, name: str, texts: dict[str, str]) -> None:
        """Keep named texts in the file, after the events so far."""
        self._write(self._batching.take())
        self._write_texts(f"{OURS}{name.rpartition('.')[2]}", texts)

    def close(self, result: Result | None) -> None:
        """Write what is pending, the number of events and the result; then disconnect.

        Raises:
            RecordingError: The file did not take everything.
        """
        if self._rec is None:
            return
        try:
            self._write(self._batching.take())
            self._drawing.close(result)
            end = {"events": str(sum(self._counts.values()))}
            if result is not None:
                end["result"] = json.dumps(result)
                end["counts"] = json.dumps({kind.label: n for kind, n in self._counts.items()})
            self._write_texts(END, end)
            if self._view:  # the viewer follows what comes, the file opens at its start
                self._rec.send_blueprint(self._layout, make_active=False)
            self._flush()
        finally:
            self._disconnect()

    def _write(self, events: Events | None) -> None:
        if events is None:
            return
        if not self._manifest.graph and not GRAPH_KINDS.isdisjoint(events.counts):
            # Readers take the last manifest, and older ones refuse its format.
            self._manifest = replace(self._manifest, graph=True)
            self._write_manifest()
        for kind, table in events.tables.items():
            for first in range(0, len(table), self._rows):
                rows = table[first : first + self._rows]
                columns = event_columns(kind, rows)
                self._rec.send_columns(f"{EVENTS}{kind.label}", time_columns(rows), columns)
            self._counts[kind] += len(table)
        self._drawing.write(events)
        self._flush()

    def _write_manifest(self) -> None:
        self._write_texts(MANIFEST, {"json": json.dumps(self._manifest.to_strings())})

    def _write_texts(self, entity: str, texts: dict[str, str]) -> None:
        value = rr.DynamicArchetype(archetype(entity), components=texts)
        self._rec.log(entity, value, static=True)

    def _flush(self) -> None:
        try:
            self._rec.flush()
        except RuntimeError:
            if not self._view:
                raise
            # The viewer was closed. The file does not depend on it.
        if self._pipe is not None:
            self._pipe.wait()

    def _disconnect(self) -> None:
        try:
            self._rec.disconnect()
        finally:
            self._rec = None
            if self._pipe is not None:
                self._pipe.close()
