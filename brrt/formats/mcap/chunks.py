"""Decode the records in a chunk of an MCAP file; every length and place may be wrong."""

import struct
from collections.abc import Mapping

import numpy as np
from mcap import records
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import Events, Kind, Table
from brrt.formats.integrity import Numbering
from brrt.formats.mcap.messages import HEAD_BYTES, TOPICS, Channel, Layout
from brrt.formats.mcap.records import parse

Index = Mapping[int, NDArray[np.uint64]]
"""For each channel, where its messages begin in a chunk."""

_DECLARATIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
_MOST_DECLARED, _MOST_SCHEMA = 100_000, 1 << 20
"""Schemas and channels in a file, which other tools repeat in each chunk; bytes of a schema."""
_MOST_WALKED = 4_000_000
"""Records of chunks without an index: a second or two."""


class ChunkDecoder:
    """Decodes the chunks of a file, in order.

    Args:
        dof: Numbers in a configuration.
        epoch_ns: When the run began.

    Attributes:
        numbering: Which event comes next.
    """

    def __init__(self, dof: int, epoch_ns: int) -> None:
        self.numbering = Numbering()
        self._dof, self._epoch_ns = dof, epoch_ns
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, Channel] = {}
        self._declared = self._walked = 0

    def events(self, raw: bytes, index: Index) -> Events:
        """Decode the messages of a chunk.

        Raises:
            BrrtError: They are not what the schemas say, or not the next events.
        """
        begin = self._declare_first(raw)
        try:
            events, size = self._decode(raw, index)
            if begin + size == len(raw):
                self.numbering.take(events)
                return events
        except BrrtError:
            pass
        # The index is wrong or not there, as where a file was cut after a chunk. The checksum of
        # the chunk is right: its records lead from one to the next.
        events, _ = self._decode(raw, self._walk(raw, begin))
        self.numbering.take(events)
        return events

    def _decode(self, raw: bytes, index: Index) -> tuple[Events, int]:
        """Decode the messages of our channels; return how many bytes they are, too."""
        tables, size = dict[Kind, Table](), 0
        for number, offsets in index.items():
            channel = self._channels.get(number)
            if channel is not None:
                if channel.kind in tables:
                    raise BrrtError(f"two channels hold events of kind {channel.kind.label}")
                tables[channel.kind], used = channel.decode(raw, offsets, self._dof, self._epoch_ns)
                size += used
        return Events(self._dof, dict(sorted(tables.items()))), size

    def _declare_first(self, raw: bytes) -> int:
        """Take in the schemas and channels that a chunk begins with; return where they end."""
        at = 0
        while at + 9 <= len(raw) and raw[at] in _DECLARATIONS:
            end: int = at + 9 + struct.unpack_from("<Q", raw, at + 1)[0]
            self._declare(raw[at], raw[at + 9 : end])
            at = end
        return at

    def _walk(self, raw: bytes, at: int) -> Index:
        """Index the messages of a chunk by going from one record to the next."""
        found: dict[int, list[int]] = {}
        while at < len(raw):
            self._walked += 1
            if at + HEAD_BYTES > len(raw) or self._walked > _MOST_WALKED:
                raise BrrtError("a chunk without its index")
            opcode, length, channel = struct.unpack_from("<BQH", raw, at)
            end = at + 9 + length
            if opcode == Opcode.MESSAGE:
                found.setdefault(channel, []).append(at)
            elif opcode in _DECLARATIONS:
                self._declare(opcode, raw[at + 9 : end])
            at = end
        return {channel: np.array(places, np.uint64) for channel, places in found.items()}

    def _declare(self, opcode: int, data: bytes) -> None:
        """Take in a schema or a channel."""
        self._declared += 1
        if self._declared > _MOST_DECLARED or len(data) > _MOST_SCHEMA:
            raise BrrtError("it declares more than any real file")
        if opcode == Opcode.SCHEMA:
            schema = parse(records.Schema, data)
            self._schemas[schema.id] = schema.data.decode(errors="replace")
            return
        channel = parse(records.Channel, data)
        if channel.topic in TOPICS and channel.schema_id in self._schemas:
            try:
                layout = Layout.parse(self._schemas[channel.schema_id])
            except (BrrtError, ValueError) as error:
                raise BrrtError(f"the schema of {channel.topic}: {error}") from None
            self._channels[channel.id] = Channel(channel.id, TOPICS[channel.topic], layout)
