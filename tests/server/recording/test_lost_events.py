"""What recordings hold and the log has lost is brought back into it: under its numbers, marked, and new to nobody."""

from __future__ import annotations

import json
import os
import random
import sqlite3
import time
from collections.abc import Callable, Iterable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.bus.journal import Journal
from server.recording import lost_events as lost_events_module
from server.recording.event_channels import ALARMS
from server.recording.folder import RecordingsFolder, part_id
from server.recording.lost_events import lost_events
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.recover import recover
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.viewer import viewer

BEGAN_MS = 1_790_000_000_000
ADDRESS = "ws://127.0.0.1:9"


def event(n: int, **more: Any) -> dict[str, Any]:
    return {"n": n, "at_ms": BEGAN_MS + 1000 * n, "alarm": None, "change": "note", "text": f"event {n}", **more}


def record(
    data: Path,
    events: Iterable[int | dict[str, Any] | bytes],
    *,
    part: int = 1,
    at_ms: int = BEGAN_MS,
    is_closed: bool = True,
    vehicle: str = "car",
    folder: str = "car",
) -> Path:
    """A recording with these events, as the recorder writes it."""
    every = RecordingsFolder(data / "recordings")
    path = every.place(folder, part_id(every.first_id(folder, at_ms), part))
    file = PartFile(path, profile="ros1", metadata={"vehicle": vehicle, "started_ms": str(at_ms)})
    channel = file.channel(ALARMS, own_schema("alarms"))
    for place, one in enumerate(events):
        row = event(one, time_ms=at_ms) if isinstance(one, int) else one
        file.add(channel, (at_ms + place) * 1_000_000, row if isinstance(row, bytes) else json.dumps(row).encode())
        file.flush()
    if is_closed:
        return file.close()
    file.abandon()
    return path


def log_of(data: Path, *, now: Callable[[], float] = lambda: 0.0) -> Journal:
    return Journal(data / "events.sqlite", lost=partial(lost_events, data / "recordings", ["car"], now=now))


def config(data: Path) -> Config:
    return Config(vehicles=(Vehicle(name="car", address=ADDRESS),), data=data)


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
    """Another one follows that is of this log."""
    record(data, range(500, 520), at_ms=BEGAN_MS + 86_400_000)
    record(data, range(51, 54), part=3)
    with closing(log_of(data)) as journal:
        assert texts(journal) == [f"event {n}" for n in range(1, 54)]


@pytest.mark.parametrize(
    ("events", "brought"),
    [
        ([event(60), event(61)], [60, 61]),  # numbers go on
        ([event(49), event(51, at_ms=BEGAN_MS), event(52)], [51, 52]),  # the clock was set back in the drive
        ([event(49, change="other"), event(51)], []),  # numbers are of another log
        ([event(49, at_ms=1), event(51)], []),
        ([event(51, at_ms=BEGAN_MS)], []),
        ([event(300)], []),
    ],
)
def test_of_which_log_a_recording_is(data: Path, events: list[dict[str, Any]], brought: list[int]) -> None:
    record(data, events, part=3)
    with closing(log_of(data)) as journal:
        assert [one["n"] for one in journal.after("car", 50)] == brought


@pytest.mark.parametrize("has_log", [True, False])
def test_recordings_of_other_cars_bring_nothing(data: Path, has_log: bool) -> None:
    if not has_log:
        (data / "events.sqlite").unlink()
    record(data, range(51, 61), part=3, vehicle="van")
    record(data, range(51, 61), part=4, vehicle="van", folder="van")
    with closing(log_of(data)) as journal:
        assert texts(journal) == [f"event {n}" for n in range(1, 51)]
        assert journal.last("van") == 0


def test_a_recording_that_ended_before_the_newest_event_is_not_opened(data: Path) -> None:
    path = record(data, range(51, 61), part=3)
    os.utime(path, (0, BEGAN_MS / 1000))
    with closing(log_of(data)) as journal:
        assert journal.last("car") == 50


