"""A real Chromium at the size of a phone, with touch, for the tests of the page."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import time
from collections.abc import AsyncIterator, Generator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
import pytest_asyncio
from playwright.async_api import Browser, BrowserContext, ConsoleMessage, Locator, Page, async_playwright, expect
from playwright.async_api import Error as PlaywrightError

from tests.chromium import FLAGS
from tests.page.canned import Canned
from tests.page.processes import IS_PARTED

PHONE: dict[str, Any] = {
    "viewport": {"width": 412, "height": 915},
    "device_scale_factor": 1,  # a quarter of the pixels for a machine without a graphics card
    "color_scheme": "dark",
    "has_touch": True,
    "is_mobile": True,
    "service_workers": "block",  # what keeps the page's shell has its own tests; here every request is the page's
}
LIVE = re.compile("^(Live|Weak)$")  # of the link; on a busy machine answers may take as long as over a weak radio
expect.set_options(timeout=20_000)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Every test here drives a browser, one for all of them, and so on one event loop. Only those marked `gate` are in
    the gate (docs/testing.md)."""
    here = Path(__file__).parent
    for item in items:
        if here in item.path.parents:
            item.add_marker(pytest.mark.browser)
            item.add_marker(pytest.mark.asyncio(loop_scope="session"), append=False)
            if item.get_closest_marker("gate") is None:
                item.add_marker(pytest.mark.field)


@pytest_asyncio.fixture(loop_scope="session", scope="session")
async def browser(chromium: str) -> AsyncIterator[Browser]:
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield browser
        await browser.close()


@pytest_asyncio.fixture(loop_scope="session", scope="session")
async def canned_server() -> AsyncIterator[Canned]:
    served = Canned()
    async with served.running():
        yield served


@pytest.fixture
def canned(canned_server: Canned) -> Canned:
    """The server of set states, as it is at first."""
    canned_server.reset()
    return canned_server


def words_of(message: ConsoleMessage) -> str:
    """With the address, of what could not be loaded."""
    return (
        f"{message.text} {message.location['url']}"
        if message.text.startswith("Failed to load resource")
        else message.text
    )


def is_complaint(message: ConsoleMessage) -> bool:
    """Whether the page reports on its console that something is wrong. It is not that these tests keep its worker away,
    that a page on a slow machine shows its first number some seconds after it preloaded the font, or that the browser
    loads the site's icon while the page is being left, and refuses it itself."""
    text = message.text
    is_advice = "blocked by Playwright" in text or ("catgraph-numerals" in text and "was preloaded" in text)
    is_icon = "apple-touch-icon" in text + message.location["url"]
    is_left = is_icon and ("from origin 'null'" in text or "net::ERR_FAILED" in text)
    return message.type in ("error", "warning") and not (is_advice or is_left)


async def press(keys: Locator) -> None:
    """Presses them all; any may go meanwhile."""
    await keys.evaluate_all("keys => keys.forEach((key) => key.click())")


DRAWN = """(states) => new Promise((done) => {
    const root = document.documentElement;
    const until = Number(root.dataset.states ?? 0) + states;
    const look = () => {
        if (Number(root.dataset.states ?? 0) < until) return;
        seen.disconnect();
        done();
    };
    const seen = new MutationObserver(look);
    seen.observe(root, { attributeFilter: ['data-states'] });
})"""


#: Whether the panel of this tab is where it stays.
IN_FRONT = """(tab) => {
    const panel = document.getElementById(`panel-${tab}`);
    return Math.abs(panel.getBoundingClientRect().left - panel.parentElement.getBoundingClientRect().left) < 1;
}"""


