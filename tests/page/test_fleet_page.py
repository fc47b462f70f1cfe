"""The page of all cars: what needs a person, in which order, and what its keys send. Against a server of set states."""

from __future__ import annotations

import asyncio
import re
import time
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Locator, Page, expect

from tests.page import canned_fleet as fleet
from tests.page.barriers import no_barrier
from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.processes import running, simulate

DESKTOP = {"width": 1440, "height": 900}
# What hangs over an edge, or is too small for a finger.
UNFIT = """() => [...document.querySelectorAll('#fleet :is(button, a, p, h1, h2, h3, li)')]
  .filter((one) => one.getClientRects().length && !one.closest('svg'))
  .map((one) => [one, one.getBoundingClientRect()])
  .filter(([one, box]) => box.right > innerWidth + 1 || box.left < -1
    || (one.matches('button') && Math.min(box.width, box.height) < 24))
  .map(([one]) => one.outerHTML.slice(0, 90))"""


async def opened(phone: Phone, canned: Canned, cars: list[Any]) -> Page:
    canned.cars = cars
    await phone.open(f"{canned.address}/fleet")
    await expect(phone.f("link-state", "#fleet")).to_have_text("Live")
    return phone.page


def item(page: Page, name: str) -> Locator:
    return page.locator(f'[data-item="{name}"]')


async def press(page: Page, name: str, act: str) -> None:
    await expect(item(page, name)).to_be_visible()
    await item(page, name).locator(f'[data-act="{act}"]').click()


def sent(canned: Canned, *kinds: str) -> list[dict[str, Any]]:
    return [{k: v for k, v in one.items() if k != "id"} for one in canned.received if one.get("kind") in kinds]


COVERED = "getComputedStyle(document.querySelector('.floor > .veil')).opacity"


async def test_what_needs_a_person_stands_first_in_words(phone: Phone, canned: Canned) -> None:
    canned.fleet_events = fleet.events()
    page = await opened(phone, canned, fleet.three())
    await page.evaluate(
        f"window.most = 0; setInterval(() => {{ window.most = Math.max(window.most, {COVERED}); }}, 50)"
    )
    names = page.locator(".item h3")
    await expect(names).to_have_text(["Margay", "Serval", "Caracal"])
    await expect(item(page, "Margay")).to_contain_text("Bridge silent")
    await expect(item(page, "Margay")).to_contain_text("at Supervisor for 0:1")
    await expect(item(page, "Serval")).to_contain_text("12.6 m/s, limit 11.0 m/s")
    await expect(item(page, "Serval")).to_contain_text("unassigned")
    await expect(item(page, "Serval")).to_contain_text(re.compile(r"Supervisor in 0:[12]\d"))
    await expect(item(page, "Caracal")).to_contain_text("assigned to Desk 2, acknowledged")
    await expect(item(page, "Caracal").locator(".key:visible")).to_have_text(["Take over"])
    await expect(page.locator("tbody tr:visible")).to_have_count(2)  # on a phone the others alone
    await expect(phone.f("strip", "#fleet")).to_have_attribute("data-kind", "crit")
    await no_barrier(page, "the fleet")
    await page.set_viewport_size({"width": 360, "height": 740})
    assert await page.evaluate(UNFIT) == []
    await page.locator("[data-f=show-map]").click()
    await expect(phone.f("where-head", "#fleet")).to_contain_text("5 cars, 1 last seen 0:4")
    await expect(page.locator("[data-f=map] .car[data-old]")).to_have_count(1)
    await page.set_viewport_size(DESKTOP)
    await expect(page.locator("tbody tr:visible")).to_have_count(5)
    await expect(page.locator('tr[data-car="Margay"]')).to_contain_text("unknown")
    await expect(page.locator("[data-f=events] li")).to_have_count(3)
    await no_barrier(page, "the fleet on a desktop")
    assert await page.evaluate("window.most") == 0, "nothing was covered while lists came"


