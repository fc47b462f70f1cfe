"""The departure check at a car: its log, its signature, the list that is edited, drives, and a restart."""

from __future__ import annotations

import asyncio
import hashlib
import threading
from pathlib import Path
from typing import Any

import orjson
import pytest

from monitor.values import Effort, Twist
from server.control.authorization import Caller
from server.judge.active_settings import ActiveSettings
from server.judge.settings import SettingsFile
from server.protocol.drive_commands import SetDepartureList
from server.recording.standing import EarlyEntries
from server.storage.storage_thread import StorageThread
from server.vehicle import restore
from server.vehicle.car_departure import WITHOUT, CarDeparture, DepartureFile
from tests.server.vehicle.attended import ANN, BEN, Attended

AK = {"person": {"name": "A. K.", "role": "safety_driver", "device": "dev-a"}}
LIST = [
    {"id": "doors", "title": "Boot and doors shut"},
    {"id": "tyres", "title": "Tyres", "every_days": 30, "every_km": 500},
    {"id": "sound", "title": "Sound armed", "kind": "sound"},
    {"id": "brake", "title": "Press the brake", "kind": "brake", "need": 20, "every_days": 7},
]


async def begun() -> Attended:
    car = Attended()
    await car.accepted(BEN, "set_departure_list", items=LIST)
    await car.accepted(BEN, "begin_departure")
    return car


async def answer(car: Attended) -> dict[str, Any]:
    return await car.ask(ANN, "departure")


def log(car: Attended, *steps: str) -> list[dict[str, Any]]:
    found = reversed(car.bus.past_events(car.name, change="departure", limit=500))
    return [event for event in found if not steps or event["step"] in steps]


def press_brake(car: Attended, percent: float) -> None:
    car.session._parts.judgement.state.receive("brake", Effort(percent=percent), car.now_s)
    car.tick(0.05)


async def signed() -> Attended:
    car = await begun()
    log = car.session._parts.event_log
    log._wall_ms = lambda wall_ms=log._wall_ms: wall_ms() + 7  # what happened is logged a moment later
    car.tick(2.5)  # nobody would hear an alarm
    await car.accepted(ANN, "present", visible=True, sound="ready", awake="ready")
    car.tick(1.5, reporting=(ANN,))
    press_brake(car, 31.0)
    await car.accepted(ANN | AK, "set_departure_item", item="doors", result="done")
    await car.accepted(ANN, "set_departure_item", item="tyres", result="failed", note="worn")
    await car.accepted(
        ANN | AK, "set_departure_item", item="tyres", result="not_applicable", note="Seen by somebody else"
    )
    await car.accepted(ANN | AK, "sign_departure", check=(await answer(car))["check"])
    return car


async def test_it_is_worked_through_logged_and_signed_by_a_person() -> None:
    car = await signed()
    shown = await answer(car)
    signature = shown["signature"]
    assert (signature["by"], signature["role"]) == ("A. K. (Ann)", "safety driver")
    assert hashlib.sha256(signature["document"].encode()).hexdigest() == signature["hash"]
    assert [(row["result"], row["value"], row["note"]) for row in shown["items"]] == [
        ("done", "", ""),
        ("not_applicable", "", "Seen by somebody else"),
        ("done", "on 1 phone", ""),
        ("done", "31 %", ""),
    ]
    begin, *items, end = log(car)
    assert (begin["step"], begin["by"], begin["check"]) == ("begun", "Ben", shown["check"])
    turns = [(event["item"], event["result"], event["by"]) for event in items]
    assert turns == [
        ("sound", "failed", None),
        ("sound", "done", None),
        ("brake", "done", None),
        ("doors", "done", "A. K. (Ann)"),
        ("tyres", "failed", "Ann"),
        ("tyres", "not_applicable", "A. K. (Ann)"),
    ]
    assert {event["step"] for event in items} == {"item"}
    assert items[-1]["item_title"] == "Tyres"
    assert (end["step"], end["hash"], end["by"], end["person"]) == ("signed", signature["hash"], "A. K. (Ann)", "A. K.")
    assert [end[name] for name in ("done", "failed", "not_applicable", "of", "fixed")] == [3, 0, 1, 4, 1]
    assert end["recurring"] == [
        {"item": "tyres", "title": "Tyres", "every_days": 30, "every_km": 500, "is_done": False},
        {"item": "brake", "title": "Press the brake", "every_days": 7, "every_km": None, "is_done": True},
    ]
    assert [(row["every_days"], row["every_km"]) for row in shown["items"]][1:] == [(30, 500), (None, None), (7, None)]
    state = car.session.frame()["departure"]
    assert (state["state"], state["by"], state["done"], state["of"]) == ("signed", "A. K. (Ann)", 3, 4)


