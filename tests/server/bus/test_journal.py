"""The log: numbered, found again, and kept through kill -9, a full disk, a locked and a damaged file."""

from __future__ import annotations

import random
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from server.bus.journal import MAX_UNSAVED, Journal
from tests.tree import PROJECT

ROOT = PROJECT


def event(number: int, **fields: Any) -> dict[str, Any]:
    return {"at_ms": number * 10, "alarm": "hot", "change": "raised", "text": f"event {number}"} | fields


def numbers(events: list[dict[str, Any]]) -> list[int]:
    return [one["n"] for one in events]


def holder(path: Path) -> sqlite3.Connection:
    """Another program that holds the file's write lock."""
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    return other


def test_numbers_count_for_each_vehicle_and_go_on_after_a_restart(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "events.sqlite")
    assert numbers(journal.append("red", [event(1), event(2)])) == [1, 2]
    assert numbers(journal.append("blue", [event(1)])) == [1]
    journal.close()
    journal = Journal(tmp_path / "events.sqlite")
    assert (journal.last("red"), journal.last("blue"), journal.last("green")) == (2, 1, 0)
    assert numbers(journal.append("red", [event(3)])) == [3]
    assert [one["text"] for one in journal.after("red", 1)] == ["event 2", "event 3"]
    journal.close()


@pytest.mark.parametrize(
    ("filters", "found"),
    [
        ({}, [6, 5, 4, 3, 2, 1]),
        ({"limit": 2}, [6, 5]),
        ({"before": 3}, [2, 1]),
        ({"alarm": "cold"}, [5, 2]),
        ({"change": "cleared"}, [6]),
        ({"since_ms": 40}, [6, 5, 4]),
        ({"until_ms": 40}, [3, 2, 1]),
        ({"since_ms": 20, "until_ms": 60, "alarm": "cold", "limit": 1}, [5]),
        ({"alarm": "' OR 1=1 --"}, []),
    ],
    ids=str,
)
@pytest.mark.parametrize("unsaved", [0, 2, 6])
def test_events_are_found_newest_first_on_the_disk_and_in_memory(
    tmp_path: Path, filters: dict[str, Any], found: list[int], unsaved: int
) -> None:
    journal = Journal(tmp_path / "events.sqlite")
    events = [event(n, alarm="cold" if n % 3 == 2 else "hot") for n in range(1, 6)] + [event(6, change="cleared")]
    journal.append("car", events[: 6 - unsaved])
    lock = holder(tmp_path / "events.sqlite")
    journal.append("car", events[6 - unsaved :])
    assert (journal.trouble is not None) == (unsaved > 0)
    assert numbers(journal.find("car", **filters)) == found
    assert numbers(journal.after("car", 2)) == [3, 4, 5, 6]
    assert journal.alarms("car") == ["cold", "hot"]
    lock.close()
    journal.close()


@pytest.mark.field
def test_while_another_program_holds_the_file_events_wait_and_are_kept_afterwards(tmp_path: Path) -> None:
    path = tmp_path / "events.sqlite"
    journal = Journal(path)
    journal.append("car", [event(1)])
    other = holder(path)
    started_s = time.monotonic()
    journal.append("car", [event(2)])
    assert time.monotonic() - started_s < 0.2, "the loop was held up"
    assert journal.trouble == "The alarm log is not stored: another program holds the file. 1 event is in memory only."
    journal.save()
    journal.append("car", [event(3)])
    assert "2 events are in memory only" in (journal.trouble or "")
    other.execute("ROLLBACK")
    journal.save()
    assert journal.trouble is None
    assert numbers(Journal(path).after("car", 0)) == [1, 2, 3]
    other.close()
    journal.close()


def test_what_memory_cannot_hold_any_more_is_counted_as_lost(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "events.sqlite")
    lock = holder(tmp_path / "events.sqlite")
    journal.append("car", [event(n) for n in range(MAX_UNSAVED + 7)])
    journal.append("car", [event(0)])
    assert "8 events are lost" in (journal.trouble or "")
    assert numbers(journal.after("car", 0, 1)) == [9]
    lock.close()
    journal.close()


