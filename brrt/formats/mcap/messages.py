"""Events as ROS 2 messages, both ways: definitions, and Message records that numpy lays out.

Flat messages of fixed size make records of fixed size, which numpy writes and reads by the chunk.
The one exception is a field of type `q[]`, whose events are rare and are packed one by one.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import FIELDS, Events, Kind, Table, table_dtype

TOPICS = {f"/brrt/{kind.label}": kind for kind in Kind}
"""The topic of each kind of event."""

ENCODINGS = "ros2msg", "cdr"
"""Encodings of the schemas and of the messages."""

_PRIMITIVES = {
    "bool": "?", "byte": "u1", "char": "u1", "uint8": "u1", "int8": "i1", "uint16": "<u2",
    "int16": "<i2", "uint32": "<u4", "int32": "<i4", "uint64": "<u8", "int64": "<i8",
    "float32": "<f4", "float64": "<f8",
}  # fmt: skip
_ENCAPSULATION = b"\x00\x01\x00\x00"
"""How a body begins: CDR version 1, little endian; then two bytes of options."""
_LITTLE_ENDIAN = int.from_bytes(_ENCAPSULATION[:2], "little")

_HEAD = [("op", "u1"), ("length", "<u8"), ("channel", "<u2"), ("seq", "<u4"),
         ("log_time", "<u8"), ("publish_time", "<u8")]  # fmt: skip
HEAD_BYTES = np.dtype(_HEAD).itemsize
"""Bytes before the body of a Message record."""

MESSAGE = 5
"""The opcode of a Message record."""

_MAX_FIELDS, _MAX_COUNT = 256, 4096


def channel_of(kind: Kind) -> int:
    """Return the channel's number; 0 stands for no schema in MCAP."""
    return int(kind) + 1


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
    """Where the fields of one kind of message are in its record.

    Attributes:
        record: The whole Message record, body fields by name; for a message that ends in a
            sequence, what precedes the sequence.
        sequence: Name of the float64 sequence that ends the message, if there is one.
    """

    record: np.dtype[np.void]
    sequence: str | None

    @classmethod
    def parse(cls, text: str) -> "Layout":
        """Derive the layout from a message definition, as files contain it.

        Raises:
            BrrtError: A field is neither a number, nor a fixed array of numbers, nor a last
                sequence of float64.
            ValueError: Two fields have one name.
        """
        columns: list[tuple[str, Any, int]] = []
        for name, kind in _HEAD:
            begin = sum(np.dtype(before).itemsize for _, before in _HEAD[: len(columns)])
            columns.append((name, kind, begin))
        columns.append(("encapsulation", "<u2", HEAD_BYTES))
        body = HEAD_BYTES + len(_ENCAPSULATION)
        position, sequence = 0, None
        for line in text.splitlines():
            words = line.split("#", 1)[0].split()
            if not words or any("=" in word for word in words):
                continue
            name, dtype, count = _field(words)
            if sequence is not None or len(columns) > _MAX_FIELDS:
                raise BrrtError(f"unsupported message field {' '.join(words)!r:.80}")
            if count is None:
                # A sequence begins with its length, aligned to 4.
                sequence, dtype, count = name, np.dtype("<u4"), 0
            position += -position % dtype.itemsize
            columns.append((name, (dtype, (count,)) if count else dtype, body + position))
            position += dtype.itemsize * max(1, count)
        names, formats, offsets = map(list, zip(*columns, strict=True))
        record = np.dtype(
            {"names": names, "formats": formats, "offsets": offsets, "itemsize": body + position}
        )
        return cls(record, sequence)

    def records(self, kind: Kind, table: Table, epoch_ns: int) -> NDArray[np.void]:
        """Return the Message records of a table, shape (n,); sequences are left out."""
        records = np.zeros(len(table), self.record)
        records["op"], records["channel"] = MESSAGE, channel_of(kind)
        records["length"] = self.record.itemsize - 9
        records["encapsulation"] = _LITTLE_ENDIAN
        records["seq"] = table["seq"] & 0xFFFFFFFF
        records["log_time"] = table["t"] + epoch_ns
        records["publish_time"] = records["log_time"]
        records["iteration"] = table["iteration"]
        for field in FIELDS[kind]:
            if field.name != self.sequence:
                records[field.name] = table[field.name]
        return records

    def with_sequence(self, record: np.void, numbers: NDArray[np.float64]) -> bytes:
        """Return a record with its sequence."""
        flat = np.ascontiguousarray(numbers, "<f8").reshape(-1)
        head = bytearray(record.tobytes()).ljust(self.sequence_at(), b"\0")
        struct.pack_into("<I", head, self.record.itemsize - 4, len(flat))
        struct.pack_into("<Q", head, 1, len(head) - 9 + flat.nbytes)
        return bytes(head) + flat.tobytes()

    def sequence_at(self) -> int:
        """Return where in the record the numbers of the sequence begin, aligned to 8."""
        body = self.record.itemsize - HEAD_BYTES - len(_ENCAPSULATION)
        return self.record.itemsize + -body % 8


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
        raise BrrtError(f"unsupported message field {' '.join(words)!r:.80}")
    return name, dtype, count


