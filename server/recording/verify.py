"""Verifies the hash chain of a recording: whether each byte of the file is as it was written, or where it is not.

The file alone is enough. chain_neighbours.py compares the hashes by which recordings name the one before them.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import IO, Literal

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Header, Metadata

from server.recording.mcap.chain import (
    CHAIN_OPCODE,
    DATA_END_BYTES,
    FOOTER_BYTES,
    LIBRARY_MARK,
    RECORD_BYTES,
    TAG,
    ChainRecord,
    Kind,
    parsed,
)
from server.recording.mcap.chunks import HEAD_BYTES, MAGIC
from server.recording.own import LIBRARY, METADATA

State = Literal["intact", "broken", "unfinished", "no chain", "unreadable"]
OnProgress = Callable[[float], None]  # which part is done, from 0 to 1

_BLOCK = 1 << 20
_LONGEST_TEXT = 4 << 20  # bytes of a header or a metadata record that are read


@dataclass(frozen=True, slots=True, kw_only=True)
class Break:
    """Where the chain breaks: the record whose hash does not hold, and the bytes and the time that it covers."""

    record: int
    from_byte: int
    to_byte: int
    from_ns: int  # 0: unknown
    to_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Verified:
    """What became of one file."""

    state: State
    sentence: str
    records: int = 0  # of the chain that were read
    head: str | None = None  # hash of the last record [hex]; that of a broken chain proves nothing
    broken: Break | None = None
    is_recovered: bool = False  # the recorder had ended without closing the file, and recovery completed it
    previous: str | None = None  # the recording that this one names as the one before it

    @property
    def short(self) -> str:
        """As a page or a report shows it."""
        if self.state == "intact":
            return f"Intact · {(self.head or '')[:8]}"
        if self.state == "broken":
            return f"Broken at record {self.broken.record}" if self.broken is not None else "Broken"
        if self.state == "unfinished":
            return f"Ends at record {self.records} (unfinished)"
        return {"no chain": "Has no chain", "unreadable": "Cannot be read"}[self.state]


def verify(path: Path, on_progress: OnProgress = lambda part: None) -> Verified:
    """Verifies one file. Raises nothing for what is in it."""
    try:
        with path.open("rb") as file:
            return _Run(file, on_progress).verified()
    except OSError as error:
        return Verified(state="unreadable", sentence=f"Cannot be read: {error.strerror or error}.")


class _Run:
    """One pass over a file, from its first byte to its last."""

    def __init__(self, file: IO[bytes], on_progress: OnProgress) -> None:
        self._file = file
        self._on_progress = on_progress
        self._size = os.fstat(file.fileno()).st_size
        self._at = 0
        self._crc = 0
        self._hash = hashlib.sha256()
        self._from = 0  # where the bytes begin that the next record covers
        self._last: ChainRecord | None = None
        self._recovered_at: int | None = None
        self._broken: Break | None = None
        self._library: str | None = None
        self._first: dict[str, str] = {}  # metadata of the beginning
        self._newest: dict[str, str] = {}
        self._next_progress = 0

    def verified(self) -> Verified:
        if self._take(len(MAGIC)) != MAGIC:
            return self._stopped()
        while len(head := self._file.read(HEAD_BYTES)) == HEAD_BYTES:
            opcode, length = head[0], int.from_bytes(head[1:], "little")
            if self._at + HEAD_BYTES + length > self._size or not _is_record(opcode):
                break
            if opcode == CHAIN_OPCODE and HEAD_BYTES + length == RECORD_BYTES:
                raw = head + self._file.read(length)
                record = parsed(raw)
                if record is not None and record.kind is Kind.SEAL:
                    return self._sealed(record, raw)
                if record is not None:
                    self._link(record, raw)
                else:
                    self._count(raw)
                continue
            if opcode == Opcode.DATA_END:
                break
            self._count(head)
            self._body(opcode, length)
            self._report()
        return self._stopped()

    # -- reading -----------------------------------------------------------------------------------------------------

    def _count(self, raw: bytes) -> None:
        self._at += len(raw)
        self._crc = zlib.crc32(raw, self._crc)
        self._hash.update(raw)

    def _take(self, length: int) -> bytes:
        raw = self._file.read(length)
        self._count(raw)
        return raw

    def _body(self, opcode: int, length: int) -> None:
        if opcode in (Opcode.HEADER, Opcode.METADATA) and length <= _LONGEST_TEXT:
            self._note(opcode, self._take(length))
            return
        left = length
        while left and (raw := self._take(min(_BLOCK, left))):
            left -= len(raw)

    def _note(self, opcode: int, body: bytes) -> None:
        with contextlib.suppress(Exception):  # damage makes the readers fail in every way there is
            if opcode == Opcode.HEADER:
                self._library = Header.read(ReadDataStream(BytesIO(body))).library
            else:
                note = Metadata.read(ReadDataStream(BytesIO(body)))
                if note.name == METADATA:
                    self._newest = dict(note.metadata)
                    self._first = self._first or self._newest

    def _report(self) -> None:
        if self._at >= self._next_progress:
            self._next_progress = self._at + 8 * _BLOCK
            self._on_progress(self._at / max(1, self._size))

    # -- the chain ---------------------------------------------------------------------------------------------------

    def _link(self, record: ChainRecord, raw: bytes) -> None:
        self._hash.update(record.head)
        self._judge(record, self._at + len(raw))
        self._from = self._at
        self._at += len(raw)
        self._crc = zlib.crc32(raw, self._crc)
        self._hash = hashlib.sha256(raw)
        self._last = record
        if record.kind is Kind.RECOVERED and self._recovered_at is None:
            self._recovered_at = record.number

    def _judge(self, record: ChainRecord, to_byte: int) -> None:
        expected = self._expected
        if (record.number != expected or self._hash.digest() != record.digest) and self._broken is None:
            self._break(to_byte, record.at_ns)

    @property
    def _expected(self) -> int:
        return 1 if self._last is None else self._last.number + 1

    def _break(self, to_byte: int, to_ns: int = 0) -> None:
        if self._broken is None:
            from_ns = self._last.at_ns if self._last is not None else 0
            self._broken = Break(
                record=self._expected, from_byte=self._from, to_byte=to_byte, from_ns=from_ns, to_ns=to_ns
            )

    def _sealed(self, record: ChainRecord, raw: bytes) -> Verified:
        """The end: DataEnd with the CRC of all before it, and what the seal covers besides."""
        self._hash.update(record.head)
        self._crc = zlib.crc32(raw, self._crc)
        data_end = self._file.read(DATA_END_BYTES)
        while tail := self._file.read(_BLOCK):
            self._hash.update(tail)
        self._judge(record, self._size)
        expected = bytes((Opcode.DATA_END,)) + (4).to_bytes(8, "little") + self._crc.to_bytes(4, "little")
        if data_end != expected:
            self._break(self._size, record.at_ns)
        if self._broken is not None and self._broken.record == self._expected and not self._has_footer():
            self._broken = None  # its writer was killed while it wrote the end
            return self._unfinished()
        self._last = record
        if self._broken is not None:
            return self._is_broken()
        recovered = ""
        if self._recovered_at is not None:
            recovered = (
                f" The recorder was interrupted behind record {self._recovered_at - 1}; "
                "the file was completed when it was recovered."
            )
        return self._found(
            "intact", f"Intact: {record.number} records, head {record.digest.hex()}.{recovered}", record.digest.hex()
        )

    def _stopped(self) -> Verified:
        """There is no seal: the file ends too early, was changed, has no chain, or is not one of ours."""
        is_ended = self._ends_like_a_file()
        has_more = self._has_record_behind()
        is_declared = self._library is not None and LIBRARY_MARK in self._library
        if self._broken is None and self._last is None and not has_more and not (is_declared and is_ended):
            if is_declared:
                return self._found("unfinished", "Ends before record 1 (unfinished): it holds nothing yet.")
            return self._without_chain(is_ended)
        if self._broken is None and not is_ended and not has_more:
            return self._unfinished()
        if self._broken is None and self._last is None and not has_more:  # as recovery leaves a damaged file
            why = self._newest.get("why", "")
            reason = f": {why}" if self._newest.get("ended") == "recovered" and why else "."
            return self._found("broken", f"Broken: its chain is missing{reason}")
        self._break(self._size)
        return self._is_broken()

    def _unfinished(self) -> Verified:
        assert self._last is not None
        unread = self._size - self._from - RECORD_BYTES
        rest = f"; {unread} bytes behind it are not covered" if unread else ""
        sentence = (
            f"Ends at record {self._last.number} (unfinished){rest}. "
            f"What was recorded after {f'{at} UTC' if (at := clock(self._last.at_ns)) else 'it'} is missing, "
            "or the file is still being written."
        )
        return self._found("unfinished", sentence, self._last.digest.hex())

    def _without_chain(self, is_ended: bool) -> Verified:
        if self._library is not None and self._first:
            if not self._library.startswith(LIBRARY):
                return self._found(
                    "no chain",
                    f"Has no chain: a recording of catgraph, written anew by {self._library[:60] or 'another tool'}.",
                )
            version = self._first.get("version")
            by = f"catgraph {version}" if version else "a version of catgraph"
            return self._found("no chain", f"Has no chain: recorded by {by} before recordings had one.")
        what = "It is not a recording of catgraph." if is_ended else "It is not a recording of catgraph, or not whole."
        return self._found("unreadable", what)

    def _is_broken(self) -> Verified:
        assert self._broken is not None
        broken = self._broken
        sentence = (
            f"Broken at record {broken.record}: bytes {broken.from_byte} to {broken.to_byte}"
            f"{_times(broken)} are not as they were recorded."
        )
        return self._found("broken", sentence)

    def _found(self, state: State, sentence: str, head: str | None = None) -> Verified:
        return Verified(
            state=state,
            sentence=sentence,
            records=self._last.number if self._last is not None else 0,
            head=head,
            broken=self._broken,
            is_recovered=self._recovered_at is not None,
            previous=self._first.get("previous"),
        )

    def _ends_like_a_file(self) -> bool:
        self._file.seek(max(0, self._size - len(MAGIC)))
        return self._size > 2 * len(MAGIC) and self._file.read(len(MAGIC)) == MAGIC

    def _has_footer(self) -> bool:
        """Whether a footer is in its place at the end, or the magic behind it: not both go with one byte."""
        self._file.seek(max(0, self._size - FOOTER_BYTES - len(MAGIC)))
        head = bytes((Opcode.FOOTER,)) + (FOOTER_BYTES - HEAD_BYTES).to_bytes(8, "little")
        return self._file.read(HEAD_BYTES) == head or self._ends_like_a_file()

    def _has_record_behind(self) -> bool:
        """Whether there are chain records behind the last one that was read in its place. What was written since the
        file was opened does not count."""
        start = self._from + RECORD_BYTES if self._last is not None else 0
        self._file.seek(start)
        left = self._size - start
        kept = b""
        while left > 0 and (block := self._file.read(min(_BLOCK, left))):
            left -= len(block)
            kept += block
            at = -1
            while (at := kept.find(TAG, at + 1)) >= 0:
                place = max(0, at - HEAD_BYTES)
                if parsed(kept[place : place + RECORD_BYTES]) is not None:
                    return True
            kept = kept[-RECORD_BYTES:]
        return False


def _is_record(opcode: int) -> bool:
    return Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode >= 0x80


def _times(broken: Break) -> str:
    from_, to = clock(broken.from_ns), clock(broken.to_ns)
    if from_ and to:
        return f" ({from_} to {to.rpartition(' ')[2]} UTC)"
    if from_:
        return f" (after {from_} UTC)"
    return f" (until {to} UTC)" if to else ""


def clock(time_ns: int) -> str:
    """A time of day in UTC, with milliseconds; empty: not known."""
    if not time_ns:
        return ""
    try:
        text = datetime.fromtimestamp(time_ns / 1e9, UTC).strftime("%Y-%m-%d %H:%M:%S.%f")
    except (OverflowError, ValueError, OSError):
        return ""
    return text[:-3]
