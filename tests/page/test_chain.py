"""Each part of the chain falls silent in turn: the page shows which, covers the values, and comes back by itself."""

from __future__ import annotations

import asyncio
import contextlib
import re
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import psutil
import pytest
import pytest_asyncio
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.drives import number, steady, twist, write
from tests.page.processes import Drive, driving, replay, running, server, simulate
from tests.page.radio import Radio
from tests.ports import free_port

CAR_S = 2.0  # what the design allows; to each is added what the looking and a busy machine cost: phone.slack_s
FROZEN_S = 2.5
VEIL_S = 2.25
BACK_S = 4.0


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def driven(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Drive]:
    async with driving(tmp_path_factory.mktemp("data")) as drive:
        yield drive


@pytest_asyncio.fixture(loop_scope="session")
async def drive(driven: Drive, phone: Phone) -> Drive:
    """A simulated car, a server that watches it, and the page live on it. What is frozen is thawed by the test."""
    await phone.open(driven[1].address)
    await phone.live()
    return driven


async def covered(phone: Phone, kind: str, sentence: str, within_s: float, began_s: float) -> None:
    """The veil stands and names the part, in time."""
    await expect(phone.f("veil")).to_have_attribute("data-on", kind)
    took_s = time.monotonic() - began_s
    assert took_s <= within_s + phone.slack_s, f"covered after {took_s:.2f} s"
    await expect(phone.f("veil-words")).to_contain_text(sentence)
    opacity = await phone.f("veil").evaluate("veil => getComputedStyle(veil).opacity")
    assert opacity == "1"


async def cut_between(phone: Phone, root: str, a: str, b: str) -> None:
    await expect(phone.page.locator(f"{root} .bigchain")).to_have_attribute(
        "aria-label", f"The link is broken between {a} and {b}"
    )


async def test_a_silent_car(phone: Phone, drive: Drive) -> None:
    car, _ = drive
    await car.type("all-silent 60")
    began_s = time.monotonic()
    await covered(phone, "values", "The car fell silent.", CAR_S, began_s)
    sheet = phone.page.locator("#sheet-lost")
    await expect(sheet).to_contain_text("The car may still be moving: watch the car.")
    await expect(phone.page.locator("#sheet-lost")).not_to_have_attribute("data-moved", "")
    await phone.page.keyboard.press("Escape")  # seen: the sheet goes, the veil stays
    await expect(sheet).to_be_hidden()
    await cut_between(phone, "#monitor .veil", "Bridge", "Car")
    await expect(phone.f("link-state")).to_have_text("Silent")
    await expect(phone.f("strip")).to_contain_text("The car fell silent")
    await expect(phone.f("veil-then")).to_have_text(re.compile(r"\d+\.\d m/s"))
    await expect(phone.page.locator(".checks li.ok")).to_have_count(0)
    await car.type("stop")
    await phone.live()
    await expect(phone.page.locator("dialog[open]")).to_have_count(0)


