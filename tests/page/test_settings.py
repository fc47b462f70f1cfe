"""Settings: limits set by thumb, key and number; other pages, refusals, undo; topics, units, files; for everyone."""

from __future__ import annotations

import asyncio
import re
import time
import tomllib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, cast

import httpx
import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, expect

from monitor.catalog import AllLimits
from monitor.check import Limits
from tests.http import http_client
from tests.page.barriers import fits_all, no_barrier
from tests.page.canned import Canned
from tests.page.conftest import PHONE, Phone, phone_in
from tests.page.processes import UNHURRIED, Process, running, server, simulate
from tests.page.touch import stroke

LIMIT = "speed_limit.max_mps"


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """A server that watches a simulated car."""
    data = tmp_path_factory.mktemp("data")
    async with running(*simulate()) as car, running(*server(data, car.address)) as process:
        yield process


@pytest_asyncio.fixture(loop_scope="session")
async def api(watch: Process) -> AsyncIterator[httpx.AsyncClient]:
    """The server's own answers; at the end all settings are as at first, and what they raised is over."""
    async with http_client(base_url=watch.console, headers={"x-catgraph-name": "Another"}) as client:
        yield client
        (await client.put("/api/settings.toml", content=UNHURRIED)).raise_for_status()
        async with asyncio.timeout(20):
            while fast := [a for a in (await client.get("/api/alarms")).json()["alarms"] if a["id"] == "speed_limit"]:
                body = {"occurrence": fast[0]["occurrence"]}
                await client.post("/api/alarms/speed_limit/acknowledge", json=body)
                await asyncio.sleep(0.2)


async def limit(api: httpx.AsyncClient, name: str = LIMIT) -> float:
    found: float = (await api.get("/api/settings")).json()["values"][name]
    return found


async def until_limit(api: httpx.AsyncClient, value: float, name: str = LIMIT) -> None:
    async with asyncio.timeout(8):
        while await limit(api, name) != value:
            await asyncio.sleep(0.05)


async def gets_below(api: httpx.AsyncClient, value: float, within_s: float = 4.0) -> bool:
    """Whether the limit gets below this value in time."""
    until_s = time.monotonic() + within_s
    while not (is_below := await limit(api) < value) and time.monotonic() < until_s:
        await asyncio.sleep(0.05)
    return is_below


async def settings(phone: Phone, watch: Process | Canned) -> None:
    """Opens the tab and waits until its limits stand there."""
    await phone.open(f"{watch.address}/#settings")
    await phone.live()
    await expect(row(phone)).to_be_visible()
    await expect(number(phone)).to_be_enabled()


def titles(toml: str) -> list[str]:
    """What the settings of a file are called on the page."""
    groups = AllLimits.model_fields
    return [
        str(cast("type[Limits]", groups[group].annotation).model_fields[name].title)
        for group, values in tomllib.loads(toml)["limits"].items()
        for name in values
    ]


def row(phone: Phone, name: str = LIMIT) -> Locator:
    return phone.page.locator(f'[data-setting="{name}"]')


def number(phone: Phone, name: str = LIMIT) -> Locator:
    return row(phone, name).locator("input.v")


def slider(phone: Phone, name: str = LIMIT) -> Locator:
    return row(phone, name).locator("input[type=range]")


async def drag(phone: Phone, one: Locator, share: float) -> None:
    """A finger takes the thumb of a slider and leaves it at a share of the whole."""
    await one.scroll_into_view_if_needed()
    box = await one.bounding_box()
    assert box is not None
    now = await one.evaluate("one => one.value / one.max")
    x, y, wide = box["x"] + 28, box["y"] + 22, box["width"] - 56
    await stroke(phone.page, (x + now * wide, y, x + share * wide, y))


async def type_number(phone: Phone, text: str, name: str = LIMIT) -> None:
    await number(phone, name).fill(text)
    await phone.page.keyboard.press("Enter")


