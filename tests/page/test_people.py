"""Two phones and the people who hold them: signed on in two taps, named beside control, handed over with read-back."""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, Page, Route, expect
from playwright.async_api import TimeoutError as PlaywrightTimeout

from tests.http import http_client
from tests.page.barriers import no_barrier
from tests.page.conftest import PHONE, Phone, phone_in
from tests.page.processes import Process, running, server, simulate

HOSTILE = "<img src=x onerror=owned=1>"


class Shift:
    """Two phones at one server that watches one car, and the server as a program sees it, also from beside the car."""

    def __init__(self, ann: Phone, ben: Phone, client: httpx.AsyncClient, console: httpx.AsyncClient) -> None:
        self.ann = ann
        self.ben = ben
        self.client = client
        self.console = console

    async def sign_on(self, phone: Phone, name: str) -> None:
        """From the list that opens by itself: a person, then the key."""
        await row(phone, name).tap()
        await phone.page.locator('#sheet-duty [data-f="sign-on"]').tap()
        await expect(phone.page.locator("#sheet-duty")).to_have_count(0)

    async def order(self, phone: Phone, key: str) -> None:
        await phone.f("who").tap()
        await phone.page.locator('#sheet-cars [data-f="cars-control"]').tap()
        await phone.page.locator("#sheet-control").get_by_role("button", name=key).tap()

    async def control(self) -> dict[str, Any]:
        found: dict[str, Any] = (await self.client.get("/api/state")).json()["control"]
        return found

    async def events(self, change: str) -> list[dict[str, Any]]:
        found = (await self.client.get("/api/events", params={"limit": 1000})).json()["events"]
        return [event for event in found if event["change"] == change]


def row(phone: Phone, name: str) -> Locator:
    return phone.page.locator("#sheet-duty [data-person]").filter(has=phone.page.get_by_text(name, exact=True))


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def car() -> AsyncIterator[Process]:
    async with running(*simulate()) as process:
        yield process


@contextlib.asynccontextmanager
async def shift(browser: Browser, data: Path, car: Process) -> AsyncIterator[Shift]:
    phones = []
    async with running(*server(data, car.address)) as watch, contextlib.AsyncExitStack() as stack:
        client = await stack.enter_async_context(http_client(base_url=watch.address))
        console = await stack.enter_async_context(http_client(base_url=watch.console))
        for name, role in (("A. K.", "operator"), ("M. R.", "safety_driver"), (HOSTILE, "supervisor")):
            assert (await client.post("/api/people", json={"name": name, "role": role})).is_success
        for name in ("Pixel 7", "iPhone"):
            context = await browser.new_context(**PHONE)
            stack.push_async_callback(context.close)
            await context.add_init_script(f"localStorage.setItem('catgraph.device', '{name}')")
            phone = await phone_in(context)
            await phone.open(watch.address)
            await phone.live()
            phones.append(phone)
        yield Shift(phones[0], phones[1], client, console)
    assert [line for phone in phones for line in phone.faults] == []


@pytest.mark.gate
async def test_who_signs_on_is_named_on_both_phones(browser: Browser, car: Process, tmp_path: Path) -> None:
    async with shift(browser, tmp_path, car) as one:
        await expect(row(one.ann, HOSTILE)).to_be_visible()  # as text, and nothing of it runs
        await one.sign_on(one.ann, "A. K.")
        await expect(one.ann.f("who-name")).to_have_text("AK on duty")
        await one.sign_on(one.ben, "M. R.")
        await one.order(one.ann, "Take control")
        await expect(one.ann.f("who-name")).to_have_text("AK controls")
        await expect(one.ben.f("who-name")).to_have_text("A. K. (Pixel 7)")
        people = (await one.client.get("/api/people")).json()["people"]
        assert {person["name"] for person in people if person["duty"]} == {"A. K.", "M. R."}


