"""The hash chain of a recording: records between its chunks, each with the SHA-256 of all bytes since the one before.

A chain record's opcode is one that MCAP leaves to applications, so readers skip it. A record's hash covers the bytes of
the file from the beginning of the record before it (which holds that one's hash) up to its own hash. The last record is
the seal: its hash also covers everything behind the DataEnd record, the index and the end of the file. DataEnd has the
CRC of all bytes before it, and nothing else.
"""

from __future__ import annotations

import hashlib
import os
import struct
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import IO

CHAIN_OPCODE = 0xC6
TAG = b"catgraph chain 1"
LIBRARY_MARK = "(hash chain)"  # in the header of a file that has one
_HEAD = struct.Struct("<BQ16sBQQ")  # opcode, length, tag, kind, number, time [ns]
DIGEST_BYTES = 32
RECORD_BYTES = _HEAD.size + DIGEST_BYTES
BODY_BYTES = RECORD_BYTES - 9
DATA_END_BYTES = 13
FOOTER_BYTES = 29
_END_BYTES = FOOTER_BYTES + 8  # with the magic behind it
_LOOK_BACK = 1 << 20  # bytes at the end of an unfinished file in which its last chain record is


class Kind(IntEnum):
    """What a chain record is."""

    LINK = 0
    RECOVERED = 1  # written when the file was recovered: the recorder had ended before
    SEAL = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainRecord:
    """One record of the chain."""

    kind: Kind
    number: int  # from 1
    at_ns: int  # of the newest message before it; 0: there is none
    digest: bytes

    @property
    def head(self) -> bytes:
        """All of the record before its hash."""
        return head_of_record(self.kind, self.number, self.at_ns)

    @property
    def raw(self) -> bytes:
        """The record as it is in the file."""
        return self.head + self.digest


def head_of_record(kind: Kind, number: int, at_ns: int) -> bytes:
    """All of a record before its hash."""
    return _HEAD.pack(CHAIN_OPCODE, BODY_BYTES, TAG, kind, number, at_ns)


def parsed(raw: bytes) -> ChainRecord | None:
    """The chain record in these bytes; None: they are none."""
    if len(raw) != RECORD_BYTES:
        return None
    opcode, length, tag, kind, number, at_ns = _HEAD.unpack_from(raw)
    if (opcode, length, tag) != (CHAIN_OPCODE, BODY_BYTES, TAG) or kind not in (0, 1, 2):
        return None
    return ChainRecord(kind=Kind(kind), number=number, at_ns=at_ns, digest=raw[_HEAD.size :])


class ChainWriter:
    """Makes the records of one file; is given each byte of it in order."""

    def __init__(self, after: ChainRecord | None = None) -> None:
        """`after`: the file has a chain up to and with this record, and continues behind it."""
        self.number = after.number if after is not None else 0
        self.head = after.digest if after is not None else b""  # hash of the newest record
        self._last = after.raw if after is not None else b""
        self._hash = hashlib.sha256(self._last)
        self.has_unlinked = after is None  # bytes that no record covers yet

    def feed(self, data: bytes) -> None:
        """The next bytes of the file."""
        self._hash.update(data)
        self.has_unlinked = True

    def link(self, at_ns: int, kind: Kind = Kind.LINK) -> bytes:
        """A record that covers all bytes before it. It is part of the chain already: do not feed it."""
        head = head_of_record(kind, self.number + 1, at_ns)
        self._hash.update(head)
        return self._added(head)

    def seal(self, at_ns: int, tail: bytes) -> bytes:
        """The last record, which must follow the one before directly. `tail`: all that is behind DataEnd."""
        head = head_of_record(Kind.SEAL, self.number + 1, at_ns)
        self._hash = hashlib.sha256(self._last + head)
        self._hash.update(tail)
        return self._added(head)

    def _added(self, head: bytes) -> bytes:
        self.head = self._hash.digest()
        self.number += 1
        self._last = head + self.head
        self._hash = hashlib.sha256(self._last)
        self.has_unlinked = False
        return self._last


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """The newest chain record of a file, as the next recording names it."""

    id: str  # of the recording
    number: int
    digest: str  # hex
    at_ns: int = 0  # of the newest message before it; 0: not known


def read_head(path: Path, id: str) -> Head | None:
    """The seal of a finished file, the last record of an unfinished one. None: it has none, or cannot be read."""
    try:
        with path.open("rb") as file:
            record = _seal(file) or _last_record(file)
    except OSError:
        return None
    return None if record is None else Head(id=id, number=record.number, digest=record.digest.hex(), at_ns=record.at_ns)


def _seal(file: IO[bytes]) -> ChainRecord | None:
    size = file.seek(0, os.SEEK_END)
    if size < _END_BYTES + DATA_END_BYTES + RECORD_BYTES:
        return None
    file.seek(size - _END_BYTES + 9)
    summary = int.from_bytes(file.read(8), "little")
    at = summary - DATA_END_BYTES - RECORD_BYTES
    if not 0 <= at <= size - RECORD_BYTES:
        return None
    file.seek(at)
    record = parsed(file.read(RECORD_BYTES))
    return record if record is not None and record.kind is Kind.SEAL else None


def _last_record(file: IO[bytes]) -> ChainRecord | None:
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - _LOOK_BACK))
    end = file.read(_LOOK_BACK)
    at = len(end)
    while (at := end.rfind(TAG, 0, at)) >= 9:
        if (record := parsed(end[at - 9 : at - 9 + RECORD_BYTES])) is not None:
            return record
    return None
