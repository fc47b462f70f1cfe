"""The journal is written by a thread of its own: the loop waits for no disk, and a slow one delays no alarm."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from server.bus.journal import SLOW_DISK_S, Journal
from server.bus.local import LocalBus
from server.storage.storage_thread import StorageThread
from server.web.event_feed import FIRST_BATCH, EventFeed


def event(text: str = "x", **more: Any) -> dict[str, Any]:
    return {"at_ms": 1, "alarm": "hot", "change": "raised", "text": text, **more}


def numbers(events: list[dict[str, Any]]) -> list[int]:
    return [one["n"] for one in events]


class Disk:
    """A storage thread that can be held, as a disk that does not answer holds it."""

    def __init__(self, path: Path) -> None:
        self.now_s = 100.0
        self.path = path
        self.thread = StorageThread()
        self.journal = Journal(path, thread=self.thread, now=lambda: self.now_s)
        self.bus = LocalBus(self.journal, now=lambda: self.now_s, storage=self.thread)

    @contextlib.contextmanager
    def holding(self) -> Iterator[None]:
        """No job of the thread begins before the end of the block."""
        answers = threading.Event()
        self.thread.submit(lambda: answers.wait() and None)
        try:
            yield
        finally:
            answers.set()

    async def settled(self) -> None:
        await self.thread.run(lambda: None)
        await asyncio.sleep(0)  # what the thread scheduled on the loop
        await asyncio.sleep(0)

    def stored(self) -> int:
        with contextlib.closing(sqlite3.connect(self.path)) as database:
            return int(database.execute("SELECT COUNT(*) FROM event").fetchone()[0])


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    one = Disk(tmp_path / "events.sqlite")
    yield one
    one.thread.close()
    one.journal.close()


async def test_pages_are_woken_once_the_disk_has_the_event(disk: Disk) -> None:
    woken: list[int] = []
    disk.bus.watch("car", lambda _: woken.append(disk.stored()))
    with disk.holding():
        assert numbers(disk.bus.append("car", [event()])) == [1]
        assert disk.bus.recent_events("car", 0) == []
        assert disk.bus.last_event("car") == 0
        assert woken == []
    await disk.settled()
    assert woken == [1]
    assert numbers(await disk.bus.events_after("car", 0)) == [1]
    assert disk.bus.last_event("car") == 1


async def test_an_event_is_shown_without_a_disk_that_does_not_answer_once_that_is_reported(disk: Disk) -> None:
    woken = asyncio.Event()
    disk.bus.watch("car", lambda _: woken.set())
    with disk.holding():
        began_s = time.monotonic()
        disk.bus.append("car", [event()])
        assert disk.bus.recent_events("car", 0) == []
        await asyncio.wait_for(woken.wait(), 15)
        assert time.monotonic() - began_s >= SLOW_DISK_S - 0.01
        disk.now_s += SLOW_DISK_S
        assert "the disk has not answered for 1 s. 1 event is in memory only." in (disk.bus.save_events() or "")
        assert numbers(disk.bus.recent_events("car", 0) or []) == [1]
        assert disk.stored() == 0


@pytest.mark.parametrize("error", [sqlite3.OperationalError("disk I/O error"), sqlite3.DatabaseError("full")])
async def test_what_the_disk_refuses_is_shown_at_once_with_the_reason(
    disk: Disk, monkeypatch: pytest.MonkeyPatch, error: sqlite3.Error
) -> None:
    def refuse(*_: object) -> bool:
        raise error

    monkeypatch.setattr("server.bus.local.SLOW_DISK_S", 3600.0)
    disk.bus.append("car", [event("stored")])
    await disk.settled()
    monkeypatch.setattr(disk.journal, "_write", refuse)
    disk.bus.append("car", [event("refused")])
    await disk.settled()
    assert numbers(disk.bus.recent_events("car", 0) or []) == [1, 2]
    assert disk.bus.save_events() == f"The alarm log is not stored: {error}. 1 event is in memory only."
    monkeypatch.undo()
    disk.bus.append("car", [event("stored again")])
    await disk.settled()
    assert disk.bus.save_events() is None
    assert disk.stored() == 3


async def test_events_of_one_tick_are_committed_together(disk: Disk) -> None:
    """A disk syncs once for all of them."""
    commits: list[str] = []
    assert disk.journal._database is not None
    with disk.holding():
        disk.journal._database.set_trace_callback(commits.append)
        for number in range(20):
            disk.bus.append("car" if number % 2 else "truck", [event(str(number))])
    await disk.settled()
    assert commits.count("COMMIT") == 1
    assert disk.stored() == 20


def test_each_commit_is_written_through_to_the_disk(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "events.sqlite")
    assert journal._database is not None
    assert journal._database.execute("PRAGMA synchronous").fetchone() == (2,), "FULL"
    assert journal._database.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    journal.close()


async def test_events_come_in_order_though_some_are_stored_and_some_are_not(disk: Disk) -> None:
    disk.bus.append("car", [event("a")])
    await disk.settled()
    with disk.holding():
        disk.bus.append("car", [event("b")])
        assert numbers(disk.bus.recent_events("car", 0) or []) == [1]
        disk.bus.append("car", [event("c")])
    await disk.settled()
    assert numbers(await disk.bus.find_events("car")) == [3, 2, 1]


async def test_a_hung_disk_is_trouble_that_is_reported(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    answers, began = threading.Event(), threading.Event()

    def hang(*_: object) -> bool:
        began.set()
        return answers.wait()

    monkeypatch.setattr(disk.journal, "_write", hang)
    disk.bus.append("car", [event()])
    assert await asyncio.to_thread(began.wait, 5)
    assert disk.bus.save_events() is None
    disk.now_s += SLOW_DISK_S + 1
    trouble = disk.bus.save_events() or ""
    assert "the disk has not answered for 2 s" in trouble
    assert "1 event is in memory only" in trouble
    answers.set()
    await disk.settled()
    assert disk.bus.save_events() is None


async def test_no_event_is_missed_or_doubled_while_the_thread_writes(disk: Disk) -> None:
    for number in range(1, 400):
        disk.bus.append("car", [event(str(number))])
        if number % 7 == 0:
            await asyncio.sleep(0)
        if number % 20 == 0:
            found = await disk.thread.run(lambda: disk.journal.find("car", limit=1000))
            assert numbers(found) == list(range(number, 0, -1))
            assert numbers(disk.journal.stored_after("car", 0, 1000)) == list(range(1, number + 1))


async def test_older_events_are_read_while_the_page_gets_its_other_frames(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "events.sqlite")
    journal.append("car", [event(str(n)) for n in range(500)])
    journal.close()
    disk = Disk(tmp_path / "events.sqlite")
    ready = asyncio.Event()
    feed = EventFeed(disk.bus, "car", time.monotonic, ready.set)
    with disk.holding():
        assert feed.after(0) == []
        assert feed.after(0) == []
        assert not ready.is_set()
    await asyncio.wait_for(ready.wait(), 5)
    assert numbers(feed.after(0)) == list(range(1, FIRST_BATCH + 1))
    ready.clear()
    assert feed.after(100) == []
    await asyncio.wait_for(ready.wait(), 5)
    assert feed.after(200) == [], "what was read is not what is wanted any more"
    feed.close()
    disk.thread.close()
    disk.journal.close()


KILLED = """
import asyncio, os, signal, sys
from pathlib import Path
from server.bus.local import LocalBus
from server.bus.journal import Journal
from server.storage.storage_thread import StorageThread

