"""The Mark key comes after the page is complete; what a finger may be on its way to stays where it is."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone

WHERE = """() => ['.view', '.ledge', '.rail', '[data-do=slow], .rail .slide, .rail [data-f=pause]'].map((name) => {
  const element = document.querySelector(`#monitor > ${name}, #monitor ${name}`);
  const { x, y, width, height } = element.getBoundingClientRect();
  return [name, Math.round(x), Math.round(y), Math.round(width), Math.round(height)];
})"""


@pytest.mark.parametrize(("width", "height"), [(360, 740), (412, 915), (820, 1180), (1440, 900)])
async def test_nothing_moves_when_the_mark_key_comes(phone: Phone, canned: Canned, width: int, height: int) -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await phone.open(canned.address)
    await phone.live()
    key = phone.page.locator('[data-f="mark"]')
    before = await phone.page.evaluate(WHERE)
    assert await key.count() == 0, "measured before it came"
    await expect(key).to_be_visible(timeout=15_000)
    assert await phone.page.evaluate(WHERE) == before
    assert (await key.bounding_box() or {"height": 0})["height"] >= 56
    await phone.page.locator("[data-tab=files]").tap()
    await expect(phone.page.locator("#monitor > .ledge")).to_be_hidden()
