"""The list of all cars as one frame: when it is made, and what it costs with a hundred cars."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import orjson
import pytest

from server.bus.bus import ALL, SUMMARY
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.web.cars_board import FLEET, FRAME, LEAST_S, CarsBoard
from tests.server.web.test_version_skew import NEWER

pytestmark = pytest.mark.virtual_time

MANY = 100


async def nothing(_: Any) -> dict[str, Any]:
    return {"ok": True}


class Cars:
    """A bus with some cars and a board on it, by the clock of the loop."""

    def __init__(self, *names: str) -> None:
        self.bus = LocalBus(Journal(None), now=asyncio.get_running_loop().time)
        for name in names:
            self.bus.serve(name, nothing)
        self.board = CarsBoard(self.bus, now=asyncio.get_running_loop().time, wall_ms=lambda: 5)
        self.came: list[str] = []

    def put(self, name: str, **more: Any) -> None:
        self.bus.put(ALL, name, orjson.dumps(NEWER | more).decode())

    def frame(self, kind: str) -> list[dict[str, Any]] | None:
        found = self.bus.newest(ALL, kind)
        return None if found is None else orjson.loads(found.payload)["cars"]


async def test_a_page_of_all_cars_gets_frames_also_where_there_is_one_car() -> None:
    cars = Cars("ocelot")
    ordinary: list[str] = []
    cars.board.watch(ordinary.append)
    assert not cars.bus.watched(ALL)
    end = cars.board.watch_fleet(cars.came.append)
    assert cars.bus.wanted(ALL, SUMMARY)
    cars.put("ocelot")
    await asyncio.sleep(0.2)
    found = cars.frame(FLEET)
    assert found is not None
    assert found[0]["summary"] == NEWER
    assert cars.came[0] == "cars"
    assert (cars.frame(FRAME), ordinary) == (None, []), "an ordinary page of one car has no list"
    end()
    assert not cars.bus.watched(ALL)
    assert not cars.bus.wanted(ALL, SUMMARY)
    before = len(cars.came)
    cars.put("ocelot", waiting=9)
    await asyncio.sleep(1.0)
    assert len(cars.came) == before


async def test_frames_go_on_though_no_session_puts_anything() -> None:
    """Else a page could not tell a server that is gone from cars that are."""
    cars = Cars("ocelot", "serval")
    cars.board.watch_fleet(cars.came.append)
    await asyncio.sleep(2.2)
    assert len(cars.came) == 4
    found = cars.frame(FLEET)
    assert found is not None
    assert [(car["name"], car["age_s"], car["summary"]) for car in found] == [
        ("ocelot", None, None),
        ("serval", None, None),
    ]


@pytest.mark.parametrize(
    "change",
    [
        {"waiting": 3},
        {"phase": "lost"},
        {"attention": None},
        {"attention": {**NEWER["attention"], "assigned": None}},
        {"attention": {**NEWER["attention"], "offered": None}},
        {"attention": {**NEWER["attention"], "assigned": None, "escalated_ms": 7}},
    ],
)
async def test_what_a_person_waits_for_is_sent_at_once(change: dict[str, Any]) -> None:
    cars = Cars("ocelot", "serval")
    cars.board.watch(cars.came.append)
    cars.put("ocelot")
    cars.put("serval")
    await asyncio.sleep(0.2)
    before = len(cars.came)
    cars.put("ocelot", energy_percent=1.0)
    await asyncio.sleep(0.04)
    assert len(cars.came) == before, "it can wait for the others"
    cars.put("ocelot", **change)
    await asyncio.sleep(0.06)
    assert len(cars.came) == before + 1


async def test_a_storm_of_changes_neither_floods_pages_nor_holds_the_frame_back() -> None:
    cars = Cars("ocelot", "serval")
    cars.board.watch(cars.came.append)
    begun_s = time.monotonic()
    number = 0
    while time.monotonic() - begun_s < 1.0:
        number += 1
        cars.put("ocelot", waiting=number)
        await asyncio.sleep(0.0005)
    assert number > 100
    assert len(cars.came) == pytest.approx(1.0 / LEAST_S, abs=1)


async def test_pages_are_called_for_frames_and_not_for_each_car_that_states_something() -> None:
    """With 100 cars and 100 pages it would be 20 000 calls a second."""
    cars = Cars("ocelot", "serval")
    listed: list[str] = []
    ends = [cars.board.watch(listed.append), cars.board.watch_fleet(cars.came.append)]
    assert cars.bus.watched(ALL) == 1, "the board alone"
    for _ in range(20):
        cars.put("ocelot")
        cars.put("serval")
    cars.came.clear()
    await asyncio.sleep(0.2)
    assert (len(listed), len(cars.came)) == (2, 1), "the list that opened, and the one after it"
    ends.pop(0)()
    assert cars.bus.watched(ALL) == 1
    ends.pop()()
    assert cars.bus.watched(ALL) == 0


@pytest.mark.field
async def test_a_frame_of_a_hundred_cars_costs_less_than_5_ms() -> None:
    names = [f"car{number}" for number in range(MANY)]
    cars = Cars(*names)
    cars.board.watch_fleet(cars.came.append)
    people = [{"page": f"page-{number}", "name": f"Operator {number}"} for number in range(20)]
    for name in names:
        cars.put(name, people=people)

    def cost_s() -> float:
        begun_s = time.perf_counter()
        cars.board._put()
        return time.perf_counter() - begun_s

    assert min(cost_s() for _ in range(20)) < 0.005
    found = cars.frame(FLEET)
    assert found is not None
    assert [car["name"] for car in found] == names
    assert all(len(car["summary"]["people"]) == 20 for car in found)
