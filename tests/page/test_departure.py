"""The departure check on a phone: ten items, one that fails and is fixed, a brake that is seen, signed; a kill -9."""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, expect

from tests.http import http_client
from tests.page.barriers import no_barrier
from tests.page.conftest import LIVE, PHONE, Phone, phone_in
from tests.page.processes import Process, running, server, simulate
from tests.ports import free_port

SETTINGS = """[limits.link_late]
late_s = 10.0
critical_s = 20.0
[limits.recording]
automatic = 0.0
"""
HOSTILE = "<img src=x onerror=alert(1)>"
LIST = f"""item = [
  {{ id = "tyres", title = "Tyres and lamps" }},
  {{ id = "doors", title = "Boot and doors shut" }},
  {{ id = "belt", title = "Safety driver belted {HOSTILE}" }},
  {{ id = "coupling", title = "Trailer coupling locked" }},
  {{ id = "gps", title = "GPS fix", kind = "check", of = "gps_fix" }},
  {{ id = "rate", title = "Speed arrives", kind = "topic", of = "/catvehicle/vel", need = 5 }},
  {{ id = "recorder", title = "Recorder runs", kind = "recorder", fix = "A drive that is not recorded is lost." }},
  {{ id = "sound", title = "Sound armed", kind = "sound" }},
  {{ id = "clock", title = "Clock of the car", kind = "clock", need = 5 }},
  {{ id = "brake", title = "Press the brake", kind = "brake", need = 30 }},
]
"""


class Walk:
    """A phone whose taps are counted."""

    def __init__(self, phone: Phone) -> None:
        self.page = phone.page
        self.screen = phone.page.locator(".departure")
        self.taps = 0

    async def tap(self, key: Locator) -> None:
        await self.settled()
        await key.tap()
        self.taps += 1

    async def settled(self) -> None:
        """No row moved so lately that a tap would not be meant for it."""
        await expect(self.screen.locator(".dep-list[data-moved]")).to_have_count(0)

    def item(self, name: str) -> Locator:
        return self.screen.locator(f'[data-item="{name}"]')

    async def is_face(self, name: str, face: str, within_ms: float = 15_000) -> None:
        await expect(self.item(name)).to_have_attribute("data-face", face, timeout=within_ms)


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def car() -> AsyncIterator[Process]:
    async with running(*simulate()) as process:
        yield process


def prepared(data: Path) -> Path:
    (data / "settings").mkdir()
    (data / "settings" / "car.toml").write_text(SETTINGS)
    (data / "settings" / "car.departure.toml").write_text(LIST)
    return data


async def check_of(client: httpx.AsyncClient) -> dict[str, Any]:
    found: dict[str, Any] = (await client.get("/api/departure")).json()
    return found


TOO_WIDE = """() => [...document.querySelectorAll('.departure *')]
  .filter((one) => one.getClientRects().length && one.getBoundingClientRect().right > innerWidth + 1)
  .map((one) => one.className)"""


async def fits(phone: Phone) -> None:
    for width in (360, 412, 820, 1440):
        await phone.page.set_viewport_size({"width": width, "height": 915})
        assert await phone.page.evaluate(TOO_WIDE) == [], width
    await phone.page.set_viewport_size(PHONE["viewport"])


# As a finger does that taps twice: what came there meanwhile is not meant.
PRESS_WHAT_MOVES = """() => new MutationObserver((_, all) => {
  if (!document.querySelector('.dep-list').hasAttribute('data-moved')) return; // it has just come to rest
  all.disconnect();
  document.querySelector('.departure [data-item="coupling"] .tick').click();
}).observe(document.querySelector('.dep-list'), { attributes: true, attributeFilter: ['data-moved'] })"""
CHECK_URL = re.compile(r"/api/departure(\?|$)")
OFFLINE = ("ERR_CONNECTION", "WebSocket")  # by a browser whose requests fail


