"""Every file that the MCAP library writes, with whatever it leaves out of it, is read as the library reads it."""

from __future__ import annotations

import contextlib
import struct
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from server.recording.mcap import mcap_file
from server.recording.mcap.chunks import HEAD_BYTES, MAGIC, has_magic
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.read.read import RecordingUnreadable, open_recording

INDEXES = (IndexType.ATTACHMENT, IndexType.CHUNK, IndexType.MESSAGE, IndexType.METADATA)


@dataclass(frozen=True, kw_only=True)
class Variant:
    """What a file holds, and what its writer leaves out."""

    messages: tuple[tuple[int, int], ...]  # channel and time [ns], in the order of writing
    foreign: bool
    profile: str
    chunking: bool
    chunk_size: int
    compression: CompressionType
    indexes: frozenset[IndexType]
    statistics: bool
    offsets: bool
    channels: bool
    schemas: bool
    crcs: bool
    metadata: bool


END_BYTES = 13 + 29 + 8  # DataEnd, footer and magic: the end of a file without a summary
PLAIN = Variant(
    messages=(), foreign=False, profile="ros2", chunking=True, chunk_size=200, compression=CompressionType.LZ4,
    indexes=frozenset(), statistics=False, offsets=False, channels=False, schemas=False, crcs=False, metadata=False,
)  # fmt: skip
VARIANTS = st.builds(
    Variant,
    messages=st.lists(st.tuples(st.integers(0, 2), st.integers(1, 50)), min_size=1, max_size=40).map(tuple),
    foreign=st.booleans(),
    profile=st.sampled_from(["ros2", "", "other"]),
    chunking=st.booleans(),
    chunk_size=st.sampled_from([1, 200, 100_000]),
    compression=st.sampled_from(CompressionType),
    indexes=st.frozensets(st.sampled_from(INDEXES)),
    statistics=st.booleans(),
    offsets=st.booleans(),
    channels=st.booleans(),
    schemas=st.booleans(),
    crcs=st.booleans(),
    metadata=st.booleans(),
)


def write(path: Path, variant: Variant) -> None:
    index_types = IndexType.NONE
    for one in variant.indexes:
        index_types |= one
    with path.open("wb") as file:
        writer = Writer(
            file,
            chunk_size=variant.chunk_size,
            compression=variant.compression,
            index_types=index_types,
            repeat_channels=variant.channels,
            repeat_schemas=variant.schemas,
            use_chunking=variant.chunking,
            use_statistics=variant.statistics,
            use_summary_offsets=variant.offsets,
            enable_crcs=variant.crcs,
        )
        writer.start(profile=variant.profile, library="a tool")
        schema = writer.register_schema("std_msgs/msg/Int32", "ros2msg", b"int32 data\n")
        channels = [writer.register_channel(f"/number_{n}", "cdr", schema) for n in range(3)]
        if variant.metadata:
            writer.add_metadata("catgraph", {"vehicle": "car", "session": "5e55"})
        beside = writer.register_channel("/pose", "protobuf", writer.register_schema("Pose", "protobuf", b"\n\0"))
        for n, (channel, time_ns) in enumerate(variant.messages):
            data = b"\0\1\0\0" + n.to_bytes(4, "little")
            writer.add_message(channels[channel], time_ns, data, time_ns, n)
            if variant.foreign:
                writer.add_message(beside, time_ns, b"", time_ns, n)
        writer.finish()  # type: ignore[no-untyped-call]


def by_library(path: Path) -> list[tuple[int, bytes]]:
    """Time and data of each message in CDR that the library finds before the file ends."""
    found = []
    with path.open("rb") as file, contextlib.suppress(EndOfFile, struct.error):
        for record in StreamReader(file).records:
            if isinstance(record, Message) and record.data:
                found.append((record.log_time, record.data))
    return sorted(found)


def by_us(path: Path) -> tuple[list[tuple[int, bytes]], list[str], list[str], dict[str, str]]:
    with open_recording([path]) as recording:
        rows = [(round(at_s * 1e9), b"\0\1\0\0" + content["data"].to_bytes(4, "little")) for at_s, *_, content in
                recording.rows()]  # fmt: skip
        times = [time_ns for time_ns, _ in rows]
        assert times == sorted(times)
        assert recording.count == len(rows)
        return sorted(rows), recording.notes, recording.damage, recording.metadata


