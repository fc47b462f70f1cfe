"""Two operators and one car: anybody slows it, only the one in control arms and releases; what is late is refused."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from typing import Any

import pytest

from tests.page.radio import Radio
from tests.server.slowdown.conftest import Field, field
from tests.server.viewer import Viewer, viewer

pytestmark = [pytest.mark.slow, pytest.mark.virtual_time]
SEEN = {"kind": "present", "visible": True, "sound": "ready", "awake": "ready"}


class Phone:
    """A page of an operator, seen all the time."""

    def __init__(self, name: str, page: Viewer) -> None:
        self.name = name
        self._page = page

    async def order(self, kind: str, **fields: Any) -> dict[str, Any]:
        """The answer to a command."""
        return await self._page.ask(kind=kind, **fields)

    async def press(self, kind: str, **fields: Any) -> dict[str, Any]:
        """The answer to a command with the time at which it was pressed."""
        newest = self._page.states[-1]["server"]["time_ms"]
        held_s = time.time() - self._page.got_s[-1]
        return await self.order(kind, **{"pressed_ago_s": 0.01, "heard_ms": newest, "held_s": held_s} | fields)

    async def slow(self, **late: float) -> dict[str, Any]:
        """Slow down, with what proves that it is new."""
        return await self.press("slow_down", **late)


@contextlib.asynccontextmanager
async def phone(car: Field, name: str, at: str | None = None) -> AsyncIterator[Phone]:
    """`at`: the address of the server; None: its own."""
    async with viewer(at or str(car.client.base_url).rstrip("/")) as page:
        await page.send({"kind": "hello", "name": name, "page": f"page-of-{name.lower()}", "have_event": 0})
        await page.send(SEEN)
        await page.state()

        async def be_seen() -> None:
            while True:
                await asyncio.sleep(1.0)
                await page.send(SEEN)

        seen = asyncio.create_task(be_seen())
        try:
            yield Phone(name, page)
        finally:
            seen.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await seen


async def test_anybody_may_slow_the_car_and_only_the_one_in_control_releases_it() -> None:
    async with field() as car, phone(car, "Ann") as ann, phone(car, "Ben") as ben:
        await car.until(lambda state: state["decelerate"]["state"] == "not_armed")
        await car.until_car(lambda: car.speed_mps > 4.0)
        assert (await ann.order("arm"))["ok"]  # and takes control by it
        refused = await ben.order("disarm")
        assert not refused["ok"]
        assert "Ann is in control" in refused["reason"]
        assert (await ben.slow())["ok"]
        order = (await car.slow())["order"]
        assert order["by"] == "Ben"
        assert order["steps"]["pressed_ms"] <= order["steps"]["server_ms"]
        assert (await ann.slow())["ok"]  # a second press, of another: the same order
        assert (await car.slow())["order"]["number"] == order["number"]
        refused = await ben.order("release", number=order["number"])
        assert not refused["ok"]
        assert (await car.slow())["order"] is not None
        assert (await ann.order("release", number=order["number"]))["ok"]
        assert (await car.slow())["state"] == "armed"


@pytest.mark.parametrize(
    ("late", "is_obeyed"),
    [({"pressed_ago_s": 0.49}, True), ({"pressed_ago_s": 0.51}, False), ({"held_s": 0.0, "heard_ms": 1.7e12}, False)],
)
async def test_what_was_pressed_too_long_ago_is_refused(late: dict[str, float], is_obeyed: bool) -> None:
    async with field() as car, phone(car, "Ann") as ann:
        await car.armed(1.0)
        answer = await ann.slow(**late)
        assert answer["ok"] is is_obeyed
        if not is_obeyed:
            assert "pressed" in answer["reason"]
            assert await car.steps() == ["refused"]
            assert car.speeds == []


async def test_orders_that_hung_in_the_radio_are_refused_with_an_answer() -> None:
    """Each of the five, held from just above what it may take to 10 s."""
    number = 999
    orders: dict[str, dict[str, Any]] = {
        "slow_down": {}, "release": {"number": number}, "veto": {"trigger": "link"}, "arm": {}, "disarm": {},
    }  # fmt: skip
    async with field() as car:
        radio = Radio(car.client.base_url.port or 0)
        async with radio.on_air() as at, phone(car, "Ann", at) as ann:
            await car.armed(1.0)
            assert (await ann.press("control", do="take_over"))["ok"]
            for hold_s in (0.51, 1.0, 4.0, 9.9):
                radio.cut()
                under_way = [asyncio.create_task(ann.press(kind, **more)) for kind, more in orders.items()]
                await asyncio.sleep(hold_s)
                radio.mend()
                for answer in await asyncio.gather(*under_way):
                    assert "ago: press again if still needed" in answer["reason"], answer
                assert (await car.slow())["state"] == "armed"
            assert set(await car.steps()) == {"refused"}
            assert car.speeds == []
            assert (await ann.slow())["ok"]


async def test_an_order_outlives_the_phone_that_gave_it() -> None:
    async with field() as car:
        async with phone(car, "Ann") as ann:
            await car.until(lambda state: state["decelerate"]["state"] == "not_armed")
            await car.until_car(lambda: car.speed_mps > 4.0)
            await ann.order("arm")
            assert (await ann.slow())["ok"]
        await car.until_car(lambda: car.speed_mps == 0.0)  # the phone is gone
        state = await car.state()
        assert state["decelerate"]["state"] == "holding"
        async with phone(car, "Ben") as ben:
            await car.until(lambda state: state["control"]["holder"] is None)
            assert (await ben.order("release", number=state["decelerate"]["order"]["number"]))["ok"]
            await car.until_car(lambda: car.speed_mps > 1.0)