@pytest.mark.gate
async def test_case_12_and_13_a_frozen_bridge_is_said_on_every_tab_and_its_return_leads_back(
    phone: Phone, drive: Drive
) -> None:
    car, _ = drive
    for tab in ("home", "map", "scan", "files", "settings"):
        await phone.page.locator(f"[data-tab={tab}]").tap()
        car.freeze()
        sheet = phone.page.locator("#sheet-lost")
        await expect(sheet).to_be_visible()
        await expect(sheet).to_contain_text("The bridge does not answer.")
        await expect(sheet).to_contain_text("The car may still be moving")
        await cut_between(phone, "#sheet-lost", "Server", "Bridge")
        await expect(phone.f("veil")).to_have_attribute("data-on", "values")
        car.thaw()
        await phone.live()
        await expect(sheet).to_be_hidden()
        await expect(phone.page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")


async def test_a_frozen_bridge_is_said_in_time_and_its_return_too(phone: Phone, drive: Drive) -> None:
    car, _ = drive
    car.freeze()
    began_s = time.monotonic()
    await expect(phone.page.locator("#sheet-lost")).to_be_visible()
    assert time.monotonic() - began_s <= FROZEN_S + phone.slack_s
    car.thaw()
    back_s = time.monotonic()
    await phone.live()
    assert time.monotonic() - back_s <= BACK_S + phone.slack_s


async def test_a_killed_bridge_and_its_return_on_the_same_port(phone: Phone, tmp_path: Path) -> None:
    port = free_port()
    async with running(*simulate(port=port)) as car, running(*server(tmp_path, car.address)) as watch:
        await phone.open(watch.address)
        await phone.live()
        await car.kill()
        sheet = phone.page.locator("#sheet-lost")
        await expect(sheet).to_be_visible()
        await cut_between(phone, "#sheet-lost", "Server", "Bridge")
        await expect(phone.page.locator("#sheet-lost")).not_to_have_attribute("data-moved", "")
        await phone.page.keyboard.press("Escape")  # seen: the sheet goes, the veil and the strip stay
        await expect(sheet).to_be_hidden()
        await expect(phone.f("strip")).to_contain_text("Connection lost")
        await expect(phone.f("veil")).to_have_attribute("data-on", "values")
        async with running(*simulate(port=port)):
            back_s = time.monotonic()
            await phone.live()
            assert time.monotonic() - back_s <= BACK_S + phone.slack_s


@pytest.mark.gate
async def test_case_14_exit_from_a_lost_connection_leads_to_the_connect_screen(phone: Phone, tmp_path: Path) -> None:
    async with driving(tmp_path) as (car, watch):
        await phone.open(watch.address)
        await phone.live()
        await car.kill()
        await expect(phone.page.locator("#sheet-lost")).to_be_visible()
        await expect(phone.page.locator("#sheet-lost")).not_to_have_attribute("data-moved", "")
        await phone.page.locator("#sheet-lost [data-f=exit]").tap()
        await expect(phone.page.locator("#connect")).to_be_visible()
        await expect(phone.page.locator("dialog[open]")).to_have_count(0)


async def test_a_frozen_server_is_said_by_the_page_alone(phone: Phone, drive: Drive) -> None:
    _, watch = drive
    watch.freeze()
    began_s = time.monotonic()
    await covered(phone, "all", "The server fell silent.", VEIL_S, began_s)
    await cut_between(phone, "#monitor .veil", "This device", "Server")
    await expect(phone.f("link-state")).to_have_text("Lost")
    await expect(phone.page.locator(".gauge")).to_have_attribute("data-speed", "stale")
    await expect(phone.f("latitude")).to_have_attribute("data-ink", "stale")
    await expect(phone.f("distance")).to_have_attribute("data-ink", "stale")
    await expect(phone.page.locator("#sheet-lost")).to_be_visible(timeout=4000)
    await cut_between(phone, "#sheet-lost", "This device", "Server")
    watch.thaw()
    back_s = time.monotonic()
    await phone.live()
    assert time.monotonic() - back_s <= BACK_S + 1 + phone.slack_s
    await expect(phone.page.locator("#sheet-lost")).to_be_hidden()


@pytest.mark.gate
async def test_a_server_that_is_killed_and_started_again_is_survived(phone: Phone, tmp_path: Path) -> None:
    port = free_port()
    async with running(*simulate()) as car:
        async with running(*server(tmp_path, car.address, port)) as first:
            await phone.open(first.address)
            await phone.live()
        await expect(phone.f("veil")).to_have_attribute("data-on", "all")
        await expect(phone.f("veil-words")).to_contain_text("The server fell silent.")
        async with running(*server(tmp_path, car.address, port)):
            await phone.live()
            await expect(phone.page.locator("dialog[open]")).to_have_count(0)


@pytest.mark.gate
async def test_one_silent_signal_loses_its_ink_and_no_other(phone: Phone, drive: Drive) -> None:
    car, _ = drive
    await car.type("stale-gps 60")
    await expect(phone.f("latitude")).to_have_attribute("data-ink", "stale")
    await expect(phone.page.locator(".gauge")).to_have_attribute("data-speed", "fresh")
    await expect(phone.f("veil")).not_to_have_attribute("data-on", re.compile("."))
    await expect(phone.f("fuel-line")).to_be_hidden()
    await car.type("stop")


async def test_the_veil_comes_though_the_page_hangs(phone: Phone, drive: Drive) -> None:
    """The picture on the glass, taken by the browser while the page's script stands still."""
    before, hung = await hanging(phone, 3.5)
    assert before < 0.03, "the instruments were hatched before"
    assert hung > 0.1, "the veil did not come"
    await phone.live()


async def hanging(phone: Phone, seconds: float) -> tuple[float, float]:
    """How much of the view is hatched: just before the script hangs, and in the last picture while it hangs."""
    cdp = await phone.page.context.new_cdp_session(phone.page)
    pictures: list[tuple[float, str]] = []

    def keep(event: dict[str, Any]) -> None:
        pictures.append((time.monotonic(), event["data"]))
        task = asyncio.ensure_future(cdp.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]}))
        task.add_done_callback(lambda done: done.exception())

    cdp.on("Page.screencastFrame", keep)
    await cdp.send("Page.startScreencast", {"format": "png", "everyNthFrame": 1})
    await asyncio.sleep(0.7)
    began_s = time.monotonic()
    await phone.page.evaluate(
        """(ms) => void setTimeout(() => {
          const end = performance.now() + ms;
          while (performance.now() < end);
        }, 0)""",
        seconds * 1000,
    )
    await asyncio.sleep(seconds + 1)
    await cdp.send("Page.stopScreencast")
    before = [data for at_s, data in pictures if at_s < began_s][-1]
    hung = [data for at_s, data in pictures if began_s + 1 < at_s < began_s + seconds - 0.1][-1]
    return await hatched(phone, before), await hatched(phone, hung)


