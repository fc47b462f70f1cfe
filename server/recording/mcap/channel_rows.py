"""Reads one channel of a recording of our own, and unpacks only the chunks that hold it.

Of a closed file the index names these chunks; one without an index is not searched. Of a file that was never closed the
records are walked, and of a long one only those of its end. Other readers make an object of each record of the index,
which takes seconds for each GB.
"""

from __future__ import annotations

import logging
import os
import struct
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from server.recording.mcap.chain import FOOTER_BYTES, RECORD_BYTES, TAG, parsed
from server.recording.mcap.chunk_rows import chunk_rows, read_chunk
from server.recording.mcap.chunks import HEAD_BYTES, MAGIC
from server.recording.mcap.mcap_file import is_cut
from server.recording.own import METADATA
from server.recording.read.unpack import verified

log = logging.getLogger("catgraph.recording")

_HEAD = struct.Struct("<BQ")  # opcode, length
_OF_DATA = {Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.DATA_END}
_MOST_TEXT = 16 << 20  # bytes of a record that declares something
_LINK_WITHIN = 8 << 20  # bytes in which a record of the chain begins; one is written twice a second

Check = Callable[[], None]  # called now and then; what it raises ends the reading


def metadata_of(file: IO[bytes]) -> dict[str, str]:
    """What the recorder stated at the beginning; empty: it is no file of ours. Damage raises any exception."""
    file.seek(len(MAGIC))
    body = b""
    for wanted in (Opcode.HEADER, Opcode.METADATA):
        opcode, length = _HEAD.unpack(file.read(HEAD_BYTES))
        if opcode != wanted or length > _MOST_TEXT:
            return {}
        body = file.read(length)
    found = Metadata.read(_stream(body))
    return dict(found.metadata) if found.name == METADATA else {}


def channel_rows(file: IO[bytes], topic: str, *, most_of_cut: int | None, check: Check) -> Iterator[bytes]:
    """The messages of a topic in their order. `most_of_cut`: bytes at the end of a file that was never closed which
    are read; None: all.

    A damaged chunk is left out. Raises OSError and what `check` raises; damage raises any exception.
    """
    of_cut = is_cut(file)
    places = _of_cut(file, topic, most_of_cut, check) if of_cut else _of_closed(file, topic, check)
    for at, numbers in places:
        check()
        yield from (raw for _, _, raw in _rows(file, at, numbers))


def _rows(file: IO[bytes], at: int, numbers: set[int]) -> list[tuple[int, int, bytes]]:
    try:
        return chunk_rows(file, at, numbers, 0)
    except Exception as error:  # damage makes the readers fail in every way there is
        log.debug("chunk left out: at=%d error=%s", at, error)
        return []


def _of_closed(file: IO[bytes], topic: str, check: Check) -> Iterator[tuple[int, set[int]]]:
    """The place of each chunk with messages of the topic, and the numbers of its channels."""
    end = file.seek(0, os.SEEK_END) - len(MAGIC) - FOOTER_BYTES
    file.seek(end + HEAD_BYTES)
    at = int.from_bytes(file.read(8), "little")  # where the index begins; 0: there is none
    numbers: set[int] = set()
    places: list[int] = []
    file.seek(at)
    while 0 < at < end:
        opcode, length = _HEAD.unpack(file.read(HEAD_BYTES))
        if length > _MOST_TEXT or opcode in _OF_DATA:  # the footer is damaged: there is no index
            break
        body = file.read(length)
        at += HEAD_BYTES + length
        if opcode == Opcode.CHANNEL:
            numbers |= _number(body, topic)
        elif opcode == Opcode.CHUNK_INDEX:
            check()
            place, size = int.from_bytes(body[16:24], "little"), int.from_bytes(body[32:36], "little")
            if any(
                int.from_bytes(body[one : one + 2], "little") in numbers
                for one in range(36, min(36 + size, len(body)), 10)
            ):
                places.append(place)
    yield from ((place, numbers) for place in sorted(places))


def _of_cut(file: IO[bytes], topic: str, most: int | None, check: Check) -> Iterator[tuple[int, set[int]]]:
    """As `_of_closed`, by the message indexes that follow each chunk."""
    size = file.seek(0, os.SEEK_END)
    numbers: set[int] = set()
    at, chunk_at = len(MAGIC), 0
    while True:
        file.seek(at)
        head = file.read(HEAD_BYTES)
        opcode, length = _HEAD.unpack(head) if len(head) == HEAD_BYTES else (0, 0)
        end = at + HEAD_BYTES + length
        if opcode == 0 or end > size:
            return
        if opcode == Opcode.CHUNK:
            check()
            if not numbers and (numbers := _declared(file, at, topic)) and most is not None:
                begin, at = at, _link_behind(file, size - most, at)
                if at > begin:
                    continue
            chunk_at = at
        elif opcode == Opcode.MESSAGE_INDEX and int.from_bytes(file.read(2), "little") in numbers:
            yield chunk_at, numbers
        at = end


def _link_behind(file: IO[bytes], at: int, least: int) -> int:
    """Where the first record of the chain at or behind `at` begins; `least` where that is before it, or none is."""
    if at <= least:
        return least
    file.seek(at)
    data, place = file.read(_LINK_WITHIN), HEAD_BYTES - 1
    while (place := data.find(TAG, place + 1)) >= 0:
        begin = place - HEAD_BYTES
        if parsed(data[begin : begin + RECORD_BYTES]) is not None:
            return at + begin
    return least


def _declared(file: IO[bytes], at: int, topic: str) -> set[int]:
    """The channels of a topic that a chunk declares."""
    numbers: set[int] = set()
    try:
        data = verified(read_chunk(file, at))
    except Exception as error:  # as above
        log.debug("chunk left out: at=%d error=%s", at, error)
        return numbers
    place = 0 if topic.encode() in data else len(data)
    while place + HEAD_BYTES <= len(data):
        opcode, length = _HEAD.unpack_from(data, place)
        if opcode == Opcode.CHANNEL:
            numbers |= _number(data[place + HEAD_BYTES : place + HEAD_BYTES + length], topic)
        place += HEAD_BYTES + length
    return numbers


def _number(body: bytes, topic: str) -> set[int]:
    channel = Channel.read(_stream(body))
    return {channel.id} if channel.topic == topic else set()


def _stream(body: bytes) -> Any:
    return ReadDataStream(BytesIO(body))
