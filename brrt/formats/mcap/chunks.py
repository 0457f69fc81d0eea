"""Decode the records in a chunk of an MCAP file; every length and place may be wrong."""

import struct
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from mcap import records
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import Events, Kind, Table
from brrt.formats.integrity import MOST_BYTES, Numbering
from brrt.formats.mcap.messages import ENCODINGS, HEAD_BYTES, MESSAGE, TOPICS, Channel, Layout
from brrt.formats.mcap.records import parse
from brrt.formats.ordering import Waiting, in_order

Index = Mapping[int, NDArray[np.uint64]]
"""For each channel, where its messages begin in a chunk."""

DECLARATIONS = (int(Opcode.SCHEMA), int(Opcode.CHANNEL))
_MOST_DECLARED = 1 << 24
"""Bytes of all schemas and channels that differ; there are 65,535 of each at most."""
_MOST_WALKED, _PACKED = 1_000_000, 8
"""Records that are no events, which are read one by one: a second in any case, and one more record
for so many bytes of the file."""
_MOST_WAITING = MOST_BYTES
"""Bytes of events that wait for earlier ones."""


class ChunkDecoder:
    """Decodes the chunks of a file, in order.

    Args:
        dof: Numbers in a configuration.
        epoch_ns: When the run began.

    Attributes:
        numbering: Which event comes next.
        kinds: For each channel so far the kind of its events; None for a channel of another tool.
        foreign: How many messages of other tools there are so far.
    """

    def __init__(self, dof: int, epoch_ns: int) -> None:
        self.numbering = Numbering()
        self.kinds: dict[int, Kind | None] = {}
        self.foreign = 0
        self._dof, self._epoch_ns = dof, epoch_ns
        self._declared: dict[tuple[int, bytes], bytes] = {}
        self._channels: dict[int, Channel] = {}
        self._declared_bytes = self._walked = 0
        self._most = _MOST_WALKED
        self._waiting, self._waiting_bytes = Waiting(dof), 0
        self._last_t: int | None = None

    def events(self, raw: bytes, index: Index, packed: int) -> Events:
        """Decode the messages of a chunk.

        Args:
            raw: Its records.
            index: Where its messages begin; it may be wrong.
            packed: Its bytes in the file.

        Returns:
            The next events, in order. There are none while an earlier event is missing, which other
            tools may have written later.

        Raises:
            BrrtError: They are not what the schemas say, or cannot be the next events.
        """
        self._most += packed // _PACKED
        begin = self._declare_first(raw)
        if not self._waiting.count:
            try:
                tables, size = self._decode(raw, index)
                if begin + size == len(raw):
                    events = _as_events(self._dof, tables)
                    self.numbering.take(events)
                    return events
            except BrrtError:
                pass
        # The index is wrong or not there, as where a file was cut after a chunk, or there are other
        # records between the messages. The records lead from one to the next.
        tables, _ = self._decode(raw, self._walk(raw, begin))
        self._number([table for _, table in tables])
        for kind, table in tables:
            self._waiting.add(kind, table)
        return self._next(len(raw))

    def rest(self) -> Events:
        """Return the events that wait, up to the first that is missing."""
        events = self._waiting.before_gap(self.numbering.next)
        self.numbering.take(events)
        return events

    def check_complete(self) -> None:
        """Check that no events wait for one that is missing.

        Raises:
            BrrtError: Some do.
        """
        if self._waiting.count:
            there = self._waiting.last + 1 - self.numbering.next
            twice = self._waiting.count > there
            raise BrrtError("events are there twice" if twice else "events are missing")

    def check_repeated(self, summary: Iterable[tuple[int, bytes]]) -> None:
        """Check that schemas and channels in a summary are those that the messages have.

        Raises:
            BrrtError: One is another.
        """
        for opcode, data in summary:
            known = self._declared.get((opcode, data[:2]), data)
            if known == data:
                continue
            kind: Any = records.Schema if opcode == Opcode.SCHEMA else records.Channel
            if parse(kind, known) != parse(kind, data):
                number = int.from_bytes(data[:2], "little")
                raise BrrtError(f"its summary has another {kind.__name__} {number} than its data")

    def _next(self, size: int) -> Events:
        """Return the events that wait if none is missing between them, otherwise none."""
        if self._waiting.complete(self.numbering.next):
            events = self._waiting.events()
            self.numbering.take(events)
            self._waiting.clear()
            self._waiting_bytes = 0
            return events
        self._waiting_bytes += size
        if self._waiting_bytes > _MOST_WAITING:
            raise BrrtError(
                f"event {self.numbering.next:,} is missing, or far behind later ones: if no event "
                "is lost, sort the file by its log times"
            )
        return Events(self._dof, {})

    def _number(self, tables: list[Table]) -> None:
        """Number events by their times if they have no numbers: tools may write 0 for all.

        Raises:
            BrrtError: They have none, and their times do not follow those before.
        """
        t = np.concatenate([np.empty(0, np.int64), *(table["t"] for table in tables)])
        first, none = self.numbering.next, not any(table["seq"].any() for table in tables)
        begins = first <= 1 < first + len(t) and not self._waiting.count
        if not (len(t) and none and (begins or self._last_t is not None)):
            return
        if self._last_t is not None and t.min() <= self._last_t:
            raise BrrtError("messages without sequence numbers are not in the order of their times")
        self._last_t = int(t.max())
        seqs = np.empty(len(t), np.int64)
        seqs[np.argsort(t, kind="stable")] = first + np.arange(len(t))
        ends = np.cumsum([len(table) for table in tables])
        for table, part in zip(tables, np.split(seqs, ends[:-1]), strict=True):
            table["seq"] = part

    def _decode(self, raw: bytes, index: Index) -> tuple[list[tuple[Kind, Table]], int]:
        """Decode the messages of our channels; return how many bytes they are, too."""
        tables, size = list[tuple[Kind, Table]](), 0
        for number, offsets in index.items():
            channel = self._channels.get(number)
            if channel is not None:
                table, used = channel.decode(raw, offsets, self._dof, self._epoch_ns)
                tables.append((channel.kind, table))
                size += used
            elif number not in self.kinds:
                raise _undeclared(number)
        return tables, size

    def _declare_first(self, raw: bytes) -> int:
        """Take in the schemas and channels that a chunk begins with; return where they end."""
        at = 0
        while at + 9 <= len(raw) and raw[at] in DECLARATIONS:
            end: int = at + 9 + struct.unpack_from("<Q", raw, at + 1)[0]
            self._count()
            self._declare(raw[at], raw[at + 9 : end])
            at = end
        return at

    def _count(self) -> None:
        """Count a record that is no event: an empty one is packed into less than a byte."""
        self._walked += 1
        if self._walked > self._most:
            raise BrrtError(f"{self._most:,} records that are no events")

    def _walk(self, raw: bytes, at: int) -> Index:
        """Index the messages of our channels by going from one record to the next."""
        found: dict[int, list[int]] = {}
        while at < len(raw):
            if at + 9 > len(raw):
                raise BrrtError("a record reaches out of its chunk")
            opcode, length = struct.unpack_from("<BQ", raw, at)
            begin, at = at, at + 9 + length
            if opcode == MESSAGE:
                if length < HEAD_BYTES - 9 or at > len(raw):
                    raise BrrtError("a message reaches out of its chunk")
                number = raw[begin + 9] | raw[begin + 10] << 8
                if number in self._channels:
                    found.setdefault(number, []).append(begin)
                    continue
                if number not in self.kinds:
                    raise _undeclared(number)
                self.foreign += 1
            self._count()
            if opcode in DECLARATIONS:
                self._declare(opcode, raw[begin + 9 : at])
        return {channel: np.array(places, np.uint64) for channel, places in found.items()}

    def _declare(self, opcode: int, data: bytes) -> None:
        """Take in a schema or a channel; other tools repeat them in each chunk.

        Raises:
            BrrtError: It is damaged, or another one has its number.
        """
        known = self._declared.setdefault((opcode, data[:2]), data)
        if known is not data:
            if known != data:
                what = "schemas" if opcode == Opcode.SCHEMA else "channels"
                raise BrrtError(f"two {what} have the number {int.from_bytes(data[:2], 'little')}")
            return
        self._declared_bytes += len(data)
        if self._declared_bytes > _MOST_DECLARED:
            raise BrrtError("it declares more than any real file")
        if opcode == Opcode.CHANNEL:
            channel = parse(records.Channel, data)
            self.kinds[channel.id] = kind = TOPICS.get(channel.topic)
            if kind is not None:
                self._channels[channel.id] = Channel(channel.id, kind, self._layout(channel))

    def _layout(self, channel: records.Channel) -> Layout:
        """Return the layout of a channel's messages.

        Raises:
            BrrtError: Its schema is not there, or not one that brrt can read.
        """
        number = channel.schema_id
        data = self._declared.get((Opcode.SCHEMA, number.to_bytes(2, "little")))
        if data is None:
            raise BrrtError(f"{channel.topic} has schema {number}, which is not declared before it")
        schema = parse(records.Schema, data)
        encodings = schema.encoding, channel.message_encoding
        if encodings != ENCODINGS:
            raise BrrtError(
                f"{channel.topic} is encoded as {encodings!r:.80}, brrt reads {ENCODINGS!r}"
            )
        try:
            return Layout.parse(schema.data.decode(errors="replace"))
        except (BrrtError, ValueError) as error:
            raise BrrtError(f"the schema of {channel.topic}: {error}") from None


def _undeclared(channel: int) -> BrrtError:
    return BrrtError(f"a message of channel {channel}, which is not declared before it")


def _as_events(dof: int, tables: list[tuple[Kind, Table]]) -> Events:
    """Return tables as events; a kind has several where a topic has several channels."""
    parts: dict[Kind, list[Table]] = {}
    for kind, table in tables:
        parts.setdefault(kind, []).append(table)
    joined = {k: tables[0] if len(tables) == 1 else in_order(tables) for k, tables in parts.items()}
    return Events(dof, dict(sorted(joined.items())))
