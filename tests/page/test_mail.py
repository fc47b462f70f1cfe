"""Mail from the page: set up and tried in Settings, ordered from Files, followed in the outbox, sent again."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from urllib.parse import unquote

import httpx
import pytest
import pytest_asyncio
from playwright.async_api import Locator, expect

from tests.http import http_client
from tests.page.barriers import fits_all, no_barrier
from tests.page.conftest import Phone
from tests.page.drives import steady
from tests.page.processes import AT_AGENT, Process, replay, running, server
from tests.server.mail.post import Post, posting
from tests.server.recording.made import BEGAN_MS, record

DRIVE = f"car_{datetime.fromtimestamp(BEGAN_MS / 1000, UTC).strftime('%Y%m%dT%H%M%SZ')}"
GONE = "gone@example.org"


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def post(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Post]:
    async with posting(tmp_path_factory.mktemp("post") / "box", "--refuse", GONE) as one:
        yield one


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """A server with one recording that watches a calm car."""
    folder = tmp_path_factory.mktemp("mail")
    record(folder / "data" / "recordings" / "car" / f"{DRIVE}.mcap", seconds=8.0)
    calm = steady(folder / "calm.bag", 3.0)
    async with running(*replay(calm)) as car, running(*server(folder / "data", car.address)) as process:
        yield process


@pytest_asyncio.fixture(loop_scope="session")
async def api(watch: Process, post: Post) -> AsyncIterator[httpx.AsyncClient]:
    """The server's own answers, with mail set up."""
    async with http_client(base_url=watch.address) as client:
        (await client.put("/api/mail/settings", json=settings(post))).raise_for_status()
        yield client


def settings(post: Post) -> dict[str, object]:
    return {"host": "127.0.0.1", "port": post.port, "security": "none", "sender": "car@test.example"}


def group(phone: Phone) -> Locator:
    return phone.page.locator('#panel-settings [data-part="mail"]')


async def mail_sheet(phone: Phone, watch: Process) -> Locator:
    """The e-mail sheet, opened from Files."""
    await phone.open(f"{watch.address}/#files")
    await phone.live()
    row = phone.page.locator(f'#panel-files [data-id="{DRIVE}"]')
    await expect(row).to_have_attribute("data-state", "read", timeout=20_000)
    await row.get_by_role("button").tap()
    await phone.page.locator("#sheet-file").get_by_role("button", name="E-mail").tap()
    sheet = phone.page.locator("#sheet-mail")
    await expect(sheet).to_be_visible()
    await expect(sheet.locator("[data-f=mail-size]")).to_contain_text("as recorded")
    return sheet


async def test_mail_is_set_up_and_tried_in_settings(
    phone: Phone, watch: Process, post: Post, api: httpx.AsyncClient
) -> None:
    (await api.put("/api/mail/settings", json={})).raise_for_status()
    await phone.open(f"{watch.address}/#settings")
    await phone.live()
    await group(phone).locator("summary").tap()
    host = group(phone).get_by_label("SMTP host")
    await expect(host).to_be_visible()
    await host.fill("127.0.0.1")
    await group(phone).get_by_role("button", name="TLS", exact=True).tap()
    await expect(group(phone).get_by_label("Port", exact=True)).to_have_value("465")
    await group(phone).get_by_role("button", name="None").tap()
    await group(phone).get_by_label("Port", exact=True).fill(str(post.port))
    await group(phone).get_by_label("Sender’s address").fill("car@test.example, evil@x")
    await group(phone).get_by_role("button", name="Save").tap()
    await expect(group(phone).get_by_role("alert")).to_contain_text("is not one address")
    await group(phone).get_by_label("Sender’s address").fill("car@test.example")
    await group(phone).get_by_label("User").fill("car")
    await group(phone).get_by_label("Password").fill("hunter2")
    await group(phone).get_by_role("button", name="Save").tap()
    await expect(group(phone).get_by_role("status")).to_contain_text("Saved")
    await expect(group(phone).get_by_label("Password")).to_have_value("")
    assert "hunter2" not in await phone.page.content()
    await group(phone).get_by_label("User").fill("")
    await group(phone).get_by_role("button", name="Save").tap()
    await expect(group(phone).get_by_role("status")).to_contain_text("Saved")
    await group(phone).get_by_label("Send a test e-mail to").fill("ann@example.org")
    await group(phone).get_by_role("button", name="Test").tap()
    await expect(group(phone).get_by_role("status")).to_contain_text(
        "It accepted a mail to ann@example.org. Server reply: 250"
    )
    assert post.taken[-1]["to"] == ["ann@example.org"]
    await group(phone).get_by_label("Send a test e-mail to").fill(GONE)
    await group(phone).get_by_role("button", name="Test").tap()
    await expect(group(phone).get_by_role("alert")).to_contain_text("550 5.1.1")
    phone.complaints[:] = [line for line in phone.complaints if not re.search("status of (422|502)", line)]
    await phone.page.locator("#panel-settings .find input").fill("smtp")
    await expect(phone.page.locator("#panel-settings .nothing")).to_be_hidden()
    await expect(group(phone)).to_be_visible()


