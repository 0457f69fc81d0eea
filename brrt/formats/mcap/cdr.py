"""How events look inside an MCAP file: ROS 2 message definitions and CDR bodies, as numpy dtypes.

Flat messages of fixed size make records of fixed size, which numpy writes and reads by the chunk.
The one exception is a field of type `q[]`, whose events are rare and packed one by one.
"""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from brrt.errors import RecordingError
from brrt.events import FIELDS, Kind

_PRIMITIVES = {
    "bool": "?", "byte": "u1", "char": "u1", "uint8": "u1", "int8": "i1", "uint16": "<u2",
    "int16": "<i2", "uint32": "<u4", "int32": "<i4", "uint64": "<u8", "int64": "<i8",
    "float32": "<f4", "float64": "<f8",
}  # fmt: skip
_HEADER = b"\x00\x01\x00\x00"
"""Encapsulation: CDR version 1, little endian."""

_RECORD = [("op", "u1"), ("length", "<u8"), ("channel", "<u2"), ("seq", "<u4"),
           ("log_time", "<u8"), ("publish_time", "<u8")]  # fmt: skip
RECORD_HEAD = np.dtype(_RECORD)
"""What stands before the body of each Message record, without padding."""

MESSAGE = 5
_MAX_FIELDS, _MAX_COUNT = 256, 4096


def definition(kind: Kind, dof: int) -> str:
    """Return a kind's message definition, with its enumerations as constants."""
    lines = ["uint64 iteration  # the planner's count"]
    for field in FIELDS[kind]:
        if field.choices is not None:
            prefix = field.name.upper()
            lines += [f"{field.type} {prefix}_{c.name}={c.value}" for c in field.choices]
        text = {"q": f"float64[{dof}]", "q[]": "float64[]"}.get(field.type, field.type)
        note = f", {dof} numbers each, one after another" if field.type == "q[]" else ""
        lines.append(f"{text} {field.name}  # {field.doc}{note}")
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class Layout:
    """The record of one kind of message.

    Attributes:
        record: The whole Message record, body fields by name; for a message that ends in a
            sequence, what stands before it.
        ragged: Name of the float64 sequence that ends the message, if there is one.
    """

    record: np.dtype[np.void]
    ragged: str | None

    @classmethod
    def parse(cls, text: str) -> "Layout":
        """Derive the layout from a message definition, as files hold it.

        Raises:
            RecordingError: A field is neither a number, nor a fixed array of numbers, nor a last
                sequence of float64.
        """
        at = RECORD_HEAD.itemsize + len(_HEADER)
        columns: list[tuple[str, Any, int]] = []
        for name, kind in _RECORD:
            begin = sum(np.dtype(before).itemsize for _, before in _RECORD[: len(columns)])
            columns.append((name, kind, begin))
        columns.append(("encapsulation", "<u4", RECORD_HEAD.itemsize))
        position, ragged = 0, None
        for line in text.splitlines():
            words = line.split("#", 1)[0].split()
            if not words or any("=" in word for word in words):
                continue
            name, dtype, count = _field(words)
            if ragged is not None or len(columns) > _MAX_FIELDS:
                raise RecordingError(f"unsupported message field {' '.join(words)!r}")
            if count is None:
                # A sequence begins with its length, aligned to 4.
                ragged, dtype, count = name, np.dtype("<u4"), 0
            position += -position % dtype.itemsize
            columns.append((name, (dtype, (count,)) if count else dtype, at + position))
            position += dtype.itemsize * max(1, count)
        record = np.dtype(
            {
                "names": [c[0] for c in columns],
                "formats": [c[1] for c in columns],
                "offsets": [c[2] for c in columns],
                "itemsize": at + position,
            }
        )
        return cls(record, ragged)

    def blank(self, n: int, channel: int) -> np.ndarray[Any, np.dtype[np.void]]:
        """Make n records, all fields zero but those that are the same for every message."""
        records = np.zeros(n, self.record)
        records["op"], records["channel"] = MESSAGE, channel
        records["length"] = self.record.itemsize - 9
        records["encapsulation"] = int.from_bytes(_HEADER, "little")
        return records

    def sequence_at(self) -> int:
        """Return where in the record the numbers of the sequence begin, aligned to 8."""
        body = self.record.itemsize - RECORD_HEAD.itemsize - len(_HEADER)
        return self.record.itemsize + -body % 8

    def pack(self, record: np.void, numbers: np.ndarray[Any, np.dtype[np.float64]]) -> bytes:
        """Append a sequence to its record."""
        flat = np.ascontiguousarray(numbers, "<f8").reshape(-1)
        head = bytearray(record.tobytes()).ljust(self.sequence_at(), b"\0")
        struct.pack_into("<I", head, self.record.itemsize - 4, len(flat))
        struct.pack_into("<Q", head, 1, len(head) - 9 + flat.nbytes)
        return bytes(head) + flat.tobytes()


def _field(words: list[str]) -> tuple[str, np.dtype[Any], int | None]:
    """Return a field's name, element type and count: 0 for one number, None for a sequence."""
    try:
        kind, name = words[:2]
        base, bracket, rest = kind.partition("[")
        dtype = np.dtype(_PRIMITIVES[base])
        if not bracket:
            return name, dtype, 0
        if rest == "]" and base == "float64":
            return name, dtype, None
        count = int(rest.rstrip("]"))
    except (KeyError, ValueError):
        count = 0
    if not 0 < count <= _MAX_COUNT:
        raise RecordingError(f"unsupported message field {' '.join(words)[:80]!r}")
    return name, dtype, count