async def test_who_was_removed_by_mistake_is_added_again_by_a_second_press(
    browser: Browser, car: Process, tmp_path: Path
) -> None:
    async with shift(browser, tmp_path, car) as one:
        added = next(who for who in (await one.client.get("/api/people")).json()["people"] if who["name"] == "A. K.")
        page = {"x-catgraph-page": "page-of-before"}
        assert (await one.console.post("/api/duty", json={"person": added["id"]}, headers=page)).is_success
        assert (await one.console.delete("/api/duty", headers=page)).is_success
        assert (await one.console.delete(f"/api/people/{added['id']}")).is_success
        sheet = one.ann.page.locator("#sheet-duty")
        await sheet.locator("[data-person=' new']").tap()
        await sheet.get_by_label("Name or initials").fill("A. K.")
        await sheet.locator('[data-f="sign-on"]').tap()
        await expect(sheet.get_by_role("alert")).to_contain_text("A. K. was removed lately")
        await expect(sheet.locator(".duty-keys")).not_to_have_attribute("data-moved", "")
        await sheet.locator('[data-f="sign-on"]').tap()
        await expect(one.ann.f("who-name")).to_have_text("AK on duty")
        one.ann.complaints[:] = [line for line in one.ann.complaints if "409" not in line]  # the refusal


@pytest.mark.timeout(150)
async def test_people_sign_on_act_and_hand_over(browser: Browser, car: Process, tmp_path: Path) -> None:
    async with shift(browser, tmp_path, car) as one:
        ann, ben = one.ann, one.ben
        await expect(row(ann, HOSTILE)).to_be_visible()  # as text, and nothing of it runs
        await no_barrier(ann.page, "sign on", "#sheet-duty")
        await fits(ann.page, "#sheet-duty")
        await one.sign_on(ann, "A. K.")
        await expect(ann.f("who-name")).to_have_text("AK on duty")
        await one.sign_on(ben, "M. R.")

        await one.order(ann, "Take control")
        await expect(ann.f("who-name")).to_have_text("AK controls")
        await expect(ben.f("who-name")).to_have_text("A. K. (Pixel 7)")
        await ann.page.reload()  # who is on duty stays so, and there is no second prompt
        await ann.live()
        await expect(ann.f("who-name")).to_have_text("AK controls")
        await expect(ann.page.locator("#sheet-duty")).to_have_count(0)

        await one.order(ann, "Hand over to M. R. (iPhone)")
        sheet = ben.page.locator("#sheet-handover")
        await expect(sheet).to_contain_text("In the car: M. R., safety driver")
        await ann.page.locator(".snack.note").get_by_role("button", name="Show").tap()
        await expect(ann.page.locator("#sheet-handover")).to_contain_text("0 of")
        await no_barrier(ben.page, "hand over", "#sheet-handover")
        await fits(ben.page, "#sheet-handover")
        take = sheet.locator('[data-f="take-over"]')
        await read_all(sheet)
        await expect(take).to_contain_text("all lines are read back")

        # A new alarm, and a limit that differs from its default: neither was read back.
        await one.console.patch("/api/settings", json={"values": {"speed_limit.max_mps": 2.0}})
        alarm = ben.page.locator("#sheet-alarm")
        await expect(alarm).to_be_visible(timeout=15_000)
        await alarm.locator('[data-f="acknowledge"]').tap()
        await expect(sheet).to_be_visible()  # it comes back once the alarm is answered
        await expect(sheet).to_contain_text("Speed limit: 2 m/s")
        await ann.page.locator(".snack.note").get_by_role("button", name="Show").tap()  # the alarm had closed it
        await expect(ann.page.locator("#sheet-handover")).to_contain_text("Speed limit: 2 m/s")
        await expect(take).to_contain_text("not read back yet")
        assert (await one.control())["holder"] == "A. K. (Pixel 7)"
        await read_all(sheet)
        await take.tap()
        await expect(ben.f("who-name")).to_have_text("MR controls")
        assert (await one.control())["holder"] == "M. R. (iPhone)"
        await expect(ann.page.locator(".snack.note")).to_contain_text("Control was handed over to M. R. (iPhone)")
        await expect(ann.page.locator("#sheet-handover")).to_have_count(0)

        (acknowledged,) = await one.events("acknowledged")
        assert (acknowledged["by"], acknowledged["person"], acknowledged["role"]) == (
            *("M. R. (iPhone)", "M. R.", "safety_driver"),
        )
        assert [event["step"] for event in await one.events("hand_over")] == ["offered", "accepted"]
        people = (await one.client.get("/api/people")).json()["people"]
        assert {person["name"]: person["duty"] is not None for person in people} == {
            "A. K.": False,
            "M. R.": True,
            HOSTILE: False,
        }


