"""Each part of the page on set states: what it shows, what it sends, and its texts for what is not known any more."""

from __future__ import annotations

import asyncio
import re
from typing import Any

import pytest
from playwright.async_api import Locator, expect

from tests.page.canned import Canned, alarm, live
from tests.page.conftest import Phone
from tests.page.screenshots import show, silent_car, too_fast

pytestmark = pytest.mark.gate
HOSTILE = "<img src=x onerror=\"document.title='owned'\">"
OPEN = "name => dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: name } }))"
READY = {"state": "ACKED", "acknowledged_by": "You"}


def sent(canned: Canned, kind: str) -> list[dict[str, Any]]:
    return [one for one in canned.received if one.get("kind") == kind]


async def until_sent(canned: Canned, kind: str) -> dict[str, Any]:
    """The last message of that kind, once there is one."""
    async with asyncio.timeout(20):
        while not (found := sent(canned, kind)):
            await asyncio.sleep(0.05)
    return found[-1]


async def opened(phone: Phone, canned: Canned, tab: str = "home") -> None:
    await phone.open(f"{canned.address}/#{tab}")
    await phone.live()


async def is_cut(where: Locator, a: str, b: str) -> None:
    await expect(where.locator(".bigchain")).to_have_attribute("aria-label", f"The link is broken between {a} and {b}")


# -- the tabs ----------------------------------------------------------------------------------------------------------


async def test_home_shows_each_value_and_none_of_them_as_live_once_the_car_is_silent(
    phone: Phone, canned: Canned
) -> None:
    await opened(phone, canned)
    await expect(phone.page.locator(".gauge .speed")).to_have_text("4.2")
    for name, text in (
        ("latitude", "32.231904"), ("longitude", "−110.950116"), ("altitude", "748.3"), ("heading", "087"),
        ("brake", "0"), ("accelerator", "14"), ("distance", "12.4"),
    ):  # fmt: skip
        await expect(phone.f(name)).to_contain_text(text)
    await expect(phone.page.locator(".checks li.ok")).to_have_count(12)
    canned.state = silent_car(live())
    await expect(phone.f("veil")).to_have_attribute("data-on", "values")
    await expect(phone.f("veil-words")).to_contain_text("The car fell silent.")
    await is_cut(phone.page.locator("#monitor .veil"), "Bridge", "Car")
    await expect(phone.f("link-state")).to_have_text("Silent")
    await expect(phone.page.locator(".checks li.ok")).to_have_count(0)
    canned.state = live()
    await phone.live()
    await expect(phone.page.locator(".checks li.ok")).to_have_count(12)


async def test_one_stale_value_loses_its_ink_and_no_other(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned)
    await expect(phone.f("latitude")).to_have_attribute("data-ink", "fresh")
    canned.state["signals"]["position"] |= {"freshness": "stale", "age_s": 3.4}
    await expect(phone.f("latitude")).to_have_attribute("data-ink", "stale")
    await expect(phone.page.locator(".gauge")).to_have_attribute("data-speed", "fresh")
    canned.state["signals"]["speed"] |= {"freshness": "stale", "age_s": 3.4}
    await expect(phone.page.locator(".gauge")).to_have_attribute("data-speed", "stale")
    await expect(phone.f("veil")).not_to_have_attribute("data-on", re.compile("."))


async def test_the_map_shows_both_and_says_which_is_old(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "map")
    panel = phone.page.locator("#panel-map")
    await expect(phone.f("car-lat", "#panel-map")).to_have_text("32.231904°")
    await expect(phone.f("phone-lat", "#panel-map")).to_have_text("32.231828°")
    await expect(phone.f("apart", "#panel-map")).to_have_text("10.4")
    await expect(phone.f("bearing", "#panel-map")).to_have_text("car at 324° NW")
    canned.state["signals"]["position"] |= {"freshness": "stale", "age_s": 3.35}
    canned.state["phone"] |= {
        "used": False,
        "why": "hidden",
        "why_text": "The page is in the background",
        "age_s": 12.4,
    }
    await expect(panel.locator(".car-mark").first).to_have_attribute("data-ink", "stale")
    await expect(phone.f("car-message", "#panel-map")).to_contain_text("the car may be elsewhere")
    await expect(phone.f("phone-message", "#panel-map")).to_contain_text("The page is in the background")
    await expect(phone.f("apart", "#panel-map")).to_have_text("–")