async def test_it_is_refused_while_an_item_is_failed_or_open_and_without_a_check() -> None:
    car = Attended()
    assert (await answer(car))["state"] == "none"
    assert "not begun yet" in await car.refused(ANN, "sign_departure", check="x")
    car = await begun()
    car.tick(2.5)
    check = (await answer(car))["check"]
    assert await car.refused(ANN, "sign_departure", check=check) == "Not ready: 1 failed, 3 open."
    assert "seen" in await car.refused(ANN, "set_departure_item", item="brake", result="done")
    assert "meant for" in await car.refused(ANN, "set_departure_item", vehicle="lynx", item="doors", result="done")
    assert log(car, "signed") == []


async def test_a_restart_finds_what_stood_unchanged() -> None:
    car = await signed()
    before = await answer(car)
    again = CarDeparture(ActiveSettings(SettingsFile(None)), DepartureFile(None), lambda *_, **__: None)
    again._file.items = car.session._parts.departure._file.items
    again._follow_list()
    again.restore(restore.recall_departure(car.bus, car.name))
    found = again.answer()
    assert found["signature"] == before["signature"], "the signed document too"
    rows = [{**row, "now": None, "peak": None} for row in before["items"]]
    assert [{**row, "now": None, "peak": None} for row in found["items"]] == rows
    again.dialled(0, resumed=True, by=None)
    assert again.state()["state"] == "signed"
    again.dialled(0, resumed=False, by=None)
    assert again.state()["state"] == "open", "of another drive"


async def test_each_drive_has_a_check_of_its_own() -> None:
    car = await signed()
    car.session.connect("ws://127.0.0.1:9091", by="Ann")
    assert (await answer(car))["state"] == "open"
    assert [event["step"] for event in log(car)][-1] == "begun"
    await car.accepted(ANN, "disconnect")
    assert (await answer(car))["state"] == "none"
    assert restore.recall_departure(car.bus, car.name).id is None
    await car.accepted(ANN, "begin_departure")
    await car.accepted(ANN, "set_departure_item", item="doors", result="done")
    car.session.connect("ws://127.0.0.1:9090", by="Ann")
    assert (await answer(car))["done"] == 1, "what was begun before the car was dialled is of its drive"
    await car.accepted(ANN, "begin_departure")
    assert (await answer(car))["done"] == 0, "by hand it begins again"


async def test_a_drive_without_one_is_logged_once() -> None:
    car = Attended()

    def drive(seconds: float) -> None:
        for _ in range(round(seconds / 0.25)):
            car.session._parts.judgement.state.receive("speed", Twist(speed_mps=3.0), car.now_s)
            car.tick(0.25)

    drive(9.5)
    assert log(car) == []
    drive(1.0)
    drive(15.0)
    assert [event["text"] for event in log(car)] == [WITHOUT]
    assert restore.recall_departure(car.bus, car.name).is_without_logged
    car = await signed()
    drive(12.0)
    assert log(car, "without") == []