@pytest.mark.gate
async def test_taking_it_is_sent_and_opens_the_cars_own_page(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, canned, fleet.three())
    canned.refuses = {"take_item": "This car is assigned to Desk 2: take it over, or ask."}
    await press(page, "Serval", "take")
    await expect(page.locator(".snack.note")).to_contain_text("Serval: This car is assigned to Desk 2")
    assert page.url.endswith("/fleet")
    canned.refuses = {}
    await press(page, "Serval", "take")
    await page.wait_for_url("**/?vehicle=Serval*")
    take = {"kind": "take_item", "vehicle": "Serval"}
    assert sent(canned, "take_item", "arm") == [take, take]
    greeting = next(one for one in canned.received if one.get("kind") == "hello")
    assert re.fullmatch("[0-9a-f]{16}", greeting["page"])
    announced = next(one for one in canned.received if one.get("kind") == "present" and one["announces"])
    assert announced["announces"] == ["Margay", "Serval", "Caracal", "Kodkod", "Ocelot"]


@pytest.mark.gate
async def test_an_item_is_handed_over_answered_and_taken_over(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, canned, fleet.three())
    await press(page, "Serval", "hand")
    await page.locator("#sheet-hand").get_by_role("button", name="Field 2").click()
    await expect(page.locator("#sheet-hand")).to_have_count(0)
    await expect(item(page, "Serval").locator("[data-act=hand]")).to_be_focused()
    async with asyncio.timeout(20):
        while len(sent(canned, "offer_item")) < 1:
            await asyncio.sleep(0.02)
    assert sent(canned, "take_item", "offer_item") == [
        {"kind": "take_item", "vehicle": "Serval"},
        {"kind": "offer_item", "vehicle": "Serval", "to": "field2"},
    ]
    me = next(one["page"] for one in canned.received if one.get("kind") == "hello")
    offered = {"by": "Desk 2", "name": "Me", "page": me, "since_ms": fleet.now_ms()}
    canned.cars[1]["summary"]["attention"] = fleet.attention(
        ago_s=9, assigned=fleet.holder(fleet.DESK_2), offered=offered
    )
    await expect(item(page, "Serval")).to_contain_text("offered to you by Desk 2")
    await press(page, "Serval", "decline")
    canned.cars[1]["summary"]["attention"] = fleet.attention(ago_s=9, assigned=fleet.holder({"page": me, "name": "Me"}))
    await expect(item(page, "Serval").locator(".key:visible")).to_have_text(["Open", "Hand over", "Unassign"])
    await press(page, "Serval", "release")
    await press(page, "Caracal", "over")
    await page.wait_for_url("**/?vehicle=Caracal*")
    assert sent(canned, "answer_item", "release_item", "take_item")[1:] == [
        {"kind": "answer_item", "vehicle": "Serval", "accept": False},
        {"kind": "release_item", "vehicle": "Serval"},
        {"kind": "take_item", "vehicle": "Caracal", "over": True},
    ]