async def test_the_scan_is_drawn_and_hatched_over_once_it_is_old(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "scan")
    await expect(phone.f("beams", "#panel-scan")).to_contain_text("164 of 181 beams usable")
    await expect(phone.f("distance", "#panel-scan")).to_have_text("12.4")
    await expect(phone.f("none", "#panel-scan")).to_be_hidden()
    for name in ("scan", "distance", "bearing"):
        canned.state["signals"][name] |= {"freshness": "stale", "age_s": 3.4}
    canned.is_scanning = False
    await expect(phone.f("none-words", "#panel-scan")).to_have_text(re.compile(r"STALE \d"))
    await expect(phone.f("distance", "#panel-scan")).to_have_text("–")
    await expect(phone.page.locator(".scanc")).to_have_attribute("aria-label", re.compile("STALE"))


async def test_files_lists_what_is_saved_and_a_row_opens_its_menu(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "files")
    rows = phone.page.locator("#panel-files [data-f=recordings] .file")
    await expect(rows).to_have_count(6)
    await expect(rows.nth(3)).to_contain_text("Rehearsal lot")
    await rows.nth(2).get_by_role("button").tap()
    sheet = phone.page.locator("#sheet-file")
    await expect(sheet).to_contain_text("2 critical alarms")
    await expect(sheet).to_contain_text("Recovered")
    for text in ("Open replay", "E-mail", "Download", "Delete"):
        await expect(sheet.locator(".menu-list li", has_text=text).first).to_be_visible()


async def test_a_limit_that_is_typed_in_settings_is_sent_in_si(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "settings")
    row = phone.page.locator('[data-setting="speed_limit.max_mps"]')
    await expect(row.locator("input.v")).to_have_value("11.0")
    await row.locator("input.v").fill("9,5")
    await row.locator("input.v").press("Enter")
    assert (await until_sent(canned, "set"))["values"] == {"speed_limit.max_mps": 9.5}
    await row.locator("input.v").fill("95")
    await row.locator("input.v").press("Enter")
    await expect(row.locator(".msg")).to_contain_text("0.5 to 40 m/s is allowed")
    assert len(sent(canned, "set")) == 1


# -- alarms ------------------------------------------------------------------------------------------------------------


async def test_a_critical_alarm_is_a_dialog_and_names_what_was_measured(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "files")
    canned.state = too_fast(live())
    sheet = phone.page.locator("#sheet-alarm")
    await expect(sheet).to_be_visible()
    await expect(sheet).to_have_attribute("role", "alertdialog")
    await expect(phone.f("title", "#sheet-alarm")).to_have_text("Speed above limit")
    await expect(phone.f("measured", "#sheet-alarm")).to_have_text("12.6")
    await expect(phone.f("limit", "#sheet-alarm")).to_have_text("11.0")
    await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "asking")
    await expect(sheet).not_to_have_attribute("data-moved", "")
    await phone.f("acknowledge", "#sheet-alarm").tap()
    command = await until_sent(canned, "acknowledge")
    assert (command["alarm"], command["occurrence"]) == ("Speed", 1)
    await expect(sheet).to_be_visible()  # the dialog stays until the server has confirmed
    canned.state["alarms"][0] |= READY
    await expect(sheet).to_be_hidden()
    await expect(phone.f("strip")).to_contain_text("Speed above limit")  # it stands, and is known
    await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "critical")
    canned.state["alarms"] = []
    await expect(phone.f("strip")).to_contain_text("No alarms")


async def test_a_warning_is_shelved_for_so_many_minutes(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned)
    canned.state["alarms"] = [alarm("scan_slow", "Laser slower than expected", occurrence=2)]
    snack = phone.page.locator(".snack[data-f=warning]")
    await expect(snack).to_contain_text("Laser slower than expected")
    await expect(snack).not_to_have_attribute("data-moved", "")
    await snack.get_by_role("button", name="Shelve").tap()
    sheet = phone.page.locator("#sheet-shelve")
    await expect(sheet).to_contain_text("Shelving ends by itself.")
    await expect(sheet).not_to_have_attribute("data-moved", "")
    await sheet.locator("[data-minutes]").first.tap()
    command = await until_sent(canned, "shelve")
    assert (command["alarm"], command["occurrence"]) == ("scan_slow", 2)
    assert 0 < command["minutes"] <= 15
    canned.state["alarms"][0] |= {"state": "SHELVED", "shelved_by": "You", "shelved_until_ms": 2**41, "place": "list"}
    await expect(snack).to_be_hidden()
    await phone.f("strip").tap()
    await expect(phone.page.locator("[data-f=alarms] li", has_text="Laser slower")).to_contain_text("shelved")


