"""Three browsers at one server: control taken, requested, handed over, taken over, lost by sleep; who hears alarms."""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, BrowserContext, CDPSession, Locator, expect

from tests.http import http_client
from tests.page.conftest import PHONE, Phone, phone_in
from tests.page.processes import Process, running, server, simulate

NAMES = ("Ann", "Ben", "Cem")


class Crew:
    """Three phones of three people, and the server's state of them."""

    def __init__(self, phones: dict[str, Phone], watch: Process) -> None:
        self.phones = phones
        self.watch = watch

    def __getitem__(self, name: str) -> Phone:
        return self.phones[name]

    def chip(self, name: str) -> Any:
        return self[name].f("who-name")

    async def state(self) -> dict[str, Any]:
        async with http_client() as client:
            found: dict[str, Any] = (await client.get(f"{self.watch.address}/api/state")).json()
            return found

    async def until(self, fits: Callable[[dict[str, Any]], bool], within_s: float = 10.0) -> dict[str, Any]:
        async with asyncio.timeout(within_s):
            while not fits(state := await self.state()):
                await asyncio.sleep(0.1)
        return state

    async def events(self) -> list[dict[str, Any]]:
        async with http_client() as client:
            answer = await client.get(f"{self.watch.address}/api/events", params={"limit": 1000})
        return [event for event in answer.json()["events"] if event["change"] == "control"]

    async def sheet(self, name: str) -> Any:
        """Opens who is in control, behind the chip."""
        await self[name].f("who").tap()
        await self[name].page.locator('#sheet-cars [data-f="cars-control"]').tap()
        sheet = self[name].page.locator("#sheet-control")
        await expect(sheet).to_be_visible()
        return sheet

    async def press(self, name: str, key: str) -> None:
        await tap(await self.sheet(name), key, exact=False)


async def tap(part: Locator, key: str, *, exact: bool = True) -> None:
    """Presses a key of a sheet or snackbar, once it takes a press."""
    await expect(part).not_to_have_attribute("data-moved", "")
    await part.get_by_role("button", name=key, exact=exact).tap()


class Sleep:
    """A phone that sleeps: nothing of its page runs, its socket stands. Chromium's own freezing is of no use here: the
    driver keeps every page awake that it drives."""

    def __init__(self, phone: Phone) -> None:
        self._page = phone.page
        self._session: CDPSession | None = None

    async def begin(self) -> None:
        self._session = await self._page.context.new_cdp_session(self._page)
        await self._session.send("Debugger.enable")
        await self._session.send("Debugger.pause")

    async def end(self) -> None:
        assert self._session is not None
        await self._session.send("Debugger.resume")
        await self._session.detach()


async def hide(phone: Phone, hidden: bool) -> None:
    """As an operator who turns to another app and back."""
    await phone.page.evaluate(
        """(hidden) => {
          Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
          document.dispatchEvent(new Event('visibilitychange'));
        }""",
        hidden,
    )


async def opened(browser: Browser, name: str, address: str) -> tuple[BrowserContext, Phone]:
    context = await browser.new_context(**PHONE)
    await context.add_init_script(f"localStorage.setItem('catgraph.device', '{name}')")
    phone = await phone_in(context)
    await phone.open(address)
    await phone.live()
    return context, phone


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def car() -> AsyncIterator[Process]:
    async with running(*simulate()) as process:
        yield process


@contextlib.asynccontextmanager
async def crew(browser: Browser, data: Path, car: Process, module: str = "server") -> AsyncIterator[Crew]:
    contexts, phones = [], {}
    async with running(*server(data, car.address), module=module) as watch:
        try:
            for name in NAMES:
                context, phones[name] = await opened(browser, name, watch.address)
                contexts.append(context)
            yield Crew(phones, watch)
        finally:
            for context in contexts:
                await context.close()
    assert [line for phone in phones.values() for line in phone.faults] == []


async def holds(one: Crew, name: str) -> None:
    """Every page that is seen shows who is in control."""
    for other in NAMES:
        await expect(one.chip(other)).to_have_text("You" if other == name else name)


