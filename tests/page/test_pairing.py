"""Pairing on a server that listens everywhere: by PIN, by link, as a viewer, removed while it looks."""

from __future__ import annotations

import asyncio
import contextlib
import re
import sys
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from tests.page.barriers import no_barrier
from tests.page.conftest import PHONE, Phone, phone_in
from tests.page.processes import Process, page_data, running, server, simulate

# What a browser itself writes of an answer that was no: a test provokes that.
REFUSED = re.compile(r"responded with a status of (401|403|429)|WebSocket handshake: Unexpected response code: 403")


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A server that watches a car, and its data folder."""

    address: str
    data: Path

    async def invitation(self, *options: str) -> tuple[str, str]:
        """PIN and token, as a person at the server gets them."""
        command = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "server", "pair", "--data", str(self.data), *options),
            stdout=asyncio.subprocess.PIPE,
        )
        output = (await asyncio.wait_for(command.communicate(), 30))[0].decode()
        pin, token = re.search(r"PIN (\d{6})", output), re.search(r"#pair=([\w-]+)", output)
        assert pin is not None, output
        assert token is not None, output
        return pin[1], token[1]


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def car() -> AsyncIterator[Process]:
    async with running(*simulate()) as process:
        yield process


@pytest_asyncio.fixture(loop_scope="session")
async def site(car: Process, tmp_path: Path) -> AsyncIterator[Site]:
    async with running(*server(tmp_path, car.address), "--host", "0.0.0.0", "--tls", "off") as process:
        address = re.sub(r"//[^:]+:", "//127.0.0.1:", process.address)
        yield Site(address=address, data=page_data(tmp_path))


@contextlib.asynccontextmanager
async def another_phone(browser: Browser) -> AsyncIterator[Phone]:
    context = await browser.new_context(**PHONE)
    try:
        phone = await phone_in(context)
        yield phone
        assert [line for line in phone.complaints if not REFUSED.search(line)] == []
    finally:
        await context.close()


async def pair_by_pin(phone: Phone, site: Site, pin: str) -> None:
    await phone.open(site.address)
    await type_pin(phone, pin)
    await phone.live()


async def type_pin(phone: Phone, pin: str) -> None:
    for digit in pin:
        await phone.page.locator(f'#pairing [data-digit="{digit}"]').tap()
    await phone.f("pair-go", "#pairing").tap()


@pytest.mark.gate
async def test_a_pin_lets_a_phone_in_and_it_stays_in_over_a_reload(browser: Browser, site: Site) -> None:
    async with another_phone(browser) as phone:
        await phone.open(site.address)
        await expect(phone.page.locator("#pairing h1")).to_have_text("Pair this device")
        await expect(phone.page.locator("#monitor")).to_be_hidden()
        pin, _ = await site.invitation()
        message = phone.f("pair-message", "#pairing")
        await phone.f("pair-go", "#pairing").tap()
        await expect(message).to_have_text("The PIN has 6 digits.")
        await type_pin(phone, f"{(int(pin) + 1) % 10**6:06d}")
        await expect(message).to_have_text("This PIN is wrong. Read it again from the server.")
        await phone.f("pair-name", "#pairing").fill("Ann’s phone")
        await phone.page.locator("#pair-pin").press_sequentially(pin)  # by the keys of the phone itself
        await expect(phone.page.locator("#pair-pin")).to_have_value(f"{pin[:3]} {pin[3:]}")
        await phone.page.keyboard.press("Enter")
        await phone.live()
        await phone.page.reload()
        await phone.live()
        await expect(phone.page.locator("#pairing")).to_be_hidden()


async def test_too_many_wrong_pins_are_told_with_the_time_to_wait_and_the_link_still_works(
    browser: Browser, site: Site
) -> None:
    async with another_phone(browser) as phone:
        pin, token = await site.invitation()
        await phone.open(site.address)
        wrong = f"{(int(pin) + 1) % 10**6:06d}"
        for _ in range(3):
            await expect(phone.f("pair-go", "#pairing")).to_have_text("Pair this device")
            await type_pin(phone, wrong)
            await expect(phone.f("pair-message", "#pairing")).not_to_be_empty()
        await expect(phone.f("pair-go", "#pairing")).to_have_text(re.compile(r"Wait [12] seconds?"))
        await phone.page.evaluate("token => { location.hash = `#pair=${token}`; }", token)  # scanned while it is open
        await expect(phone.page.locator("#pair-pin")).to_be_hidden()
        await phone.f("pair-go", "#pairing").tap()
        await phone.live()


async def test_a_link_pairs_a_viewer_and_is_gone_from_the_address_before_anything_is_asked(
    browser: Browser, site: Site
) -> None:
    async with another_phone(browser) as phone:
        _, token = await site.invitation("--viewer")
        requests: list[str] = []
        phone.page.on("request", lambda request: requests.append(f"{request.url} {request.headers.get('referer')}"))
        await phone.open(f"{site.address}/#pair={token}")
        await expect(phone.page.locator("#pairing h1")).to_be_visible()
        await no_barrier(phone.page, "pairing")
        assert token not in phone.page.url
        await phone.f("pair-go", "#pairing").tap()
        await phone.live()
        assert [one for one in requests if token in one] == []
        assert token not in await phone.page.evaluate(
            "JSON.stringify([history.state, location.href, {...localStorage}])"
        )

        # A viewer looks: what would change something is greyed, and shows why.
        pause = phone.f("pause")
        await expect(pause).to_have_attribute("aria-disabled", "true")
        await pause.tap(force=True)
        await expect(phone.page.locator(".snack.note")).to_contain_text("This device is paired as a viewer.")
        await phone.page.locator("#tab-settings").tap()
        await expect(phone.page.locator('#panel-settings .set input[type="range"]').first).to_have_attribute(
            "aria-disabled", "true", timeout=12_000
        )
        group = phone.page.locator('[data-part="devices"]')
        await group.locator("summary").scroll_into_view_if_needed()
        await group.locator("summary").tap()
        await expect(group).to_contain_text("This device is paired as a viewer, under the name")
        refused = await phone.page.evaluate(
            "fetch('/api/pause', {method: 'POST'}).then(async answer => [answer.status, (await answer.json()).code])"
        )
        assert refused == [403, "viewer"]

        # The same link lets nobody else in, and the page shows that.
        async with another_phone(browser) as second:
            await second.open(f"{site.address}/#pair={token}")
            await second.f("pair-go", "#pairing").tap()
            await expect(second.f("pair-message", "#pairing")).to_contain_text("This link was used already")
            await expect(second.page.locator("#pair-pin")).to_be_visible()


async def test_an_operator_pairs_another_changes_its_role_and_removes_it(browser: Browser, site: Site) -> None:
    async with another_phone(browser) as boss, another_phone(browser) as guest:
        pin, _ = await site.invitation()
        await pair_by_pin(boss, site, pin)
        await boss.show("settings")
        group = boss.page.locator('[data-part="devices"]')
        await group.locator("summary").scroll_into_view_if_needed(timeout=12_000)
        await group.locator("summary").tap()
        await expect(group.locator("li")).to_have_count(1)
        await expect(group.locator("li")).to_contain_text("This device")

        await boss.f("pair-another", "#panel-settings").tap()
        sheet = boss.page.locator("#sheet-invite")
        await expect(sheet.locator("img")).to_be_visible()
        assert await sheet.locator("img").evaluate("image => image.decode().then(() => image.naturalWidth > 0)")
        await no_barrier(boss.page, "inviting")
        guests_pin = re.sub(r"\D", "", await sheet.locator("[data-f=invite-pin]").inner_text())
        await sheet.locator("[data-f=no]").tap()
        await pair_by_pin(guest, site, guests_pin)
        row = group.locator("li", has_not_text="This device")
        await expect(row).to_contain_text("here now")
        await expect(row.locator('[data-role-key="viewer"]')).to_have_attribute("aria-pressed", "true")

        await expect(guest.f("pause")).to_have_attribute("aria-disabled", "true")
        await row.locator('[data-role-key="operator"]').tap()
        await expect(guest.f("pause")).not_to_have_attribute("aria-disabled", "true", timeout=12_000)

        await guest.page.evaluate("localStorage.setItem('catgraph.mail-to', 'ann@example.org')")
        await row.locator("[data-f=remove]").tap()
        removal = boss.page.locator("#sheet-removal")
        await expect(removal).to_contain_text("Its pages close now")
        await removal.locator("[data-f=yes]").tap()
        await expect(guest.page.locator("#pairing")).to_contain_text("This device was removed by")
        await expect(guest.page.locator("#monitor")).to_be_hidden()
        assert await guest.page.evaluate("localStorage.getItem('catgraph.mail-to')") is None
        await expect(group.locator("li")).to_have_count(1)


async def test_a_link_from_a_mail_leads_over_the_pairing_to_the_file(browser: Browser, site: Site) -> None:
    async with another_phone(browser) as phone:
        _, token = await site.invitation("--viewer")
        await phone.open(f"{site.address}/docs")
        assert phone.page.url.startswith(f"{site.address}/?then=%2Fdocs")
        await expect(phone.page.locator("#pairing h1")).to_be_visible()
        await phone.page.evaluate("token => { location.hash = `#pair=${token}`; }", token)
        await phone.f("pair-go", "#pairing").tap()
        await phone.page.wait_for_url(f"{site.address}/docs")
        await expect(phone.page.locator("body")).to_contain_text("/api/devices")
