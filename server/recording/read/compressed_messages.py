"""Messages that rosbag2 compressed one by one (`--compression-mode message`).

Nothing in a bag's file says so, only `metadata.yaml` beside it, which a copy may lack. A message in CDR begins with a
zero byte, so that the first bytes of a zstd frame cannot be confused with one.
"""

from __future__ import annotations

from collections.abc import Container, Sequence

import zstandard

from server.recording.read.unpack import PartTooLarge, unpack_message

PACKED = b"\x28\xb5\x2f\xfd"  # begins a zstd frame
Row = tuple[int, int, bytes]  # ns, channel, message


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
