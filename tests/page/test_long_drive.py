"""A recording of eight hours as an operator opens it: its speed at once, then its chart, the minute and the whole."""

from __future__ import annotations

import asyncio
import math
import re
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Request, expect

from tests.http import http_client
from tests.page import drives
from tests.page.conftest import Phone
from tests.page.processes import running, server, simulate
from tests.page.test_replay import WHEN

HOURS = 8.0
READ_S = 600.0


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[tuple[str, str]]:
    """A server that has the drive; its address and the recording's id."""
    data = tmp_path_factory.mktemp("data")
    folder = data / "recordings" / "car"
    folder.mkdir(parents=True)
    drives.write(
        folder / "long.bag",
        {
            "speed": lambda t: drives.twist(12.4 if 20_000 <= t < 20_008 else 6.0 + math.sin(t / 40)),
            "distance": lambda t: drives.number(40.0 + math.sin(t / 9)),
        },
        seconds=HOURS * 3600,
    )
    async with running(*simulate()) as car, running(*server(data, car.address)) as process:
        async with http_client() as client, asyncio.timeout(READ_S):
            while True:
                rows: list[dict[str, Any]] = (await client.get(f"{process.address}/api/recordings")).json()[
                    "recordings"
                ]
                if rows and rows[-1]["state"] == "read":
                    break
                await asyncio.sleep(1.0)
        yield process.address, rows[-1]["id"]


class Answers:
    """How long each answer about the drive took as the page sees it [s], and its size [bytes]."""

    def __init__(self) -> None:
        self.took_s: list[float] = []
        self.sizes: list[int] = []

    async def note(self, request: Request) -> None:
        if "/api/trends/drive" in request.url:
            sizes = await request.sizes()
            self.took_s.append(request.timing["responseEnd"] / 1000)
            self.sizes.append(sizes["responseBodySize"] + sizes["responseHeadersSize"])


@pytest.mark.soak
@pytest.mark.timeout(1800)
async def test_eight_hours_open_in_the_replay_and_in_the_chart(
    phone: Phone, watch: tuple[str, str], record_property: Callable[[str, object], None]
) -> None:
    address, recording = watch
    page = phone.page
    answers = Answers()
    page.on("requestfinished", answers.note)
    await phone.open(f"{address}/#files")
    await phone.live()
    row = page.locator(f'#panel-files [data-id="{recording}"]')
    await expect(row).to_have_attribute("data-state", "read", timeout=20_000)
    await phone.acknowledge_all()
    await row.locator(".t").tap()
    await expect(page.locator("#sheet-file")).to_be_visible()
    await page.evaluate(WHEN)
    await page.get_by_role("button", name="Open replay").tap()
    await page.wait_for_selector("body[data-trace-ms]", timeout=60_000)
    trace_s = float(await page.evaluate("() => document.body.dataset.traceMs")) / 1000

    await page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=60_000)
    await page.locator("[data-trend=speed]").tap()
    await expect(page.locator(".trends-strip .line")).to_have_attribute("d", re.compile("M"), timeout=20_000)
    stage = page.locator(".trends-stage")
    for key in (2, 1, 0, 2):  # the drive, six minutes, a minute, the drive
        before = len(answers.took_s)
        await page.locator(".trends-tools button").nth(key).tap()
        async with asyncio.timeout(20):
            while len(answers.took_s) == before:
                await asyncio.sleep(0.05)
    await expect(stage).to_have_attribute("aria-valuemax", re.compile(r"^28(799|800)\."))
    record_property("speed trace [s]", round(trace_s, 2))
    record_property("answers, longest [ms]", round(1000 * max(answers.took_s)))
    record_property("answers, largest [kB]", round(max(answers.sizes) / 1000, 1))
    print(trace_s, answers.took_s, answers.sizes)
    assert trace_s <= 1.0
    assert max(answers.took_s) <= 0.3
    assert max(answers.sizes) <= 60_000