class Phone:
    """A phone with the page open, and the lines of its console."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.stutter_s = 0.0
        self._handled: list[Locator] = []
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", lambda message: self.complaints.append(words_of(message)) if is_complaint(message) else None)

    @property
    def slack_s(self) -> float:
        """What must be granted beside a limit: the time of looking, and thrice what this machine lets anyone wait."""
        return 0.4 + 3 * self.stutter_s

    @property
    def faults(self) -> list[str]:
        """The lines of its console but for the lost connections a test made."""
        return [line for line in self.complaints if not LOST.search(line)]

    async def watch_machine(self) -> None:
        """Notes the longest time by which a short sleep was late, for as long as it runs."""
        while True:
            due_s = time.monotonic() + 0.05
            await asyncio.sleep(0.05)
            self.stutter_s = max(self.stutter_s, time.monotonic() - due_s)

    async def clear(self) -> None:
        """Makes it as a new phone: nothing shown and nothing kept."""
        while self._handled:
            await self.page.remove_locator_handler(self._handled.pop())
        site = urlsplit(self.page.url)
        if site.netloc:
            kept = {"origin": f"{site.scheme}://{site.netloc}", "storageTypes": "all"}
            cdp = await self.page.context.new_cdp_session(self.page)
            await cdp.send("Storage.clearDataForOrigin", kept)
            await cdp.detach()
        await self.page.goto("about:blank")
        await self.page.set_viewport_size(PHONE["viewport"])
        await self.page.emulate_media(color_scheme=PHONE["color_scheme"], reduced_motion="null")
        self.complaints.clear()
        self.stutter_s = 0.0

    async def open(self, address: str) -> None:
        await self.page.goto(address)

    async def show(self, tab: str) -> None:
        """Shows a tab by its key, and waits until its panel stands still.

        A tap that meets a panel on its way scrolls on to find what it looks for, and so to another tab.
        """
        await self.page.locator(f"#tab-{tab}").tap()
        await self.page.wait_for_function(IN_FRONT, arg=tab)

    def f(self, name: str, root: str = "#monitor") -> Any:
        """A field of the page by its name in the templates."""
        return self.page.locator(f'{root} [data-f="{name}"]').first

    async def drawn(self, states: int = 3) -> None:
        """Waits until the page has drawn so many more fresh states: the first may have been under way before."""
        await self.page.evaluate(DRAWN, states)

    async def live(self) -> None:
        """Waits until the values are live, and the page complete."""
        await expect(self.f("link-state")).to_have_text(LIVE, timeout=40_000)
        await expect(self.f("veil")).not_to_have_attribute("data-on", re.compile("."))
        await self.complete()

    async def complete(self) -> None:
        """Waits until all parts are mounted, which is after the first values: what a part listens to is lost before."""
        await expect(self.page.locator("#monitor [data-late][hidden]")).to_have_count(0, timeout=40_000)

    async def acknowledge_all(self) -> None:
        """Acknowledges what the car raises of its own, as an operator does."""
        while await self.page.locator("#sheet-alarm[open]").count():
            with contextlib.suppress(PlaywrightError):  # it may go meanwhile
                await self.page.locator('#sheet-alarm[open] [data-f="acknowledge"]').tap(timeout=2000)
            await self.page.wait_for_timeout(300)

    async def acknowledge_meanwhile(self) -> None:
        """From now on acknowledges the snackbar that would cover what a test presses: a busy machine is late."""
        acknowledge = self.page.locator('.snack[data-f="warning"]:not([hidden]) .key.solid')
        await self.page.add_locator_handler(acknowledge, press, no_wait_after=True)
        self._handled.append(acknowledge)

    async def release_the_car(self) -> None:
        """Presses the key and confirms it, and again where the page shows that it came too late: a busy machine is."""
        async with asyncio.timeout(60):
            while await self.f("release").is_visible():
                with contextlib.suppress(PlaywrightError):  # it goes where the press before was carried out
                    await self.f("release").tap(timeout=2000)
                    await self.f("yes", "#sheet-release").tap(timeout=2000)
                await self.page.wait_for_timeout(1000)

    async def no_snackbar(self) -> None:
        """Waits until no snackbar covers a key, and acknowledges what waits for that."""
        async with asyncio.timeout(20):
            while await self.page.locator(".snack:not([hidden])").count():
                await press(self.page.locator(".snack:not([hidden]) .key.solid"))
                await asyncio.sleep(0.1)

    async def press_toggle(self, key: Locator) -> None:
        """Presses a key that can be on or off, where it lies now.

        A test's own tap that meets another element scrolls on to find the key, and so leaves the tab: it is not called
        to. What pushes the key away under the finger is a banner that comes or goes.
        """
        other = {"true": "false", "false": "true"}[str(await key.get_attribute("aria-pressed"))]
        async with asyncio.timeout(15):
            while await key.get_attribute("aria-pressed") != other:
                await key.tap(force=True)
                with contextlib.suppress(AssertionError):
                    await expect(key).to_have_attribute("aria-pressed", other, timeout=1500)

    async def has_speed(self) -> None:
        """Waits for a speed: any signal makes a car live."""
        await expect(self.page.locator(".gauge .speed")).to_have_text(re.compile(r"^\d+\.\d$"))

    async def speed(self) -> str:
        return str(await self.page.locator(".gauge .speed").text_content())


LOST = re.compile(
    r"Service Worker registration blocked|WebSocket connection to"
    r"|Failed to load resource: net::ERR_(CONNECTION|EMPTY|CONTENT_LENGTH|SOCKET_NOT_CONNECTED)|ERR_CONNECTION"
    r"|404 \(Not Found\) \S+[?&]replay="  # of a connection that another one replaced
    r"|The page now draws the scan itself"  # on a machine that lets its thread wait; test_scan.py provokes it
    # A web node that has not received from the agent yet, where the port of one process would not be listened at yet:
    + (r"|the server responded with a status of 503" if IS_PARTED else "")
)


async def new_phone(browser: Browser, **more: Any) -> Phone:
    """A phone of its own; `more` are options of its browser. The caller closes its context."""
    return await phone_in(await browser.new_context(**PHONE | more))


async def phone_in(context: BrowserContext) -> Phone:
    """A new page of this context."""
    return Phone(await context.new_page())


@pytest_asyncio.fixture(loop_scope="session", scope="session")
async def kept_phones(browser: Browser) -> AsyncIterator[list[Phone]]:
    """The phone that one test passes on to the next, once there is one."""
    phones: list[Phone] = []
    yield phones
    for phone in phones:
        await phone.page.context.close()


def refuse_what_stays(phone: Phone) -> None:
    """What the next test would find in its browser needs the mark `own_phone`."""

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("This stays in the browser: mark the test with own_phone.")

    page, context = phone.page, phone.page.context
    for owner, name in (
        *((page, "add_init_script"), (page, "route")),
        *((context, "add_init_script"), (context, "grant_permissions"), (context, "set_geolocation")),
    ):
        setattr(owner, name, refused)


FAILED = pytest.StashKey[bool]()
SEEN = """() => ({
    at: location.href,
    dialogs: [...document.querySelectorAll('dialog[open], .sheet[open]')].map((it) => it.innerText),
    snackbars: [...document.querySelectorAll('.snack:not([hidden])')].map((it) => it.innerText),
    tabs: [...document.querySelectorAll('[role=tab]')].map((it) => `${it.id} ${it.ariaSelected}`),
    header: document.querySelector('header')?.innerText,
})"""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if report.when == "call":
        item.stash[FAILED] = report.failed
    return report


async def picture(phone: Phone, name: str) -> None:
    """What a failed test saw: as text with its report, and as a picture."""
    with contextlib.suppress(PlaywrightError):  # the page may be what failed
        print(json.dumps(await phone.page.evaluate(SEEN), indent=1))
        print(f"stutter {phone.stutter_s:.2f} s")
        path = Path("out/tests/failed") / f"{re.sub(r'[^A-Za-z0-9]+', '-', name)[:120]}.png"
        await phone.page.screenshot(path=path, timeout=5000)


@pytest_asyncio.fixture(loop_scope="session")
async def phone(browser: Browser, kept_phones: list[Phone], request: pytest.FixtureRequest) -> AsyncIterator[Phone]:
    """A phone; at the end its console must be clean but for the lost connections a test made.

    It is the one of the test before, cleared, for a browser's process for a new one takes seconds.
    """
    is_own = request.node.get_closest_marker("own_phone") is not None or hasattr(request, "param")
    if is_own or not kept_phones:
        phone = await new_phone(browser, **getattr(request, "param", {}))
    else:
        phone = kept_phones.pop()
    if not is_own:
        refuse_what_stays(phone)
    machine = asyncio.create_task(phone.watch_machine())
    yield phone
    machine.cancel()
    if request.node.stash.get(FAILED, False):
        await picture(phone, request.node.name)
    faults = phone.faults
    if is_own or faults:
        await phone.page.context.close()
    else:
        await phone.clear()
        kept_phones.append(phone)
    assert faults == []
