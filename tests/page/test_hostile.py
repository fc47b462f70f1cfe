"""A car, a file and a colleague who mean harm: what they say stands on the page as text, is short, and runs nothing."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import expect

from server.app.config import Config
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import Annotations
from server.rosbridge_server.graph import SOURCE, Topic
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.page.conftest import Phone
from tests.page.roamer import Roamer, roaming
from tests.page.test_policy import NOTE_VIOLATIONS, violations
from tests.page.test_tabs import TABS
from tests.server.conftest import serving
from tests.server.recording.made import record
from tests.server.viewer import viewer

SCRIPT = "<img src=x onerror=\"window.owned='img'\"><script>window.owned='script'</script>"
BIDI = "\u202eevil\u2066\u200f"
NUL = "a\0b\x1b[31m\r\nc"
LONG = "m" * 1_000_000
TEXTS = (
    SCRIPT,
    "</style></title></textarea>" + SCRIPT,
    BIDI,
    NUL,
    "{{7*7}}${7*7}",
    "javascript:window.owned='link'",
    LONG,
)
ID = "car_20160601T120000Z"


def components() -> dict[str, Any]:
    """A /diagnostics message with hostile text in every field that is text."""
    return {
        "header": {"seq": 1, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": SCRIPT},
        "status": [
            {"level": 2, "name": text, "message": text, "hardware_id": text, "values": [{"key": text, "value": text}]}
            for text in TEXTS
        ],
    }


async def talk(car: Roamer) -> None:
    while True:
        car.bridge.publish("/diagnostics", components())
        await asyncio.sleep(0.5)


def hostile(car: Roamer) -> None:
    car.bridge.advertise("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    for n, text in enumerate(TEXTS):
        name = f"/{n}{text}"  # our bridge would refuse it, another need not
        car.bridge.graph._topics[name] = Topic(name=name, type=f"evil_msgs/{text}", publishers={SOURCE})


async def harmless(phone: Phone) -> None:
    assert await phone.page.evaluate("window.owned") is None
    assert await violations(phone) == []
    assert await phone.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.own_phone
async def test_a_car_that_means_harm_is_only_told(phone: Phone, tmp_path: Path) -> None:
    await phone.page.add_init_script(NOTE_VIOLATIONS)
    async with roaming() as car:
        hostile(car)
        talking = asyncio.create_task(talk(car))
        config = Config(vehicles=(Vehicle(name="car", address=car.address),), data=tmp_path / "data")
        async with serving(config) as address:
            await phone.open(address)
            await phone.live()
            before = await phone.page.locator("script, iframe, object, embed").count()
            await phone.acknowledge_all()
            for tab in TABS:
                await phone.page.locator(f"#tab-{tab}").tap()
                await expect(phone.page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
                await phone.page.wait_for_timeout(300)
                await harmless(phone)
            await phone.f("menu").tap()
            await phone.page.locator("#sheet-menu").get_by_text("Signals").tap()
            await expect(phone.page.locator(".sig", has_text="Diagnostics")).to_contain_text("ERROR", timeout=15_000)
            await phone.page.locator(".sig", has_text="Diagnostics").tap()
            await expect(phone.page.locator(".sig-more:not([hidden])")).to_contain_text("<img src=x onerror=")
            shown = await phone.page.evaluate("document.body.innerText.length")
            assert shown < 100_000, "a text of a million letters is not drawn as one"
            assert await phone.page.locator("script, iframe, object, embed").count() == before
            await harmless(phone)
            async with viewer(address) as one:
                state = await one.state()
                assert len(str(state)) < 200_000, "nor sent to every page ten times a second"
        talking.cancel()


@pytest.mark.own_phone
async def test_a_recording_that_means_harm_is_only_listed(phone: Phone, tmp_path: Path) -> None:
    """Its title, note and tags, and the subject of a mail, which somebody else wrote."""
    await phone.page.add_init_script(NOTE_VIOLATIONS)
    drive = record(tmp_path / "data" / "recordings" / "car" / f"{ID}.mcap", seconds=6.0)
    annotation_store.write(
        drive, Annotations(title=SCRIPT[:110] + BIDI, note=SCRIPT + NUL.replace("\0", ""), tags=(SCRIPT[:39],))
    )
    async with contextlib.AsyncExitStack() as stack:
        car = await stack.enter_async_context(roaming())
        config = Config(vehicles=(Vehicle(name="car", address=car.address),), data=tmp_path / "data")
        address = await stack.enter_async_context(serving(config))
        client = await stack.enter_async_context(http_client(base_url=address))
        settings = {"host": "127.0.0.1", "port": 9, "security": "none", "sender": "car@test.example"}
        assert (await client.put("/api/mail/settings", json=settings)).status_code == 200
        async with asyncio.timeout(20):
            while (await client.get(f"/api/recordings/{ID}")).json().get("state") == "waiting":
                await asyncio.sleep(0.05)
        order = {"recordings": [ID], "format": "mcap", "to": ["ann@test.example"], "subject": SCRIPT[:100]}
        assert (await client.post("/api/mail", json=order)).status_code == 202
        for recipient in (
            f"{SCRIPT}@test.example",
            f'"{SCRIPT}"@test.example',
            f"ann@{SCRIPT}",
            f"{SCRIPT} <a@b.example>",
        ):
            refused = await client.post("/api/mail", json=order | {"to": [recipient]})
            assert refused.status_code == 422, recipient
        await phone.open(f"{address}/#files")
        await phone.live()
        row = phone.page.locator(f'#panel-files [data-f=recordings] [data-id="{ID}"]')
        await expect(row).to_contain_text("<img src=x onerror=", timeout=20_000)
        await row.locator(".t").tap()
        await expect(phone.page.locator("#sheet-file h2")).to_contain_text("<img src=x onerror=")
        await harmless(phone)
        listed = (await client.get(f"/api/recordings/{ID}")).json()
        assert "<img" in listed["title"], "kept as it was written"
        svg = await client.get(f"/api/recordings/{ID}/track.svg")
        assert "<img" not in svg.text
        assert "sandbox" in svg.headers["content-security-policy"]
