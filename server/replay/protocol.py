"""The protocol between a server and the process of one replay: JSON lines of orders, length-prefixed answers."""

from __future__ import annotations

import struct
from typing import Literal

HEAD = struct.Struct("<BI")  # what it is, how many bytes follow
Kind = Literal["state", "position", "scan", "timeline", "reply", "failed"]
KINDS: tuple[Kind, ...] = ("state", "position", "scan", "timeline", "reply", "failed")
MOST_BYTES = 4 * 1024 * 1024


def record(kind: Kind, payload: bytes) -> bytes:
    """One message in the pipe's encoding."""
    return HEAD.pack(KINDS.index(kind), len(payload)) + payload
