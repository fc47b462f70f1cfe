"""Files on a phone that only looks: what a recording is may be read, and nothing is made, mailed or changed."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from tests.page.canned import Canned
from tests.page.conftest import PHONE, phone_in

pytestmark = [pytest.mark.browser, pytest.mark.asyncio(loop_scope="session")]


@pytest.mark.gate
async def test_a_viewer_may_take_the_file_and_orders_no_other_form_of_it(browser: Browser) -> None:
    server = Canned()
    server.role = "viewer"
    async with server.running():
        context = await browser.new_context(**PHONE)
        phone = await phone_in(context)
        try:
            await phone.open(server.address)
            await phone.live()
            await phone.show("files")
            await phone.page.locator("#panel-files [data-id] button, #panel-files li button").first.tap()
            sheet = phone.page.locator("dialog.file-sheet[open]")
            await expect(sheet.get_by_role("button", name="Delete")).to_have_attribute("aria-disabled", "true")
            await sheet.get_by_role("button", name="Download").tap()
            tables = sheet.get_by_role("button", name="CSV tables")
            await expect(tables).to_have_attribute("aria-disabled", "true")
            await expect(sheet.get_by_role("link", name="MCAP")).to_be_visible()
            requests: list[str] = []
            phone.page.on("request", lambda request: requests.append(f"{request.method} {request.url}"))
            await tables.tap(force=True)
            await expect(phone.page.locator(".snack.note")).to_contain_text("This device is paired as a viewer.")
            assert [one for one in requests if one.startswith("POST")] == []
        finally:
            await context.close()