async def test_paused_every_tab_says_that_no_alarm_is_raised(phone: Phone, canned: Canned) -> None:
    canned.state["session"] |= {"paused": True, "paused_for_s": 42.1}
    await phone.open(canned.address)
    for tab in ("home", "map", "scan", "files", "settings"):
        await phone.page.locator(f"#tab-{tab}").tap()
        await expect(phone.f("strip")).to_have_text(re.compile(r"Paused 0:4\d: no alarm is raised"))
        await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "paused")
    await phone.f("pause").tap()
    await until_sent(canned, "resume")
    assert sent(canned, "pause") == []


async def test_words_that_mean_harm_are_only_words(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned)
    before = await phone.page.locator("script, img, iframe, object").count()
    canned.state["session"]["name"] = HOSTILE
    canned.state["control"] = {"holder": HOSTILE, "page": "another", "fence": 2}
    canned.state["signals"]["speed"] |= {"label": HOSTILE, "topic": HOSTILE, "type": HOSTILE}
    canned.state["alarms"] = [alarm("x", HOSTILE, text=HOSTILE, trip_text=HOSTILE, advice=HOSTILE)]
    await expect(phone.page.locator(".snack[data-f=warning]")).to_contain_text("<img src=x onerror=")
    await expect(phone.f("strip")).to_contain_text("<img src=x onerror=")
    await expect(phone.f("who-name")).to_contain_text("<img")
    await phone.page.evaluate(OPEN, "signals")
    await expect(phone.page.locator(".sigs .sig").first).to_contain_text("<img src=x onerror=")
    assert await phone.page.locator("script, img, iframe, object").count() == before
    assert await phone.page.title() != "owned"


# -- the link ----------------------------------------------------------------------------------------------------------


async def test_a_server_that_falls_silent_covers_everything_and_its_return_uncovers_it(
    phone: Phone, canned: Canned
) -> None:
    await opened(phone, canned)
    canned.silent = True
    await expect(phone.f("veil")).to_have_attribute("data-on", "all")
    await expect(phone.f("veil-words")).to_contain_text("The server fell silent.")
    await expect(phone.f("link-state")).to_have_text("Lost")
    await expect(phone.page.locator(".gauge")).to_have_attribute("data-speed", "stale")
    sheet = phone.page.locator("#sheet-lost")
    await expect(sheet).to_be_visible()
    await is_cut(sheet, "This device", "Server")
    canned.silent = False
    await phone.live()
    await expect(sheet).to_be_hidden()


@pytest.mark.parametrize(
    ("scene", "sheet", "text", "cut"),
    [
        ("link-lost", "#sheet-lost", "watch the car. Last known: 4.2 m/s, object at 12.4 m, ", ("Server", "Bridge")),
        ("no-messages", "#sheet-mute", "Connected, but no message", ("Bridge", "Car")),
        ("connect-failed", "#sheet-failed", "nothing listens on port 9090", ("Server", "Bridge")),
    ],
)
async def test_each_broken_part_of_the_chain_has_its_dialog(
    phone: Phone, canned: Canned, scene: str, sheet: str, text: str, cut: tuple[str, str]
) -> None:
    await show(canned, phone.page, scene)
    await expect(phone.page.locator(sheet)).to_be_visible()
    await expect(phone.page.locator(sheet)).to_contain_text(text)
    await is_cut(phone.page.locator(sheet), *cut)
    canned.state = live()
    await phone.live()
    await expect(phone.page.locator(sheet)).to_be_hidden()


@pytest.mark.own_phone
async def test_a_page_that_does_not_draw_says_so_over_its_old_values(phone: Phone, canned: Canned) -> None:
    canned.state["alarms"] = [alarm("speed", "Speed above limit", state="ACKED")]
    await opened(phone, canned)
    await phone.page.evaluate("window.requestAnimationFrame = () => 0")
    await phone.page.wait_for_function(
        "() => getComputedStyle(document.querySelector('.undrawn')).opacity === '1'", polling=50
    )
    await expect(phone.page.locator(".undrawn")).to_contain_text("Speed above limit")
    phone.complaints.clear()


