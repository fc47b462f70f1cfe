"""Recordings with one packed part, whose size need not be the one that they say. Written by hand."""

from __future__ import annotations

import bz2
import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Literal

import lz4.frame
import zstandard

Kind = Literal["bz2", "lz4", "zstd"]
TIME_NS = 1_700_000_000 * 10**9
TWIST = """geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


@cache
def zeros(kind: Kind, size: int) -> bytes:
    """So many zeros, packed."""
    begin = b""
    pack: Callable[[bytes], bytes]
    end: Callable[[], bytes]
    match kind:
        case "bz2":
            bz = bz2.BZ2Compressor(1)
            pack, end = bz.compress, bz.flush
        case "zstd":
            zs = zstandard.ZstdCompressor().compressobj()
            pack, end = zs.compress, zs.flush
        case "lz4":
            lz = lz4.frame.LZ4FrameCompressor()
            begin, pack, end = lz.begin(), lz.compress, lz.flush
    block = bytes(1 << 20)
    return b"".join([begin, *(pack(block) for _ in range(size >> 20)), end()])


def bag(path: Path, kind: Kind, size: int, declared: int | None = None) -> Path:
    """A ROS 1 bag with one chunk of `size` zeros, which declares `declared` bytes."""
    u4, u8 = struct.Struct("<I").pack, struct.Struct("<Q").pack
    at = struct.pack("<II", TIME_NS // 10**9, 0)
    packed = zeros(kind, size)
    chunk = _header(op=b"\x05", compression=kind.encode(), size=u4(declared or size)) + _sized(packed)
    index = _header(op=b"\x04", ver=u4(1), conn=u4(0), count=u4(1)) + _sized(at + u4(0))
    named = _header(
        topic=b"/vel",
        type=b"geometry_msgs/Twist",
        md5sum=b"9f195f881246fdfa2798d1d3eebca84a",
        message_definition=TWIST.encode(),
    )
    connection = _header(op=b"\x07", conn=u4(0), topic=b"/vel") + named
    magic = b"#ROSBAG V2.0\n"
    begins = len(magic) + 4096
    ends = begins + len(chunk) + len(index)
    head = _header(op=b"\x03", index_pos=u8(ends), conn_count=u4(1), chunk_count=u4(1))
    info = _header(op=b"\x06", ver=u4(1), chunk_pos=u8(begins), start_time=at, end_time=at, count=u4(1))
    padding = _sized(b" " * (4096 - len(head) - 4))
    path.write_bytes(magic + head + padding + chunk + index + connection + info + _sized(u4(0) + u4(1)))
    return path


def mcap(
    path: Path,
    kind: Kind,
    size: int,
    declared: int | None = None,
    *,
    is_closed: bool = True,
    has_index: bool = True,
    profile: Literal["ros1", "ros2"] = "ros1",
    chunk_at: int | None = None,
    messages: int = 1,
) -> Path:
    """An MCAP file with one chunk of `size` zeros. Its index declares `declared` bytes for the chunk, its place
    `chunk_at`, and the number of `messages`."""
    magic, packed, claimed = b"\x89MCAP0\r\n", zeros(kind, size), size if declared is None else declared
    times = struct.pack("<QQ", TIME_NS, TIME_NS + 10**9)
    chunk = _record(6, times + struct.pack("<QI", claimed, 0) + _text(kind) + struct.pack("<Q", len(packed)) + packed)
    written = magic + _record(1, _text(profile) + _text("by hand"))
    at = len(written)
    written += chunk
    index_at = len(written)
    written += _record(7, struct.pack("<HI", 1, 16) + struct.pack("<QQ", TIME_NS, 0))
    if not is_closed:
        path.write_bytes(written)
        return path
    index_bytes = len(written) - index_at
    written += _record(15, bytes(4))
    summary = len(written)
    if has_index:
        type, encoding = ("geometry_msgs/Twist", "ros1") if profile == "ros1" else ("geometry_msgs/msg/Twist", "cdr")
        text = "ros1msg" if profile == "ros1" else "ros2msg"
        written += _record(3, struct.pack("<H", 1) + _text(type) + _text(text) + _text(TWIST))
        written += _record(4, struct.pack("<HH", 1, 1) + _text("/vel") + _text(encoding) + bytes(4))
        counts = struct.pack("<QHIIII", messages, 1, 1, 0, 0, 1) + times + struct.pack("<IHQ", 10, 1, messages)
        written += _record(11, counts)
        place = struct.pack("<QQ", at if chunk_at is None else chunk_at, len(chunk))
        offsets = struct.pack("<IHQ", 10, 1, index_at) + struct.pack("<Q", index_bytes)
        written += _record(8, times + place + offsets + _text(kind) + struct.pack("<QQ", len(packed), claimed))
    written += _record(2, struct.pack("<QQI", summary if has_index else 0, 0, 0)) + magic
    path.write_bytes(written)
    return path


def _header(**fields: bytes) -> bytes:
    return _sized(b"".join(_sized(name.encode() + b"=" + value) for name, value in fields.items()))


def _sized(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def _text(text: str) -> bytes:
    return _sized(text.encode())
