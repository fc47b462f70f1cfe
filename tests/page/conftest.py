"""A real Chromium at the size of a phone, with touch, for the tests of the page."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, async_playwright, expect

from tests.chromium import FLAGS

PHONE: dict[str, Any] = {
    "viewport": {"width": 412, "height": 915},
    "device_scale_factor": 1,  # a quarter of the pixels for a machine without a graphics card
    "color_scheme": "dark",
    "has_touch": True,
    "is_mobile": True,
    "service_workers": "block",  # what keeps the page's shell has its own tests; here every request is the page's
}
expect.set_options(timeout=8000)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Every test here but those of the plain functions drives a browser, on one event loop a module."""
    here = Path(__file__).parent
    for item in items:
        if here in item.path.parents:
            item.add_marker(pytest.mark.browser)
            item.add_marker(pytest.mark.asyncio(loop_scope="module"), append=False)
            # A browser, a car and a server on two busy cores: what fails is tried again, and the summary says so.
            item.add_marker(pytest.mark.flaky(reruns=2, reruns_delay=2))


@pytest_asyncio.fixture(loop_scope="module", scope="module")
async def browser(chromium: str) -> AsyncIterator[Browser]:
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield browser
        await browser.close()


def is_complaint(kind: str, text: str) -> bool:
    """Whether the page says on its console that something is wrong; that these tests keep its worker away is not."""
    return kind in ("error", "warning") and "blocked by Playwright" not in text


class Phone:
    """A phone with the page open, and what its console said."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.stutter_s = 0.0
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on(
            "console", lambda said: self.complaints.append(said.text) if is_complaint(said.type, said.text) else None
        )

    @property
    def slack_s(self) -> float:
        """What must be granted beside a limit: the time of looking, and thrice what this machine lets anyone wait."""
        return 0.4 + 3 * self.stutter_s

    async def watch_machine(self) -> None:
        """Notes the longest time by which a short sleep was late, for as long as it runs."""
        while True:
            due_s = time.monotonic() + 0.05
            await asyncio.sleep(0.05)
            self.stutter_s = max(self.stutter_s, time.monotonic() - due_s)

    async def open(self, address: str) -> None:
        await self.page.goto(address)

    def f(self, name: str, root: str = "#monitor") -> Any:
        """A field of the page by its name in the templates."""
        return self.page.locator(f'{root} [data-f="{name}"]').first

    async def live(self) -> None:
        """Waits until the values are live."""
        await expect(self.f("word")).to_have_text("Live", timeout=12_000)
        await expect(self.f("veil")).not_to_have_attribute("data-on", re.compile("."))

    async def acknowledge_all(self) -> None:
        """Acknowledges what the car raises of its own, as an operator does."""
        while await self.page.locator("#sheet-alarm[open]").count():
            await self.f("acknowledge", "#sheet-alarm").tap()
            await self.page.wait_for_timeout(300)

    async def speed(self) -> str:
        return str(await self.page.locator(".gauge .speed").text_content())


@pytest_asyncio.fixture(loop_scope="module")
async def phone(browser: Browser, request: pytest.FixtureRequest) -> AsyncIterator[Phone]:
    """A fresh phone; at the end its console must be clean but for the lost connections a test made."""
    context = await browser.new_context(**{**PHONE, **getattr(request, "param", {})})
    phone = Phone(await context.new_page())
    machine = asyncio.create_task(phone.watch_machine())
    yield phone
    machine.cancel()
    await context.close()
    lost = re.compile(
        r"Service Worker registration blocked|WebSocket connection to"
        r"|Failed to load resource: net::ERR_(CONNECTION|EMPTY)|ERR_CONNECTION"
    )
    assert [said for said in phone.complaints if not lost.search(said)] == []