async def test_a_flood_is_one_item_and_a_hundred_cars_have_their_places(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size(DESKTOP)
    page = await opened(phone, canned, fleet.hundred(31))
    await expect(page.locator(".item h3")).to_have_text(["31 cars", "C07", "C29"])
    await page.mouse.click(4, 60)  # the line that requests a touch, so that alarms sound, has gone
    await expect(phone.f("sound-off", "#fleet")).to_be_hidden()
    group = page.locator(".item").first
    await expect(group).to_contain_text("C34 to C64")
    await expect(phone.f("rows-pages", "#fleet")).to_have_text("1–16 of 70")
    await expect(page.locator("tbody tr")).to_have_count(16)
    await expect(page.locator("[data-f=places] a")).to_have_count(100)
    await expect(page.locator("[data-f=places] a[data-kind]")).to_have_count(32)
    await group.get_by_role("button", name="Show 31").click()
    await expect(phone.f("rows-pages", "#fleet")).to_have_text("1–16 of 101")
    await expect(phone.f("pages", "#fleet")).to_contain_text("of 34")
    await group.get_by_role("button", name="Hide 31").click()
    await page.get_by_role("button", name="Next page").last.click()
    await expect(page.locator("tbody tr").first).to_have_attribute("data-car", "C15")
    await group.get_by_role("button", name="Take all").click()
    async with asyncio.timeout(20):
        while len(sent(canned, "take_item")) < 31:
            await asyncio.sleep(0.05)
    assert page.url.endswith("/fleet")
    await no_barrier(page, "a hundred cars")
    await page.locator('tr[data-car="C16"] .al').click()
    await page.wait_for_url("**/?vehicle=C16*")


async def test_a_server_that_falls_silent_is_said_within_2_s(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, canned, fleet.three())
    seen = f"() => {COVERED} === '1' || document.querySelector('#fleet').dataset.state === 'lost'"
    canned.silent = True
    begun_s = time.monotonic()
    await page.wait_for_function(seen, polling=50)
    assert time.monotonic() - begun_s < 2.0 + phone.slack_s
    await expect(page.locator("#fleet")).to_have_attribute("data-state", "lost")
    await expect(phone.f("lost", "#fleet")).to_contain_text("Cars may still be moving, and alarms of 5 cars")
    await expect(phone.f("own", "#fleet").locator("a")).to_have_count(5)
    await expect(page.locator("tbody .sp .n[data-ink=stale]")).to_have_count(5)
    await expect(page.locator("tbody .mo").first).to_have_text("unknown")
    await expect(page.locator("tbody .al").first).to_have_text("not known now")
    await page.set_viewport_size(DESKTOP)
    await expect(phone.f("over", "#fleet")).to_be_visible()
    await expect(phone.f("where-head", "#fleet")).to_contain_text("then, not now")
    await no_barrier(page, "a lost server")
    canned.silent = False
    await expect(page.locator("#fleet")).to_have_attribute("data-state", "live")
    await expect(page.locator(".item h3").first).to_have_text("Margay")


@pytest.mark.gate
async def test_a_silent_server_is_said_and_its_return_too(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, canned, fleet.three())
    canned.silent = True
    await expect(page.locator("#fleet")).to_have_attribute("data-state", "lost")
    await expect(phone.f("lost", "#fleet")).to_contain_text("Cars may still be moving, and alarms of 5 cars")
    await expect(page.locator("tbody .sp .n[data-ink=stale]")).to_have_count(5)
    await expect(page.locator("tbody .mo").first).to_have_text("unknown")
    canned.silent = False
    await expect(page.locator("#fleet")).to_have_attribute("data-state", "live")
    await expect(page.locator(".item h3").first).to_have_text("Margay")


@pytest.mark.gate
async def test_one_silent_car_is_lost_and_the_others_are_not(phone: Phone, canned: Canned) -> None:
    cars = fleet.three()
    page = await opened(phone, canned, cars)
    cars[3] |= {"summary": None, "age_s": 41.0, "trouble": "The agent of Kodkod is silent."}
    await expect(item(page, "Kodkod")).to_contain_text("No data: car may be moving")
    await expect(item(page, "Kodkod")).to_contain_text("The agent of Kodkod is silent.")
    keys = item(page, "Kodkod").locator(".key:visible")
    await expect(keys).to_have_text(["Open", "Silence", "It is off"])
    await keys.nth(1).tap()
    await expect(keys).to_have_text(["Open", "It is off"])
    canned.cars = [one | {"summary": None, "age_s": 9.0} for one in cars]
    await expect(phone.f("lost-title", "#fleet")).to_have_text("No data from any car")
    canned.cars = []
    await expect(phone.f("none", "#fleet")).to_contain_text("--vehicle NAME")
    await expect(phone.f("strip-text", "#fleet")).to_have_text("No car is listed yet")


@pytest.mark.gate
@pytest.mark.own_phone
async def test_a_page_that_does_not_draw_says_so(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, canned, fleet.three())
    await page.evaluate("window.requestAnimationFrame = () => 0")
    await page.wait_for_function(
        "() => getComputedStyle(document.querySelector('.undrawn')).opacity === '1'", polling=50
    )
    await expect(page.locator("#undrawn-alarms")).to_contain_text("Margay: Bridge silent")
    phone.complaints.clear()


async def test_hostile_names_are_text(phone: Phone, canned: Canned) -> None:
    name = "<img src=x onerror=alert(1)>\u202e" + "W" * 60
    cars = [
        fleet.car(
            name, 4.2, (0, 0, 0),
            worst=fleet.worst("<b>x</b>" * 30, "y" * 300, ago_s=7),
            attention=fleet.attention(ago_s=7, left_s=23, assigned=fleet.holder({"page": "x", "name": "Z" * 40})),
        ),
        fleet.car("../../?vehicle=a&b#c", 0.0, (90, 5, 30)),
    ]  # fmt: skip
    page = await opened(phone, canned, cars)
    await expect(page.locator(".item h3")).to_have_text([name])
    assert await page.locator("#fleet img, #fleet b b").count() == 0
    for width in (360, 820, 1440):
        await page.set_viewport_size({"width": width, "height": 900})
        assert await page.evaluate(UNFIT) == [], width
    await page.locator('tr[data-quiet] a:has-text("vehicle")').click()
    await page.wait_for_url("**/?vehicle=..%2F..%2F%3Fvehicle%3Da%26b%23c*")


@pytest.mark.gate
async def test_a_viewer_sees_all_of_it_and_sends_nothing(phone: Phone, canned: Canned) -> None:
    canned.role = "viewer"
    page = await opened(phone, canned, fleet.three())
    key = item(page, "Serval").locator("[data-act=take]")
    await expect(key).to_have_attribute("aria-disabled", "true")
    await expect(item(page, "Serval")).not_to_have_attribute("data-moved", "")
    await key.click(force=True)  # it is disabled by its own attribute
    await expect(page.locator(".snack.note")).to_contain_text("paired as a viewer")
    assert sent(canned, "take_item") == []


@pytest.mark.gate
async def test_the_focus_stays_where_it_is_while_items_come_and_go(phone: Phone, canned: Canned) -> None:
    cars = fleet.three()
    page = await opened(phone, canned, cars)
    await item(page, "Caracal").locator("[data-act=over]").focus()
    cars[3]["summary"] |= {
        "worst": fleet.worst("Obstacle in corridor", "3.9 m, limit 5.0 m", ago_s=29),
        "attention": fleet.attention(ago_s=29, left_s=1),
    }
    await expect(page.locator(".item h3")).to_have_text(["Margay", "Kodkod", "Serval", "Caracal"])
    await expect(item(page, "Caracal").locator("[data-act=over]")).to_be_focused()
    cars[2]["summary"]["attention"] = None
    await expect(item(page, "Caracal")).to_have_count(0)
    await expect(item(page, "Serval").locator("[data-act=take]")).to_be_focused()


@pytest.mark.gate
async def test_the_ways_to_it_and_back(phone: Phone, canned: Canned) -> None:
    canned.vehicle, canned.cars = "Ocelot", fleet.three()
    await phone.open(f"{canned.address}/?vehicle=Ocelot")
    await phone.live()
    await phone.f("who").evaluate("chip => chip.click()")
    await phone.page.locator("[data-f=cars-fleet]").click()
    await phone.page.wait_for_url("**/fleet")
    await expect(phone.page.locator("[data-f=way-car] use")).to_have_attribute("href", "#i-home")
    await phone.page.locator("[data-f=way-car]").click()
    await phone.page.wait_for_url(f"{canned.address}/#*")
    canned.access = "paired"
    await phone.open(f"{canned.address}/fleet")
    await phone.page.wait_for_url("**/?then=/fleet*")
    await expect(phone.page.locator("#pairing")).to_be_visible()
    phone.complaints.clear()


async def test_what_is_taken_stays_mine_on_the_cars_own_page_and_back(phone: Phone, tmp_path: Path) -> None:
    """With a server and two simulated cars."""
    async with running(*simulate()) as one, running(*simulate("--seed", "2")) as two:
        named = ("--vehicle", f"Ocelot={one.address}", "--vehicle", f"Serval={two.address}")
        async with running("serve", "--port", "0", "--data", str(tmp_path), *named) as watch:
            await phone.open(f"{watch.address}/fleet")
            page = phone.page
            await one.type("speeding 30")
            await expect(item(page, "Ocelot")).to_contain_text("Speed above limit", timeout=20_000)
            await press(page, "Ocelot", "take")
            await page.wait_for_url("**/?vehicle=Ocelot*")
            await phone.acknowledge_all()
            await page.wait_for_timeout(1500)
            await page.goto(f"{watch.address}/fleet")
            await expect(item(page, "Ocelot")).to_contain_text("assigned to you")
            await press(page, "Ocelot", "release")
            await expect(item(page, "Ocelot")).to_contain_text("unassigned")
            await page.set_viewport_size(DESKTOP)
            await expect(page.locator("[data-f=events] li")).to_have_count(2)


PACE = """() => new Promise((done) => {
  const gaps = [];
  const floor = document.querySelector('.floor');
  let last = performance.now();
  const step = (now) => {
    gaps.push(now - last);
    last = now;
    floor.scrollTop += 12;
    if (floor.scrollTop + floor.clientHeight >= floor.scrollHeight) floor.scrollTop = 0;
    if (gaps.length < 300) requestAnimationFrame(step);
    else done(gaps.slice(10).sort((a, b) => a - b));
  };
  requestAnimationFrame(step);
})"""


@pytest.mark.soak
async def test_a_hundred_cars_scroll_evenly(phone: Phone, canned: Canned, record_property: Any) -> None:
    page = await opened(phone, canned, fleet.hundred(31))
    await page.locator("[data-f=show-cars]").click()
    await expect(page.locator("tbody tr")).to_have_count(70)
    gaps = await page.evaluate(PACE)
    median, most = gaps[len(gaps) // 2], gaps[round(0.95 * (len(gaps) - 1))]
    record_property("frame_ms", f"median {median:.1f}, 95 % below {most:.1f}")
    print(f"frames of {median:.1f} ms, 95 % below {most:.1f} ms, longest {gaps[-1]:.1f} ms")
    assert median < 17.5
    assert most < 17.5 + 1000 * phone.stutter_s + 17


@pytest.mark.gate
async def test_a_planned_stop_is_ended_in_the_row_of_its_car(phone: Phone, canned: Canned) -> None:
    cars = fleet.quiet()
    caracal = next(one for one in cars if one["name"] == "Caracal")["summary"]
    caracal["planned_stop"] = "charging"
    canned.refuses["end_planned_stop"] = "The session is busy."
    page = await opened(phone, canned, cars)
    row = page.locator('tr[data-car="Caracal"]')
    keys = page.locator("[data-act=end-stop]:visible")
    for size in (DESKTOP, {"width": 820, "height": 1180}, {"width": 360, "height": 740}):
        await page.set_viewport_size(size)  # type: ignore[arg-type]
        await expect(keys).to_have_count(1)
        await expect(row).to_contain_text("planned stop")
        assert await page.evaluate(UNFIT) == []
    await no_barrier(page, "a planned stop in a row")
    key = row.get_by_role("button", name="End the planned stop: Caracal")
    box = await key.bounding_box()
    assert box is not None
    assert box["height"] >= 56, "a finger finds it"
    await key.click()
    await expect(page.locator(".snack.note")).to_contain_text("Caracal: The session is busy.")
    assert sent(canned, "end_planned_stop") == [{"kind": "end_planned_stop", "vehicle": "Caracal"}]
    assert "/fleet" in page.url, "the key opens no car"
    caracal["planned_stop"] = None
    await expect(keys).to_have_count(0)


@pytest.mark.gate
async def test_a_viewer_ends_no_planned_stop(phone: Phone, canned: Canned) -> None:
    canned.role = "viewer"
    cars = fleet.quiet()
    cars[0]["summary"]["planned_stop"] = "charging"
    page = await opened(phone, canned, cars)
    await page.locator("[data-act=end-stop]:visible").click()
    await expect(page.locator(".snack.note")).to_contain_text("A viewer can only watch")
    assert sent(canned, "end_planned_stop") == []
