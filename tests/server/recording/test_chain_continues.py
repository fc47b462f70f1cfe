"""The hash chain over a kill, its recovery, and from one recording to the next."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import re
import time
from itertools import pairwise
from pathlib import Path

import pytest

from server.cli.main import main
from server.recording.chain_neighbours import Beside, compare, newest_head, read_first_metadata
from server.recording.folder import RecordingsFolder
from server.recording.mcap.chain import RECORD_BYTES, TAG
from server.recording.mcap.chunks import Walk
from server.recording.recover import recover
from server.recording.verify import verify
from tests.server.recording.chained import change, closed, drive, recorded
from tests.server.recording.made import recover_all
from tests.server.recording.recording_child import record_until_killed
from tests.server.recording.test_recorder import RecorderUser

# -- a kill, and what is recovered -------------------------------------------------------------------------------------


def killed(root: Path, after_s: float) -> Path:
    """What a real recorder leaves that is killed with kill -9."""
    context = multiprocessing.get_context("forkserver")
    ours, its = context.Pipe(duplex=False)
    process = context.Process(target=record_until_killed, args=(root, its, 3600.0), daemon=True)
    process.start()
    its.close()
    ours.recv()
    time.sleep(after_s)
    process.kill()
    process.join()
    (left,) = RecordingsFolder(root).unfinished()
    return left


@pytest.mark.field
def test_after_kill_9_the_chain_continues(tmp_path: Path) -> None:
    left = killed(tmp_path, 1.2)
    before = verify(left)
    assert before.state == "unfinished"
    assert before.records > 2
    following = left.with_name("car_0002.mcap")
    head = newest_head(following)
    assert head is not None, "of a file that is not recovered yet"
    assert (head.id, head.number, head.digest) == ("car_0001", before.records, before.head)
    raw = left.read_bytes()
    (done,) = recover_all(RecordingsFolder(tmp_path))
    assert done.path is not None
    found = verify(done.path)
    assert found.state == "intact"
    assert found.is_recovered
    assert f"interrupted behind record {before.records};" in found.sentence
    end = raw.rindex(bytes.fromhex(before.head or "")) + 32
    assert done.path.read_bytes().startswith(raw[:end]), "not a byte of what the chain covers is another"
    closed(following, [[5]], previous=head.id, previous_record=str(head.number), previous_head=head.digest)
    assert compare(following, Beside(following.parent)).problems == ()
    assert compare(done.path, Beside(done.path.parent)).problems == ()


def test_recovery_does_not_make_a_change_good(tmp_path: Path) -> None:
    """A change whose checksum was made good too is kept as it is, and the chain shows it."""
    path = tmp_path / "car" / "car_1.mcap"
    recorded(path, [[30], [31], [32]], note="0").abandon()
    left = path.with_name("car_1.mcap.writing")
    raw = left.read_bytes()
    left.write_bytes(raw.replace(b"\x04\x00\x00\x00note\x01\x00\x00\x000", b"\x04\x00\x00\x00note\x01\x00\x00\x001", 1))
    assert left.read_bytes() != raw
    done = recover(left)
    assert done.path is not None
    assert verify(done.path).short == "Broken at record 1"


def test_what_is_saved_of_a_damaged_file_is_not_called_intact(tmp_path: Path) -> None:
    path = tmp_path / "car" / "car_1.mcap"
    recorded(path, [[300], [301], [302]]).abandon()
    left = path.with_name("car_1.mcap.writing")
    raw = left.read_bytes()
    at = raw.index(b"catgraph chain 1", raw.index(b"catgraph chain 1") + 1)
    left.write_bytes(change(raw, at - 200, 0xFF))
    done = recover(left)
    assert done.path is not None
    assert done.aside is not None
    found = verify(done.path)
    assert found.short == "Broken"
    assert "damaged and left out" in found.sentence


@pytest.mark.parametrize(
    ("offset", "by"),
    [
        *((-9, 0x40), (-5, 0x20), (-8, 0x01), (-2, 0x40)),
        *(("chunk", 0x40), ("chunk", 0x04), ("chunk", 0x01), ("chunk", 0x02), ("length", 0x40), ("second", 0x04)),
    ],
)
def test_a_bit_in_the_frame_of_a_record_costs_what_is_around_it_alone(
    tmp_path: Path, offset: int | str, by: int
) -> None:
    """What is behind it is kept, what was left is kept aside, and the result is not called intact."""
    path = tmp_path / "car" / "car_1.mcap"
    recorded(path, [[300 + n] for n in range(50)]).abandon()
    left = path.with_name("car_1.mcap.writing")
    raw = left.read_bytes()
    tags = [found.start() for found in re.finditer(TAG, raw)]
    assert len(tags) >= 50
    if isinstance(offset, int):
        at = tags[10] + offset
    else:
        with left.open("rb") as file:
            chunks = [each for each in Walk(file, len(raw)).chunks() if tags[9] < each.at < tags[10]]
        at = chunks[0].at + {"chunk": 0, "length": 4, "second": 2}[offset]
    left.write_bytes(change(raw, at, by))
    done = recover(left)
    assert done.path is not None
    assert done.aside is not None
    assert done.aside.read_bytes() == change(raw, at, by)
    assert done.messages == 50 if isinstance(offset, int) else done.messages >= 48
    assert verify(done.path).short == "Broken"
    assert "damaged and left out" in verify(done.path).sentence


def test_recovered_without_a_record_of_its_own_behind_the_last_link(tmp_path: Path) -> None:
    """Chunks behind the last record are kept: they were not covered, and are from here on."""
    path = tmp_path / "car" / "car_1.mcap"
    recorded(path, [[30], [31], [32]]).abandon()
    left = path.with_name("car_1.mcap.writing")
    os.truncate(left, left.stat().st_size - RECORD_BYTES)
    records = verify(left).records
    done = recover(left)
    assert done.path is not None
    assert done.messages == 3
    found = verify(done.path)
    assert (found.state, found.records) == ("intact", records + 2)


# -- from one recording to the next ------------------------------------------------------------------------------------


def test_a_recording_that_was_made_anew_is_not_the_one_that_the_next_one_names(tmp_path: Path) -> None:
    first, second = drive(tmp_path, 1), drive(tmp_path, 2)
    assert read_first_metadata(second)["previous"] == "car_1"
    assert main(["verify", str(tmp_path)]) == 0
    first.unlink()
    closed(first, [[7], [8]])
    assert verify(first).state == "intact", "alone it cannot be detected"
    assert compare(first, Beside(first.parent)).problems == (
        "It is not as it was when car_2 began, which names it as the recording before it.",
    )
    assert main(["verify", str(first)]) == 1
    assert main(["verify", str(second)]) == 1
    first.unlink()
    gone = compare(second, Beside(second.parent)).missing
    assert gone is not None
    assert gone.id == "car_1"
    assert main(["verify", str(second)]) == 0, "it was deleted, or is kept elsewhere"


def test_part_ten_follows_part_nine(tmp_path: Path) -> None:
    for part in ("", "_p2", "_p9", "_p10"):
        closed(tmp_path / f"car_20260601T120000Z{part}.mcap", [[1]])
    head = newest_head(tmp_path / "car_20260601T120000Z_p11.mcap")
    assert head is not None
    assert head.id == "car_20260601T120000Z_p10"
    assert newest_head(tmp_path / "none" / "car_1.mcap") is None


def test_a_copy_with_a_name_that_no_recording_has_is_not_named_as_the_one_before(tmp_path: Path) -> None:
    for name in ("car_20260601T120000Z", "car_20260601T120000Z (copy)"):
        closed(tmp_path / f"{name}.mcap", [[1]])
    head = newest_head(tmp_path / "car_20260602T120000Z.mcap")
    assert head is not None
    assert head.id == "car_20260601T120000Z"


async def test_a_recorder_names_the_part_before_also_after_a_restart(tmp_path: Path) -> None:
    heads = []
    for run in range(2):
        user = RecorderUser(tmp_path / "recordings")
        for n in (1, 2):
            user.recorder.begin(user.part(2 * run + n))
            user.say(n)
            await user.end(ended="closed")
        await user.stop()
        await asyncio.sleep(0)
        for path in user.finished:
            heads.append((path.name.partition(".")[0], verify(path).head, read_first_metadata(path)))
    assert len(heads) == 4
    assert "previous" not in heads[0][2]
    for (id, head, _), (_, _, metadata) in pairwise(heads):
        assert (metadata["previous"], metadata["previous_head"]) == (id, head)
    assert main(["verify", str(tmp_path)]) == 0
