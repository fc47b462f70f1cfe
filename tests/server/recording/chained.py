"""Small recordings with a hash chain."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

from server.recording.chain_neighbours import newest_head
from server.recording.folder import writing_path
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.recover import recover

AT_NS = 1_700_000_000_000_000_000


def recorded(path: Path, sizes: list[list[int]], **metadata: str) -> PartFile:
    """A file with a flush after each list of messages of so many bytes; not closed yet."""
    file = PartFile(path, profile="ros1", metadata={"vehicle": "car", **metadata})
    chance = random.Random(str(sizes))
    at_ns = AT_NS
    for n, portion in enumerate(sizes):
        for size in portion:
            at_ns += 10_000_000
            channel = file.channel(("/a", "/catgraph/alarms")[size % 2], own_schema("alarms"))
            file.add(channel, at_ns, chance.randbytes(size))
        if n % 3 == 1:
            file.note(left_out=f"/camera{n}")
        file.flush()
    return file


def closed(path: Path, sizes: list[list[int]], **metadata: str) -> bytes:
    return recorded(path, sizes, **metadata).close(ended="closed").read_bytes()


def recovered(path: Path, sizes: list[list[int]]) -> bytes:
    """As `closed`, of a recorder that was killed."""
    recorded(path, [[1], *sizes]).abandon()
    done = recover(writing_path(path))
    assert done.path == path
    return path.read_bytes()


def change(raw: bytes, at: int, by: int) -> bytes:
    return raw[:at] + bytes((raw[at] ^ by,)) + raw[at + 1 :]


def drive(folder: Path, n: int, **more: Any) -> Path:
    path = folder / f"car_{n}.mcap"
    head = newest_head(path)
    assert (head is None) == (n == 1)
    named = (
        {} if head is None else {"previous": head.id, "previous_record": str(head.number), "previous_head": head.digest}
    )
    closed(path, [[n], [n + 1]], **named, **more)
    return path