async def test_a_phone_that_is_not_paired_sees_nothing_of_the_car(phone: Phone, canned: Canned) -> None:
    canned.access = "paired"
    await phone.open(canned.address)
    await expect(phone.page.locator("#pairing h1")).to_have_text("Pair this device")
    await expect(phone.page.locator("#monitor")).to_be_hidden()
    await phone.f("pair-go", "#pairing").tap()
    await expect(phone.f("pair-message", "#pairing")).to_have_text("The PIN has 6 digits.")
    phone.complaints.clear()  # the browser's own, of the ticket that was refused


# -- who, where and what was -------------------------------------------------------------------------------------------


async def test_another_car_that_needs_a_person_is_named_and_opened(phone: Phone, canned: Canned) -> None:
    await show(canned, phone.page, "cars")
    sheet = phone.page.locator("#sheet-cars")
    for text in (
        "Serval",
        "Speed above limit",
        "Margay",
        "Car silent",
        "Caracal",
        "GPS drift, acknowledged",
        "Desk 2",
    ):
        await expect(sheet).to_contain_text(text)
    await expect(phone.f("car-count")).to_have_text("2")  # Caracal's is acknowledged


async def test_control_that_another_page_took_is_said_and_asked_for(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned)
    await expect(phone.f("who-name")).to_have_text("You")
    canned.state["control"] = {"holder": "Desk 1", "page": "another", "fence": 8}
    await expect(phone.f("who-name")).to_have_text("Desk 1")
    canned.refuses["pause"] = "Desk 1 is in control."
    await phone.f("pause").tap()
    await expect(phone.page.locator(".snack.note")).to_contain_text("Desk 1 is in control.")
    await phone.f("who").tap()
    await phone.page.locator("#sheet-cars [data-f=cars-control]").tap()
    await phone.page.locator("#sheet-control").get_by_role("button", name="Request control").tap()
    assert (await until_sent(canned, "control"))["do"] == "request"


async def test_the_departure_check_lists_what_is_open(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned)
    await phone.page.evaluate(OPEN, "departure")
    await expect(phone.f("title")).to_have_text("Departure check")
    await expect(phone.page.locator(".dep-count")).to_have_text(re.compile(r"^0 of \d+$"))
    await expect(phone.page.locator(".departure").get_by_role("button", name="Begin the check")).to_be_visible()


async def test_the_mode_of_the_car_is_named(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned)
    for mode, text in (("autonomous", "Autonomous"), ("manual", "Manual"), ("unknown", "Mode not known")):
        why = "silent" if mode == "unknown" else None
        canned.state["mode"] |= {"mode": mode, "why": why, "since_ms": 0, "source": "/mode", "way_m": 12.0}
        await expect(phone.page.locator(".ledge [data-f=mode]")).to_contain_text(text, timeout=20_000)


async def test_the_outbox_says_what_became_of_each_mail(phone: Phone, canned: Canned) -> None:
    await show(canned, phone.page, "outbox")
    mails = phone.page.locator("#sheet-outbox [data-mail]")
    await expect(mails).to_have_count(3)
    for n, (state, text) in enumerate((("queued", "tried again by itself"), ("sent", "Sent"), ("failed", "refused"))):
        await expect(mails.nth(n)).to_have_attribute("data-state", state)
        await expect(mails.nth(n)).to_contain_text(text)


async def test_a_replay_says_that_it_is_one_and_orders_nothing(phone: Phone, canned: Canned) -> None:
    await show(canned, phone.page, "replay")
    await expect(phone.page.locator(".gauge .speed")).to_have_text("12.1")
    await expect(phone.page.locator(".replay-date")).to_contain_text("Recorded")
    await expect(phone.page).to_have_title(re.compile("REPLAY"))
    await expect(phone.page.locator("#monitor > .rail")).to_be_hidden()
    await expect(phone.page.locator(".replay-line")).to_contain_text("Speed above limit")
    await expect(phone.page.locator("#sheet-alarm")).to_be_hidden()  # what was an alarm then has no dialog now


async def test_the_log_lists_what_happened_and_by_whom(phone: Phone, canned: Canned) -> None:
    await show(canned, phone.page, "alarm-log")
    rows = phone.page.locator("[data-f=happened] li:not(.day)")
    await expect(rows.filter(has_text="Speed above limit acknowledged")).to_contain_text("Pixel 7")
    await expect(rows.filter(has_text="Speed limit: 9.0 m/s → 11.0 m/s")).to_have_count(1)
    await expect(rows.filter(has_text="Connected to 192.168.4.1:9090.")).to_have_count(1)
