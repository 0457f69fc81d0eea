"""Unpack the chunks of MCAP files into bounded memory."""

import zlib

import zstandard
from mcap import records

from brrt.errors import BrrtError
from brrt.formats.integrity import MOST_BYTES
from brrt.formats.mcap.records import parse

_ANY, _TIMES = 1 << 20, 256
"""Bytes that a chunk may unpack to: in any case, and times its size. Events come to 15 times."""


def unpack_chunk(data: bytes) -> bytes:
    """Return the records in a chunk.

    Raises:
        BrrtError: The chunk is damaged, or has a compression that MCAP does not specify.
    """
    chunk = parse(records.Chunk, data)
    size, unpack = chunk.uncompressed_size, _UNPACK.get(chunk.compression)
    if unpack is None:
        raise BrrtError(
            f"a chunk has the compression {chunk.compression!r:.40}, brrt reads zstd and lz4"
        )
    if chunk.compression and size > min(MOST_BYTES, _ANY + _TIMES * len(chunk.data)):
        raise BrrtError(f"a chunk says that it unpacks to {size:,} bytes")
    raw = unpack(chunk.data, size)
    if len(raw) != size:
        raise BrrtError("a chunk has a wrong size")
    if chunk.uncompressed_crc not in (0, zlib.crc32(raw)):  # 0 stands for no checksum
        raise BrrtError("the checksum of a chunk does not match")
    return raw


def _unpack_zstd(data: bytes, size: int) -> bytes:
    """Unpack zstd frames, up to one byte more than `size`."""
    try:
        if data and zstandard.frame_content_size(data) == size:
            return bytes(zstandard.ZstdDecompressor().decompress(data))
        unpacker = zstandard.ZstdDecompressor(max_window_size=MOST_BYTES)
        # Streaming compressors state no size, and may end a frame whenever they are flushed.
        with unpacker.stream_reader(data, read_across_frames=True) as stream:
            return bytes(stream.read(size + 1))
    except zstandard.ZstdError as error:
        raise BrrtError(f"a chunk cannot be unpacked ({error})") from None


def _unpack_lz4(data: bytes, size: int) -> bytes:
    """Unpack lz4 frames, up to one byte more than `size`."""
    from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - brrt itself writes zstd

    raw = b""
    try:
        while data and len(raw) <= size:
            unpacker = LZ4FrameDecompressor()
            raw += unpacker.decompress(data, max_length=size + 1 - len(raw))
            data = unpacker.unused_data or b""
    except RuntimeError as error:
        raise BrrtError(f"a chunk cannot be unpacked ({error})") from None
    return raw


_UNPACK = {"": lambda data, _: bytes(data), "zstd": _unpack_zstd, "lz4": _unpack_lz4}