def test_a_closed_recording_without_an_index_is_not_searched(data: Path) -> None:
    path = record(data, range(51, 61), part=3)
    raw = bytearray(path.read_bytes())
    raw[-28:-12] = bytes(16)  # where the index begins
    path.write_bytes(raw)
    with closing(log_of(data)) as journal:
        assert journal.last("car") == 50


@pytest.mark.parametrize(("has_log", "within_s"), [(True, 2.0), (False, 20.0)])
def test_the_start_waits_for_a_bounded_time(
    data: Path, has_log: bool, within_s: float, caplog: pytest.LogCaptureFixture
) -> None:
    """Each look at the clock takes 0.1 s. What was found by then is brought back."""
    if not has_log:
        (data / "events.sqlite").unlink()
    for path in (data / "recordings" / "car").iterdir():
        os.utime(path, (0, 0))
    for part in range(3, 103):
        record(data, [45 + 2 * part, 46 + 2 * part], part=part)
    moments = [0.0]

    def now() -> float:
        moments.append(moments[-1] + 0.1)
        return moments[-1]

    with closing(log_of(data, now=now)) as journal:
        numbers = [one["n"] for one in journal.after("car", 0, limit=1000)]
        assert journal.complaint is not None
        assert "Not all recordings were searched" in journal.complaint
    assert moments[-1] <= within_s + 0.2
    assert 2 < len(numbers) - 50 * has_log < 120
    assert numbers[-1] == numbers[0] + len(numbers) - 1
    assert numbers[0] == 1 if has_log else numbers[-1] == 250
    assert "not all searched" in caplog.text


@pytest.mark.parametrize(
    ("first", "within", "brought"),
    [
        ([50, 51], 0, [51, *range(55, 62)]),
        ([50, 51], 60, [60, 61]),  # the time is over before all of it is read
        ([], 0, [*range(55, 62)]),
    ],
)
def test_of_a_long_recording_that_was_never_closed_the_end_is_read_first(
    data: Path, monkeypatch: pytest.MonkeyPatch, first: list[int], within: int, brought: list[int]
) -> None:
    monkeypatch.setattr(lost_events_module, "MOST_OF_CUT", 200_000)
    ballast = [random.Random(1).randbytes(30_000)] * 20
    path = record(data, [*first, 55, *ballast, *range(56, 60), *ballast, 60, 61], part=3, is_closed=False)
    assert path.with_suffix(".mcap.writing").stat().st_size > 1_000_000
    for one in (data / "recordings" / "car").glob("*.mcap"):
        os.utime(one, (0, 0))
    looks = iter([0.0] * within + [10.0] * 1000 if within else [0.0] * 1000)
    with closing(log_of(data, now=lambda: next(looks))) as journal:
        assert [one["n"] for one in journal.after("car", 50)] == brought


def test_of_an_empty_log_the_end_of_a_long_recording_counts_where_the_time_is_over(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lost_events_module, "MOST_OF_CUT", 200_000)
    ballast = [random.Random(1).randbytes(30_000)] * 20
    record(data, [55, *ballast, *range(56, 60), *ballast, 60, 61], part=3, is_closed=False)
    (data / "events.sqlite").unlink()
    looks = iter([0.0] * 60 + [100.0] * 1000)
    with closing(log_of(data, now=lambda: next(looks))) as journal:
        assert [one["n"] for one in journal.after("car", 0)] == [60, 61]
        assert journal.append("car", [{"at_ms": BEGAN_MS, "alarm": None, "change": "note"}])[0]["n"] == 62


