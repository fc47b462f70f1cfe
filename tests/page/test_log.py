"""The alarm log on the page: newest first, filtered, paged back to its beginning, saved; and the licences."""

from __future__ import annotations

import csv
import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import expect

from server.bus.journal import Journal
from tests.http import http_client
from tests.page.barriers import no_barrier
from tests.page.conftest import Phone
from tests.page.drives import steady
from tests.page.processes import Process, replay, running, server

NOW_MS = 1_750_000_000_000
DAY_MS = 86_400_000


def _event(i: int) -> dict[str, object]:
    named = (
        {"alarm": "gps_jump", "title": "GPS jump", "priority": "warning"}
        if i % 5
        else {"alarm": "fuel_low", "title": "Fuel low", "priority": "advisory"}
    )
    return {
        "at_ms": NOW_MS - DAY_MS + i * 1000, "occurrence": i, "change": "raised", "place": "snackbar",
        "sound": "medium", "text": f"{i} m at once", "by": None, "state": "UNACKED", **named,
    }  # fmt: skip


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """A server with 230 events of another day in its log, that now watches a car at 12.6 m/s with the limit at 11.0."""
    folder = tmp_path_factory.mktemp("log")
    fast = steady(folder / "fast.bag", 12.6)
    async with running(*server(folder / "data")) as first:
        async with http_client(base_url=first.address) as client:
            await client.get("/api/log")
    found = list((folder / "data").rglob("events.sqlite"))
    assert len(found) == 1, found
    journal = Journal(found[0])
    vehicle = "car"
    journal.append(vehicle, [_event(i) for i in range(1, 231)])
    journal.close()
    async with running(*replay(fast)) as car, running(*server(folder / "data", car.address)) as process:
        yield process


async def opened(phone: Phone, watch: Process) -> None:
    await phone.open(f"{watch.address}/#home")
    if await phone.page.locator("#sheet-alarm[open]").count():
        await phone.acknowledge_all()
    await phone.f("menu").tap()
    await phone.page.locator("#sheet-menu").get_by_text("Alarm log").tap()
    await expect(phone.page.locator("[data-f=happened] li").first).to_be_visible()


async def test_older_events_come_page_by_page_to_the_beginning(phone: Phone, watch: Process) -> None:
    await phone.open(watch.address)
    await expect(phone.page.locator("#sheet-alarm")).to_contain_text("Speed above limit")
    await phone.f("acknowledge", "#sheet-alarm").tap()
    await expect(phone.page.locator("#sheet-alarm")).to_be_hidden()
    await opened(phone, watch)
    rows = phone.page.locator("[data-f=happened] li:not(.day)")
    await expect(rows.filter(has_text="Speed above limit acknowledged")).to_contain_text(re.compile(r"after \d+\.\d s"))
    older = phone.page.locator("[data-f=older]")
    while await older.is_visible():
        before = await rows.count()
        await older.tap()
        await expect(rows).not_to_have_count(before)
    await expect(phone.page.locator("[data-f=log-message]")).to_have_text("This is the beginning of the log.")
    assert await rows.filter(has_text="m at once").count() == 230
    await expect(rows.last).to_contain_text("1 m at once")
    days = await phone.page.locator("[data-f=happened] li.day").all_inner_texts()
    assert len(days) == 1, days
    assert re.fullmatch(r"\w+day, \d+ June 2025", days[0])


async def test_a_filter_holds_here_on_the_server_and_in_what_is_saved(
    phone: Phone, watch: Process, tmp_path: Path
) -> None:
    await opened(phone, watch)
    rows = phone.page.locator("[data-f=happened] li:not(.day)")
    await phone.page.locator("[data-kind=critical]").tap()
    await expect(phone.page.locator("[data-kind=critical]")).to_have_attribute("aria-pressed", "true")
    await expect(rows.filter(has_text="GPS jump")).to_have_count(0)
    await expect(rows.filter(has_text="Speed above limit").first).to_be_visible()
    await phone.page.locator("[data-kind=advisory]").tap()
    await phone.page.locator("[data-f=older]").tap()
    await expect(rows.filter(has_text="m at once")).to_have_count(46)
    await phone.page.locator("#log-find").fill("  115 M ")
    await expect(rows).to_have_text("Nothing found here")  # among what this page has received
    await phone.page.locator("[data-f=older]").tap()
    await expect(rows).to_have_count(1)
    await expect(rows).to_contain_text("115 m at once")
    async with phone.page.expect_download() as coming:
        await phone.page.get_by_role("link", name="Save what is found as CSV").tap()
    saved = tmp_path / "log.csv"
    await (await coming.value).save_as(saved)
    with saved.open(newline="") as file:
        assert [row["text"] for row in csv.DictReader(file)] == ["115 m at once"]
    await phone.page.locator("#log-find").fill("no such text")
    await expect(rows).to_have_text("Nothing found here")


async def test_the_title_and_the_icon_tell_the_alarm_to_who_looks_elsewhere(phone: Phone, watch: Process) -> None:
    await phone.open(watch.address)
    await expect(phone.page).to_have_title(re.compile(r"^\(\d+\) Speed above limit · catgraph$"))
    icon = phone.page.locator("link[rel=icon]")
    await expect(icon).to_have_attribute("href", re.compile("catgraph-critical.svg"))
    answer = await phone.page.request.get(f"{watch.address}{await icon.get_attribute('href')}")
    assert answer.headers["content-type"].startswith("image/svg")
    watch.freeze()
    try:
        await expect(phone.page).to_have_title("Not live · catgraph")
        await expect(icon).to_have_attribute("href", re.compile("catgraph-lost.svg"))
    finally:
        watch.thaw()
    await expect(phone.page).to_have_title(re.compile("Speed above limit"), timeout=20_000)


async def test_licence_and_about_are_open_to_all(phone: Phone, watch: Process) -> None:
    await opened(phone, watch)
    await phone.f("back").tap()
    for screen in ("License", "About"):
        await phone.f("menu").tap()
        await phone.page.locator("#sheet-menu").get_by_text(screen).tap()
        await expect(phone.f("title")).to_have_text(screen)
        if screen == "License":
            notice, text = phone.page.locator(".notice summary"), phone.page.locator(".notice[open] .license")
            await notice.filter(has_text="Leaflet").tap()
            await expect(text).to_contain_text("Redistribution and use")
            await notice.filter(has_text="catgraph").tap()
            await expect(text.first).to_contain_text("TERMS AND CONDITIONS FOR USE")
        else:
            await expect(phone.page.locator(".facts")).to_contain_text(re.compile(r"roslibpy\s*2\.1\.0"))
            await expect(phone.page.locator("[data-f=screen] .prose")).to_contain_text("not an emergency stop")
        await no_barrier(phone.page, screen)
        assert await phone.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
