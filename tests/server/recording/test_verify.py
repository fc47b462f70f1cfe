"""The hash chain: every changed byte is found, nothing untouched is accused, and neither a kill nor a recovery breaks
it."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path
from typing import Any

import orjson
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from server.cli.main import main
from server.recording.mcap.chain import DATA_END_BYTES, RECORD_BYTES, ChainWriter, parsed, read_head
from server.recording.read.read import open_recording
from server.recording.verification import verification
from server.recording.verify import verify
from tests.server.recording.chained import change, closed, drive, recovered

AT_NS = 1_700_000_000_000_000_000


def chance_sizes(chance: random.Random) -> list[list[int]]:
    return [[chance.randrange(400) for _ in range(chance.randrange(1, 6))] for _ in range(chance.randrange(1, 8))]


def places(raw: bytes) -> dict[str, range]:
    """The bytes of each section of a closed file."""
    summary = int.from_bytes(raw[-28:-20], "little")
    offsets = int.from_bytes(raw[-20:-12], "little")
    first = raw.index(b"catgraph chain 1") - 9
    seal = summary - DATA_END_BYTES - RECORD_BYTES
    return {
        "magic": range(8),
        "header": range(8, 40),
        "metadata": range(60, first),
        "record": range(first, first + RECORD_BYTES),
        "chunk": range(first + RECORD_BYTES, seal - RECORD_BYTES),
        "last record": range(seal - RECORD_BYTES, seal),
        "seal": range(seal, seal + RECORD_BYTES),
        "data end": range(seal + RECORD_BYTES, summary),
        "summary": range(summary, offsets),
        "summary offsets": range(offsets, len(raw) - 37),
        "footer": range(len(raw) - 37, len(raw) - 8),
        "last magic": range(len(raw) - 8, len(raw)),
    }


@pytest.mark.parametrize(("changes", "untouched"), [(60, 40), pytest.param(1000, 1000, marks=[pytest.mark.soak])])
def test_each_changed_byte_is_found_and_no_untouched_file_is_accused(
    tmp_path: Path, changes: int, untouched: int
) -> None:
    """In each section of a file, and anywhere; every fourth file is one that was recovered after a kill."""
    chance = random.Random(changes)
    path, touched = tmp_path / "car_1.mcap", tmp_path / "touched.mcap"
    found = accused = 0
    raw = b""
    for n in range(max(changes, untouched)):
        if n < untouched:
            path.unlink(missing_ok=True)
            raw = (recovered if n % 4 == 3 else closed)(path, chance_sizes(chance))
            accused += verify(path).state != "intact"
        if n < changes:
            sections = list(places(raw).values())
            section = sections[n % (2 * len(sections))] if n % (2 * len(sections)) < len(sections) else range(len(raw))
            touched.write_bytes(change(raw, chance.choice(section), chance.randrange(1, 256)))
            found += verify(touched).state == "broken"
    print(f"{found} of {changes} changed bytes found; {accused} of {untouched} untouched files accused")
    assert (found, accused) == (changes, 0)


def test_each_byte_of_one_file(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    raw = closed(path, [[30, 41], [50]])
    for at in range(0, len(raw), 5):
        path.write_bytes(change(raw, at, 1 << at % 8))
        assert verify(path).state == "broken", at


@settings(max_examples=15, deadline=None)
@given(st.lists(st.lists(st.integers(0, 40_000), max_size=6), max_size=6), st.data())
def test_whatever_was_recorded_is_intact_and_any_other_bytes_are_not(
    tmp_path_factory: pytest.TempPathFactory, sizes: list[list[int]], data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("any") / "car_1.mcap"
    raw = closed(path, sizes)
    assert verify(path).state == "intact"
    at, length = data.draw(st.integers(0, len(raw))), data.draw(st.integers(0, 40))
    other = raw[:at] + data.draw(st.binary(max_size=40)) + raw[at + length :]
    path.write_bytes(other)
    assert (verify(path).state == "intact") == (other == raw)


def test_it_names_at_which_record_bytes_and_time(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    raw = closed(path, [[100]] * 60)
    tags = [at - 9 for at in range(len(raw)) if raw.startswith(b"catgraph chain 1", at)]
    path.write_bytes(change(raw, tags[56] - 5, 1))
    found = verify(path)
    assert found.short == "Broken at record 57"
    assert found.broken is not None
    assert (found.broken.from_byte, found.broken.to_byte) == (tags[55], tags[56] + RECORD_BYTES)
    assert found.sentence == (
        f"Broken at record 57: bytes {tags[55]} to {tags[56] + RECORD_BYTES} "
        "(2023-11-14 22:13:20.550 to 22:13:20.560 UTC) are not as they were recorded."
    )
    assert found.head is None, "a broken chain has no head to be compared"


def test_a_file_that_ends_too_early_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    raw = closed(path, [[30], [31], [32]])
    ends = [at - 9 + RECORD_BYTES for at in range(len(raw)) if raw.startswith(b"catgraph chain 1", at)]
    for size in range(ends[0], len(raw), 7):
        path.write_bytes(raw[:size])
        record = sum(end <= size for end in ends[:-1])
        assert verify(path).short == f"Ends at record {record} (unfinished)", size


@pytest.mark.parametrize("is_closed", [False, True])
def test_a_file_that_is_written_meanwhile_is_not_broken(tmp_path: Path, is_closed: bool) -> None:
    """It is verified as far as it went at the beginning."""
    path = tmp_path / "car_1.mcap"
    sizes = [[30], [31], [32], [33]]
    raw = closed(path, sizes)
    ends = [found.start() - 9 + RECORD_BYTES for found in re.finditer(b"catgraph chain 1", raw)]
    whole = raw if is_closed else raw[: ends[-2]]
    for size in (ends[0], ends[0] + 20, ends[1]):
        path.write_bytes(raw[:size])

        def go_on(part: float) -> None:
            path.write_bytes(whole)

        assert verify(path, go_on).state == "unfinished", size
        assert path.stat().st_size == len(whole)


def test_older_recordings_and_other_files_have_no_chain(tmp_path: Path) -> None:
    old, other = tmp_path / "old.mcap", tmp_path / "other.mcap"
    for path, library, metadata in ((old, "catgraph 0.1.0", {"version": "0.1.0"}), (other, "x", {})):
        with path.open("wb") as file:
            writer: Any = Writer(file)
            writer.start("ros1", library)
            if metadata:
                writer.add_metadata("catgraph", metadata)
            writer.finish()
    assert verify(old).sentence == "Has no chain: recorded by catgraph 0.1.0 before recordings had one."
    assert verify(other).state == "unreadable"
    assert verify(tmp_path / "none.mcap").state == "unreadable"
    assert main(["verify", str(old)]) == 2


def test_a_chain_that_was_cut_out_is_missed(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    raw = closed(path, [[30], [31]])
    summary = int.from_bytes(raw[-28:-20], "little")
    without = b"".join(part[RECORD_BYTES - 9 :] if n else part for n, part in enumerate(_split(raw[:summary])))
    path.write_bytes(without + raw[summary:])
    assert verify(path).short == "Broken"


def _split(raw: bytes) -> list[bytes]:
    """The bytes between the chain records, each part but the first without the record's head."""
    parts = raw.split(b"catgraph chain 1")
    return [part[:-9] if n < len(parts) - 1 else part for n, part in enumerate(parts)]


