"""Events out of MCAP: record by record from the front, so that a cut file gives what it has."""

from collections.abc import Generator, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import RecordingError
from brrt.events import Events
from brrt.formats.integrity import CutError, DamagedError, ReplacedError, head
from brrt.formats.mcap.decoder import Decoder
from brrt.formats.mcap.records import (
    attachment_of,
    check_summary,
    ends_as_mcap,
    metadata_of,
    opened,
    records_of,
)
from brrt.formats.mcap.summary import chunk_starts, ending, figures_of
from brrt.formats.mcap.writer import RESULT, RUN, WORLD
from brrt.recording import Recording
from brrt.scenario.manifest import Manifest

_MOST_LEAPS = 50
"""Over damaged records: each may cost to read as much as a record may hold."""

Index = dict[int, NDArray[np.uint64]]


def read_mcap(path: Path) -> Recording:
    """Open a recording.

    Its batches raise `CutError` behind the last whole chunk of a file that was cut, and
    `DamagedError` behind the last event that is proved whole of one that is damaged.

    Raises:
        RecordingError: The file cannot be read, or is not a recording of brrt.
    """
    texts: Mapping[str, str] | None = None
    with opened(path) as file:
        for opcode, data in _head_of(path, file):
            if opcode == Opcode.METADATA:
                metadata = metadata_of(path, data)
                texts = metadata.metadata if metadata.name == RUN else texts
            elif opcode == Opcode.ATTACHMENT and texts is not None:
                attachment = attachment_of(path, data)
                if attachment.name == WORLD:
                    manifest, world = head(path, texts, attachment.data)
                    batches = partial(_batches, path, manifest, texts)
                    end = ending(path)
                    return Recording(manifest, world, batches, end.result, end.counts)
            elif opcode in (Opcode.CHUNK, Opcode.DATA_END):
                break
    raise RecordingError(
        f"{path}: an MCAP file, but not a recording of brrt, or one that another tool rewrote: "
        f"metadata {RUN} and behind it attachment {WORLD} must stand ahead of the first chunk; "
        "read the file that it was made of, or have the tool write them first"
    )


def is_whole(path: Path) -> bool:
    """Whether the checksums of data and summary are right; the events are not looked at."""
    try:
        with opened(path) as file:
            for _ in records_of(path, file):
                pass
            check_summary(path, file)
    except RecordingError:
        return False
    return True


def _head_of(path: Path, file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    try:
        yield from records_of(path, file)
    except CutError as error:
        raise error.in_front() from None


def _batches(path: Path, manifest: Manifest, texts: Mapping[str, str]) -> Iterator[Events]:
    """Yield the events of each chunk, up to the first that is not proved whole.

    What is damaged besides, as an index, is told behind them.
    """
    walk = _Walk(Decoder(path, manifest), texts)
    decoder = walk.decoder
    with opened(path) as file:
        for chunk, index in walk.chunks(file):
            try:
                events = decoder.events(chunk, index)
            except RecordingError as error:
                decoder.note(error)  # whether events are missing for that, the next ones tell
                continue
            if len(events):
                yield events
            if decoder.over:
                break
    walk.judge()


class _Walk:
    """Goes through a file's data, and over what is damaged in it.

    Args:
        decoder: Knows how far the events go, and what is wrong.
        texts: Those of the manifest that was read.
    """

    def __init__(self, decoder: Decoder, texts: Mapping[str, str]) -> None:
        self.decoder, self._path, self._texts = decoder, decoder.path, texts
        self._figures: Mapping[str, Any] | None = None
        self._sound, self._same = False, False

    def chunks(self, file: IO[bytes]) -> Iterator[tuple[bytes, Index]]:
        """Yield each chunk and its indexes.

        Where records cannot be told from each other any more, go on with the next chunk that the
        summary knows of, if that is whole.

        Raises:
            RecordingError: It is another file by now.
        """
        begun = yield from self._stretch(file)
        if self.decoder.wrong is None:
            return
        leaps = [start for start in chunk_starts(self._path) if start > begun]
        for start in leaps[:_MOST_LEAPS]:
            if start > begun:
                file.seek(start)
                begun = max(start, (yield from self._stretch(file)))

    def _stretch(self, file: IO[bytes]) -> Generator[tuple[bytes, Index], None, int]:
        """Yield chunks and their indexes until the end or damage; return where the last began."""
        decoder, path = self.decoder, self._path
        begun, behind = 0, file.tell()
        chunk: bytes | None = None
        index: Index = {}
        try:
            for opcode, data in records_of(path, file):
                behind = file.tell()
                if opcode == Opcode.MESSAGE_INDEX:
                    self._index(data, index)
                    continue
                if chunk is not None:
                    yield chunk, index
                    chunk, index = None, {}
                if opcode == Opcode.CHUNK:
                    chunk, begun = data, behind - len(data) - 9
                else:
                    self._look(opcode, data)
            self._sound = True
            check_summary(path, file)
        except ReplacedError:
            raise
        except CutError as error:
            why = f"damaged behind byte {behind:,}: a record is not what it says"
            decoder.note(DamagedError(path, why) if ends_as_mcap(file) else error)
        except RecordingError as error:
            decoder.note(error)
        if chunk is not None:
            yield chunk, index
        return begun

    def _index(self, data: bytes, index: Index) -> None:
        try:
            channel, offsets = self.decoder.index(data)
        except RecordingError as error:
            self.decoder.note(error)
        else:
            index[channel] = offsets

    def _look(self, opcode: int, data: bytes) -> None:
        """Look at a record between two chunks."""
        if opcode == Opcode.MESSAGE:
            why = "a message outside of a chunk, as brrt writes none"
            self.decoder.note(self.decoder.damaged(why))
        elif opcode == Opcode.METADATA:
            try:
                metadata = metadata_of(self._path, data)
                if metadata.name == RESULT:
                    self._figures = figures_of(self._path, metadata)
            except RecordingError as error:
                self.decoder.note(error)
            else:
                self._same = self._same or metadata.metadata == self._texts
                if metadata.name == RUN and not self._same:
                    raise ReplacedError(self._path)

    def judge(self) -> None:
        """See whether all events were there.

        Raises:
            BrokenError: They were not, or something else is wrong with the file.
            ReplacedError: It is another file by now.
        """
        if not self._same:
            raise ReplacedError(self._path)
        count, wrong, end = self.decoder.numbering.next, self.decoder.wrong, ending(self._path)
        stated = None if end.counts is None else sum(end.counts.values())
        if self._figures is not None:
            stated = self._figures.get("events")
            if wrong is None and stated != count:
                why = f"damaged: {stated} events were written, {count} are there"
                wrong = DamagedError(self._path, why)
        if wrong is not None:
            complete = self._sound if stated is None else stated == count
            ended = end.ended or self._figures is not None
            raise wrong.judged(complete=complete and not self.decoder.over, ended=ended)
