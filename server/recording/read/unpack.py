"""Unpacks one part or message of a recording, and never more of it than fits.

rosbag2 may compress messages one by one (`--compression-mode message`). Nothing in a bag's file shows that, only
`metadata.yaml` beside it, which a copy may lack. A message in CDR begins with a zero byte, so that the first bytes of a
zstd frame cannot be confused with one.
"""

from __future__ import annotations

import bz2
import zlib
from collections.abc import Container, Sequence
from typing import Any

import lz4.frame
import zstandard

from server.system.process_limits import free_bytes

MOST_BYTES = 1 << 30  # of one part, unpacked; recorders write 1 MB, and one message is hardly ever larger than 100 MB
UNASKED_BYTES = 16 << 20  # below this size the free memory is not checked
FREE_PART = 0.25  # of the free memory, for one part

PACKED = b"\x28\xb5\x2f\xfd"  # begins a zstd frame
Row = tuple[int, int, bytes]  # ns, channel, message


class PartTooLarge(Exception):
    """An unpacked part would exceed the memory limit; `str()` has the limit, without a file name."""


def unpack(compression: str, packed: bytes, size: int, most: int = MOST_BYTES) -> bytes:
    """Unpack a part with a declared size of `size` bytes.

    Raises PartTooLarge if it declares or holds too many, and ValueError, RuntimeError, EOFError, OSError or
    zstandard.ZstdError where it is damaged or is not of its size. `compression`: "", "none", "bz2", "lz4" or "zstd".
    """
    allowed = allowed_bytes(most) if size > UNASKED_BYTES else most
    if size > allowed:
        raise too_large(allowed)
    match compression:
        case "" | "none":
            data = packed
        case "bz2":
            data = _streamed(bz2.BZ2Decompressor(), packed, size)
        case "lz4":
            data = _streamed(lz4.frame.LZ4FrameDecompressor(), packed, size)
        case "zstd":
            data = _zstd(packed, size)
        case other:
            raise ValueError(f"packed as {other[:20]!r}, which is not supported")
    if len(data) != size:
        raise ValueError("another size than it declares")
    return data


def unpack_message(packed: bytes) -> bytes:
    """One message packed with zstd, as rosbag2 packs them one by one. Raises as `unpack`."""
    size = zstandard.frame_content_size(packed)
    if size >= 0:
        return unpack("zstd", packed, size)
    allowed = allowed_bytes(MOST_BYTES)
    data = zstandard.ZstdDecompressor().stream_reader(packed).read(allowed + 1)
    if len(data) > allowed:
        raise too_large(allowed)
    return data


def verified(chunk: Any, most: int = MOST_BYTES) -> bytes:
    """The records in a chunk of MCAP. Raises as `unpack`, and ValueError where its checksum is another."""
    data = unpack(chunk.compression, chunk.data, chunk.uncompressed_size, most)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("another checksum")
    return data


def allowed_bytes(most: int) -> int:
    """How large a part may be, by what the machine has free."""
    free = free_bytes()
    return most if free is None else min(most, int(free * FREE_PART))


def too_large(allowed: int) -> PartTooLarge:
    return PartTooLarge(f"it would take more than {allowed / 2**20:.0f} MB, unpacked")


def _streamed(unpacker: Any, packed: bytes, size: int) -> bytes:
    """Unpack at most one byte more than declared."""
    data = bytes(unpacker.decompress(packed, size + 1))
    if len(data) == size and not unpacker.eof:  # its end mark may not have been read yet
        data += unpacker.decompress(b"", 1)
    if not unpacker.eof and len(data) <= size:
        raise EOFError("it ends too early")
    return data


def _zstd(packed: bytes, size: int) -> bytes:
    declared = zstandard.frame_content_size(packed)
    if declared >= 0 and declared != size:  # the declared size is reserved before unpacking
        raise ValueError("another size than it declares")
    return zstandard.ZstdDecompressor().decompress(packed, max_output_size=max(1, size))


def unpacked_rows(rows: Sequence[Row], channels: Container[int]) -> tuple[list[Row], int]:
    """The rows with the packed messages of these channels unpacked, and how many could not be.

    Raises PartTooLarge and MemoryError.
    """
    found, lost = [], 0
    for row in rows:
        time_ns, channel, raw = row
        if raw[:4] != PACKED or channel not in channels:
            found.append(row)
            continue
        message = unpacked(raw)
        if message is None:
            lost += 1
        else:
            found.append((time_ns, channel, message))
    return found, lost


def unpacked(raw: bytes) -> bytes | None:
    """A packed message; None where it is damaged. Raises PartTooLarge and MemoryError."""
    try:
        return unpack_message(raw)
    except (PartTooLarge, MemoryError):
        raise
    except (ValueError, EOFError, RuntimeError, zstandard.ZstdError):
        return None
