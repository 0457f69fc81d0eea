"""Events into Rerun: exact columns to replay from, and a picture beside them."""

import json
from pathlib import Path
from typing import Any

import rerun as rr

from brrt.errors import WriteError
from brrt.events import FIELDS, Events, Kind
from brrt.formats.batching import Gathering
from brrt.formats.rrd.checksum import WRITTEN, stamp
from brrt.formats.rrd.outline import CHECK, END, EVENTS, MANIFEST, OURS, WORLD, archetype
from brrt.recording import Result
from brrt.scenario.manifest import Manifest
from brrt.views.rerun.arrow import event_columns, time_columns
from brrt.views.rerun.drawing import RunDrawing
from brrt.views.rerun.layout import application, blueprint, recording_id
from brrt.views.rerun.pipe import Drain
from brrt.views.rerun.stream import connect, new_stream
from brrt.views.viewer import process
from brrt.worlds.world import World

_GATHERED, _FILE_S, _VIEW_S = 1 << 15, 0.5, 0.1
"""Events that are written together, and for how long one may wait for that: on its way to a file
alone, and to somebody who is looking."""

_WINDOW = 1 << 16
"""How many bytes back the compression of Rerun's files (LZ4) finds what comes again. Each column of
a chunk begins with the same offsets, 4 bytes a row, which so take no space but in the first one."""


class RerunSink:
    """Writes every event, exactly, to an .rrd file or a live viewer, and draws what happens.

    Manifest and world come first; if the run ended well, its figures come last. What waits to be
    written does not do so for long, as in `McapSink`.

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
        self._manifest, self._view = manifest, view
        self._path = None if path is None else Path(path)
        self._counts = dict.fromkeys(Kind, 0)
        self._gathering = Gathering(manifest.dof, _GATHERED, _VIEW_S if view else _FILE_S)
        self._chunk = max(256, _WINDOW // (8 * manifest.dof + 5))
        self._layout = blueprint(manifest, world)
        self._rec: Any = new_stream(recording_id(manifest), application(manifest, world))
        if view:
            process.open_viewer()
        self._drain = None if self._path is None else Drain(self._path)
        try:
            first = blueprint(manifest, world, live=True) if view else self._layout
            connect(self._rec, first, self._drain, view=view)
            self._write_head(world)
            self._drawing = RunDrawing(self._rec, manifest, world)
            self._flush()
        except BaseException:
            self._rec.disconnect()
            raise

    def write(self, events: Events) -> None:
        """Take a batch; small ones are gathered, then written and drawn.

        Raises:
            RecordingError: The disk is full, or something else is wrong with the file.
        """
        self._write(self._gathering.add(events))

    def annotate(self, name: str, texts: dict[str, str]) -> None:
        """Keep named texts in the file, behind the events so far."""
        self._write(self._gathering.take())
        self._write_texts(f"{OURS}{name.rpartition('.')[2]}", texts)

    def close(self, result: Result | None) -> None:
        """Write how it ended, and let go of file and viewer.

        Raises:
            RecordingError: The file did not take everything.
        """
        if self._rec is None:
            return
        try:
            self._write(self._gathering.take())
            self._drawing.close(result)
            end = {"events": str(sum(self._counts.values())), "stamp": WRITTEN}
            if result is not None:
                end["result"] = json.dumps(result)
                end["counts"] = json.dumps({kind.label: n for kind, n in self._counts.items()})
            self._write_texts(END, end)
            if self._view:  # the file is to open at its beginning, though the viewer is at the end
                self._rec.send_blueprint(self._layout, make_active=False)
            self._hand_on()
        finally:
            self._disconnect()

    def _write(self, events: Events | None) -> None:
        if events is None:
            return
        chunks = [
            (kind, table[first : first + self._chunk])
            for kind, table in events.tables.items()
            for first in range(0, len(table), self._chunk)
        ]
        # By their first events, so that of a file that is cut little goes for want of a kind.
        for kind, table in sorted(chunks, key=lambda chunk: int(chunk[1]["seq"][0])):
            entity = f"{EVENTS}{kind.label}"
            columns = event_columns(archetype(entity), FIELDS[kind], table)
            self._rec.send_columns(entity, time_columns(table), columns)
        self._flush()  # ahead of the drawing: a file that is cut there lacks none of these events
        self._drawing.write(events)
        for kind, count in events.counts.items():
            self._counts[kind] += count
        self._hand_on()

    def _disconnect(self) -> None:
        try:
            self._rec.disconnect()
        finally:
            self._rec = None
            if self._drain is not None:
                self._drain.close()
        if self._drain is not None and self._path is not None and self._path.is_file():
            try:
                stamp(self._path, self._drain.crc)
            except OSError as error:
                raise WriteError(self._path, error.strerror or str(error)) from None

    def _write_head(self, world: World) -> None:
        texts = {
            MANIFEST: json.dumps(self._manifest.to_strings()),
            WORLD: world.to_json(),
        }
        for entity, text in texts.items():
            self._write_texts(entity, {"json": text})

    def _write_texts(self, entity: str, texts: dict[str, str]) -> None:
        value = rr.DynamicArchetype(archetype(entity), components=texts)
        self._rec.log(entity, value, static=True)

    def _flush(self) -> None:
        """Hand everything on now: a killed run leaves all but its last batch.

        Behind it comes a checksum of the file so far, since the format has none; what is read of
        a file that was cut are the events ahead of its last checksum.
        """
        self._hand_on()
        if self._drain is not None:
            text = {"bytes": str(self._drain.size), "crc32": str(self._drain.crc)}
            self._write_texts(CHECK, text)
            self._hand_on()

    def _hand_on(self) -> None:
        try:
            self._rec.flush()
        except RuntimeError:
            if not self._view:
                raise
            # Someone has closed the viewer. The file, which has its own way out, goes on.
        if self._drain is not None:
            self._drain.settle()