async def hatched(phone: Phone, picture: str) -> float:
    """Which share of the view has the colour of the veil's hatching."""
    share = await phone.page.evaluate(
        """async (data) => {
          const image = new Image();
          image.src = `data:image/png;base64,${data}`;
          await image.decode();
          const canvas = document.createElement('canvas');
          [canvas.width, canvas.height] = [image.width, image.height];
          const g = canvas.getContext('2d');
          g.drawImage(image, 0, 0);
          const top = Math.round(image.height * 0.18);
          const { data: pixels } = g.getImageData(0, top, image.width, Math.round(image.height * 0.12));
          let found = 0;
          for (let i = 0; i < pixels.length; i += 4) {
            found += [0x59, 0x64, 0x6a].every((value, k) => Math.abs(pixels[i + k] - value) < 10);
          }
          return found / (pixels.length / 4);
        }""",
        picture,
    )
    return float(share)


@pytest.mark.gate
async def test_a_page_that_slept_shows_the_veil_first(phone: Phone, drive: Drive) -> None:
    """Hidden and seen again: covered before anything is drawn. A browser under test never hides, so it is set to."""
    seen = await phone.page.evaluate(
        """() => {
          const veil = document.querySelector('#monitor .veil');
          const turn = (hidden) => {
            Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
            document.dispatchEvent(new Event('visibilitychange'));
            return veil.dataset.on;
          };
          return [turn(true), turn(false)];
        }"""
    )
    assert seen == ["all", "all"]
    await phone.live()


def running_renderers() -> list[psutil.Process]:
    """The processes of the browser's pages; one of a closed page may end meanwhile."""
    found = []
    for one in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):  # also one that has ended and is not yet waited for
            if "--type=renderer" in one.cmdline():
                found.append(one)
    return found


