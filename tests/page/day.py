"""A day with one simulated car, two people and their phones, and the moments that truly were."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
from playwright.async_api import Browser, Locator, expect
from playwright.async_api import TimeoutError as PlaywrightTimeout

from tests.page.conftest import PHONE, Phone, phone_in, picture
from tests.page.processes import Process, running, server, simulate
from tests.ports import free_port
from tests.server.mail.post import Post, posting
from tests.server.simulator.conftest import bridge_client

SETTINGS = "[limits.link_late]\nlate_s = 10.0\ncritical_s = 20.0\n"  # this machine is shared: that is not tested here
LIST = """item = [
  { id = "tyres", title = "Tyres and lamps" },
  { id = "belt", title = "Safety driver belted" },
  { id = "gps", title = "GPS fix", kind = "check", of = "gps_fix" },
  { id = "recorder", title = "Recorder runs", kind = "recorder" },
]
"""
REPORT_TO = "fleet@example.org"
# When each finger came down, by the browser's own clock, before anything of the page sees it.
NOTE_PRESSES = """window.presses = [];
addEventListener('pointerdown', (event) => presses.push(performance.timeOrigin + event.timeStamp), true);"""
FRESH_S = 20.0


class Day:
    """`truth_ms`: when what happened truly happened, by the browser's clock and the simulator's."""

    def __init__(self, data: Path, car: Process, post: Post) -> None:
        self.data = data
        self.car = car
        self.post = post
        self.port = free_port()
        self.watch = Process(*server(data, car.address, self.port))
        self.truth_ms: dict[str, float] = {}
        self.taps: dict[str, int] = {}
        self.phones: list[Phone] = []

    @property
    def ann(self) -> Phone:
        return self.phones[0]

    @property
    def ben(self) -> Phone:
        return self.phones[1]

    async def serve(self) -> None:
        self.watch = await Process(*server(self.data, self.car.address, self.port)).start()

    async def get(self, path: str) -> httpx.Response:
        async with httpx.AsyncClient(base_url=self.watch.address, timeout=60.0) as client:
            return (await client.get(path)).raise_for_status()

    async def json(self, path: str) -> Any:
        return (await self.get(path)).json()

    async def until(self, path: str, is_so: Any, within_s: float = FRESH_S) -> Any:
        """What the server answers, once it is so."""
        async with asyncio.timeout(within_s):
            while not is_so(found := await self.json(path)):
                await asyncio.sleep(0.1)
        return found

    async def press(self, phone: Phone, key: Locator, what: str | None = None) -> None:
        """One tap, counted; `what` happens by it."""
        await key.tap()
        if what is not None:
            self.taps[what] = self.taps.get(what, 0) + 1
            self.truth_ms[what] = await pressed_ms(phone)

    async def interventions(self) -> list[dict[str, Any]]:
        """As they truly were, by the simulator."""
        async with bridge_client(int(self.car.shown.rpartition(":")[2])) as client:
            found: list[dict[str, Any]] = (await client.call("/catgraph/simulator/state"))["values"]["truth"][
                "interventions"
            ]
        return found

    async def marks(self, count: int, **having: Any) -> list[dict[str, Any]]:
        """Those of this drive, once there are so many, one of them as wanted."""

        def is_so(found: Any) -> bool:
            return len(found["marks"]) == count and any(having.items() <= mark.items() for mark in found["marks"])

        found: list[dict[str, Any]] = (await self.until("/api/marks?vehicle=car", is_so))["marks"]
        return found


async def pressed_ms(phone: Phone) -> float:
    """When the last finger came down [ms since 1970]."""
    return float(await phone.page.evaluate("presses.at(-1)"))


async def tapped_through(phone: Phone, key: Locator) -> None:
    """A tap on what an alarm may cover: that is acknowledged first, as an operator does."""
    async with asyncio.timeout(30):
        while True:
            await phone.acknowledge_all()
            before = await phone.page.evaluate("presses.length")
            with contextlib.suppress(PlaywrightTimeout):
                await key.tap(timeout=1500)
            if await phone.page.evaluate("presses.length") > before:  # also where the tool gave up waiting afterwards
                return


@contextlib.asynccontextmanager
async def a_day(browser: Browser, folder: Path) -> AsyncIterator[Day]:
    """Server, car, mail server and two phones with a fake microphone; two people are known, mail is set up."""
    data = folder / "data"
    (data / "settings").mkdir(parents=True)
    (data / "settings" / "car.toml").write_text(SETTINGS)
    (data / "settings" / "car.departure.toml").write_text(LIST)
    async with contextlib.AsyncExitStack() as stack:
        post = await stack.enter_async_context(posting(folder / "box"))
        day = Day(data, await stack.enter_async_context(running(*simulate())), post)
        await day.serve()
        stack.push_async_callback(lambda: day.watch.kill())
        async with httpx.AsyncClient(base_url=day.watch.address, timeout=60.0) as client:
            for name, role in (("A. K.", "operator"), ("M. R.", "safety_driver")):
                (await client.post("/api/people", json={"name": name, "role": role})).raise_for_status()
            mail = {"host": "127.0.0.1", "port": post.port, "security": "none", "sender": "car@test.example"}
            (await client.put("/api/mail/settings", json={**mail, "report_to": [REPORT_TO]})).raise_for_status()
        for name in ("Pixel 7", "iPhone"):
            context = await browser.new_context(**PHONE, permissions=["microphone", "camera"])
            stack.push_async_callback(context.close)
            await context.add_init_script(f"localStorage.setItem('catgraph.device', '{name}'); {NOTE_PRESSES}")
            context.set_default_timeout(10_000)
            day.phones.append(phone := await phone_in(context))
            await phone.acknowledge_meanwhile()
            await phone.open(day.watch.address)
            await phone.live()
        machine = asyncio.create_task(day.ann.watch_machine())
        stack.callback(machine.cancel)
        try:
            yield day
        except BaseException:
            for phone in day.phones:
                await picture(phone, f"day {day.phones.index(phone)}")
            raise


async def held(phone: Phone, key: Locator, for_s: float) -> float:
    """A finger on a key; answers when it came down [ms since 1970]."""
    await expect(key).to_be_visible()
    box = await key.bounding_box()
    assert box is not None
    await phone.page.mouse.move(box["x"] + 40, box["y"] + 28)
    await phone.page.mouse.down()
    await asyncio.sleep(for_s)
    await phone.page.mouse.up()
    return await pressed_ms(phone)


async def read_back(sheet: Locator) -> None:
    """Reads and presses line after line of a hand-over, until there is none left."""
    following = sheet.locator(".tick[data-next]")
    until_s = time.monotonic() + 30
    while not await sheet.get_by_text("all lines are read back").count():
        assert time.monotonic() < until_s, "the lines cannot be read back"
        with contextlib.suppress(PlaywrightTimeout, AssertionError):  # a press at once was not meant for it
            key = await following.get_attribute("data-line", timeout=1000)
            await following.tap(timeout=1000)
            read = sheet.locator(f'.tick[data-line="{key}"]')
            await expect(read).to_have_attribute("aria-pressed", "true", timeout=1000)