async def is_old_without_answers(walk: Walk) -> None:
    """A missing answer is shown, and no value stands as if it were measured now."""
    value, state = walk.item("brake").locator(".v"), walk.screen.locator(".state")
    await expect(value).not_to_have_text("–")
    await walk.page.route(CHECK_URL, lambda route: route.abort("connectionrefused"))
    await expect(state).to_contain_text("What is shown here is old.")
    await expect(value).to_have_text("–")
    await walk.page.unroute(CHECK_URL)
    await expect(state).to_be_hidden()
    await expect(value).not_to_have_text("–")


@pytest.mark.timeout(120)
async def test_ten_items_are_walked_fixed_and_signed_within_15_taps(
    browser: Browser, car: Process, tmp_path: Path
) -> None:
    port = free_port()
    context = await browser.new_context(**PHONE)
    await context.add_init_script("localStorage.setItem('catgraph.device', 'Pixel 7')")
    phone = await phone_in(context)
    walk = Walk(phone)
    async with running(*server(prepared(tmp_path), car.address, port)) as watch:
        async with http_client(base_url=watch.address) as client:
            await phone.open(watch.address)
            await phone.live()
            await walk.tap(phone.f("menu"))
            await walk.tap(phone.page.get_by_role("button", name="Departure check"))
            await expect(phone.page.locator(".dep-count")).to_have_text("0 of 10")
            await walk.tap(walk.screen.get_by_role("button", name="Begin the check"))
            await walk.is_face("recorder", "failed")
            await walk.is_face("brake", "now")
            for name in ("gps", "rate", "sound", "clock"):
                await walk.is_face(name, "done")
            await expect(walk.screen.locator('[data-f="departure-sign"]')).to_contain_text("1 failed, 5 open")
            await no_barrier(phone.page, "departure check", ".departure")
            await is_old_without_answers(walk)
            await phone.page.emulate_media(color_scheme="dark")
            await fits(phone)
            for name in ("tyres", "doors", "belt"):
                await walk.page.evaluate(PRESS_WHAT_MOVES)
                await walk.tap(walk.item(name).get_by_role("button", name="Done:"))
                await walk.is_face(name, "done")
                await walk.settled()
                await walk.is_face("coupling", "open")
            await expect(walk.item("belt")).to_contain_text(HOSTILE)  # as text
            await walk.tap(walk.item("coupling").locator(".dep-body"))
            sheet = phone.page.locator("#sheet-departure")
            await no_barrier(phone.page, "not applicable", "#sheet-departure")
            await walk.tap(sheet.get_by_role("button", name="Not fitted to this car"))
            await walk.tap(sheet.locator('[data-f="why-yes"]'))
            await walk.is_face("coupling", "not_applicable")
            await walk.tap(walk.item("recorder").get_by_role("button", name="Start recording"))
            await walk.is_face("recorder", "done")
            await expect(walk.item("recorder")).to_contain_text("fixed")
            await car.type("driver-brakes")  # the lap alone never brakes so hard
            await walk.is_face("brake", "done", 45_000)
            await walk.tap(walk.screen.get_by_role("button", name="Sign as Pixel 7"))
            await expect(walk.screen.locator(".dep-seal")).to_contain_text("Ready: signed by Pixel 7")
            await no_barrier(phone.page, "signed departure check", ".departure")
            assert walk.taps <= 15

            signed = await check_of(client)
            signature = signed["signature"]
            assert hashlib.sha256(signature["document"].encode()).hexdigest() == signature["hash"]
            assert (signature["done"], signature["not_applicable"]) == (9, 1)
            fixed = [row["id"] for row in signed["items"] if row["is_fixed"]]
            assert "recorder" in fixed
            assert signature["fixed"] == len(fixed)
            assert {row["id"]: row["result"] for row in json.loads(signature["document"])["items"]} == {
                row["id"]: row["result"] for row in signed["items"]
            }
            assert (await client.get("/api/state")).json()["departure"]["state"] == "signed"
            events = (await client.get("/api/log.json", params={"change": "departure"})).json()
            steps = [event["step"] for event in events if event["change"] == "departure" and event["step"] != "without"]
            assert steps[0] == "begun"
            assert steps[-1] == "signed"
            assert steps.count("item") >= 10 + len(fixed), "each item, and each failure"
        await watch.kill()
        await expect(phone.f("link-state")).not_to_have_text(LIVE, timeout=12_000)
    async with (
        running(*server(tmp_path, car.address, port)) as watch,
        http_client(base_url=watch.address) as client,
    ):
        again = await check_of(client)
        assert again["signature"] == signature, "what was signed is kept letter by letter"
        assert [(row["id"], row["result"], row["note"]) for row in again["items"]] == [
            (row["id"], row["result"], row["note"]) for row in signed["items"]
        ]
        await expect(walk.screen.locator(".dep-seal")).to_contain_text("Ready: signed by Pixel 7")
        await phone.live()
        await phone.page.locator('[data-f="departure-reopen"]').tap()
        await expect(walk.screen.locator('[data-f="departure-sign"]')).to_be_visible()
    assert [one for one in phone.complaints if not any(line in one for line in OFFLINE)] == []
    await context.close()


