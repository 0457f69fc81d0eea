"""What the end of an MCAP file says of the run: its result, and how many events were written."""

import json
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import IO, NamedTuple

from mcap import records as stock
from mcap.opcode import Opcode

from brrt.errors import BrrtError
from brrt.events import Kind
from brrt.files import open_file
from brrt.formats.integrity import MOST_BYTES
from brrt.formats.mcap.messages import TOPICS
from brrt.formats.mcap.records import find_metadata, parse, parse_metadata, read_summary
from brrt.formats.mcap.sink import RESULT
from brrt.recording import Result


class Ending(NamedTuple):
    """What the end of the file says of the run.

    Attributes:
        result: The metrics; None if they are not there, or damaged.
        ended: Whether there is a result, so that the run came to its own end.
        statistics: The counts of all messages; None if they are not there.
        kinds: The kinds of the channels that the summary repeats.
        records: The records of the summary, opcode and content.
    """

    result: Result | None = None
    ended: bool = False
    statistics: stock.Statistics | None = None
    kinds: Mapping[int, Kind] = {}
    records: Sequence[tuple[int, bytes]] = ()

    @property
    def counts(self) -> Mapping[Kind, int]:
        """Events of each kind; empty if they are not there."""
        return self.counts_of(self.kinds)

    def counts_of(self, channels: Mapping[int, Kind | None]) -> Mapping[Kind, int]:
        """Return how many events of each kind some channels have; empty if that is not there."""
        stated = {} if self.statistics is None else self.statistics.channel_message_counts
        counts = dict[Kind, int]()
        for number, kind in channels.items() if stated else ():
            if kind is not None:
                counts[kind] = counts.get(kind, 0) + int(stated.get(number, 0))
        return counts


def read_ending(path: Path) -> Ending:
    """Read the result and the counts from the end of a file; of a cut file there are none."""
    kinds, statistics, places = dict[int, Kind](), None, list[stock.MetadataIndex]()
    try:
        with open_file(path) as file:
            summary = list(read_summary(path, file))
            for opcode, data in summary:
                if opcode == Opcode.CHANNEL:
                    channel = parse(stock.Channel, data)
                    if channel.topic in TOPICS:
                        kinds[channel.id] = TOPICS[channel.topic]
                elif opcode == Opcode.STATISTICS:
                    statistics = parse(stock.Statistics, data)
                elif opcode == Opcode.METADATA_INDEX:
                    places.append(parse(stock.MetadataIndex, data))
            result, ended = _result_in(file, places)
            return Ending(result, ended, statistics, kinds, summary)
    except (OSError, OverflowError, BrrtError):
        return Ending()


def _result_in(
    file: IO[bytes], places: Sequence[stock.MetadataIndex]
) -> tuple[Result | None, bool]:
    """Read the result, None if it is not there, or damaged; and whether it is there.

    Args:
        file: The file.
        places: Where the summary says that there is metadata.
    """
    try:
        # The index may be missing or wrong; then the records lead to it.
        found = None
        for find in (partial(_indexed_result, file, places), partial(find_metadata, file, RESULT)):
            with suppress(
                OSError, ValueError, OverflowError
            ):  # a wrong place or length may lead anywhere
                found = found or find()
        if found is not None:
            return parse_result(found), True
    except BrrtError:
        return None, True
    return None, any(place.name == RESULT for place in places)


def _indexed_result(
    file: IO[bytes], places: Sequence[stock.MetadataIndex]
) -> stock.Metadata | None:
    """Read the result where the index says; None if it is not there.

    Raises:
        BrrtError: It is there, and damaged.
    """
    for place in places:
        if place.name == RESULT and 9 < place.length <= MOST_BYTES:
            file.seek(place.offset)
            record = file.read(place.length)
            if record[:9] == struct.pack("<BQ", Opcode.METADATA, place.length - 9):
                metadata = parse_metadata(record[9:])
                return metadata if metadata.name == RESULT else None
    return None


def parse_result(metadata: stock.Metadata) -> Result:
    """Read the result.

    Raises:
        BrrtError: It is damaged.
    """
    try:
        return {name: json.loads(text) for name, text in metadata.metadata.items()}
    except (ValueError, RecursionError):
        raise BrrtError(f"{metadata.name} is not JSON") from None