@pytest.mark.parametrize("is_known", [True, False])
def test_only_the_end_is_read_where_the_log_has_an_event_of_it(
    data: Path, monkeypatch: pytest.MonkeyPatch, is_known: bool
) -> None:
    """Before each chunk that is read, the clock is looked at."""
    monkeypatch.setattr(lost_events_module, "MOST_OF_CUT", 200_000)
    ballast = [random.Random(1).randbytes(30_000)] * 40
    for one in (data / "recordings" / "car").iterdir():
        os.utime(one, (0, 0))
    record(data, [49, *ballast, 50, 51] if is_known else [49, 50, *ballast, 51], part=3, is_closed=False)
    looks: list[float] = []

    def now() -> float:
        looks.append(0.0)
        return 0.0

    with closing(log_of(data, now=now)) as journal:
        assert journal.last("car") == 51
    assert (len(looks) > 60) is not is_known


def test_a_recording_that_was_recovered_brings_its_events(data: Path) -> None:
    path = record(data, range(49, 61), part=3, is_closed=False)
    assert recover(path.with_suffix(".mcap.writing")).path == path
    with closing(log_of(data)) as journal:
        assert journal.last("car") == 60


@pytest.mark.parametrize("lost", [[{"n": 51, "at_ms": 2**63, "change": "note"}], [{"n": 51}], [{"n": object()}], None])
def test_whatever_recordings_hold_the_log_is_opened(data: Path, lost: list[dict[str, Any]] | None) -> None:
    """The first event could be stored, the other one cannot."""
    first = {"n": 52, "at_ms": 1, "change": "note"}
    with closing(Journal(data / "events.sqlite", lost=lambda _: [("car", first), *(("car", e) for e in lost)])) as one:
        assert (one.trouble, one.last("car")) == (None, 50)
        assert one.complaint == "Events of recordings could not be brought back into the alarm log."
        one.append("car", [{"at_ms": BEGAN_MS, "alarm": None, "change": "note"}])
        assert (one.trouble, one.last("car")) == (None, 51)


def test_a_damaged_recording_costs_nothing_but_its_own_events(data: Path) -> None:
    (data / "events.sqlite").unlink()
    path = next(iter(RecordingsFolder(data / "recordings").finished()))
    path.write_bytes(bytes(1000))
    with closing(log_of(data)) as journal:
        assert texts(journal) == [f"event {n}" for n in range(31, 51)]


@pytest.mark.virtual_time
async def test_a_server_whose_log_was_deleted_shows_them_as_brought_back_and_announces_none(data: Path) -> None:
    (data / "events.sqlite").unlink()
    async with serving(config(data)) as server, http_client(base_url=server) as client, viewer(server) as page:
        await page.until(lambda: page.states)
        shown = (await client.get("/api/log", params={"limit": 200})).json()["events"]
        brought = [one["n"] for one in shown if "brought_from" in one]
        assert {(one["by"], one["settings_version"]) for one in shown if "brought_from" in one} == {(None, 0)}
        assert brought == list(range(50, 0, -1))
        assert any("50 events were brought back" in one["text"] for one in shown if one["n"] > 50)
        assert all(one["n"] > 50 for one in page.events)


@pytest.mark.virtual_time
async def test_what_is_brought_back_restores_no_state(data: Path) -> None:
    """The recording ended with the drive; that it ended was in the log only."""
    (data / "events.sqlite").unlink()
    signed = {"check": "c1", "by": "Ann", "done": 1, "failed": 0, "not_applicable": 0, "of": 1, "hash": "00"}
    drive: list[dict[str, Any]] = [
        {"change": "started", "address": ADDRESS},
        {"change": "departure", "step": "begun", "check": "c1", "by": "Ann"},
        {"change": "departure", "step": "signed", **signed},
        {"change": "slow_down", "step": "slows", "order": 1, "at_ms": round(time.time() * 1000)},
        {"change": "planned_stop", "reason": "workshop", "by": "Ann", "since_ms": BEGAN_MS},
        {"change": "paused", "by": "Ann", "since_ms": BEGAN_MS},
    ]
    record(data, [event(n, **one) for n, one in enumerate(drive, 51)], part=3)
    for start in range(2):
        async with serving(config(data)) as server, http_client(base_url=server) as client, viewer(server) as page:
            state = await page.state(lambda one: one["session"]["address"])
            session, departure, slow_down = state["session"], state["departure"], state["decelerate"]
            assert (session["paused"], session["planned_stop"], session["held"]) == (False, None, None), start
            assert (departure["state"], slow_down.get("order")) == ("none", None), start
            shown = (await client.get("/api/log", params={"limit": 200})).json()["events"]
            assert [one["n"] for one in shown if one["change"] == "stopped"] == [57], start