async def test_a_page_that_is_stopped_wakes_under_the_veil(phone: Phone, drive: Drive) -> None:
    """The browser's own process is stopped, as a phone's are in its sleep; old frames wait for it in its sockets."""
    await phone.page.evaluate(
        """() => {
          window.seen = [];
          const veil = document.querySelector('#monitor .veil');
          const note = () => window.seen.push(veil.dataset.on ?? 'lifted');
          new MutationObserver(note).observe(veil, { attributeFilter: ['data-on'] });
        }"""
    )
    renderers = running_renderers()
    for one in renderers:
        one.suspend()
    try:
        await asyncio.sleep(5)
    finally:
        for one in renderers:
            one.resume()
    await phone.page.wait_for_function("() => window.seen.length > 0")  # else what still stood from before would do
    await phone.live()
    assert (await phone.page.evaluate("window.seen"))[0] == "all"


async def test_a_radio_gap_hides_old_values_and_its_events_come_exactly_once(phone: Phone, tmp_path: Path) -> None:
    """The car begins to speed while the phone receives nothing; the alarm is there when it receives again, once."""
    drive = write(
        tmp_path / "late.bag",
        {
            "speed": lambda t: twist(4.2 if t < 9 else 12.6),
            "distance": lambda t: number(70 + 0.01 * t),
            "bearing": lambda t: number(0.001 * t),
        },
        seconds=40,
    )
    async with running(*replay(drive, "--wait")) as car, running(*server(tmp_path / "data", car.address)) as watch:
        radio = Radio(int(watch.address.rsplit(":", 1)[1]))
        async with radio.on_air() as address:
            await phone.open(address)
            await phone.live()
            radio.cut()
            began_s = time.monotonic()
            await covered(phone, "all", "The server fell silent.", VEIL_S, began_s)
            assert await phone.page.locator("#sheet-alarm[open]").count() == 0
            await asyncio.sleep(9)
            radio.mend()
            note = phone.page.locator(".snack.note")
            await expect(note).to_contain_text(re.compile(r"No data for \d+ s; 1 alarm began, 0 ended"))
            await expect(phone.page.locator("#sheet-alarm")).to_contain_text("Speed above limit")
            await phone.page.locator("#sheet-alarm [data-f=acknowledge]").tap()
            await phone.f("strip").tap()
            await phone.page.locator("[data-f=screen] button[data-screen=log]").tap()
            raised = phone.page.locator("[data-f=happened] .t", has_text=re.compile("^Speed above limit$"))
            await expect(raised).to_have_count(1)
            await expect(phone.page.locator(".log .gap")).to_have_count(1)


@pytest.mark.gate
async def test_case_03_connected_but_no_message(phone: Phone, tmp_path: Path) -> None:
    """Topics are there, nothing is published on them: what a bridge looks like after a restart of roscore."""
    drive = steady(tmp_path / "steady.bag", 4.2)
    async with (
        running("replay", str(drive), "--port", "0", "--stay", "--rate", "100") as car,
        running(*server(tmp_path / "data")) as watch,
    ):
        await asyncio.sleep(1)  # all was published before anyone subscribed
        await phone.open(watch.address)
        await phone.page.fill("#address", car.shown)
        await phone.f("go", "#connect").tap()
        sheet = phone.page.locator("#sheet-mute")
        await expect(sheet).to_contain_text("Connected, but no message", timeout=12_000)
        await cut_between(phone, "#sheet-mute", "Bridge", "Car")
        await sheet.locator("[data-f=retry]").tap()
        await expect(sheet).to_be_hidden()
        await expect(sheet).to_be_visible(timeout=12_000)
        await sheet.locator("[data-f=exit]").tap()
        await expect(phone.page.locator("#connect")).to_be_visible()


@pytest.mark.parametrize("every_s", [0.6, 0.7, 0.9])
async def test_seldom_states_are_not_covered(phone: Phone, canned: Canned, every_s: float) -> None:
    """Between two of them the page draws on its own; each fresh one rewinds the cover all the same."""
    canned.states_every_s = every_s
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.page.evaluate(
        """() => {
          window.covered = 0;
          const veil = document.querySelector('#monitor .veil');
          setInterval(() => { window.covered += Number(getComputedStyle(veil).opacity === '1'); }, 20);
        }"""
    )
    await phone.page.wait_for_timeout(5000)
    assert await phone.page.evaluate("() => window.covered") == 0
