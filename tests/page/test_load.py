"""How soon the page is there: on an access point of 20 Mbit/s and 5 ms, with a processor a quarter as fast as this."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from pathlib import Path
from statistics import median
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page

from tests.page.canned import Canned
from tests.page.conftest import PHONE
from tests.page.processes import Process, running, server, simulate

COLD_S, WARM_S = 0.8, 0.6
COLD_BYTES = 100_000
SETTLES_MS = 3000  # a window of this browser loads two hundred files of its own when it opens
ACCESS_POINT = {"offline": False, "latency": 5, "downloadThroughput": 20e6 / 8, "uploadThroughput": 20e6 / 8}
TRACED = [
    "devtools.timeline",
    "blink.user_timing",
    *(f"disabled-by-default-devtools.timeline{of}" for of in ("", ".stack")),
]
LAID = {"UpdateLayoutTree", "Layout"}
PAINTED_US = 50_000  # the picture with the first values is complete by then
# Live values stand on Home: the time of the page's own clock when they first did.
WATCH = """() => {
  const look = () => {
    const state = document.querySelector('#monitor [data-f=link-state]')?.textContent;
    const digits = document.querySelector('.gauge .speed')?.textContent ?? '';
    const isCovered = document.querySelector('.veil')?.dataset.on;
    if (['Live', 'Weak'].includes(state) && /[0-9]/.test(digits) && !isCovered) window.thereAt = performance.now();
    else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}"""


#: The names of the files that the document itself requests.
FIRST = """() => {
  const name = (one) => (one.src || one.href).replace(/.*\\//, '');
  const names = (query) => [...document.head.querySelectorAll(query)].map(name);
  return { styles: names('link[rel=stylesheet]').slice(0, 1), scripts: names('script[src], link[rel=modulepreload]') };
}"""


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    async with running(*simulate()) as car, running(*server(tmp_path_factory.mktemp("data"), car.address)) as process:
        yield process


async def load(page: Page, address: str, slower: float) -> tuple[float, int, int]:
    """Loads it; seconds until live values stand there, bytes on the wire and answers until the network is idle."""
    cdp = await page.context.new_cdp_session(page)
    sizes: list[float] = []
    data: set[str] = set()  # answers that are the car's, not the page's
    cdp.on(
        "Network.responseReceived",
        lambda event: data.add(event["requestId"]) if "/api/" in event["response"]["url"] else None,
    )
    cdp.on(
        "Network.loadingFinished",
        lambda event: sizes.append(event["encodedDataLength"]) if event["requestId"] not in data else None,
    )
    await cdp.send("Network.enable")
    await cdp.send("Network.emulateNetworkConditions", ACCESS_POINT)
    await cdp.send("Emulation.setCPUThrottlingRate", {"rate": slower})
    await page.goto(address, wait_until="commit")
    took_ms = None
    async with asyncio.timeout(30):
        while took_ms is None:  # not by Playwright's own means: they bring 100 kB of script into the page, and time it
            await asyncio.sleep(1.0)
            took_ms = (await cdp.send("Runtime.evaluate", {"expression": "window.thereAt"}))["result"].get("value")
    await asyncio.sleep(0.5)
    await cdp.send("Emulation.setCPUThrottlingRate", {"rate": 1})
    await cdp.detach()
    return took_ms / 1000, round(sum(sizes)), len(sizes)


async def cold_and_warm(browser: Browser, address: str, slower: float) -> tuple[Any, Any]:
    context = await browser.new_context(**PHONE)
    try:
        page = await context.new_page()
        await page.add_init_script(f"({WATCH})()")
        await page.goto("about:blank")
        await page.wait_for_timeout(SETTLES_MS)
        cold = await load(page, address, slower)
        await page.goto("about:blank")
        warm = await load(page, address, slower)
        return cold, warm
    finally:
        await context.close()


async def test_the_page_is_small(browser: Browser, watch: Process) -> None:
    cold, warm = await cold_and_warm(browser, watch.address, 1)
    print(f"cold {cold[1]} B in {cold[2]} answers, warm {warm[1]} B")
    assert cold[1] <= COLD_BYTES
    assert warm[1] <= 0.4 * cold[1], "what has not changed is not sent again"
    assert cold[0] <= 10 * COLD_S  # whatever else this machine does


async def test_no_script_forces_a_style_or_layout_before_the_first_values(
    browser: Browser, watch: Process, tmp_path: Path
) -> None:
    """Each costs a slow phone 50 ms, and is done again once the values are written."""
    trace = tmp_path / "trace.json"
    page = await browser.new_page(**PHONE)
    try:
        await page.add_init_script(f"({WATCH})()")
        await browser.start_tracing(page=page, path=trace, categories=TRACED)
        await page.goto(watch.address, wait_until="commit")
        await page.wait_for_function("() => window.thereAt")
        await page.wait_for_timeout(200)  # until it is painted
        there_us = 1000 * await page.evaluate("window.thereAt")
        await browser.stop_tracing()
    finally:
        await page.close()
    events = json.loads(trace.read_text(encoding="utf-8"))["traceEvents"]
    begun = max(event["ts"] for event in events if event["name"] == "navigationStart")
    shown = [
        event for event in events if begun <= event["ts"] < begun + there_us + PAINTED_US and event["name"] in LAID
    ]
    assert {event["name"] for event in shown} == LAID, "the trace has what is looked for"
    forced = {
        (event["name"], frames[0]["functionName"], frames[0]["url"].rpartition("/")[2], frames[0]["lineNumber"])
        for event in shown
        if (frames := stack_of(event)) and watch.address in frames[0]["url"]
    }
    assert not forced


@pytest.mark.gate
async def test_what_the_first_picture_needs_comes_before_the_scripts(browser: Browser, canned: Canned) -> None:
    """On a slow radio they share the bytes with the style sheet otherwise, and the window stays empty for longer."""
    page = await browser.new_page(**PHONE)
    try:
        cdp = await page.context.new_cdp_session(page)
        await cdp.send("Network.enable")
        priority: dict[str, str] = {}

        def note(event: dict[str, Any]) -> None:
            request = event["request"]
            priority[request["url"].rpartition("/")[2]] = request["initialPriority"]

        cdp.on("Network.requestWillBeSent", note)
        await page.goto(canned.address)
        await page.wait_for_function("document.querySelectorAll('link[rel=modulepreload]').length > 0")
        first = await page.evaluate(FIRST)
        assert {priority[name] for name in first["styles"]} == {"VeryHigh"}
        assert {priority[name] for name in first["scripts"]} == {"Low"}
    finally:
        await page.close()


def stack_of(event: dict[str, Any]) -> list[dict[str, Any]]:
    """The script that read a size while the page was not laid out."""
    args = event.get("args", {})
    frames: list[dict[str, Any]] = args.get("beginData", args).get("stackTrace", [])
    return frames


@pytest.mark.soak
async def test_the_page_is_soon_there(browser: Browser, watch: Process) -> None:
    """On a machine that does nothing else."""
    rounds = [await cold_and_warm(browser, watch.address, 4) for _ in range(5)]
    cold_s, warm_s = median(cold[0] for cold, _ in rounds), median(warm[0] for _, warm in rounds)
    print(f"cold {cold_s:.2f} s, warm {warm_s:.2f} s")
    assert cold_s <= COLD_S
    assert warm_s <= WARM_S
