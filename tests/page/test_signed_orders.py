"""Orders of a page through a web node, a real broker and an agent that takes signed orders only."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import expect

from tests.http import http_client
from tests.page.conftest import Phone
from tests.page.test_fleet import Fleet, fleet
from tests.page.test_slow_down import armed_by_hand

CLEARED = """() => new Promise((resolve, reject) => {
  const request = indexedDB.deleteDatabase('catgraph');
  request.onsuccess = () => resolve(null);
  request.onerror = request.onblocked = () => reject(request.error ?? new Error('blocked'));
})"""
OWN_KEY = """() => new Promise((resolve) => {
  const request = indexedDB.open('catgraph', 1);
  request.onsuccess = () => {
    const database = request.result;
    const found = database.transaction('keys').objectStore('keys').get('orders');
    found.onsuccess = () => {
      database.close();
      resolve(found.result ? found.result.privateKey.extractable : null);
    };
  };
})"""
# How long the browser takes to sign [ms], the median of 50.
SIGNING_MS = """async () => {
  const pair = await crypto.subtle.generateKey({ name: 'ECDSA', namedCurve: 'P-256' }, false, ['sign']);
  const took = [];
  for (let i = 0; i < 50; i += 1) {
    const began_ms = performance.now();
    await crypto.subtle.sign({ name: 'ECDSA', hash: 'SHA-256' }, pair.privateKey, new Uint8Array(400));
    took.push(performance.now() - began_ms);
  }
  return took.sort((a, b) => a - b)[25];
}"""


async def devices(one: Fleet) -> list[str]:
    """The devices in the car's log."""
    async with http_client(base_url=one.agent.address) as car:
        events: list[dict[str, Any]] = (await car.get("/api/events", params={"limit": 1000})).json()["events"]
    return [str(event["text"]) for event in events if event["change"] == "device"]


@pytest.mark.timeout(120)
async def test_a_page_signs_what_it_orders_and_a_cleared_browser_begins_anew(phone: Phone, tmp_path: Path) -> None:
    page = phone.page
    async with fleet(tmp_path) as one:
        address = f"{one.node.address}/?vehicle=ocelot"
        thumb = await armed_by_hand(phone, address)
        await thumb.slow_the_car()
        await expect(page.locator(".order li[data-mark=ok]")).to_have_count(4)
        after_s = [float(text[1:-2]) for text in await page.locator(".order li b").all_inner_texts() if "+" in text]
        assert after_s[-1] < 2.0  # from the press to the car's own speed, signed and all
        signing_ms = await page.evaluate(SIGNING_MS)
        print(f"signing {signing_ms:.2f} ms, steps after {after_s} s")
        assert signing_ms < 5 + 1000 * phone.stutter_s
        (first,) = await devices(one)
        assert first.startswith("First order of ")
        assert await page.evaluate(OWN_KEY) is False, "kept, and cannot be taken out"
        await phone.acknowledge_all()
        await phone.release_the_car()
        await expect(phone.f("release")).to_be_hidden()

        await page.evaluate(CLEARED)
        await phone.open(address)
        await phone.live()
        await phone.acknowledge_all()
        await page.locator("#monitor .top .rec").tap()
        await phone.f("pause").tap()
        await expect(phone.f("pause")).to_contain_text("Resume")
        found = await devices(one)
        assert len(found) == 2, found
        assert "a name that another key has" in found[1]

        # What became of an order whose answer was lost is found out, and shown.
        note = page.locator(".snack.note")
        one.agent.freeze()
        await phone.f("pause").tap()
        await expect(note).to_contain_text("Not known")
        await expect(note).to_contain_text("The agent of ocelot did not answer")
        await expect(note).to_contain_text("It may have been carried out.")
        await expect(note).to_contain_text(
            "The link is cut between server and agent. Not known yet in which direction."
        )
        one.agent.thaw()
        await expect(note).to_contain_text("Not carried out", timeout=20_000)
        await expect(note).to_contain_text("“Resume” was lost on its way.")
        await expect(note).to_contain_text("The link was cut in the direction to the car, between server and agent.")
        await phone.live()
        await expect(phone.f("pause")).to_contain_text("Resume")
        phone.complaints[:] = [line for line in phone.complaints if "503" not in line]  # its request to a lost agent
