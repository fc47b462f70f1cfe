"""What recordings hold and the log has lost is brought back into it: under its numbers, marked, and new to nobody."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import orjson
import pytest

from server.app.config import Config
from server.bus.journal import Journal
from server.bus.journal_db import Newest
from server.recording.event_channels import ALARMS
from server.recording.folder import RecordingsFolder, part_id
from server.recording.lost_events import lost_events
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.viewer import viewer

BEGAN_MS = 1_790_000_000_000


def event(n: int, **more: Any) -> dict[str, Any]:
    return {"n": n, "at_ms": BEGAN_MS + 1000 * n, "alarm": None, "change": "note", "text": f"event {n}", **more}


def record(data: Path, numbers: Sequence[int], *, part: int = 1, at_ms: int = BEGAN_MS, is_closed: bool = True) -> Path:
    """A recording with these events, as the recorder writes it."""
    folder = RecordingsFolder(data / "recordings")
    path = folder.place("car", part_id(folder.first_id("car", at_ms), part))
    file = PartFile(path, profile="ros1", metadata={"vehicle": "car", "started_ms": str(at_ms)})
    channel = file.channel(ALARMS, own_schema("alarms"))
    for n in numbers:
        file.add(channel, (at_ms + n) * 1_000_000, orjson.dumps(event(n, time_ms=at_ms)))
    if is_closed:
        return file.close()
    file.flush()
    file.abandon()
    return path


def log_of(data: Path) -> Journal:
    return Journal(data / "events.sqlite", lost=partial(lost_events, data / "recordings"))


def texts(journal: Journal) -> list[str]:
    return [one["text"] for one in journal.after("car", 0, limit=10_000)]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A log of 50 events, which two recordings hold too."""
    with closing(Journal(tmp_path / "events.sqlite", run="before")) as journal:
        journal.append("car", [{key: value for key, value in event(n).items() if key != "n"} for n in range(1, 51)])
    record(tmp_path, range(1, 31))
    record(tmp_path, range(31, 51), part=2)
    return tmp_path


@pytest.mark.parametrize("loss", ["deleted", "damaged", "older"])
def test_a_log_that_was_lost_has_its_events_again_and_goes_on_behind_them(data: Path, loss: str) -> None:
    path = data / "events.sqlite"
    match loss:
        case "deleted":
            path.unlink()
        case "damaged":
            path.write_bytes(path.read_bytes()[:4096] + bytes(8192))
        case "older":
            with closing(sqlite3.connect(path)) as log, log:
                log.execute("DELETE FROM event WHERE n > 20")
    with closing(log_of(data)) as journal:
        assert texts(journal) == [f"event {n}" for n in range(1, 51)]
        assert journal.complaint is not None
        assert "brought back from recordings" in journal.complaint
        brought = [one["n"] for one in journal.after("car", 0, limit=100) if "brought_from" in one]
        assert brought == list(range(21 if loss == "older" else 1, 51))
        assert journal.append("car", [{"at_ms": BEGAN_MS, "alarm": None, "change": "note"}])[0]["n"] == 51
        found = journal.runs.resume("car", "another run", 50, 51)
        assert found.new_after == 50, "to a page that knew the log they are not new"


def test_a_log_that_has_all_of_it_is_left_as_it_is(data: Path) -> None:
    with closing(log_of(data)) as journal:
        assert (journal.complaint, journal.last("car")) == (None, 50)


def test_it_is_brought_back_once(data: Path) -> None:
    (data / "events.sqlite").unlink()
    log_of(data).close()
    with closing(log_of(data)) as journal:
        assert (journal.complaint, journal.last("car")) == (None, 50)


def test_what_a_recording_that_was_never_closed_holds_is_brought_back_too(data: Path) -> None:
    record(data, range(51, 61), part=3, is_closed=False)
    with closing(log_of(data)) as journal:
        assert journal.last("car") == 60


def test_of_two_logs_with_the_same_numbers_the_newer_one_holds(data: Path) -> None:
    (data / "events.sqlite").unlink()
    path = record(data, range(11, 21), at_ms=BEGAN_MS + 86_400_000)
    with closing(log_of(data)) as journal:
        brought = [(one["n"], one["brought_from"] == path.stem) for one in journal.after("car", 0, limit=100)]
        assert brought == [(n, n > 10) for n in range(1, 21)]


def test_a_recording_of_another_log_brings_nothing(data: Path) -> None:
    shutil.rmtree(data / "recordings")
    record(data, range(500, 520), at_ms=BEGAN_MS + 86_400_000)
    record(data, range(520, 521), at_ms=BEGAN_MS + 86_500_000).write_bytes(bytes(100))
    assert list(lost_events(data / "recordings", {"car": Newest(n=50, at_ms=BEGAN_MS + 50_000)})) == []
    assert len(list(lost_events(data / "recordings", {}))) == 20


def test_a_damaged_recording_costs_nothing_but_its_own_events(data: Path) -> None:
    (data / "events.sqlite").unlink()
    path = next(iter(RecordingsFolder(data / "recordings").finished()))
    path.write_bytes(bytes(1000))
    with closing(log_of(data)) as journal:
        assert texts(journal) == [f"event {n}" for n in range(31, 51)]


@pytest.mark.virtual_time
async def test_a_server_whose_log_was_deleted_shows_them_as_brought_back_and_announces_none(data: Path) -> None:
    (data / "events.sqlite").unlink()
    config = Config(vehicles=(Vehicle(name="car", address="ws://127.0.0.1:9"),), data=data)
    async with serving(config) as server, http_client(base_url=server) as client, viewer(server) as page:
        await page.until(lambda: page.states)
        shown = (await client.get("/api/log", params={"limit": 200})).json()["events"]
        brought = [one["n"] for one in shown if "brought_from" in one]
        assert {(one["by"], one["settings_version"]) for one in shown if "brought_from" in one} == {(None, 0)}
        assert brought == list(range(50, 0, -1))
        assert any("50 events were brought back" in one["text"] for one in shown if one["n"] > 50)
        assert all(one["n"] > 50 for one in page.events)


@pytest.mark.parametrize("rows", [[{"n": 0}, {"n": "7"}, {"n": True}, {"at_ms": 1.5}, {"change": None}, {"alarm": 7}]])
def test_what_is_no_event_is_left_out(
    tmp_path: Path, rows: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = iter(rows)
    monkeypatch.setitem(globals(), "event", lambda n, **more: {**_event(n, **more), **next(made, {})})
    record(tmp_path, range(1, 11))
    with closing(log_of(tmp_path)) as journal:
        assert texts(journal) == [f"event {n}" for n in range(7, 11)]


_event = event