def encode(
    events: Events, layouts: Mapping[Kind, Layout], epoch_ns: int
) -> tuple[bytes, NDArray[np.uint64], NDArray[np.uint8], NDArray[np.uint64]]:
    """Return the Message records of n events, in order.

    Returns:
        The records, their log times in ns, their channels, and where each begins; shape (n,).
    """
    first, kinds = events.kinds_in_order()
    sizes, times = np.zeros(len(kinds), np.int64), np.empty(len(kinds), np.uint64)
    blocks: list[tuple[NDArray[np.int64], Any]] = []
    for kind, table in events.tables.items():
        rows, layout = table["seq"] - first, layouts[kind]
        records = layout.records(kind, table, epoch_ns)
        times[rows] = records["log_time"]
        if layout.sequence is None:
            sizes[rows] = layout.record.itemsize
            blocks.append((rows, records))
            continue
        for i, row in enumerate(rows):
            packed = layout.with_sequence(records[i], table[layout.sequence][i])
            sizes[row] = len(packed)
            blocks.append((rows[i : i + 1], np.frombuffer(packed, f"V{len(packed)}")))
    offsets = np.cumsum(sizes) - sizes
    raw = np.empty(int(sizes.sum()), np.uint8)
    for rows, block in blocks:
        size = block.dtype.itemsize
        # Every place where a record of this size could begin, as one overlapping view.
        window = np.ndarray((len(raw) - size + 1,), f"V{size}", raw.data, strides=(1,))
        window[offsets[rows]] = block.view(f"V{size}")
    return raw.tobytes(), times, kinds + np.uint8(1), offsets.astype(np.uint64)


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel of events.

    Attributes:
        number: Its number in the file.
        kind: The kind of its events.
        layout: Of its messages.
    """

    number: int
    kind: Kind
    layout: Layout

    def decode(
        self, raw: bytes, offsets: NDArray[np.uint64], dof: int, epoch_ns: int
    ) -> tuple[Table, int]:
        """Return the events of this channel's messages, and how many bytes their records have.

        Args:
            raw: The records of a chunk.
            offsets: Where the messages begin, shape (n,); they may be wrong.
            dof: Numbers in a configuration.
            epoch_ns: When the run began.

        Raises:
            BrrtError: There are no such messages, or they lack a field of the kind.
        """
        layout, size = self.layout, self.layout.record.itemsize
        places = len(raw) - size + 1
        if len(offsets) * size > len(raw) or int(offsets.max()) >= places:
            raise BrrtError("a message reaches out of its chunk")
        window = np.ndarray((places,), f"V{size}", raw, strides=(1,))
        block = window[offsets].view(layout.record)
        right = (block["op"] == MESSAGE) & (block["channel"] == self.number)
        right &= block["encapsulation"] == _LITTLE_ENDIAN
        if layout.sequence is None:
            right &= block["length"] == size - 9
        if not right.all():
            raise BrrtError(f"a message does not have the layout of its schema, {self.kind.label}")
        table = np.empty(len(block), table_dtype(self.kind, dof))
        table["seq"] = block["seq"]
        table["t"] = block["log_time"].astype(np.int64) - epoch_ns
        types = {"iteration": "", **{f.name: f.type for f in FIELDS[self.kind]}}
        for name, type_ in types.items():
            if name == layout.sequence and type_ == "q[]":
                for i, offset in enumerate(offsets):
                    begin = int(offset) + layout.sequence_at()
                    table[name][i] = _sequence(raw, begin, int(block[name][i]), dof)
            elif type_ == "q[]" or not _fits(layout, table.dtype, name):
                raise BrrtError(f"the schema of {self.kind.label} has no such field {name!r}")
            else:
                table[name] = block[name]
        if layout.sequence is None:
            return table, len(block) * size
        return table, int((block["length"] + np.uint64(9)).sum())


def _sequence(raw: bytes, begin: int, count: int, dof: int) -> NDArray[np.float64]:
    if begin + 8 * count > len(raw) or count % dof:
        raise BrrtError("a sequence reaches out of its chunk")
    return np.frombuffer(raw, "<f8", count, begin).reshape(-1, dof).copy()


def _fits(layout: Layout, wanted: np.dtype[Any], name: str) -> bool:
    """Whether a field is there with as many numbers, and of a type that holds no others."""
    if name == layout.sequence or name not in (layout.record.names or ()):
        return False
    a, b = layout.record[name], wanted[name]
    # Iterations are unsigned in files; those beyond int64 are refused as negative ones.
    casting: Any = "same_kind" if name == "iteration" else "safe"
    return a.shape == b.shape and np.can_cast(a.base, b.base, casting)
