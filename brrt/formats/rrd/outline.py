"""What an .rrd file of ours holds, and where: found in one pass, the events left for later."""

import zlib
from dataclasses import dataclass, field
from os import SEEK_END
from pathlib import Path
from typing import IO, Any, Self

from brrt.errors import BrrtError, RecordingError
from brrt.events import Kind
from brrt.formats.integrity import MOST_BYTES, BrokenError, CutError, DamagedError
from brrt.formats.rrd.checksum import is_damaged
from brrt.formats.rrd.frames import BATCH, FRAME, FRAMES, HEAD, MAGIC, STREAM_ENDS, opened, unpacked

EVENTS, OURS = "/ev/", "/brrt/"
MANIFEST, WORLD, END, CHECK = "/brrt/manifest", "/brrt/world", "/brrt/end", "/brrt/check"
"""Where things are in an .rrd file. A check says what CRC-32 all bytes ahead of it have."""

_KINDS = {f"{EVENTS}{kind.label}": kind for kind in Kind}
_ANY, _TIMES = 1 << 26, 64
"""Of all that is unpacked: bytes in any case, and times the size of the file."""


@dataclass(slots=True)
class Outline:
    """What a file holds, and where: all but the events.

    Attributes:
        path: The file.
        texts: Named texts of each entity that has such.
        places: Where the events are: kind, first byte, length, checksum of these bytes. Of a file
            that is not whole, those that are proved to be.
        stopped: Why the rest of the file is of no use; None if it is whole.
        unpacked: Bytes that were decompressed so far.
        checked: Up to which byte its checks say that it is sound; 0 where it has none.
        sound: So many of the places are ahead of that.
    """

    path: Path
    texts: dict[str, dict[str, str]] = field(default_factory=dict)
    places: list[tuple[Kind, int, int, int]] = field(default_factory=list)
    stopped: BrokenError | None = None
    unpacked: int = 0
    checked: int = 0
    sound: int = 0

    @classmethod
    def of(cls, path: Path) -> Self:
        """Look through a file, after its checksum if it has one.

        Where that is wrong, or the file was cut, the checksums of its parts say what is sound.

        Raises:
            RecordingError: The file cannot be read, is no such file, or nothing of it is sound.
        """
        try:
            with path.open("rb") as file:
                magic = file.read(HEAD)[: len(MAGIC)]
            damaged = magic == MAGIC and is_damaged(path)
            if magic != MAGIC:
                raise RecordingError(f"{path}: not a Rerun recording")
            outline = cls(path)
            with path.open("rb") as file:
                try:
                    outline._read(file)
                except BrokenError as error:
                    outline.stopped = error
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}") from None
        if damaged and not isinstance(outline.stopped, DamagedError):  # it has all its bytes
            outline.stopped = DamagedError(path, "damaged: the checksum does not match")
        if outline.stopped is not None:
            del outline.places[outline.sound :]
            if not outline.checked:
                raise outline.stopped.in_front()
        return outline

    def _read(self, file: IO[bytes]) -> None:
        """Go through all frames.

        Raises:
            CutError: The file ends before its end.
            DamagedError: It is damaged.
        """
        size = file.seek(0, SEEK_END)
        file.seek(0)
        crc, at = zlib.crc32(file.read(HEAD)), HEAD
        while len(frame := file.read(FRAME.size)) == FRAME.size:
            kind, length = FRAME.unpack(frame)
            body = at + FRAME.size
            if kind not in FRAMES:
                raise self.damaged(at, f"there is no frame of kind {kind}")
            if length > size - body:
                break
            if kind == STREAM_ENDS:
                rest = file.read(FRAME.size)
                if rest and not any(rest) and not length and END not in self.texts:
                    # A disk that lost its power may fill up what it did not write.
                    raise CutError(self.path, f"the file is cut at byte {at:,}: zeros follow")
                return
            if length > MOST_BYTES:
                raise self.damaged(at, f"a message of {length:,} bytes")
            message = file.read(length)
            if kind == BATCH:
                check = self._look(message, body, _ANY + _TIMES * size)
                if check is not None:
                    self._hold(check, at, crc)
            crc, at = zlib.crc32(message, zlib.crc32(frame, crc)), body + length
        raise CutError(self.path, f"the file is cut at byte {size:,}")

    def _look(self, message: bytes, at: int, most: int) -> dict[str, str] | None:
        """Note where events are, and take in texts; return what is a check."""
        try:
            arrow = unpacked(message)
            self.unpacked += len(arrow)
            if self.unpacked > most:
                raise BrrtError("it unpacks to more than any real file")  # noqa: TRY301
            # The entity's name is in the schema; to parse the schemas of drawings takes longer.
            begin = arrow[: 1 << 14].tobytes()
            if EVENTS.encode() not in begin and OURS.encode() not in begin:
                return None
            entity, batches = opened(arrow)
            if entity in _KINDS:
                self.places.append((_KINDS[entity], at, len(message), zlib.crc32(message)))
            elif entity.startswith(OURS):
                for batch in batches:
                    found = _texts(entity, batch)
                    if entity == CHECK:
                        return found
                    if self.texts.setdefault(entity, found) != found:
                        raise BrrtError("it holds more than one recording")  # noqa: TRY301
        except Exception as error:  # noqa: BLE001 - whatever damage leads pyarrow to
            raise self.damaged(at, reason(error)) from None
        return None

    def _hold(self, check: dict[str, str], at: int, crc: int) -> None:
        """Hold the file so far against a check; other tools move checks, which then say nothing."""
        if check.get("bytes") != str(at):
            return
        if check.get("crc32") != str(crc):
            why = f"damaged between bytes {self.checked:,} and {at:,}: the checksum does not match"
            raise DamagedError(self.path, why)
        self.checked, self.sound = at, len(self.places)

    def damaged(self, at: int, why: str) -> DamagedError:
        """Return the error for what is wrong near a byte."""
        return DamagedError(self.path, f"damaged near byte {at:,}: {why}")


def _texts(entity: str, batch: Any) -> dict[str, str]:
    """Return the last of an entity's named texts; to write them again is to replace them."""
    return {
        name.rpartition(":")[2]: str(batch.column(name)[-1].as_py()[0])
        for name in batch.schema.names
        if name.startswith(f"{archetype(entity)}:") and batch.num_rows
    }


def archetype(entity: str) -> str:
    """`brrt.edge` for `/ev/edge`."""
    return f"brrt.{entity.rsplit('/', 1)[-1]}"


def reason(error: Exception) -> str:
    """Return in one line what an error says."""
    return (str(error).strip() or repr(error)).splitlines()[0][:200]
