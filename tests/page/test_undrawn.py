"""A page that cannot draw: whatever function of its browser fails, no old value stands there as if it were live."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, CDPSession, Page
from playwright.async_api import Error as PlaywrightError

from tests.page.canned import Canned, alarm
from tests.page.conftest import PHONE

BREAKER = (Path(__file__).parent / "broken.js").read_text(encoding="utf-8")
TITLE = "Speed above limit"
LANES = 3
ANSWER_S = 10.0  # an answer of Chromium about one page; it comes within milliseconds, or never
ATTEMPTS = 3
Functions = tuple[tuple[str, str, str], ...]
# Owner, name and how: broken throws, never does not call back, idle does nothing, set throws in the setter, mute does
# nothing there.


def functions(text: str) -> Functions:
    """Owner, name and how each is broken."""
    rows = (row.split() for row in text.replace("\n", "|").strip("|").split("|"))
    return tuple((owner, name, kind[0] if kind else "broken") for owner, name, *kind in rows)


IN_EACH_ROUND = functions("""
Number.prototype toFixed|Element.prototype replaceChildren|Element.prototype setAttribute
Element.prototype replaceChildren idle|Node.prototype textContent mute|CharacterData.prototype data mute
window requestAnimationFrame never|window requestAnimationFrame|String.prototype replace|Array.prototype map
Array.prototype filter|Array.prototype @@iterator|Map.prototype get|Set.prototype @@iterator|JSON parse
JSON stringify|Element.prototype append|Document.prototype createElement|Node.prototype textContent set
HTMLElement.prototype dataset|HTMLDialogElement.prototype showModal|Document.prototype hidden
DOMTokenList.prototype toggle|CSSStyleDeclaration.prototype setProperty
CanvasRenderingContext2D.prototype beginPath|Intl NumberFormat|Performance.prototype now|Date now
window setTimeout|window queueMicrotask|Promise.prototype then|Element.prototype setAttribute idle|console error
""")
FUNCTIONS = IN_EACH_ROUND + functions("""
Number.prototype toFixed idle|Number.prototype toString|String.prototype split|String.prototype trim
String.prototype matchAll|Array.prototype find|Array.prototype sort|Array.prototype push|Array.prototype join
Map.prototype set|WeakMap.prototype get|Object entries|Object keys|Math max|Math round
Element.prototype getAttribute|Element.prototype hasAttribute|Element.prototype removeAttribute
Element.prototype querySelector|Document.prototype createElementNS
Document.prototype querySelectorAll|Document.prototype documentElement|Document.prototype title set
HTMLElement.prototype focus|DOMTokenList.prototype add|Date now never|window setTimeout never|window setInterval
window setInterval never|window fetch|Promise.prototype catch|window matchMedia|window AudioContext
WebSocket.prototype send|window IntersectionObserver|window MutationObserver
EventTarget.prototype addEventListener|CharacterData.prototype data set
""")
REPORTED = ("toFixed", "setAttribute", "replaceChildren", "textContent", "requestAnimationFrame")  # needs none of them
LOOK = """(() => {
  const one = (selector) => document.querySelector(selector);
  const opacity = (selector) => one(selector) ? Number(getComputedStyle(one(selector)).opacity) : 0;
  const text = (selector) => (one(selector)?.textContent ?? '').trim();
  return JSON.stringify({
    screen: document.body?.dataset.screen ?? '', start: text('#start h1'),
    begun: !one('#panel-home [data-late][hidden]'),
    undrawn: opacity('.undrawn'), text: text('.undrawn'), veil: opacity('.veil'), on: one('.veil')?.dataset.on ?? '',
    speed: text('.gauge .speed'), strip: text('[data-f="strip-text"]'), link: text('#monitor .top .link'),
    dialog: Boolean(one('#sheet-alarm[open]')), title: document.title,
  });
})()"""
END_OF_ANIMATIONS = "for (const one of document.getAnimations()) one.currentTime = 11_000"


class Glass:
    """A page seen from outside of its scripts, so that nothing broken there is needed to look at it."""

    def __init__(self, page: Page, cdp: CDPSession) -> None:
        self.page = page
        self._cdp = cdp

    @classmethod
    async def of(cls, page: Page) -> Glass:
        return cls(page, await page.context.new_cdp_session(page))

    async def look(self, script: str = LOOK) -> dict[str, Any]:
        """What is seen; tried again where the document was replaced meanwhile, for then Chromium may never answer."""
        problems: list[Exception] = []
        while len(problems) < ATTEMPTS:
            try:
                async with asyncio.timeout(ANSWER_S):
                    if problems:
                        self._cdp = await self.page.context.new_cdp_session(self.page)
                    return await self._look(script)
            except (TimeoutError, PlaywrightError) as problem:
                problems.append(problem)
        raise AssertionError(f"The page could not be looked at: {problems}")

    async def _look(self, script: str) -> dict[str, Any]:
        frame = (await self._cdp.send("Page.getFrameTree"))["frameTree"]["frame"]["id"]
        world = await self._cdp.send("Page.createIsolatedWorld", {"frameId": frame})
        arguments = {"expression": script, "contextId": world["executionContextId"], "returnByValue": True}
        value = (await self._cdp.send("Runtime.evaluate", arguments))["result"].get("value")
        return dict(json.loads(value)) if isinstance(value, str) else {}

    async def close(self) -> None:
        """Closes the page. Chromium seldom never answers where one is just being reloaded; it ends with the browser."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(ANSWER_S):
                await self.page.context.close()

    async def do(self, script: str) -> None:
        """Runs a script in the page itself."""
        async with asyncio.timeout(ANSWER_S):
            answer = await self._cdp.send("Runtime.evaluate", {"expression": script, "returnByValue": True})
        assert "exceptionDetails" not in answer, answer

    async def until(self, is_so: Any, within_s: float) -> dict[str, Any] | None:
        """What is seen once `is_so`; None: not within that time."""
        due_s = time.monotonic() + within_s
        while time.monotonic() < due_s:
            seen = await self.look()
            if is_so(seen):
                return seen
            await asyncio.sleep(0.1)
        return None