@pytest.mark.parametrize(
    ("is_closed", "lacks", "has_newer", "stands"),
    [(False, 0, False, True), (True, 0, False, False), (False, 1, False, False), (False, 0, True, False)],
)
async def test_a_pause_that_only_the_recording_of_a_killed_server_has_stands(
    data: Path, *, is_closed: bool, lacks: int, has_newer: bool, stands: bool
) -> None:
    """The recorder was a moment ahead of the log. Of what came after a recording, or in its gap, nothing is known."""
    started, paused = {"change": "started", "address": ADDRESS}, {"change": "paused", "by": "Ann", "since_ms": BEGAN_MS}
    with closing(Journal(data / "events.sqlite", run="killed")) as journal:
        journal.append("car", [{key: value for key, value in event(51, **started).items() if key != "n"}])
    rows = [event(51, **started), event(52, **paused, was_cut=True), event(53 + lacks)]
    record(data, rows, part=3, is_closed=is_closed)
    if has_newer:
        record(data, [], part=4)
    for start in range(2):
        async with serving(config(data)) as server, viewer(server) as page:
            session = (await page.state(lambda one: one["session"]["address"]))["session"]
            assert session["paused"] is stands, start


async def test_settings_that_are_older_than_those_of_the_recordings_are_reported(data: Path) -> None:
    record(data, [event(n, settings_version=9) for n in (50, 51)], part=3)
    async with serving(config(data)) as server, http_client(base_url=server) as client:
        shown = (await client.get("/api/log", params={"limit": 200})).json()["events"]
        assert [one["settings_version"] for one in shown if "The settings differ" in one["text"]] == [10]


async def test_a_damaged_event_keeps_no_server_from_its_start(tmp_path: Path) -> None:
    """What SQLite or JSON cannot hold, what has other types than declared, and numbers behind which none can follow."""
    odd: list[dict[str, Any]] = [
        {"n": 0}, {"n": "7"}, {"n": True}, {"n": 2**53 - 1}, {"n": 2**64 - 1}, {"at_ms": 1.5}, {"at_ms": -1},
        {"at_ms": 2**63}, {"change": None}, {"change": ["mark"]}, {"alarm": 7}, {"text": "x" * 100_000},
    ]  # fmt: skip
    kept = [
        {"change": "mark", "mark": ["m"], "words": 7}, {"settings_version": 10**30}, {"settings_version": 2**60},
        {"alarm": "a", "state": "ACKED", "occurrence": 10**30}, {"alarm": "a", "occurrence": 2**63, "causes": 7},
    ]  # fmt: skip
    deep = b'{"n":90,"at_ms":1,"change":"note","x":' + b"[" * 300 + b"]" * 300 + b"}"
    rows = [event(n) | one for n, one in enumerate(odd + kept, 1)]
    record(tmp_path, [deep, b"{", b"[]", *rows, 91])
    async with serving(config(tmp_path)) as server, http_client(base_url=server) as client:
        shown = (await client.get("/api/log", params={"limit": 200})).json()["events"]
        assert [one["n"] for one in shown if "brought_from" in one] == [91, *range(17, 12, -1)]
        assert all(one["settings_version"] < 100 for one in shown)
        assert (await client.get("/api/state")).json()["log_trouble"] is None