def test_a_full_database_continues_in_memory_and_reports_it(tmp_path: Path) -> None:
    """SQLite's own limit of pages raises the error of a full disk."""
    journal = Journal(tmp_path / "events.sqlite")
    assert journal._database is not None
    (pages,) = journal._database.execute("PRAGMA page_count").fetchone()
    journal._database.execute(f"PRAGMA max_page_count = {pages + 2}")
    for n in range(1, 101):
        journal.append("car", [event(n, text="x" * 300)])
    assert (journal.trouble or "").startswith("The alarm log is not stored: the disk is full. ")
    assert numbers(journal.after("car", 0)) == list(range(1, 101))
    journal._database.execute("PRAGMA max_page_count = 100000")
    journal.save()
    assert journal.trouble is None
    assert numbers(journal.after("car", 0)) == list(range(1, 101))
    journal.close()


def test_a_disk_that_takes_no_more_stops_nobody(tmp_path: Path) -> None:
    """The kernel refuses every byte beyond 300 kB: events are numbered on, and what was kept before is whole."""
    path = tmp_path / "events.sqlite"
    done = subprocess.run(
        [sys.executable, "-m", "tests.server.appender", str(path), "300000"],
        capture_output=True, text=True, timeout=60, cwd=ROOT, check=False,
    )  # fmt: skip
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    kept = [int(line.split()[0]) for line in lines if not line.split()[1:]]
    assert "The alarm log is not stored: the disk " in lines[-1]
    assert kept
    journal = Journal(path)
    found = journal.after("car", 0, 10**6)
    assert numbers(found) == list(range(1, len(found) + 1))
    assert len(found) >= kept[-1]
    journal.close()


@pytest.mark.parametrize("kills", [20, pytest.param(300, marks=[pytest.mark.soak, pytest.mark.timeout(1800)])])
def test_kill_9_in_the_middle_of_an_append_loses_nothing_that_was_kept(tmp_path: Path, kills: int) -> None:
    path = tmp_path / "events.sqlite"
    chance = random.Random(20161)
    total = 0
    for _ in range(kills):
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.server.appender", str(path), "0"],
            stdout=subprocess.PIPE, text=True, cwd=ROOT,
        )  # fmt: skip
        assert process.stdout is not None
        printed = [int(process.stdout.readline()) for _ in range(3)]
        time.sleep(chance.uniform(0.0, 0.12))
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read().split("\n")
        process.wait()
        process.stdout.close()
        printed += [int(line) for line in rest[:-1] if line.strip()]  # the last may be cut off
        journal = Journal(path)
        assert journal.complaint is None
        assert journal.trouble is None
        assert journal.last("car") >= printed[-1]
        found = journal.after("car", total, 10**6)
        assert numbers(found) == list(range(total + 1, journal.last("car") + 1))
        assert all(one["text"] == "x" * (one["at_ms"] * 37 % 400) for one in found)
        total = journal.last("car")
        journal.close()
    assert total > kills * 10


