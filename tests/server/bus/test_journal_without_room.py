"""The log of a server that starts on a full disk: it is read, and nothing of it is lost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.bus.journal import Journal
from tests.server.bus.test_journal import event, numbers
from tests.server.small_disk import fill, small_disk


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    with small_disk(tmp_path / "disk", 256 << 10) as root:
        yield root


def kept(path: Path, count: int) -> None:
    journal = Journal(path)
    journal.append("car", [event(n, text="x" * 300) for n in range(1, count + 1)])
    journal.close()


def test_it_goes_on_and_is_stored_once_there_is_room(disk: Path) -> None:
    path = disk / "events.sqlite"
    kept(path, 2)
    other = fill(disk)
    journal = Journal(path)
    assert [one["n"] for one in journal.find("car", alarm="hot")] == [2, 1]
    assert numbers(journal.append("car", [event(3)])) == [3]
    assert journal.trouble == "The alarm log is not stored: the disk is full. 1 event is in memory only."
    other.unlink()
    assert numbers(journal.append("car", [event(4)])) == [4]
    assert journal.trouble is None
    journal.close()
    assert numbers(Journal(path).stored_after("car", 0)) == [1, 2, 3, 4]


@pytest.mark.parametrize("leave", [0, 36_864, 61_440, 81_920, 94_208, 130_000])
def test_a_damaged_one_is_read_at_the_latest_at_the_next_start_with_room(disk: Path, leave: int) -> None:
    path = disk / "events.sqlite"
    kept(path, 60)
    body = bytearray(path.read_bytes())
    body[8192:12288] = b"\xff" * 4096  # of the index of alarms
    path.write_bytes(body)
    other = fill(disk, leave=leave)
    Journal(path).close()
    other.unlink()
    journal = Journal(path)
    assert numbers(journal.stored_after("car", 0, 100)) == list(range(1, 61))
    assert journal.trouble is None
    journal.close()
    assert (disk / "events.damaged.sqlite").exists()


def test_a_kill_before_the_copy_of_a_damaged_log_has_its_name_loses_nothing(tmp_path: Path) -> None:
    path, other = tmp_path / "events.sqlite", tmp_path / "events.sqlite-wal"
    journal = Journal(path)
    journal.append("car", [event(1), event(2)])
    journal.close()
    path.rename(tmp_path / "events.sqlite.anew")
    other.write_bytes(b"of the log that was set aside")
    journal = Journal(path)
    assert numbers(journal.append("car", [event(3)])) == [3]
    assert numbers(journal.stored_after("car", 0)) == [1, 2, 3]
    journal.close()
    assert (tmp_path / "events.damaged.sqlite-wal").read_bytes() == b"of the log that was set aside"