@pytest.mark.timeout(90)
async def test_the_list_is_edited_in_settings(browser: Browser, car: Process, tmp_path: Path) -> None:
    context = await browser.new_context(**PHONE)
    phone = await phone_in(context)
    async with (
        running(*server(prepared(tmp_path), car.address)) as watch,
        http_client(base_url=watch.address) as client,
    ):
        await phone.open(f"{watch.address}/#settings")
        await phone.live()
        group = phone.page.locator('[data-part="departure"]')
        await group.locator("summary").tap()
        rows = group.locator(".dep-edit > li")
        await expect(rows).to_have_count(10)
        await no_barrier(phone.page, "list of the departure check", '[data-part="departure"]')

        async def listed() -> list[str]:
            return [f"{one['id']} {one['kind']} {one['need']}" for one in (await check_of(client))["items"]]

        await group.get_by_label("Title of one more item").fill("Örtliche Lage")
        await phone.page.route(CHECK_URL, lambda route: route.abort("connectionrefused"))
        await group.locator('[data-f="departure-add"]').tap()
        await expect(group.locator(".bad")).to_contain_text("Nothing was changed.")
        await phone.page.unroute(CHECK_URL)
        assert len(await listed()) == 10
        await group.locator('[data-f="departure-add"]').tap()
        await expect(rows).to_have_count(11)
        await rows.last.get_by_role("button", name="Up:").tap()
        await expect(rows.nth(9)).to_have_attribute("data-id", "o_rtliche_lage")
        await rows.nth(9).get_by_label("Kind of").select_option("brake")
        await rows.nth(9).get_by_label("Needed %").fill("35")
        await rows.nth(9).get_by_label("Needed %").blur()
        await rows.nth(9).get_by_label("Days: how often").fill("30,5")
        await rows.nth(9).get_by_label("Days: how often").blur()
        await expect(group.locator(".bad")).to_contain_text("`every_days` is a whole number of days from 1 to 3650")
        for label, value in (("Days", "30"), ("Kilometres", "500")):
            await rows.nth(9).get_by_label(f"{label}: how often").fill(value)
            await rows.nth(9).get_by_label(f"{label}: how often").blur()
        async with asyncio.timeout(8):  # the second was typed while the first was sent
            while [(one["every_days"], one["every_km"]) for one in (await check_of(client))["items"]][9] != (30, 500):
                await asyncio.sleep(0.1)
        await rows.first.get_by_role("button", name="Remove").tap()
        await expect(rows).to_have_count(10)
        assert (await listed())[-2:] == ["o_rtliche_lage brake 35.0", "brake brake 30.0"]
        await rows.nth(8).get_by_label("Needed %").fill("350")
        await rows.nth(8).get_by_label("Needed %").blur()
        await expect(group.locator(".bad")).to_contain_text("a number from 1 to 100 %")
        kept = (tmp_path / "settings" / "car.departure.toml").read_text()
        assert (await client.get("/api/departure.toml")).text == kept
        await group.locator('[data-f="departure-default"]').tap()
        await expect(rows).to_have_count(11)
        assert (await check_of(client))["is_default"]
    assert [one for one in phone.complaints if not any(line in one for line in OFFLINE)] == []
    await context.close()