def is_covered(seen: dict[str, Any]) -> bool:
    """The page shows a text that it does not draw, over its head and over its values."""
    return (
        seen["undrawn"] == 1 and (seen["veil"] == 1 or seen["screen"] != "monitor") and "Watch the car" in seen["text"]
    )


def is_given_up(seen: dict[str, Any]) -> bool:
    return bool(seen["screen"] == "start" and seen["start"] == "This page does not work")


def is_silent(seen: dict[str, Any]) -> bool:
    """Covered, because the server does not send any more."""
    return seen["veil"] == 1 and seen["on"] == "all" and "Live" not in seen["link"]


def is_true(seen: dict[str, Any], speed: str) -> bool:
    """Live, with the newest value, and the alarm there to be read."""
    is_live = seen["veil"] == 0 and seen["undrawn"] == 0 and seen["screen"] == "monitor"
    return is_live and seen["speed"] == speed and TITLE in seen["strip"] and seen["dialog"]


async def is_reported(served: Canned, *, draws: bool) -> bool:
    """Whether the page's newest report about itself comes to state it."""
    due_s = time.monotonic() + 10
    while time.monotonic() < due_s:
        reports = [one["draws"] for one in served.received if one["kind"] == "present"]
        if reports and reports[-1] is draws:
            return True
        await asyncio.sleep(0.1)
    return False


def is_calm(seen: dict[str, Any]) -> bool:
    """Begun, live and without an alarm."""
    is_live = seen["begun"] and seen["speed"] == "4.2" and seen["veil"] == seen["undrawn"] == 0
    return bool(is_live and not seen["dialog"])


def is_honest(seen: dict[str, Any]) -> bool:
    return is_covered(seen) or is_given_up(seen) or is_silent(seen) or is_true(seen, "12.6")


def over(number: int) -> dict[str, Any]:
    """A critical alarm that nobody has acknowledged."""
    quantity = {"value": 12.6, "unit": "m/s"}
    return alarm(
        "speed_limit", TITLE, occurrence=number, priority="critical", place="dialog", sound="high", measured=quantity,
        limit=quantity | {"value": 11.0}, text="12.6 m/s, limit 11.0 m/s", actions=["acknowledge", "decelerate"],
    )  # fmt: skip


@pytest_asyncio.fixture(loop_scope="session")
async def canned() -> AsyncIterator[Canned]:
    served = Canned()
    async with served.running():
        yield served


async def opened(browser: Browser, served: Canned, *scripts: str) -> Glass:
    context = await browser.new_context(**PHONE)
    page = await context.new_page()
    for script in (BREAKER, *scripts):
        await page.add_init_script(script)
    await page.goto(served.address, wait_until="commit")
    return await Glass.of(page)