@settings(
    deadline=None, max_examples=120, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(variant=VARIANTS)
def test_every_variant_is_read_whole(tmp_path: Path, variant: Variant) -> None:
    path = tmp_path / "a.mcap"
    write(path, variant)
    rows, notes, damage, metadata = by_us(path)
    assert rows == by_library(path)
    assert len(rows) == len(variant.messages)
    assert damage == []
    left_out = f"/pose ({len(variant.messages)} messages) is left out: messages encoded as 'protobuf' are not supported"
    assert notes == ([left_out] if variant.foreign else [])
    assert ("session" in metadata) == variant.metadata


@settings(
    deadline=None, max_examples=120, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(variant=VARIANTS, part=st.floats(0.02, 0.999))
def test_every_variant_that_is_cut_is_read_as_far_as_it_is_whole(tmp_path: Path, variant: Variant, part: float) -> None:
    path = tmp_path / "a.mcap"
    write(path, variant)
    content = path.read_bytes()
    path.write_bytes(content[: max(20, int(len(content) * part))])
    expected = by_library(path)
    if not expected:
        with contextlib.suppress(RecordingUnreadable):
            assert by_us(path)[0] == []
        return
    rows, _, damage, _ = by_us(path)
    assert rows == expected
    assert any("was never closed" in sentence for sentence in damage)


@pytest.mark.parametrize("order", [(True, False), (False, True), (True, False, True), (False, True, False)])
def test_a_file_with_messages_in_chunks_and_outside_of_them(tmp_path: Path, order: tuple[bool, ...]) -> None:
    """The format allows it, though the library's writer does not do it."""
    bodies: list[bytes] = []
    expected: list[tuple[int, bytes]] = []
    end = b""
    for number, chunking in enumerate(order):
        times = tuple((0, 100 * number + n) for n in range(1, 20))
        one = replace(PLAIN, messages=times, chunking=chunking, chunk_size=200)
        write(tmp_path / "one.mcap", one)
        content = (tmp_path / "one.mcap").read_bytes()
        expected += by_library(tmp_path / "one.mcap")
        header = len(MAGIC) + HEAD_BYTES + int.from_bytes(content[9:17], "little")
        bodies.append(content[:header] if not bodies else b"")
        bodies.append(content[header:-END_BYTES])
        end = content[-END_BYTES:]
    (tmp_path / "a.mcap").write_bytes(b"".join([*bodies, end]))
    assert by_library(tmp_path / "a.mcap") == sorted(expected)
    rows, _, damage, _ = by_us(tmp_path / "a.mcap")
    assert (rows, damage) == (sorted(expected), [])


@pytest.mark.parametrize("is_indexed", [True, False])
@pytest.mark.parametrize("other_times", [(1, 2, 3), (70, 80), ()])
def test_what_follows_the_end_is_named(tmp_path: Path, is_indexed: bool, other_times: tuple[int, ...]) -> None:
    """Two files that were joined, equal or not, and bytes that are no file."""
    variant = replace(PLAIN, messages=((0, 1), (0, 2), (0, 3)))
    if is_indexed:
        variant = replace(variant, indexes=frozenset(INDEXES), statistics=True, channels=True, schemas=True)
    write(tmp_path / "a.mcap", variant)
    rest = b"no file"
    if other_times:
        write(tmp_path / "b.mcap", replace(variant, messages=tuple((0, time_ns) for time_ns in other_times)))
        rest = (tmp_path / "b.mcap").read_bytes()
    expected = by_library(tmp_path / "a.mcap")
    (tmp_path / "a.mcap").write_bytes((tmp_path / "a.mcap").read_bytes() + rest)
    rows, _, damage, _ = by_us(tmp_path / "a.mcap")
    assert rows == expected
    assert damage == [f"a.mcap goes on behind its end, as where two files were joined: {len(rest)} bytes are left out"]


@pytest.mark.parametrize("is_chunked", [True, False])
@pytest.mark.parametrize("is_indexed", [True, False])
@pytest.mark.parametrize("other_times", [(1, 2, 3), (71, 72, 73)])
def test_of_two_joined_files_no_message_is_missing_in_silence_wherever_the_first_is_cut(
    tmp_path: Path, is_chunked: bool, is_indexed: bool, other_times: tuple[int, ...]
) -> None:
    variant = replace(PLAIN, messages=((0, 1), (0, 2), (0, 3)), chunking=is_chunked)
    if is_indexed:
        variant = replace(variant, indexes=frozenset(INDEXES), statistics=True, channels=True, schemas=True)
    contents = []
    for times in ((1, 2, 3), other_times):
        write(tmp_path / "a.mcap", replace(variant, messages=tuple((0, time_ns) for time_ns in times)))
        contents.append((tmp_path / "a.mcap").read_bytes())
    first, second = contents
    for size in range(len(MAGIC) + 1, len(first)):
        (tmp_path / "a.mcap").write_bytes(first[:size] + second)
        with contextlib.suppress(RecordingUnreadable), open_recording([tmp_path / "a.mcap"]) as recording:
            times = [round(at_s * 1e9) for at_s, *_ in recording.rows()]
            is_named = recording.damage or recording.notes or recording.rejected
            assert is_named or times == sorted((1, 2, 3, *other_times)), size


@pytest.mark.parametrize("block", [8, 9, 20])
@pytest.mark.parametrize("place", range(30))
def test_another_file_is_found_across_blocks(block: int, place: int) -> None:
    raw = bytes(place) + MAGIC + bytes(30 - place)
    for at, end, is_there in (
        (0, len(raw), True),
        (place, place + len(MAGIC), True),
        (place + 1, len(raw), False),
        (0, place + len(MAGIC) - 1, False),
    ):
        assert has_magic(BytesIO(raw), at, end, block) is is_there


def scanned(*_: object, **__: object) -> object:
    raise AssertionError("all records were read")


def test_a_whole_index_saves_reading_the_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An hour's recording opens by its summary, of any writer."""
    theirs, ours = tmp_path / "theirs.mcap", tmp_path / "ours.mcap"
    messages = tuple((n % 3, n) for n in range(1, 200))
    variant = Variant(
        messages=messages, foreign=True, profile="ros2", chunking=True, chunk_size=500, crcs=True, metadata=True,
        compression=CompressionType.ZSTD, indexes=frozenset(INDEXES), statistics=True, offsets=True, channels=True,
        schemas=True,
    )  # fmt: skip
    write(theirs, variant)
    part = PartFile(ours, profile="ros2", metadata={"vehicle": "car"})
    channel = part.channel("/catgraph/alarms", own_schema("alarms"))
    for n in range(100):
        part.add(channel, n, b'{"time_ms": 1}')
        part.flush()
    part.close(ended="closed", why="")
    monkeypatch.setattr(mcap_file, "scan", scanned)
    assert len(by_us(theirs)[0]) == len(messages)
    with open_recording([ours]) as recording:
        assert len(list(recording.own("/catgraph/alarms"))) == 100