@pytest.mark.parametrize("damage", ["no database", "a page", "cut off", "the first page"])
def test_a_damaged_log_is_set_aside_and_what_can_be_read_goes_on(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "events.sqlite"
    journal = Journal(path)
    journal.append("car", [event(n, text="x" * 500) for n in range(1, 301)])
    journal.close()  # the WAL goes into the file
    body = bytearray(path.read_bytes())
    match damage:
        case "no database":
            body[:] = b"this is no database" * 1000
        case "a page":
            body[len(body) // 2 : len(body) // 2 + 8192] = b"\xff" * 8192
        case "cut off":
            del body[len(body) // 2 :]
        case "the first page":
            body[:100] = bytes(100)
    path.write_bytes(body)
    journal = Journal(path)
    journal.after("car", 0, 1000)  # in the middle, damage shows only when it is read
    before = journal.last("car")
    appended = journal.append("car", [event(9)])
    assert appended[0]["n"] == before + 1
    found = numbers(journal.after("car", before))
    assert found == [before + 1]
    if damage in ("no database", "the first page"):
        assert journal.complaint == (
            "The alarm log was damaged: it is set aside as events.damaged.sqlite; 0 of its events could be read."
        )
        assert (tmp_path / "events.damaged.sqlite").read_bytes() == bytes(body)
    journal.close()


@pytest.mark.parametrize("before", [b"no json", b"[]", b"null", b'{"car": "x"}'])
def test_a_run_that_cannot_be_read_stops_no_start(tmp_path: Path, before: bytes) -> None:
    path = tmp_path / "events.sqlite"
    journal = Journal(path)
    journal.append("car", [event(1)])
    former = journal.runs.present.id
    journal._database.execute("UPDATE run SET before = ?", (before,))  # type: ignore[union-attr]
    journal.close()
    journal = Journal(path)
    assert (journal.trouble, journal.last("car")) == (None, 1)
    assert journal.runs.resume("car", former, 1, 1).new_after == 1  # as a run that the log does not know
    journal.close()


def test_a_program_that_holds_the_file_for_a_moment_at_the_start_is_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "events.sqlite"
    journal = Journal(path)
    journal.append("car", [event(1)])
    journal.close()
    other = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    other.execute("PRAGMA locking_mode=EXCLUSIVE")
    other.execute("BEGIN EXCLUSIVE")
    threading.Timer(0.1, other.close).start()
    journal = Journal(path)
    assert (journal.trouble, journal.last("car")) == (None, 1)
    assert journal._database is not None
    assert journal._database.execute("PRAGMA busy_timeout").fetchone() == (0,)  # later it delays no alarm
    journal.close()


def test_a_second_damage_does_not_overwrite_what_was_set_aside(tmp_path: Path) -> None:
    path = tmp_path / "events.sqlite"
    for _ in range(2):
        path.write_bytes(b"no database at all" * 500)
        Journal(path).close()
    assert {one.name for one in tmp_path.iterdir() if "damaged" in one.name} == {
        "events.damaged.sqlite",
        "events.damaged-2.sqlite",
    }


def test_a_folder_that_is_none_leaves_the_log_in_memory(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "nowhere" / "events.sqlite")
    assert numbers(journal.append("car", [event(1), event(2)])) == [1, 2]
    assert numbers(journal.after("car", 0)) == [1, 2]
    assert journal.trouble == ("The alarm log is not stored: the file cannot be opened. 2 events are in memory only.")
    journal.close()


def test_a_file_that_may_only_be_read_goes_on_with_its_numbers(tmp_path: Path) -> None:
    """SQLite's own refusal, for a superuser may write everywhere."""
    path = tmp_path / "events.sqlite"
    journal = Journal(path)
    journal.append("car", [event(1)])
    assert journal._database is not None
    journal._database.execute("PRAGMA query_only = ON")
    assert numbers(journal.append("car", [event(2)])) == [2]
    assert (journal.trouble or "").startswith("The alarm log is not stored: the file may not be written.")
    assert numbers(journal.after("car", 0)) == [1, 2]
    journal.close()


def test_two_servers_on_one_log_are_reported_and_nothing_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "events.sqlite"
    one, other = Journal(path), Journal(path)
    one.append("car", [event(1, text="of one")])
    other.append("car", [event(1, text="of the other")])
    assert (other.trouble or "").startswith("The alarm log is not stored: another server writes into the same file.")
    assert one.trouble is None
    assert [kept["text"] for kept in Journal(path).after("car", 0)] == ["of one"]
    one.close()
    other.close()


def test_one_alarm_is_found_by_an_index() -> None:
    """A log of years is not read through for where an alarm is active."""
    journal = Journal(None)
    assert journal._database is not None
    queries: list[str] = []
    journal._database.set_trace_callback(queries.append)
    journal.find("car", alarm="hot", before=9)
    journal.find("car", alarm="")
    journal.alarms("car")
    journal._database.set_trace_callback(None)
    assert len(queries) == 3
    for query in queries:
        plan = journal._database.execute(f"EXPLAIN QUERY PLAN {query}").fetchall()
        assert "event_of_alarm (vehicle=? AND alarm" in plan[0][3]
        assert len(plan) == 1, "it sorts"
    journal.close()
