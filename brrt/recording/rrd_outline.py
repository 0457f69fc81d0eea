"""What an .rrd file of ours holds, and where: found in one pass, the events left for later."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Self

from brrt.errors import BrrtError, RecordingError
from brrt.events import Kind
from brrt.recording.rrd_frames import (
    BATCH,
    FRAME,
    FRAMES,
    HEAD,
    MAGIC,
    STREAM_ENDS,
    opened,
    unpacked,
)
from brrt.recording.sound import MOST_BYTES, CutError
from brrt.recording.stamp import is_damaged

EVENTS, OURS = "/ev/", "/brrt/"
MANIFEST, WORLD, END = "/brrt/manifest", "/brrt/world", "/brrt/end"
"""Where things are in an .rrd file."""

_KINDS = {f"{EVENTS}{kind.label}": kind for kind in Kind}
_ANY, _TIMES = 1 << 26, 64
"""Of all that is unpacked: bytes in any case, and times the size of the file."""


@dataclass(slots=True)
class Outline:
    """What a file holds, and where: all but the events.

    Attributes:
        path: The file.
        texts: Named texts of each entity that has such.
        places: Where the events are: kind, first byte, length.
        stopped: Why the rest of the file is of no use; None if it is whole.
        unpacked: Bytes that were decompressed so far.
    """

    path: Path
    texts: dict[str, dict[str, str]] = field(default_factory=dict)
    places: list[tuple[Kind, int, int]] = field(default_factory=list)
    stopped: RecordingError | None = None
    unpacked: int = 0

    @classmethod
    def of(cls, path: Path) -> Self:
        """Look through a file, after its checksum if it has one.

        Raises:
            RecordingError: It cannot be read, is damaged, or is no such file.
        """
        try:
            with path.open("rb") as file:
                magic = file.read(HEAD)[: len(MAGIC)]
            damaged = magic == MAGIC and is_damaged(path)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}") from None
        if magic != MAGIC:
            raise RecordingError(f"{path}: not a Rerun recording")
        if damaged:
            raise RecordingError(f"{path}: damaged: the checksum does not match")
        outline = cls(path)
        with path.open("rb") as file:
            try:
                outline.read(file)
            except RecordingError as error:
                outline.stopped = error
        return outline

    def read(self, file: IO[bytes]) -> None:
        """Go through all frames.

        Raises:
            CutError: The file ends before its end.
            RecordingError: It is damaged.
        """
        size = file.seek(0, 2)
        at = file.seek(HEAD)
        while True:
            frame = file.read(FRAME.size)
            if len(frame) < FRAME.size:
                break
            kind, length = FRAME.unpack(frame)
            at += len(frame)
            if kind not in FRAMES:
                raise self.damaged(at, f"there is no frame of kind {kind}")
            if length > size - at:
                break
            if kind == STREAM_ENDS:
                return
            if kind == BATCH:
                self._look(file, at, length, _ANY + _TIMES * size)
            at = file.seek(at + length)
        raise CutError(f"{self.path}: the file is cut at byte {size:,}")

    def _look(self, file: IO[bytes], at: int, length: int, most: int) -> None:
        """Note where events are, and take in texts."""
        if length > MOST_BYTES:
            raise self.damaged(at, f"a message of {length:,} bytes")
        try:
            arrow = unpacked(file.read(length))
            self.unpacked += len(arrow)
            if self.unpacked > most:
                raise BrrtError("it unpacks to more than any real file")  # noqa: TRY301
            # The entity's name is in the schema; to parse the schemas of drawings takes longer.
            begin = arrow[: 1 << 14].tobytes()
            if EVENTS.encode() not in begin and OURS.encode() not in begin:
                return
            entity, batches = opened(arrow)
            if entity in _KINDS:
                self.places.append((_KINDS[entity], at, length))
            elif entity.startswith(OURS):
                for batch in batches:
                    self._take_texts(entity, batch)
        except Exception as error:  # noqa: BLE001 - whatever damage leads pyarrow to
            raise self.damaged(at, reason(error)) from None

    def _take_texts(self, entity: str, batch: Any) -> None:
        found = {
            name.rpartition(":")[2]: str(batch.column(name)[0].as_py()[0])
            for name in batch.schema.names
            if name.startswith(f"{archetype(entity)}:") and batch.num_rows
        }
        if self.texts.setdefault(entity, found) != found:
            raise BrrtError("it holds more than one recording")

    def damaged(self, at: int, why: str) -> RecordingError:
        """Return the error for what is wrong near a byte."""
        return RecordingError(f"{self.path}: damaged near byte {at:,}: {why}")


def archetype(entity: str) -> str:
    """`brrt.edge` for `/ev/edge`."""
    return f"brrt.{entity.rsplit('/', 1)[-1]}"


def reason(error: Exception) -> str:
    """Return in one line what an error says."""
    return (str(error).strip() or repr(error)).splitlines()[0][:200]
