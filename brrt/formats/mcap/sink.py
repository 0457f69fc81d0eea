"""The sink that writes a run to an MCAP file.

First come the metadata `brrt.run` (the manifest) and the attachment `world.json`, then the events
in chunks, one topic a kind, then the metadata `brrt.result` and the summary.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from mcap import records

from brrt.errors import WriteError
from brrt.events import GRAPH_KINDS, Events, Kind
from brrt.formats.batching import Batching
from brrt.formats.mcap.container import Container
from brrt.formats.mcap.messages import ENCODINGS, TOPICS, Layout, channel_of, definition, encode
from brrt.formats.mcap.records import with_checksum
from brrt.recording import Result
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World

RUN, RESULT, WORLD = "brrt.run", "brrt.result", "world.json"
"""Names of the metadata and of the attachment."""

LEFT = "what was written before is whole: replay it with --partial, or see brrt recover"
"""What there is of a file whose disk filled up."""

_CHUNK_EVENTS = 8000
_CHUNK_SECONDS = 0.2
"""Less than the half second that is promised: the rest is for the writing on a busy machine."""


class McapSink:
    """Writes every event, in order, to an MCAP file that stock tools read.

    Manifest and world come first, so that a cut file keeps them; the result comes last. A chunk
    is written at the latest by the first batch that comes 0.2 s after its first event; in
    a `BackgroundSink`, as `brrt plan` uses it, even if the planner emits nothing.

    Args:
        path: The file; it is overwritten.
        manifest: The run's.
        world: The run's.

    Raises:
        RecordingError: The file cannot be written.
    """

    def __init__(self, path: Path | str, manifest: Manifest, world: World) -> None:
        self._path, self._epoch, self._manifest = Path(path), manifest.epoch_ns, manifest
        self._definitions = {kind: definition(kind, manifest.dof) for kind in Kind}
        self._layouts = {kind: Layout.parse(text) for kind, text in self._definitions.items()}
        self._batching = Batching(manifest.dof, _CHUNK_EVENTS, _CHUNK_SECONDS)
        library = f"brrt {manifest.made_by.get('brrt', '')}".strip()
        try:
            self._file = Container(self._path, library)
        except OSError as error:
            raise WriteError(path, error.strerror or str(error)) from None
        try:
            self._declare(kind for kind in Kind if manifest.graph or kind not in GRAPH_KINDS)
            self._file.rewritable_metadata(RUN, with_checksum(manifest.to_strings()))
            self._file.attach(WORLD, world.to_json().encode(), manifest.epoch_ns)
            self._file.flush()
        except OSError as error:
            raise WriteError(path, error.strerror or str(error)) from None
        except BaseException:
            self._file.close()
            raise

    def write(self, events: Events) -> None:
        """Take a batch; small ones are joined into one chunk."""
        self._write_chunk(self._batching.add(events))

    def annotate(self, name: str, texts: dict[str, str]) -> None:
        """Keep named texts in the file, after the events so far.

        Raises:
            RecordingError: The disk does not take them.
        """
        self._write_chunk(self._batching.take())
        with self._converting_errors():
            self._file.metadata(name, texts)

    def close(self, result: Result | None) -> None:
        """Write what is pending, the result, the summary and the footer."""
        if self._file.closed:
            return
        try:
            self._write_chunk(self._batching.take())
            with self._converting_errors():
                if result is not None:
                    texts = {name: json.dumps(value) for name, value in result.items()}
                    self._file.metadata(RESULT, with_checksum(texts))
                self._file.finish()
        finally:
            with self._converting_errors():
                self._file.close()

    @contextmanager
    def _converting_errors(self) -> Iterator[None]:
        """Raise an error that names what can be saved where the disk does not take all."""
        try:
            yield
        except OSError as error:
            raise WriteError(self._path, error.strerror or str(error), LEFT) from None
        except BaseException:  # no memory: what was flushed is whole, and nothing can follow it
            self._file.close()
            raise

    def _write_chunk(self, events: Events | None) -> None:
        if events is not None:
            with self._converting_errors():
                if not self._manifest.graph and not GRAPH_KINDS.isdisjoint(events.counts):
                    self._become_graph()
                self._file.chunk(*encode(events, self._layouts, self._epoch))

    def _become_graph(self) -> None:
        """Give the file the format of graphs, before its first event of them."""
        old, self._manifest = self._manifest, replace(self._manifest, graph=True)
        texts = (with_checksum(each.to_strings()) for each in (old, self._manifest))
        self._file.rewrite_metadata(RUN, *texts)
        self._declare(kind for kind in Kind if kind in GRAPH_KINDS)

    def _declare(self, kinds: Iterable[Kind]) -> None:
        """Declare the schemas and channels of kinds of events."""
        self._file.declare(*_declarations({kind: self._definitions[kind] for kind in kinds}))


def _declarations(definitions: Mapping[Kind, str]) -> Iterator[records.Schema | records.Channel]:
    of_schemas, of_messages = ENCODINGS
    for kind, text in definitions.items():
        name = f"brrt_msgs/msg/{kind.label.capitalize()}"
        yield records.Schema(channel_of(kind), text.encode(), of_schemas, name)
    for topic, kind in TOPICS.items():
        if kind in definitions:
            yield records.Channel(channel_of(kind), topic, of_messages, {}, channel_of(kind))