async def main():
    thread = StorageThread()
    bus = LocalBus(Journal(Path(sys.argv[1]), thread=thread), now=lambda: 0.0, storage=thread)
    shown = 0
    def woken(kind):
        nonlocal shown
        for one in bus.recent_events("car", shown, 1000) or []:
            shown = one["n"]
            print(shown, flush=True)
    bus.watch("car", woken)
    appended = 0
    while True:
        if appended - shown < 100:  # a page that is not further behind has them from memory
            bus.append("car", [{"at_ms": 1, "alarm": "hot", "change": "raised"}])
            appended += 1
        await asyncio.sleep(0.001)

asyncio.run(main())
"""


def test_what_a_page_was_shown_survives_kill_9(tmp_path: Path) -> None:
    """Else its number would be given again, to an event that the page takes for known."""
    path = tmp_path / "events.sqlite"
    with subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        shown = [int(writer.stdout.readline()) for _ in range(150)]
        writer.kill()
        shown += [int(line) for line in writer.stdout if line.endswith("\n")]
    journal = Journal(path)
    assert journal.last("car") >= shown[-1]
    assert numbers(journal.after("car", 0, 10**6)) == list(range(1, journal.last("car") + 1))
    journal.close()


async def test_a_command_is_answered_once_the_disk_has_its_events(disk: Disk) -> None:
    async def handler(_: Any) -> dict[str, Any]:
        disk.bus.append("car", [event()])
        return {"ok": True}

    disk.bus.serve("car", handler)
    assert await disk.bus.request("car", {}) == {"ok": True}
    assert disk.stored() == 1
    with disk.holding():
        assert await asyncio.wait_for(disk.bus.request("car", {}), 5) == {"ok": True}
        assert disk.stored() == 1
