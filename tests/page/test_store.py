"""The Files tab of a server with a store: where the copy of each recording is, and what a web node lists."""

from __future__ import annotations

import json
from typing import Any

import pytest
from playwright.async_api import Locator, Route, expect

from tests.page.canned import Canned
from tests.page.conftest import Phone

NOT_STORED = {
    "state": "none", "share": None, "checked_ms": None, "sentence": "The whole file is uploaded on request.",
    "clips": 2, "is_asked": False, "is_deletion_asked": False,
}  # fmt: skip
FAILED = NOT_STORED | {"state": "failed", "sentence": "The store s3.example is full.", "is_asked": True}


def row(phone: Phone, id: str) -> Locator:
    return phone.page.locator(f'#panel-files [data-f=recordings] [data-id="{id}"]')


@pytest.mark.gate
@pytest.mark.own_phone
async def test_each_row_says_where_its_copy_is_and_a_key_asks_for_it(phone: Phone, canned: Canned) -> None:
    stored: dict[str, Any] = {"car_1": FAILED, "car_2": NOT_STORED}
    requests: list[tuple[str, Any]] = []

    async def listed(route: Route) -> None:
        answer = await route.fetch()
        body = await answer.json()
        for one in body["recordings"]:
            one["stored"] = stored.get(one["id"], NOT_STORED)
        body["store"] = {"address": "s3://b", "problem": "The store s3.example is full."}
        await route.fulfill(json=body)

    async def ask(route: Route) -> None:
        requests.append((route.request.method, json.loads(route.request.post_data or "null")))
        stored["car_2"] = NOT_STORED | {"state": "uploading", "share": 0.43, "is_asked": True}
        await route.fulfill(status=202, json=stored["car_2"])

    await phone.page.route("**/api/recordings?*", listed)
    await phone.page.route("**/api/recordings/car_2/store", ask)
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    await expect(row(phone, "car_1")).to_contain_text("not stored, failed: The store s3.example is full.")
    await expect(phone.f("files-state", "#panel-files")).to_have_text("The store s3.example is full.")
    await expect(row(phone, "car_2").locator(".stored")).to_have_text("not stored")
    await row(phone, "car_2").get_by_role("button").tap()
    sheet = phone.page.locator("#sheet-file")
    await sheet.get_by_text("Copy in the store").tap()
    await expect(sheet).to_contain_text("The whole file is uploaded on request.")
    await expect(sheet).to_contain_text("2 clips around alarms stored.")
    await sheet.get_by_role("button", name="Upload, then delete it here").tap()
    await expect(sheet).to_contain_text("deleted on this server for good")
    assert requests == []
    await sheet.get_by_role("button", name="Back").tap()
    await sheet.get_by_text("Copy in the store").tap()
    await sheet.get_by_role("button", name="Upload the whole file").tap()
    await expect(sheet).to_be_hidden()
    assert requests == [("POST", {"delete": False})]
    await expect(row(phone, "car_2").locator(".stored")).to_have_text("uploading 43 %")


@pytest.mark.gate
@pytest.mark.own_phone
@pytest.mark.parametrize(("status", "why"), [(404, ""), (503, "The agent of ocelot does not answer.")])
async def test_a_web_node_lists_what_agents_stored(phone: Phone, canned: Canned, status: int, why: str) -> None:
    one = {
        "id": "ocelot_1", "vehicle": "ocelot", "folder": "ocelot", "title": "", "started_ms": 1_790_000_000_000,
        "length_s": 61.0, "distance_m": None, "top_speed_mps": None, "sketch": None, "sha256": "0" * 64,
        "alarms": {"critical": 1, "warning": 0, "advisory": 0}, "file": "ocelot_1.mcap", "size_bytes": 5_000_000,
        "checked_ms": 1_790_000_100_000,
        "clips": [{"name": "clip_1.mcap", "at_ms": 1_790_000_030_000, "size_bytes": 9_000}],
    }  # fmt: skip
    listing = {"store": "s3://b/fleet", "recordings": [one], "next": None, "count": 1}

    async def kept_elsewhere(route: Route) -> None:
        await route.fulfill(status=status, json={"detail": why})

    async def stored(route: Route) -> None:
        await route.fulfill(json=listing)

    await phone.page.route("**/api/recordings?*", kept_elsewhere)
    await phone.page.route("**/api/stored?*", stored)
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    await expect(phone.page.locator("#panel-files .sec").first).to_contain_text("1 recording in the store s3://b/fleet")
    await expect(phone.f("files-state", "#panel-files")).to_have_text(why)
    await expect(row(phone, "ocelot_1")).to_contain_text("stored (checked")
    await row(phone, "ocelot_1").get_by_role("button").tap()
    links = phone.page.locator("#sheet-file .menu-list a")
    await expect(links).to_have_count(2)
    assert [await link.get_attribute("href") for link in await links.all()] == [
        "/api/stored/ocelot/ocelot_1/file",
        "/api/stored/ocelot/ocelot_1/clips/clip_1.mcap",
    ]
    await expect(phone.page.locator("#sheet-file")).not_to_contain_text("Open replay")
    assert all(
        str(status) in complaint for complaint in phone.complaints
    )  # the browser's own, of the list that is not there
    phone.complaints.clear()
