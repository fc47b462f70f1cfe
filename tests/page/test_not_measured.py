"""At the width of a phone: a signal of which messages come, but no value, is shown as that, with the reason."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone

pytestmark = pytest.mark.gate
CUT = "all => all.filter((one) => one.scrollWidth > one.clientWidth + 1).map((one) => one.textContent)"
GONE = {"value": None, "age_s": None, "horizon_s": None, "topic": "/car/topic", "count": 40, "rate_hz": 20.0}


def without_value(canned: Canned, name: str, freshness: str, why: str) -> None:
    canned.state["signals"][name] |= GONE | {"freshness": freshness, "note": why, "unusable": why}


async def test_home_and_signals_say_not_measured_and_why(phone: Phone, canned: Canned) -> None:
    for name in ("fuel", "heading", "acceleration", "distance"):
        without_value(canned, name, "not_measured", "not measured (present is false)")
    without_value(canned, "brake", "no_value", "not a number (data)")
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    for name in ("fuel", "heading"):
        await expect(phone.f(name)).to_have_text("not measured")
    await expect(phone.f("brake")).to_have_text("no value")
    await expect(phone.page.locator(".near [data-f=none]")).to_have_text("not measured")
    await expect(phone.page.locator("#panel-home .gauge .aval")).to_have_text("acceleration –")
    meter = phone.page.get_by_role("meter", name="Acceleration")
    await expect(meter).to_have_attribute("aria-valuetext", "not measured")
    assert await phone.page.locator("#panel-home .n, #panel-home .v").evaluate_all(CUT) == []
    assert await phone.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    await phone.page.evaluate("dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: 'signals' } }))")
    row = phone.page.locator(".sigs .sig", has_text="Fuel")
    await expect(row).to_contain_text("not measured")
    await row.tap()
    await expect(phone.page.locator(".sig-more:not([hidden])")).to_contain_text("not measured (present is false)")
    await expect(phone.page.locator(".sigs .sig", has_text="Brake")).to_contain_text("no value")
    assert await phone.page.locator(".sigs .sig > span").evaluate_all(CUT) == []