SLIDING = """addEventListener('DOMContentLoaded', () => {
  const slide = Object.assign(document.createElement('i'), { id: 'sliding', className: 'slide', hidden: true });
  slide.dataset.moves = '';
  document.body.append(slide);
})"""


@pytest.mark.timeout(90)
async def test_what_opens_by_itself_covers_neither_an_alarm_nor_a_finger(
    browser: Browser, car: Process, tmp_path: Path
) -> None:
    async with shift(browser, tmp_path, car) as one, await browser.new_context(**PHONE) as context:
        late = await phone_in(context)
        requested, loads = asyncio.Event(), asyncio.Event()

        async def hold(route: Route) -> None:
            requested.set()
            await loads.wait()
            await route.continue_()

        await late.page.route("**/people*.css*", hold)
        await late.page.add_init_script(SLIDING)
        async with late.page.expect_response(re.compile("duty-notices")):
            await late.open(one.ann.page.url)
            await late.live()
        await late.page.wait_for_timeout(600)  # of several pictures
        assert not requested.is_set()
        await late.page.evaluate("document.querySelector('#sliding').remove()")
        await asyncio.wait_for(requested.wait(), 10)
        await one.console.patch("/api/settings", json={"values": {"speed_limit.max_mps": 2.0}})
        alarm = late.page.locator("#sheet-alarm")
        await expect(alarm).to_be_visible(timeout=15_000)
        loads.set()
        await late.page.wait_for_function("() => document.querySelector('link[href*=people]')?.sheet")
        await late.page.wait_for_timeout(300)
        await expect(late.page.locator("#sheet-duty")).to_have_count(0)
        await alarm.locator('[data-f="acknowledge"]').tap()
        await expect(row(late, "A. K.")).to_be_visible()  # once the alarm is answered


BESIDE = """(sheet) => [...document.querySelectorAll(`${sheet} *`)]
  .filter((one) => one.getClientRects().length && !one.closest('svg'))
  .map((one) => [one.getBoundingClientRect(), one])
  .filter(([box, one]) => box.left < -1 || box.right > innerWidth + 1
    || (one.matches('button') && !one.closest('.duty-body') && (box.bottom > innerHeight + 1 || box.height < 44)))
  .map(([, one]) => one.outerHTML.slice(0, 90))"""


async def fits(page: Page, sheet: str) -> None:
    """At each size nothing of a sheet is beside the screen, and its keys are seen and large enough."""
    for width, height in ((320, 640), (360, 740), (740, 360), (820, 1180), (1440, 900), (412, 915)):
        await page.set_viewport_size({"width": width, "height": height})
        assert await page.evaluate(BESIDE, sheet) == [], f"{sheet} of {width} × {height}"


async def read_all(sheet: Locator) -> None:
    """Reads and presses line after line, until there is none left. The sheet gives way to an alarm, and comes back."""
    title, following = sheet.locator('[data-f="take-over"]'), sheet.locator(".tick[data-next]")
    async with asyncio.timeout(30):
        while not await title.filter(has_text="all lines are read back").count():
            with contextlib.suppress(PlaywrightTimeout, AssertionError):  # a press at once was not meant for it
                key = await following.get_attribute("data-line", timeout=1000)
                await following.tap(timeout=1000)
                read = sheet.locator(f'.tick[data-line="{key}"]')
                await expect(read).to_have_attribute("aria-pressed", "true", timeout=1000)
