"""The page in WebKit, as far as its GTK port goes: what an iPhone's browser is built upon."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.page.drives import steady
from tests.page.processes import replay, running, server
from tests.page.webdriver import lacking, webkit

IS_LIVE = "return document.querySelector('#monitor [data-f=link-state]')?.textContent === 'Live'"


@pytest.mark.skipif(lacking() is not None, reason=str(lacking()))
@pytest.mark.timeout(180)
async def test_a_drive_in_webkit(tmp_path: Path) -> None:
    """Live values, every tab, an alarm and its acknowledgement, a silent server under its veil."""
    fast = steady(tmp_path / "fast.bag", 12.6)
    async with (
        running(*replay(fast)) as car,
        running(*server(tmp_path / "data", car.address)) as watch,
        webkit(tmp_path) as page,
    ):
        await page.open(watch.address)
        await page.run("window.complaints = []; addEventListener('error', (e) => complaints.push(e.message));")
        await page.until(IS_LIVE)
        await page.until("return document.querySelector('.gauge .speed')?.textContent === '12.6'")
        await page.until("return document.querySelector('#sheet-alarm')?.open")
        assert "Speed above limit" in await page.run("return document.querySelector('#sheet-alarm').innerText")
        await page.press("#sheet-alarm [data-f=acknowledge]")
        await page.until("return !document.querySelector('#sheet-alarm').open")
        for tab in ("map", "scan", "files", "settings", "home"):
            await page.press(f"#tab-{tab}")
            await page.until(
                f"return Math.abs(document.querySelector('#panel-{tab}').getBoundingClientRect().left) < 1"
                f" && document.querySelector('#tab-{tab}').getAttribute('aria-selected') === 'true'"
            )
            assert await page.run("return document.documentElement.scrollWidth <= innerWidth"), tab
        watch.freeze()
        try:
            await page.until("return document.querySelector('#monitor .veil').dataset.on === 'all'")
        finally:
            watch.thaw()
        await page.until(IS_LIVE)
        assert await page.run("return window.complaints") == []