@pytest.mark.gate
@pytest.mark.timeout(120)
async def test_control_is_taken_asked_for_kept_handed_over_and_taken_over(
    browser: Browser, car: Process, tmp_path: Path
) -> None:
    async with crew(browser, tmp_path, car, "tests.page.patient_server") as one:
        await expect(one.chip("Ann")).to_have_text("No one")
        await one["Ann"].f("pause").tap()  # the first order takes it
        await holds(one, "Ann")
        await expect(one["Ben"].page.locator(".snack.note")).to_contain_text("Ann is in control.")

        await one["Ben"].f("pause").tap()
        refused = one["Ben"].page.locator(".snack.note")
        await expect(refused).to_contain_text("Not resumed")
        await expect(refused).to_contain_text("Ann is in control.")
        await tap(refused, "Request control")
        prompt = one["Ann"].page.locator(".snack.prompt")
        await expect(prompt).to_contain_text(re.compile(r"Ben gets it in (\d+) s unless you keep it\."))
        await tap(prompt, "Keep")
        await expect(one["Ben"].page.locator(".snack.note")).to_contain_text(
            "Ann keeps control; the request of Ben was declined."
        )
        await holds(one, "Ann")

        await one.press("Cem", "Request control")
        await expect(one["Cem"].page.locator("#sheet-control")).to_contain_text("It is granted in")
        await tap(prompt, "Hand over")
        await holds(one, "Cem")
        await one["Cem"].page.locator("#sheet-control").get_by_role("button", name="Close").tap()

        await one.press("Cem", "Hand over to Ben")
        await holds(one, "Ben")
        await expect(one["Ben"].page.locator(".snack.note")).to_contain_text("Cem handed control over to Ben.")

        sheet = await one.sheet("Ann")
        await tap(sheet, "Take over …")
        await expect(sheet).to_contain_text("Take over from Ben?")
        await expect(one.chip("Ann")).to_have_text("Ben")  # not before it is confirmed
        await tap(sheet, "Take over")
        await holds(one, "Ann")
        await expect(one["Ben"].page.locator(".snack.note")).to_contain_text("You lost control")
        await expect(one["Cem"].page.locator(".snack.note")).to_contain_text("Ann took control over from Ben.")
        events = await one.events()
        assert [event["act"] for event in events] == [
            *("taken", "requested", "kept", "requested", "granted", "handed_over", "taken_over"),
        ]
        fences = [event["fence"] for event in events]
        assert fences == sorted(fences)


@pytest.mark.timeout(120)
async def test_lost_by_sleep_back_again_and_lost_for_good(browser: Browser, car: Process, tmp_path: Path) -> None:
    async with crew(browser, tmp_path, car) as one:
        await one.press("Ann", "Take control")
        await holds(one, "Ann")
        sleep = Sleep(one["Ann"])
        await sleep.begin()
        state = await one.until(lambda s: s["control"]["holder"] is None, 8.0)
        assert state["control"]["former"]["name"] == "Ann"
        await expect(one.chip("Ben")).to_have_text("No one")
        await expect(one["Ben"].page.locator(".snack.note")).to_contain_text("Ann fell silent for 3 s")
        await sleep.end()
        await holds(one, "Ann")  # nobody had taken it meanwhile
        again = one["Ann"].page.locator(".snack.note")
        await expect(again).to_contain_text("You are in control again", timeout=20_000)  # first, that it was blind

        await hide(one["Ann"], True)
        await expect(one["Ben"].page.locator(".snack.note")).to_contain_text("Nobody is in control", timeout=10_000)
        await tap(one["Ben"].page.locator(".snack.note"), "Take control")
        await expect(one.chip("Ben")).to_have_text("You")
        await hide(one["Ann"], False)
        await holds(one, "Ben")
        assert [event["act"] for event in await one.events()] == ["taken", "lapsed", "returned", "lapsed", "taken"]


@pytest.mark.timeout(120)
async def test_silence_grants_what_is_asked_for_and_a_reload_keeps_it(
    browser: Browser, car: Process, tmp_path: Path
) -> None:
    async with crew(browser, tmp_path, car) as one:
        await one.press("Ann", "Take control")
        await holds(one, "Ann")
        await one.press("Ben", "Request control")
        await expect(one["Ann"].page.locator(".snack.prompt")).to_be_visible()
        await expect(one.chip("Ben")).to_have_text("You", timeout=14_000)
        await expect(one["Ann"].page.locator(".snack.prompt")).to_be_hidden()
        await expect(one["Ann"].page.locator(".snack.note")).to_contain_text("Ann did not answer within 10 s")
        await one["Ben"].page.reload()
        await one["Ben"].live()
        await holds(one, "Ben")
        assert [event["act"] for event in await one.events()] == ["taken", "requested", "granted", "lapsed", "returned"]


def reach(state: dict[str, Any]) -> tuple[int, int]:
    return state["reach"]["can"], state["reach"]["of"]