async def broken_while_live(browser: Browser, functions: Functions) -> list[str]:
    """What stood there wrongly, of one function after the other on one page."""
    wrong: list[str] = []
    served = Canned()
    async with served.running():
        glass = await opened(browser, served)
        for number, (owner, name, kind) in enumerate(functions, 1):
            served.state["alarms"] = []
            served.state["signals"]["speed"]["value"]["speed_mps"] = 4.2
            if await glass.until(is_calm, 30) is None:
                wrong.append(f"before {owner}.{name}: not recovered, {await glass.look()}")
                await glass.close()
                glass = await opened(browser, served)
                await glass.until(is_calm, 30)
            await glass.do(f"catgraphBreak({owner!r}, {name!r}, {kind!r})")
            speed = f"{5 + number / 10:.1f}"
            served.state["signals"]["speed"]["value"]["speed_mps"] = float(speed)
            served.state["alarms"] = [over(number)]
            seen = await glass.until(
                lambda seen, speed=speed: is_covered(seen) or is_silent(seen) or is_true(seen, speed), 8
            )
            if seen is None:
                wrong.append(f"{owner}.{name} ({kind}): {await glass.look()}")
            elif is_covered(seen) and not (TITLE in seen["text"] or seen["dialog"] or "may be missing" in seen["text"]):
                wrong.append(f"{owner}.{name} ({kind}) does not name the alarm: {seen}")
            elif is_covered(seen) and name in REPORTED and not await is_reported(served, draws=False):
                wrong.append(f"{owner}.{name} ({kind}): it is not reported to the server")
            await glass.do("catgraphMend()")
            # What seemed to be written is not: only a page that is loaded anew is believed.
            if kind == "mute" or (kind == "idle" and owner.endswith("t.prototype")):
                await glass.page.wait_for_timeout(1500)
                if not is_covered(await glass.look()):
                    wrong.append(f"{owner}.{name} ({kind}): it is believed again")
                    continue
                await glass.page.locator("#undrawn-reload").tap(timeout=15_000)
            if await glass.until(lambda seen, speed=speed: is_true(seen, speed), 25) is None:
                wrong.append(f"{owner}.{name} ({kind}), mended: {await glass.look()}")
            elif name in REPORTED and not await is_reported(served, draws=True):
                wrong.append(f"{owner}.{name} ({kind}), mended: it is not reported to the server")
            if number % 2 == 0 and number < len(functions):  # a third failure within half a minute would be for good
                await glass.page.reload(wait_until="commit")
        await glass.close()
    return wrong


async def live_in_lanes(browser: Browser, functions: Functions) -> list[str]:
    lanes = await asyncio.gather(*(broken_while_live(browser, functions[n::LANES]) for n in range(LANES)))
    return [one for lane in lanes for one in lane]


@pytest.mark.world(n=14)
@pytest.mark.timeout(300)
async def test_whatever_breaks_while_the_page_is_live_no_old_value_looks_live(browser: Browser) -> None:
    """And once it is mended, what is shown is true: nothing that failed to be written is taken for written."""
    assert await live_in_lanes(browser, IN_EACH_ROUND) == []


@pytest.mark.world(n=14)
@pytest.mark.soak
async def test_each_of_all_functions_while_the_page_is_live(browser: Browser) -> None:
    assert await live_in_lanes(browser, FUNCTIONS) == []


async def broken_before(browser: Browser, served: Canned, function: tuple[str, str, str]) -> str | None:
    owner, name, kind = function
    glass = await opened(browser, served, f"catgraphBreak({owner!r}, {name!r}, {kind!r})")
    seen = await glass.until(is_honest, 2)
    for _ in range(6):
        if seen is None and (await glass.look())["screen"] == "start":  # its own limit is longer than a test should be
            await glass.look(END_OF_ANIMATIONS)
        seen = seen or await glass.until(is_honest, 2)
    what = None if seen else f"{owner}.{name} ({kind}): {await glass.look()}"
    await glass.close()
    return what


async def before_in_lanes(browser: Browser, served: Canned, functions: Functions) -> list[str]:
    served.state["signals"]["speed"]["value"]["speed_mps"] = 12.6
    served.state["alarms"] = [over(1)]
    wrong: list[str | None] = []
    for n in range(0, len(functions), LANES):
        wrong += await asyncio.gather(*(broken_before(browser, served, one) for one in functions[n : n + LANES]))
    return [one for one in wrong if one]


@pytest.mark.world(n=14)
@pytest.mark.timeout(300)
async def test_whatever_is_broken_before_the_page_begins_it_says_so(browser: Browser, canned: Canned) -> None:
    assert await before_in_lanes(browser, canned, FUNCTIONS[::6]) == []


@pytest.mark.world(n=14)
@pytest.mark.soak
async def test_each_of_all_functions_before_the_page_begins(browser: Browser, canned: Canned) -> None:
    assert await before_in_lanes(browser, canned, FUNCTIONS) == []