@pytest.mark.gate
async def test_a_recording_is_mailed_from_files_and_followed_in_the_outbox(
    phone: Phone, watch: Process, post: Post, api: httpx.AsyncClient
) -> None:
    sheet = await mail_sheet(phone, watch)
    await sheet.get_by_label("To").fill("nobody")
    await sheet.get_by_role("button", name="Send").tap()
    await expect(sheet.get_by_role("alert")).to_have_text("“nobody” is not an address.")
    await sheet.get_by_label("To").fill("ann@example.org; bob@example.org")
    await sheet.get_by_label("Subject").fill("Fahrt über den Hügel")
    await sheet.get_by_label("Message").fill("See alarm 3.\nAnn")
    await sheet.get_by_role("button", name="Send").tap()
    await expect(sheet).to_be_hidden()
    await phone.page.locator(".snack.note").get_by_role("button", name="Outbox").tap()
    box = phone.page.locator("#sheet-outbox")
    first = box.locator("[data-mail]").first
    await expect(first).to_have_attribute("data-state", "sent", timeout=20_000)
    await expect(first).to_contain_text("Fahrt über den Hügel")
    await expect(first).to_contain_text("250 2.0.0 OK queued as")
    mail = post.mails()[-1]
    assert mail["Subject"] == "Fahrt über den Hügel"
    assert [one.addr_spec for one in mail["To"].addresses] == ["ann@example.org", "bob@example.org"]
    assert next(mail.iter_attachments()).get_filename() == f"{DRIVE}.zip"
    count = len(post.taken)
    await first.get_by_role("button", name=re.compile("Send again")).tap()
    async with asyncio.timeout(20):
        while len(post.taken) == count:
            await asyncio.sleep(0.05)
    assert post.taken[-1]["message_id"] == post.taken[-2]["message_id"]


async def test_what_failed_says_why_and_can_be_given_up(
    phone: Phone, watch: Process, post: Post, api: httpx.AsyncClient
) -> None:
    sheet = await mail_sheet(phone, watch)
    await sheet.get_by_label("To").fill(f"ann@example.org {GONE}")
    await sheet.get_by_role("button", name="Report").tap()
    await sheet.get_by_role("button", name="MCAP").tap()
    await sheet.get_by_role("button", name="Send").tap()
    await phone.page.locator(".snack.note").get_by_role("button", name="Outbox").tap()
    first = phone.page.locator("#sheet-outbox [data-mail]").first
    await expect(first).to_have_attribute("data-state", "failed", timeout=20_000)
    await expect(first).to_contain_text(f"{GONE}: 550 5.1.1")
    await expect(first).to_contain_text("1 of 2 recipients have it")
    await first.get_by_role("button", name=re.compile("Give up")).tap()
    await expect(first).to_have_attribute("data-state", "cancelled")


async def test_the_phones_own_mail_program_gets_links_where_it_takes_no_files(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    sheet = await mail_sheet(phone, watch)
    await phone.page.evaluate(
        """() => { HTMLAnchorElement.prototype.click = function () { window.opened = this.href; };
                   Object.defineProperty(navigator, 'canShare', {value: () => false, configurable: true}); }"""
    )
    await sheet.get_by_label("To").fill("ann@example.org")
    await sheet.get_by_label("Message").fill("Hello & <b>Ann</b>")
    await sheet.get_by_role("button", name="Open in my mail app").tap()
    await expect(sheet.get_by_role("status")).to_contain_text("gets links, because this device cannot share files")
    link_url = await phone.page.evaluate("window.opened")
    assert link_url.startswith("mailto:ann@example.org?subject=")
    link = f"{watch.address}{AT_AGENT}/api/recordings/{DRIVE}/file.mcap"
    assert f"Hello & <b>Ann</b>\r\n\r\n{link}" in unquote(link_url)


async def test_the_phones_own_mail_program_is_handed_the_file_where_it_takes_it(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    sheet = await mail_sheet(phone, watch)
    await phone.page.evaluate(
        """() => { for (const [name, value] of [['canShare', () => true], ['share', async (what) => {
                     window.shared = [what.files[0].name, what.files[0].size, what.text]; }]])
                     Object.defineProperty(navigator, name, {value, configurable: true}); }"""
    )
    await sheet.get_by_label("Message").fill("Hello")
    await sheet.get_by_role("button", name="Open in my mail app").tap()
    await sheet.get_by_role("button", name="Open it in my mail app").tap()
    await expect(sheet).to_be_hidden()
    name, size, text = await phone.page.evaluate("window.shared")
    whole = (await api.get(f"/api/recordings/{DRIVE}/file.mcap")).content
    assert (name, size, text) == (f"{DRIVE}.mcap", len(whole), "Hello")


async def test_a_server_without_mail_says_so_and_leaves_the_other_way(
    phone: Phone, watch: Process, post: Post, api: httpx.AsyncClient
) -> None:
    (await api.put("/api/mail/settings", json={})).raise_for_status()
    sheet = await mail_sheet(phone, watch)
    await expect(sheet.get_by_role("alert")).to_contain_text("see Settings, E-mail")
    await expect(sheet.get_by_role("button", name="Send")).to_be_disabled()
    await expect(sheet.get_by_role("button", name="Open in my mail app")).to_be_enabled()


async def test_the_settings_of_mail_keep_nobody_out_and_fit_every_screen(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    await phone.open(f"{watch.address}/#settings")
    await phone.live()
    await group(phone).locator("summary").tap()
    host = group(phone).get_by_label("SMTP host")
    await expect(host).to_be_visible()
    await host.scroll_into_view_if_needed()
    await no_barrier(phone.page, "settings", "#panel-settings")
    await fits_all(phone.page, "settings")