async def test_a_limit_dragged_below_the_speed_raises_the_alarm(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    await settings(phone, watch)
    await phone.page.evaluate("document.body.dispatchEvent(new Event('pointerup'))")
    for _ in range(3):  # as a person does where a dialog came up under the finger, or a busy browser dropped the stroke
        await phone.no_snackbar()
        await drag(phone, slider(phone), 0.02)
        if await gets_below(api, 2.0):
            break
    assert await limit(api) < 2.0
    await expect(phone.page.locator("#sheet-alarm[open]")).to_contain_text("Speed above limit", timeout=15_000)
    await expect(phone.page.locator("#tab-settings")).to_have_attribute("aria-selected", "true")  # no tab was swiped


@pytest.mark.gate
async def test_a_stroke_over_the_sliders_scrolls_and_sets_nothing(phone: Phone, canned: Canned) -> None:
    await settings(phone, canned)
    box = await slider(phone).bounding_box()
    assert box is not None
    await phone.page.touchscreen.tap(box["x"] + box["width"] * 0.8, box["y"] + 22)  # beside the thumb
    await stroke(phone.page, (300, 700, 300, 300))
    await phone.page.wait_for_function("() => document.querySelector('#panel-settings').scrollTop > 50")
    assert [one for one in canned.received if one["kind"] == "set"] == []
    await expect(number(phone)).to_have_value("11.0")


async def test_another_page_sees_the_change_and_is_told_by_whom(
    phone: Phone, browser: Browser, watch: Process, api: httpx.AsyncClient
) -> None:
    await settings(phone, watch)
    context = await browser.new_context(**PHONE)
    other = await phone_in(context)
    await settings(other, watch)
    await type_number(phone, "13,5")
    await expect(number(other)).to_have_value("13.5")
    await expect(other.page.locator(".snack.note")).to_contain_text("Speed limit: 11 → 13.5 m/s")
    await expect(row(other).locator(".usual")).to_have_text("default 11")
    await context.close()


async def test_what_is_typed_is_taken_with_comma_or_point_or_refused_in_words(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    await settings(phone, watch)
    await type_number(phone, "13,25")
    await until_limit(api, 13.25)
    await expect(number(phone)).to_have_value("13.25")
    for typed, why in (
        ("95", "0.5 to 40 m/s is allowed"),
        ("fast", "“fast” is not a number"),
        ("", "a number is required"),
    ):
        await type_number(phone, typed)
        await expect(row(phone).locator(".msg")).to_contain_text(why)
        await expect(number(phone)).to_have_value("13.25")
    await number(phone).fill("3")
    await phone.page.keyboard.press("Escape")
    await expect(number(phone)).to_have_value("13.25")
    assert await limit(api) == 13.25


async def test_what_the_server_refuses_goes_back_and_its_sentence_stands_there(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    """Another page changed something between display and press: the page shows that and shows what is in force."""
    await settings(phone, watch)
    # This page's own wire is held for the length of a change by another: what it sends names a version that is over.
    await phone.page.evaluate("""() => {
      const send = WebSocket.prototype.send;
      WebSocket.prototype.send = function (text) {
        if (typeof text !== 'string' || !text.includes('"kind":"set"')) return send.call(this, text);
        WebSocket.prototype.send = send;
        fetch('/api/settings', { method: 'PATCH', headers: { 'content-type': 'application/json' },
          body: JSON.stringify({ values: { 'obstacle.standoff_m': 7 } }) }).then(() => send.call(this, text));
      };
    }""")
    await type_number(phone, "19")
    await expect(row(phone).locator(".msg")).to_contain_text("Somebody else changed the settings meanwhile")
    await expect(number(phone)).to_have_value("11.0")
    await expect(number(phone, "obstacle.standoff_m")).to_have_value("7.0")
    assert await limit(api) == 11.0
    await type_number(phone, "19")
    await until_limit(api, 19.0)


async def test_a_hand_on_the_slider_is_told_when_another_page_sets_the_same(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    await settings(phone, watch)
    await slider(phone).focus()
    for _ in range(3):
        await phone.page.keyboard.press("ArrowRight")
    assert await row(phone).get_attribute("data-open") is not None  # not confirmed yet, and it looks so
    await expect(slider(phone)).to_have_attribute("aria-valuetext", re.compile("not confirmed yet"))
    await until_limit(api, 11.3)
    await expect(row(phone)).not_to_have_attribute("data-open", re.compile(""))
    await expect(slider(phone)).to_have_attribute("aria-valuetext", "11.3 m/s")


async def test_tapping_the_default_resets_and_undo_takes_back(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    await settings(phone, watch)
    undo = phone.page.locator(".find .undo")
    await expect(undo).to_be_disabled()
    await type_number(phone, "20")
    await until_limit(api, 20.0)
    await row(phone).locator(".usual").tap()
    await until_limit(api, 11.0)
    await expect(number(phone)).to_have_value("11.0")
    await type_number(phone, "15")
    await until_limit(api, 15.0)
    await expect(undo).to_have_attribute("aria-label", "Undo Speed limit: 15.0 → 11.0 m/s")
    await undo.tap()
    await until_limit(api, 11.0)
    await expect(undo).to_be_disabled()
    await expect(phone.page.locator(".snack.note")).to_contain_text("Taken back")


async def test_reset_all_names_what_changes_and_asks(phone: Phone, watch: Process, api: httpx.AsyncClient) -> None:
    await api.patch("/api/settings", json={"values": {LIMIT: 18.0, "obstacle.wheelbase_m": 3.0}})
    await settings(phone, watch)
    await expect(number(phone)).to_have_value("18.0")
    await phone.page.locator("[data-part=reset]").tap()
    sheet = phone.page.locator("#sheet-reset")
    wide = [re.compile(f"^{title}: ") for title in titles(UNHURRIED)]  # of what every server of these tests starts with
    await expect(sheet.locator("li")).to_have_text(["Speed limit: 18.0 → 11.0 m/s", "Wheelbase: 3.00 → 2.62 m", *wide])
    await no_barrier(phone.page, "reset", "#sheet-reset")
    await sheet.locator("[data-f=no]").tap()
    assert await limit(api) == 18.0
    await phone.page.locator("[data-part=reset]").tap()
    await sheet.locator("[data-f=yes]").tap()
    await until_limit(api, 11.0)
    assert await limit(api, "obstacle.wheelbase_m") == 2.62
    await phone.page.locator(".find .undo").tap()
    await until_limit(api, 18.0)
    assert await limit(api, "obstacle.wheelbase_m") == 3.0


async def test_a_limit_shows_the_last_minute_of_its_signal_while_it_is_in_sight(phone: Phone, canned: Canned) -> None:
    await settings(phone, canned)
    traces = phone.page.locator("[data-setting] .trace")
    assert await traces.evaluate_all("all => all.map((one) => one.closest('[data-setting]').dataset.setting)") == [
        LIMIT, "obstacle.standoff_m",
    ]  # fmt: skip
    await expect(row(phone).locator(".trace[data-drawn]")).to_be_visible()
    folded = phone.page.locator(".group:not([open]) .trace[data-drawn]")
    await expect(folded).to_have_count(0)
    requests: list[str] = []
    phone.page.on("request", lambda request: requests.append(request.url))
    await phone.page.wait_for_timeout(1500)
    assert [url for url in requests if "/api/trends" in url or "/api/checks" in url] == []


@pytest.mark.gate
async def test_a_search_shows_what_it_names_and_nothing_else(phone: Phone, canned: Canned) -> None:
    await settings(phone, canned)
    search = phone.page.locator(".find input")
    await search.fill("WHEEL base")
    await expect(phone.page.locator(".set:visible")).to_have_count(1)
    await expect(row(phone, "obstacle.wheelbase_m")).to_be_visible()
    await expect(number(phone, "obstacle.wheelbase_m")).to_have_value("2.62")
    await expect(phone.page.locator(".topic:visible")).to_have_count(0)
    await search.fill("<img src=x>")
    await expect(phone.page.locator(".nothing")).to_have_text("No setting matches “<img src=x>”.")
    await search.fill("navsatfix")
    await expect(phone.page.locator(".topic:visible")).to_have_count(1)
    await search.fill("")
    await expect(row(phone)).to_be_visible()
    await expect(row(phone, "obstacle.wheelbase_m")).to_be_hidden()


async def test_rates_and_deadbands_are_folded_away_for_experts(phone: Phone, watch: Process) -> None:
    """They are opened by a tap or a key, and found by a search."""
    await settings(phone, watch)
    expert = phone.page.locator("#panel-settings details.group:has(.set)").last
    await expect(expert.locator("summary .h")).to_have_text("Expert")
    rate, deadband = row(phone, "signals.speed_hz"), row(phone, "speed_limit.deadband_mps")
    await expect(rate).to_be_hidden()
    await expect(deadband).to_be_hidden()
    await expert.locator("summary").tap()
    await expect(rate).to_be_visible()
    await expert.locator("summary").press("Enter")
    await expect(deadband).to_be_hidden()
    await phone.page.get_by_role("searchbox", name="Search settings").fill("deadband")
    await expect(deadband).to_be_visible()


async def test_every_threshold_of_the_server_has_its_row(phone: Phone, watch: Process, api: httpx.AsyncClient) -> None:
    await settings(phone, watch)
    schema = (await api.get("/api/settings")).json()["schema"]
    found = await phone.page.evaluate("[...document.querySelectorAll('.set')].map((one) => one.dataset.setting)")
    headings = list(dict.fromkeys(field["heading"] for field in schema.values()))
    assert found == sorted(schema, key=lambda name: headings.index(schema[name]["heading"]))  # each heading once
    assert await phone.page.locator(".group:has(.set) summary .h").all_text_contents() == headings


async def test_every_row_is_reached_and_set_by_keys_alone(phone: Phone, watch: Process, api: httpx.AsyncClient) -> None:
    await settings(phone, watch)
    await phone.page.evaluate("document.querySelectorAll('.group').forEach((one) => { one.open = true; })")
    schema = (await api.get("/api/settings")).json()["schema"]
    reached = await phone.page.evaluate(
        """() => [...document.querySelectorAll('#panel-settings :is(input, button, summary)')]
          .filter((one) => one.tabIndex >= 0 && one.checkVisibility() && !one.matches(':disabled'))
          .flatMap((one) => Object.values(one.closest('[data-setting], [data-signal], [data-part]')?.dataset ?? {}))"""
    )
    assert set(schema) <= set(reached)
    assert {"speed", "fuel", "profile", "export", "import"} <= set(reached)
    await number(phone).focus()
    order = []
    for _ in range(3):
        order.append(await phone.page.evaluate("document.activeElement.className || document.activeElement.type"))
        await phone.page.keyboard.press("Tab")
    assert order == ["n v", "usual", "range"]
    pause = "paused_long.after_min"
    await slider(phone, pause).focus()
    for key, value in (("Home", 0.5), ("PageUp", 5.5), ("ArrowUp", 6.0), ("ArrowLeft", 5.5), ("End", 60.0)):
        await phone.page.keyboard.press(key)
        await until_limit(api, value, pause)


async def test_a_threshold_that_is_on_or_off_is_a_switch(phone: Phone, watch: Process, api: httpx.AsyncClient) -> None:
    await settings(phone, watch)
    await phone.page.locator(".find input").fill("unknown gps quality")
    switch = row(phone, "gps_fix.strict").get_by_role("switch", name="Reject unknown GPS quality")
    await expect(switch).to_have_attribute("aria-checked", "false")
    await switch.tap()
    await until_limit(api, 1.0, "gps_fix.strict")
    await expect(switch).to_have_attribute("aria-checked", "true")


async def test_units_follow_everywhere_and_the_wire_stays_si(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    await settings(phone, watch)
    await phone.f("menu").tap()
    await phone.page.locator("#sheet-menu").get_by_text("Preferences").tap()
    await phone.page.locator('[data-unit-key="km/h"]').tap()
    await expect(phone.page.locator('[data-unit-key="km/h"]')).to_have_attribute("aria-pressed", "true")
    await phone.page.keyboard.press("Escape")
    await expect(number(phone)).to_have_value("39.6")
    await expect(row(phone).locator(".u")).to_have_text("km/h")
    await expect(row(phone).locator(".high")).to_have_text("144")
    await expect(number(phone, "obstacle.standoff_m")).to_have_value("5.0")
    await type_number(phone, "7,2")
    await until_limit(api, 2.0)
    sheet = phone.page.locator("#sheet-alarm[open]")
    await expect(sheet.locator("[data-f=limit-unit]")).to_have_text("km/h", timeout=15_000)
    await expect(sheet.locator("[data-f=limit]")).to_have_text("7.2")
    await phone.acknowledge_all()
    await phone.page.locator("[data-tab=home]").tap()
    await expect(phone.page.locator(".gauge .lim")).to_have_text("limit 7.2")
    await expect(phone.page.locator(".gauge .unit").last).to_contain_text("km/h")
    await expect(phone.page.locator("[role=meter][aria-label=Speed]")).to_have_attribute(
        "aria-valuetext", re.compile("kilometres an hour")
    )
    await phone.page.reload()  # it is kept on this phone
    await phone.live()
    await expect(phone.page.locator(".gauge .unit").last).to_contain_text("km/h")


async def test_the_log_beneath_preferences_follows_the_unit(
    phone: Phone, watch: Process, api: httpx.AsyncClient
) -> None:
    await api.patch("/api/settings", json={"values": {LIMIT: 20.0}})
    await settings(phone, watch)
    for screen in ("Alarm log", "Preferences"):
        await phone.f("menu").tap()
        await phone.page.locator("#sheet-menu").get_by_text(screen).tap()
    log = phone.page.locator(".screen")
    await expect(log).to_contain_text("→ 20 m/s")
    await phone.page.locator('[data-unit-key="km/h"]').tap()
    await expect(log).to_contain_text("→ 72 km/h")


async def test_the_file_goes_out_and_comes_in_and_a_bad_one_is_refused_in_words(
    phone: Phone, watch: Process, api: httpx.AsyncClient, tmp_path: Path
) -> None:
    await api.patch("/api/settings", json={"values": {LIMIT: 17.5}, "topics": {"fuel": "/other"}})
    await settings(phone, watch)
    await expect(number(phone)).to_have_value("17.5")
    async with phone.page.expect_download() as download:
        await phone.page.locator("[data-part=export]").tap()
    out = await download.value
    assert out.suggested_filename == "catgraph-car.toml"
    kept = tmp_path / "kept.toml"
    await out.save_as(kept)
    assert "max_mps = 17.5" in kept.read_text()
    await api.put("/api/settings.toml", content=UNHURRIED)
    await expect(number(phone)).to_have_value("11.0")
    picker = phone.page.locator("input[type=file]")
    await picker.set_input_files(kept)
    await until_limit(api, 17.5)
    assert (await api.get("/api/settings")).json()["topics"] == {"fuel": "/other"}
    note = phone.page.locator(".snack.note")
    await expect(note).to_contain_text("2 settings changed")
    bad: tuple[tuple[str, bytes, str], ...] = (
        ("text.toml", b"[limits", "This is not TOML"),
        ("range.toml", b"[limits.speed_limit]\nmax_mps = 400.0", "Speed limit: 0.5 to 40 m/s is allowed."),
        ("newer.toml", b"[limits.speed_limit]\nwarp = 9.0", "There is no setting named speed_limit.warp."),
        ("photo.toml", b"\xff\xd8\xff\xe0", "is not text"),
        ("large.toml", b"#" * 70_000, "at most 64 kB"),
        ("empty.toml", b"", "is empty"),
    )
    for name, body, why in bad:
        await picker.set_input_files({"name": name, "mimeType": "text/plain", "buffer": body})
        await expect(note).to_contain_text(why)
        await expect(note).to_contain_text("Not imported")
    assert await limit(api) == 17.5
    await phone.page.locator(".find .undo").tap()
    await until_limit(api, 11.0)
    phone.complaints[:] = [line for line in phone.complaints if "422" not in line]


async def test_another_topic_is_picked_and_given_back(phone: Phone, watch: Process, api: httpx.AsyncClient) -> None:
    async def topic() -> Any:
        return (await api.get("/api/state")).json()["signals"]["speed"]["topic"]

    await settings(phone, watch)
    speed = phone.page.locator('.topic[data-signal="speed"]')
    await expect(speed).to_contain_text("/catvehicle/vel")
    await expect(speed).to_contain_text("speed · Twist")
    await expect(speed.locator(".r")).to_contain_text("Hz")
    await speed.tap()
    sheet = phone.page.locator("#sheet-topic")
    await expect(sheet).to_contain_text("match this signal")
    await expect(sheet.get_by_role("button", pressed=True)).to_contain_text("Choose automatically")
    assert "NavSatFix" not in await sheet.inner_text()
    await sheet.get_by_text("/gps_odom").tap()
    await expect(sheet).to_be_hidden()
    await expect(speed).to_contain_text("/gps_odom")
    await expect(speed).to_contain_text("chosen by you")
    assert await topic() == "/gps_odom"
    await phone.f("menu").tap()  # and back again from the screen of all signals
    await phone.page.locator("#sheet-menu").get_by_text("Signals").tap()
    await phone.page.locator(".sigs .sig").first.tap()
    await phone.page.get_by_role("button", name="Choose another topic").tap()
    await sheet.get_by_text("Choose automatically").tap()
    await expect(sheet).to_be_hidden()
    async with asyncio.timeout(8):
        while await topic() != "/catvehicle/vel":
            await asyncio.sleep(0.05)


async def test_the_kind_of_car_is_shown_and_chosen(phone: Phone, watch: Process, api: httpx.AsyncClient) -> None:
    await settings(phone, watch)
    profile = phone.page.locator("[data-part=profile]")
    await expect(profile).to_contain_text("CATVehicle, as recognised")
    await profile.tap()
    sheet = phone.page.locator("#sheet-profile")
    await expect(sheet.get_by_role("button", pressed=True)).to_contain_text("As recognised")
    await sheet.get_by_text("Any car").tap()
    await expect(sheet).to_be_hidden()
    await expect(profile).to_contain_text("Any car, chosen")
    assert (await api.get("/api/settings")).json()["profile"]["chosen"] == "generic"


async def test_without_the_server_nothing_pretends_to_be_set(phone: Phone, tmp_path: Path) -> None:
    async with running(*simulate()) as car, running(*server(tmp_path, car.address)) as watch:
        await settings(phone, watch)
        watch.freeze()
        await number(phone).fill("9")
        await phone.page.keyboard.press("Enter")
        await expect(number(phone)).to_be_disabled()
        await expect(slider(phone)).to_be_disabled()
        await expect(phone.page.locator("p.state[data-bad]")).to_contain_text("nothing can be changed")
        await expect(row(phone).locator(".msg")).to_contain_text("Not changed.")
        await expect(number(phone)).to_have_value("11.0")
        watch.thaw()
        await expect(number(phone)).to_be_enabled(timeout=15_000)
        await expect(phone.page.locator("p.state[data-bad]")).to_have_count(0)


async def test_each_alarm_sound_can_be_tried_before_a_car_is_connected(phone: Phone, tmp_path: Path) -> None:
    async with running(*server(tmp_path)) as watch:
        await phone.open(watch.address)
        await phone.page.locator("#connect [data-f=settings]").tap()
        message = phone.page.locator("[data-f=sound-message]")
        for sound, text in (("high", "ten quick"), ("medium", "three rising"), ("low", "two falling")):
            await phone.page.locator(f"[data-sound-key={sound}]").tap()
            await expect(message).to_contain_text(text)


async def test_the_slow_down_goes_under_the_left_thumb_and_stop_to_the_far_corner(phone: Phone, watch: Process) -> None:
    await settings(phone, watch)
    await phone.page.get_by_role("button", name="Preferences of this device").tap()
    await phone.page.locator("[data-hand-key=left]").tap()
    await phone.page.locator("#sheet-preferences [data-f=no]").tap()
    boxes = [await phone.page.locator(f".board > .rail [data-f={f}]").bounding_box() for f in ("slow", "pause", "stop")]
    assert [box["x"] for box in boxes if box] == sorted(box["x"] for box in boxes if box)
    await phone.page.reload()
    assert await phone.page.evaluate("document.documentElement.dataset.hand") == "left"


@pytest.mark.own_phone
async def test_a_phone_that_cannot_sound_is_told_plainly(phone: Phone, watch: Process) -> None:
    await phone.page.add_init_script("delete window.AudioContext")
    await settings(phone, watch)
    await phone.page.get_by_role("button", name="Preferences of this device").tap()
    await phone.page.locator("[data-sound-key=high]").tap()
    await expect(phone.page.locator("[data-f=sound-message]")).to_contain_text("This browser has no sound")


async def test_with_all_of_it_open_it_keeps_nobody_out_and_fits_every_screen(phone: Phone, canned: Canned) -> None:
    await settings(phone, canned)
    await type_number(phone, "99")
    await expect(row(phone).locator(".msg")).to_be_visible()
    await phone.page.evaluate("document.querySelectorAll('.group').forEach((one) => { one.open = true; })")
    await expect(phone.page.locator("#panel-settings .people-list input").first).to_have_value("A. K.")
    await no_barrier(phone.page, "tab", "#panel-settings")
    await fits_all(phone.page, "tab")
    for width in (320, 412, 1180):
        await phone.page.set_viewport_size({"width": width, "height": 820})
        small = await phone.page.evaluate(
            """() => [...document.querySelectorAll('#panel-settings :is(button, summary, .v, .field)')]
              .filter((one) => one.getClientRects().length)
              .map((one) => [one.outerHTML.slice(0, 80), one.getBoundingClientRect()])
              .filter(([, box]) => box.height < 55.5 || box.width < 55.5)
              .map(([text, box]) => [text, box.width, box.height])"""
        )
        assert small == [], width
    await phone.page.locator("[data-part=profile]").tap()
    await expect(phone.page.locator("#sheet-profile")).to_be_visible()
    await no_barrier(phone.page, "profile", "#sheet-profile")
