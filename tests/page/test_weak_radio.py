"""The link's display over a radio that takes long for an answer."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone

#: By how much a text of the top bar lies over the next part [px].
OVER = """bar => {
  const boxOf = (name) => bar.querySelector(`[data-f="${name}"]`).getBoundingClientRect();
  return boxOf('link-age').right - boxOf('rec').left;
}"""


@pytest.mark.gate
@pytest.mark.parametrize("width", [412, 320])
async def test_a_weak_radio_is_said_beside_the_age(phone: Phone, canned: Canned, width: int) -> None:
    canned.answers_after_s = 0.4
    await phone.page.set_viewport_size({"width": width, "height": 780})
    await phone.open(canned.address)
    state = phone.page.locator('#monitor [data-f="link-state"]')
    await expect(state).to_have_text("Weak")
    link = phone.page.locator('#monitor [data-f="link"]')
    label = await link.get_attribute("aria-label") or ""
    assert label.startswith("Weak ")
    assert "Weak radio: an answer takes 0." in label
    assert await phone.page.locator("#monitor > .top").evaluate(OVER) <= 0
    if folder := os.environ.get("CATGRAPH_LOOK"):
        await phone.page.screenshot(path=Path(folder) / f"weak-{width}.png")
    canned.answers_after_s = 0.0
    await expect(state).to_have_text("Live", timeout=20_000)
