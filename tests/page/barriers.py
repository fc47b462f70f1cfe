"""What keeps nobody out: measured by axe in both themes, and by the places of what is seen at every size."""

from __future__ import annotations

from axe_playwright_python.async_playwright import Axe
from playwright.async_api import Page

SIZES = [(320, 640), (360, 740), (412, 915), (640, 400), (915, 412), (800, 1100), (1280, 800)]
# Of the panels that are seen whole: on a wide screen the neighbours of the one in front may be cut.
HANGS_OVER = """(within) => {
  const over = (one) => {
    const box = one.getBoundingClientRect();
    return box.width > 0 && (box.right > innerWidth + 1 || box.left < -1);
  };
  const cut = [...document.querySelectorAll('#monitor .panel')].filter(over);
  return [...document.querySelectorAll(`${within} *`)]
    .filter((one) => one.getClientRects().length && !one.closest('svg, canvas, .leaflet-container, [inert]'))
    .filter((one) => !one.matches('.unseen, .clip *, .turn, .turn *, .moves, .pager'))
    .filter((one) => over(one) && !cut.some((panel) => panel.contains(one)))
    .map((one) => `${one.tagName} ${one.className} ${one.textContent.trim().slice(0, 40)}`);
}"""
PRESSED = "button, a[href], input:not(.unseen), select, summary, [role=button], [role=slider]"
TOO_SMALL = f"""(within) => [...document.querySelectorAll(`${{within}} :is({PRESSED})`)]
  .filter((one) => one.getClientRects().length && !one.closest('[inert], .leaflet-control-attribution'))
  .map((one) => [(one.closest('label') ?? one).getBoundingClientRect(), one])
  .filter(([box]) => Math.min(box.width, box.height) < 24)
  .map(([box, one]) => `${{one.outerHTML.slice(0, 90)}} ${{box.width}}×${{box.height}}`)"""
# In the second theme only what colours decide is measured: the document is the same.
OF_COLOURS = ["color-contrast", "link-in-text-block"]


async def no_barrier(page: Page, where: str, context: str | None = None) -> None:
    """Nothing that axe finds in the page, or in what a selector names in it, in either theme."""
    for theme, rules in (("dark", {}), ("light", {"runOnly": OF_COLOURS})):
        await page.emulate_media(color_scheme="dark" if theme == "dark" else "light", reduced_motion="reduce")
        await page.wait_for_timeout(150)  # what moves comes to rest
        found = await Axe().run(page, context=context, options={"resultTypes": ["violations"]} | rules)
        broken = [(one["id"], [node["html"] for node in one["nodes"]]) for one in found.response["violations"]]
        assert broken == [], f"{where}, {theme}: {broken}"


async def fits(page: Page, where: str, within: str = "#monitor") -> None:
    """Nothing in what a selector names hangs over an edge of the screen, and what is pressed is large enough."""
    width = await page.evaluate("innerWidth")
    assert await page.evaluate("document.documentElement.scrollWidth") <= width, f"{where}, {width}"
    for fault in (HANGS_OVER, TOO_SMALL):
        found = await page.evaluate(fault, within)
        assert found == [], f"{where}, {width}: {found}"


async def fits_all(page: Page, where: str, within: str = "#monitor") -> None:
    """The same at the size of each screen: the page stays as it is and is made larger and smaller."""
    before = page.viewport_size
    for width, height in SIZES:
        await page.set_viewport_size({"width": width, "height": height})
        # The tab in front comes to its place within two drawings.
        await page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        await fits(page, f"{where} of {width} × {height}", within)
    if before is not None:
        await page.set_viewport_size(before)
