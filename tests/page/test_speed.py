"""1440 beams at 20 Hz on a phone's processor: the main thread's share, even frames, a heap that stays flat."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from tests.page import drives
from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.main_thread import heap_bytes, measure
from tests.page.processes import replay, running, server
from tests.page.test_load import LAID, TRACED, stack_of

pytestmark = pytest.mark.own_phone  # its processor is slowed down
SHARE = {"scan": 0.40, "home": 0.40, "desk": 0.60}  # of the main thread; desk: all panes in sight at 1440 × 900


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def street(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[str]:
    """A server that watches a car in a street: 1440 beams 20 times a second, beside its other signals."""
    data = tmp_path_factory.mktemp("street")
    drive = drives.write(
        data / "street.bag",
        {
            "speed": lambda t: drives.twist(4.2 + 0.4 * np.sin(t)),
            "steering": lambda t: drives.steering(0.05 * np.sin(t / 2)),
            "distance": lambda t: drives.number(40.0 + np.sin(9 * t)),
            "bearing": lambda t: drives.number(0.01 * np.sin(7 * t)),
            "scan": lambda t: drives.street(t, 1440, gap_m=40.0),
        },
        seconds=40.0,
    )
    async with running(*replay(drive)) as car, running(*server(data, car.address)) as watch:
        yield watch.address


async def shown(phone: Phone, address: str, tab: str) -> None:
    is_desk = tab == "desk"
    if is_desk:
        await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{address}/#{'home' if is_desk else tab}")
    await phone.live()
    if is_desk:
        await expect(phone.f("head-scan")).to_have_text(re.compile("of 1440"), timeout=12_000)
    elif tab == "scan":
        await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile("of 1440"), timeout=12_000)
    else:
        await phone.page.locator("[data-trend=brake]").scroll_into_view_if_needed()
    await phone.page.wait_for_timeout(1500)


#: What runs now of what only the main thread can animate: it has a picture for it 60 times a second.
BUSY = """() => document.getAnimations().filter(({ playState, effect }) => {
  const others = ['offset', 'computedOffset', 'easing', 'composite'];
  const drawn = ['opacity', 'transform', 'translate', 'rotate', 'scale'];
  const names = effect.getKeyframes().flatMap((one) => Object.keys(one)).filter((one) => !others.includes(one));
  const isMoving = playState === 'running' && effect.getComputedTiming().progress !== null;
  return isMoving && names.some((one) => !drawn.includes(one));
}).map((one) => one.animationName ?? one.transitionProperty)"""


@pytest.mark.gate
async def test_nothing_is_animated_by_the_main_thread_while_all_is_well(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.drawn()
    assert await phone.page.evaluate("document.getAnimations().length") > 1
    assert await phone.page.evaluate(BUSY) == []


@pytest.mark.gate
async def test_no_script_forces_a_style_or_layout_of_the_panes(
    browser: Browser, phone: Phone, canned: Canned, tmp_path: Path
) -> None:
    """Five times a second, while hardly anything moved."""
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.page.locator(".trends-pane").first).to_be_visible()
    found = []
    for n in range(3):  # on a busy machine a pane may begin meanwhile: what it measures then, it measures once
        forced = await forced_in(browser, phone, canned.address, tmp_path / f"trace-{n}.json")
        if forced.total() <= 2:  # a list that has other rows is measured
            return
        found.append(forced)
    raise AssertionError(found)


async def forced_in(browser: Browser, phone: Phone, address: str, trace: Path) -> Counter[tuple[object, ...]]:
    """The styles and layouts of the next 15 drawings that a script of the page made the browser do at once."""
    await browser.start_tracing(page=phone.page, path=trace, categories=TRACED)
    await phone.drawn(15)
    await browser.stop_tracing()
    laid = [one for one in json.loads(trace.read_text(encoding="utf-8"))["traceEvents"] if one["name"] in LAID]
    assert {one["name"] for one in laid} == LAID, "the trace has what is looked for"
    return Counter(
        (one["name"], frames[0]["functionName"], frames[0]["url"].rpartition("/")[2], frames[0]["lineNumber"])
        for one in laid
        if (frames := stack_of(one)) and address in frames[0]["url"] and "/vendor/" not in frames[0]["url"]
    )


#: From now on, how often a picture is requested.
COUNT = """() => {
  window.pictures = 0;
  const request = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => {
    window.pictures += 1;
    return request(draw);
  };
}"""


async def test_a_frame_costs_few_pictures(phone: Phone, street: str) -> None:
    await shown(phone, street, "desk")
    await phone.page.evaluate(COUNT)
    await phone.drawn(30)  # five a second, of ten frames
    assert await phone.page.evaluate("window.pictures") <= 30 * 5


@pytest.mark.parametrize("tab", SHARE)
async def test_the_main_thread_keeps_time(phone: Phone, street: str, tab: str) -> None:
    await shown(phone, street, tab)
    cost = await measure(phone.page, 8.0)
    print(tab, cost)
    # Without the painting: a machine without a graphics card does that on the processor, and others work beside it.
    assert cost.own_share <= SHARE[tab], str(cost)


@pytest.mark.soak
@pytest.mark.parametrize("tab", SHARE)
async def test_60_frames_a_second(phone: Phone, street: str, tab: str) -> None:
    """The long form, for a machine that does nothing else."""
    await shown(phone, street, tab)
    cost = await measure(phone.page, 30.0)
    print(tab, cost)
    assert cost.share <= SHARE[tab], str(cost)
    assert cost.frames_hz > 55, str(cost)
    assert tab == "home" or cost.scans_hz > 19, str(cost)


@pytest.mark.soak
@pytest.mark.parametrize("tab", SHARE)
async def test_a_flat_heap_for_half_an_hour(phone: Phone, street: str, tab: str) -> None:
    await shown(phone, street, tab)
    heaps = []
    for _ in range(30):
        heaps.append(await heap_bytes(phone.page))
        await phone.page.wait_for_timeout(60_000)
        await phone.acknowledge_all()
    print(tab, [round(one / 1024) for one in heaps], "KiB")
    # The first minutes compile and fill the rings of a minute; from then on nothing may grow.
    assert np.mean(heaps[-5:]) < np.mean(heaps[5:10]) + 300_000