@pytest.mark.timeout(120)
async def test_two_of_three_operators_can_hear_alarms(browser: Browser, car: Process, tmp_path: Path) -> None:
    async with crew(browser, tmp_path, car) as one:
        line = one["Ann"].page.locator('[data-part="reach"]')
        await expect(line).to_contain_text("Nobody can hear alarms (3 operators)")
        await expect(line).to_contain_text("3 × sound off")
        for name in ("Ann", "Ben"):
            await one[name].f("sound-off").tap()
        assert reach(await one.until(lambda s: reach(s) == (2, 3))) == (2, 3)
        await expect(line).to_contain_text("Alarms audible on 2 of 3 operator pages")
        await expect(one["Cem"].page.locator('[data-part="reach"]')).to_contain_text("2 of 3 operator pages")

        await hide(one["Ann"], True)
        await one.until(lambda s: reach(s) == (1, 3) and s["reach"]["why"] == "page in the background, sound off")
        await hide(one["Ann"], False)
        await one.until(lambda s: reach(s) == (2, 3))
        sleep = Sleep(one["Ben"])
        await sleep.begin()
        state = await one.until(lambda s: reach(s) == (1, 3))
        assert {page["name"]: page["why"] for page in state["reach"]["pages"]} == {
            "Ann": None, "Ben": "silent", "Cem": "sound",
        }  # fmt: skip
        await sleep.end()
        await one.until(lambda s: reach(s) == (2, 3))
        await one["Cem"].page.close()  # a farewell: nobody expects anything of it
        await one.until(lambda s: reach(s) == (2, 2))


@pytest.mark.timeout(120)
async def test_nobody_who_hears_while_the_car_moves_is_a_warning_on_every_page(
    browser: Browser, car: Process, tmp_path: Path
) -> None:
    async with running(*server(tmp_path, car.address)) as watch:
        context, phone = await opened(browser, "Ann", watch.address)
        try:
            await expect(phone.page.locator(".strip")).to_contain_text("Nobody can hear alarms", timeout=40_000)
            async with http_client() as client:
                standing = (await client.get(f"{watch.address}/api/alarms")).json()["alarms"]
            assert [
                "nobody can hear alarms: none of 1 (sound off)" in one["text"]
                for one in standing
                if one["id"] == "reach"
            ] == [True]
            await phone.page.locator('[data-part="reach"]').tap()
            sheet = phone.page.locator("#sheet-this-phone")
            await expect(sheet).to_be_visible()
            await sheet.locator('[data-f="arm"]').tap()
            await expect(sheet).to_contain_text("This device sounds alarms while this page is in the foreground.")
            async with http_client() as client:
                async with asyncio.timeout(10):
                    while True:
                        alarms = (await client.get(f"{watch.address}/api/alarms")).json()["alarms"]
                        if [one["active"] for one in alarms if one["id"] == "reach"] == [False]:
                            break
                        await asyncio.sleep(0.2)
        finally:
            await context.close()


@pytest.mark.timeout(120)
async def test_each_phone_has_its_marker_and_the_one_in_the_car_is_compared(
    browser: Browser, car: Process, tmp_path: Path
) -> None:
    """Ann shares a position, Ben was not allowed to; Ann, in control, chooses that Ben's is in the car."""
    async with running(*server(tmp_path, car.address)) as watch:
        one = Crew({}, watch)
        contexts = []
        try:
            for name in ("Ann", "Ben"):
                context, one.phones[name] = await opened(browser, name, watch.address)
                contexts.append(context)
            await contexts[0].grant_permissions(["geolocation"])
            position = (await one.state())["signals"]["position"]["value"]
            here = {"latitude": position["lat_deg"], "longitude": position["lon_deg"], "accuracy": 6.0}
            await contexts[0].set_geolocation(here)
            for name in ("Ann", "Ben"):
                await one[name].f("sound-off").tap()
            state = await one.until(lambda s: len(s["phones"]) == 2 and s["phones"][0]["accuracy_m"] == 6.0)
            assert [(phone["label"], phone["compared"]) for phone in state["phones"]] == [("Ann", True), ("Ben", False)]
            assert state["phone"]["choice"] == "first"

            await one["Ann"].show("map")
            await one["Ann"].f("phones").tap()
            sheet = one["Ann"].page.locator("#sheet-phones")
            await expect(sheet).to_contain_text("Of 2, the first with a usable position is used")
            bens = sheet.get_by_role("button", name="Ben")
            await expect(bens).to_contain_text("Location permission denied on this phone.")
            await bens.tap()
            await expect(bens).to_contain_text("In the car")
            await sheet.get_by_role("button", name="Close").tap()
            state = await one.until(lambda s: s["phone"]["choice"] == "operator")
            assert (state["phone"]["label"], state["phone"]["why"]) == ("Ben", "denied")  # no other takes its place
            await expect(one["Ann"].page.locator(".others .whose")).to_contain_text("You")
            await expect(one["Ann"].f("phones")).to_contain_text("Ben is in the car")
            await expect(one.chip("Ben")).to_have_text("Ann")
        finally:
            for context in contexts:
                await context.close()
