"""Fingers on a screen, as a browser gets them from it."""

from __future__ import annotations

import asyncio

from playwright.async_api import Page

DRAWN = "new Promise((done) => requestAnimationFrame(done))"
Way = tuple[float, float, float, float]  # from x, y to x, y [px]


async def stroke(page: Page, *ways: Way, steps: int = 10, rest_s: float = 0.0) -> None:
    """Fingers that come down one after the other, move together and leave after `rest_s`.

    The page draws between two movements: what a busy browser has not seen yet it may drop.
    """
    cdp = await page.context.new_cdp_session(page)

    def points(share: float) -> list[dict[str, float]]:
        return [
            {"x": x + (to_x - x) * share, "y": y + (to_y - y) * share, "id": n}
            for n, (x, y, to_x, to_y) in enumerate(ways)
        ]

    for count in range(1, len(ways) + 1):
        await cdp.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": points(0)[:count]})
    await page.evaluate(DRAWN)
    for step in range(1, steps + 1):
        await cdp.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": points(step / steps)})
        await page.evaluate(DRAWN)
    if rest_s:
        await asyncio.sleep(rest_s)
    await cdp.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    await cdp.detach()