async def test_the_list_is_edited_kept_and_refused_with_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "settings" / "car.departure.toml"
    car = await begun()
    car.session._parts.departure._file._path = path
    await car.accepted(ANN, "set_departure_item", item="doors", result="done")
    await car.accepted(BEN, "set_departure_list", items=[LIST[2], LIST[0]])
    shown = await answer(car)
    assert [(row["id"], row["result"]) for row in shown["items"]] == [("sound", "open"), ("doors", "done")]
    assert not shown["is_default"]
    kept = DepartureFile(path)
    assert kept.items is not None
    assert [one.id for one in kept.items] == ["sound", "doors"]
    refused = await car.refused(BEN, "set_departure_list", items=[{"id": "a", "title": "A", "kind": "dance"}])
    assert refused.startswith("Item 1, “A”: a kind is one of manual, check")
    await car.accepted(BEN, "set_departure_list", items=None)
    assert not path.exists()
    assert (await answer(car))["is_default"]
    texts = [event["text"] for event in car.bus.past_events(car.name, change="settings") if event["by"] == "Ben"]
    assert texts[0] == "The list of the departure check is the one of the vehicle profile again."


@pytest.mark.parametrize(
    ("content", "why"),
    [(b"[[item", "This is not TOML"), (b"\xff", "not UTF-8"), (b"[[item]]\nid = 'a'", "Item 1 needs a title")],
    ids=["toml", "utf8", "title"],
)
def test_a_file_that_cannot_be_used_is_reported_and_left_alone(tmp_path: Path, content: bytes, why: str) -> None:
    path = tmp_path / "car.departure.toml"
    path.write_bytes(content)
    found = DepartureFile(path)
    assert found.items is None
    assert found.complaint is not None
    assert why in found.complaint
    assert path.read_bytes() == content


@pytest.mark.parametrize("items", [LIST, None], ids=["list", "of-profile"])
async def test_a_file_that_cannot_be_used_is_set_aside_before_the_list_is_kept(
    tmp_path: Path, items: list[dict[str, Any]] | None
) -> None:
    path = tmp_path / "car.departure.toml"
    path.write_bytes(b"[[item")
    car = Attended()
    car.session._parts.departure._file = DepartureFile(path)
    await car.accepted(BEN, "set_departure_list", items=items)
    assert (tmp_path / "car.departure.unusable.toml").read_bytes() == b"[[item"
    assert path.exists() == (items is not None)
    assert (await answer(car))["complaint"] is None
    (event,) = (one for one in car.bus.past_events(car.name, change="settings") if one["by"] == "Ben")
    assert event["text"].endswith("What could not be used is kept in car.departure.unusable.toml.")


async def test_a_list_that_takes_long_to_keep_comes_into_force_though_nobody_waits(tmp_path: Path) -> None:
    path, storage, disk, texts = tmp_path / "car.departure.toml", StorageThread(), threading.Event(), list[str]()
    car = CarDeparture(
        ActiveSettings(SettingsFile(None)), DepartureFile(path), lambda _, text, **__: texts.append(text)
    )
    storage.submit(lambda: disk.wait(10) and None)
    commands = [SetDepartureList(kind="set_departure_list", items=LIST[:number]) for number in (2, 3)]
    first, second = [asyncio.create_task(car.execute(one, Caller(name="Ann"), 0, storage)) for one in commands]
    await asyncio.sleep(0)
    first.cancel()
    disk.set()
    await asyncio.wait_for(second, 10)
    storage.close()
    assert first.cancelled()
    assert texts == [f"The list of the departure check has {number} items now." for number in (2, 3)]
    kept = DepartureFile(path).items
    assert kept is not None
    assert [one.id for one in kept] == [row["id"] for row in car.answer()["items"]] == ["doors", "tyres", "sound"]


def test_a_recording_knows_whether_its_drive_was_checked() -> None:
    entries = EarlyEntries()
    assert entries.standing()["departure"] == ""
    event = {"change": "departure", "step": "signed", "check": "c1", "by": "Ann", "at_ms": 5, "hash": "ab", "done": 3}
    entries.hold(0.0, "alarms", event)
    assert orjson.loads(entries.standing()["departure"])["hash"] == "ab"
    for ends in ({"change": "departure", "step": "reopened"}, {"change": "stopped"}):
        entries.note("alarms", event)
        assert entries.standing()["departure"]
        entries.note("alarms", ends)
        assert entries.standing()["departure"] == ""
