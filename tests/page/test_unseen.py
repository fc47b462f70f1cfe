"""The metres unseen on the page: whenever the speed is covered, as a bound, and never as 0 where it is not known."""

from __future__ import annotations

import re
from typing import Any

import pytest
from playwright.async_api import expect

from monitor.catalog import AllLimits, flat
from tests.page.canned import Canned, live
from tests.page.conftest import Phone

pytestmark = pytest.mark.gate
OPEN = "name => dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: name } }))"


def state(speed: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A car at 4.2 m/s whose speed is as given; `more`: other limits."""
    shown = live()
    shown["limits"] |= flat(AllLimits()) | more
    shown["signals"]["speed"] |= speed
    return shown


async def test_a_covered_speed_says_how_far_the_car_may_have_driven(phone: Phone, canned: Canned) -> None:
    unseen, why = phone.page.locator('.gauge [data-f="unseen"]'), phone.page.locator(".gauge .why")
    canned.state = state({})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.page.locator(".gauge .speed")).to_have_text("4.2")
    await expect(unseen).to_be_empty()
    canned.state = state({"freshness": "stale", "age_s": 60.0})
    await expect(unseen).to_have_text(re.compile(r"^≤ [56]\.\d km unseen$"))  # 4.2 · 60 + 3 · 60² / 2, and the way here
    await expect(why).to_have_attribute("aria-label", re.compile(r"^Speed: STALE 1:\d\d s, ≤ [56]\.\d km unseen\. "))
    canned.state = state({"freshness": "stale", "age_s": 60.0, "value": {"speed_mps": None, "yaw_rate_radps": None}})
    await expect(unseen).to_have_text("driven: unknown")
    canned.state = state({"freshness": "ageing", "age_s": 60.0, "value": {"speed_mps": 0.0, "yaw_rate_radps": None}})
    await expect(unseen).to_have_text(re.compile(r"^≤ [56]\.\d km unseen$"))


async def test_the_speed_of_a_late_link_is_proposed_where_the_setting_says_so(phone: Phone, canned: Canned) -> None:
    late: dict[str, Any] = {"freshness": "ageing", "age_s": 10.1, "delay_s": 10.0}
    canned.state = state(late)
    canned.state["link"]["late_s"] = 10.0
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    gauge = phone.page.locator(".gauge")
    await expect(gauge).to_contain_text(re.compile(r"≤ \d+ m unseen"))
    await expect(gauge).not_to_contain_text("2.78")
    canned.state["limits"]["unseen.proposes_speed"] = 1.0
    await expect(gauge).to_contain_text("≤ 0.2 m/sfor 2.78 m")
    canned.state["link"]["late_s"] = None
    await expect(gauge).to_contain_text("delaynot known")


async def test_a_gap_says_it_on_the_veil_on_the_sheet_and_in_the_log(phone: Phone, canned: Canned) -> None:
    canned.state = state({"age_s": 100.0})
    about = {"alarm": "not_moving", "title": "Car not moving", "text": "", "occurrence": 1, "priority": "advisory"}
    canned.log = [{"n": 117, "at_ms": 1_778_076_238_000, "change": "cleared"} | about]
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    canned.silent = True
    await expect(phone.f("veil-then")).to_have_text(re.compile(r"4\.2 m/s.*, ≤ \d\d\.\d km unseen$"), timeout=15_000)
    await expect(phone.page.locator('#sheet-lost [data-f="more"]')).to_have_text(
        re.compile(r"Last known: 4\.2 m/s.*, ≤ \d\d\.\d km unseen\.$"), timeout=15_000
    )
    canned.silent = False
    await phone.live()
    await phone.page.evaluate(OPEN, "log")
    await expect(phone.page.locator(".log .gap").first).to_contain_text(re.compile(r", ≤ \d\d\.\d km unseen$"))


@pytest.mark.parametrize("width", [360, 412, 1440, 1920])
async def test_how_far_it_may_have_driven_touches_neither_the_speed_nor_the_acceleration(
    phone: Phone, canned: Canned, width: int
) -> None:
    """In units of the gauge: a digit begins 80 above its foot, a letter 11."""
    canned.state = state({"freshness": "ageing", "age_s": 0.62})
    await phone.page.set_viewport_size({"width": width, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.page.locator('.gauge [data-f="unseen"]')).to_have_text(re.compile("unseen$"))
    at = "(name) => Number(document.querySelector(`.gauge ${name}`).getAttribute('y'))"
    push, way, speed = [await phone.page.evaluate(at, name) for name in (".aval", "[data-f=unseen]", ".speed")]
    assert speed - 80 - way >= 4
    assert way - 11 - push >= 4