def test_readers_skip_the_records(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    closed(path, [[30], [31], [32]])
    with path.open("rb") as file:
        records = list(StreamReader(file, validate_crcs=True).records)
    assert sum(type(record).__name__ == "Message" for record in records) == 3
    with open_recording([path]) as recording:
        assert recording.count == 2, "of the car"


def test_the_head_is_read_from_the_end(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    closed(path, [[1], [2]])
    head = read_head(path, "car_1")
    assert head is not None
    assert head.digest == verify(path).head
    assert read_head(tmp_path / "none.mcap", "none") is None


def test_a_record_holds_what_was_put_into_it() -> None:
    chain = ChainWriter()
    chain.feed(b"abc")
    record = parsed(chain.link(5))
    assert record is not None
    assert (record.number, record.at_ns, record.digest) == (1, 5, chain.head)
    assert parsed(record.raw[:-1]) is None


# -- the command -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["gone", "zeroed", "damaged"])
def test_a_recording_that_is_destroyed_is_named_with_its_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    begun = ("22:13:20", "22:14:00", "22:15:00", "22:16:00")
    paths = [
        drive(tmp_path, n, started_ms=str(AT_NS // 10**6 + 60_000 * (n - 1))) for n, _ in enumerate(begun, start=1)
    ]
    third = paths[2]
    records = verify(third).records
    if how == "zeroed":
        third.write_bytes(bytes(third.stat().st_size))
    elif how == "damaged":
        third.rename(third.with_name("car_3.mcap.damaged"))
    else:
        third.unlink()
    code = main(["verify", str(tmp_path)])
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    time = "ecorded between 2023-11-14 22:13:20.020 and 2023-11-14 22:16:20.000 UTC"
    if how == "zeroed":
        assert lines[str(third)].endswith(
            f"car_4 names it as the recording before it ({records} records): it is destroyed. R{time}."
        )
        assert code == 1
    else:
        gone = f"Not in this folder: the recording before it, car_3 ({records} records) (r{time})."
        damaged = f"The recording before it, car_3 ({records} records), cannot be read. R{time}."
        assert lines[str(paths[3])].endswith(damaged if how == "damaged" else gone)
        assert code == 0, "what is there is as it was recorded"


def test_parts_that_nothing_names_are_named_too(tmp_path: Path) -> None:
    first, last = tmp_path / "car_1.mcap", tmp_path / "car_1_p4.mcap"
    closed(first, [[1], [2]])
    closed(last, [[3]], previous="car_1_p3", previous_record="7", previous_head="ab" * 32)
    assert verification(last).sentence.endswith(
        "Not in this folder: the recording before it, car_1_p3 (7 records), car_1_p2 "
        "(recorded after 2023-11-14 22:13:20.020 UTC)."
    )


@pytest.mark.parametrize(
    "previous", ["../car_1", "car_1/x", "car_" + "9" * 5000, "x" * 300, "car_0_p99999999999", "a\0b", ""]
)
def test_a_damaged_name_of_the_one_before_stops_no_verification(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], previous: str
) -> None:
    path, other = tmp_path / "car_1.mcap", tmp_path / "car_2.mcap"
    closed(path, [[1], [2]], previous=previous, previous_record="7", previous_head="ab" * 32)
    closed(other, [[3]])
    assert main(["verify", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(": ")[0] for line in lines] == [str(path), str(other)]
    assert len(max(lines, key=len)) < 2000


def test_a_cut_tail_is_reported_with_its_time(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    raw = closed(path, [[100]] * 6)
    path.write_bytes(raw[: len(raw) * 2 // 3])
    assert re.search(r"after 2023-11-14 22:13:20\.0\d0 UTC is missing", verify(path).sentence)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = drive(tmp_path, 1), drive(tmp_path, 2)
    assert main(["verify", str(first)]) == 0
    assert capsys.readouterr().out == f"{first}: {verify(first).sentence}\n"
    second.write_bytes(change(second.read_bytes(), 200, 1))
    assert main(["verify", "--json", str(tmp_path)]) == 1
    rows = orjson.loads(capsys.readouterr().out)
    assert [(Path(row["file"]).name, row["state"]) for row in rows] == [
        ("car_1.mcap", "intact"),
        ("car_2.mcap", "broken"),
    ]
    assert rows[0]["head"] == verify(first).head
    assert json.dumps(rows)
    (tmp_path / "empty").mkdir()
    assert main(["verify", str(tmp_path / "empty")]) == 2
