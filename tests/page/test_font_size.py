"""The page grows with the browser's font, and stands at 150 %: each key is in reach, nothing covers another, and no
digit of the speed is cut."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, async_playwright, expect

from tests.chromium import FLAGS
from tests.page.canned import Canned, live
from tests.page.conftest import Phone, new_phone
from tests.page.screenshots import at_a_planned_stop
from tests.page.screenshots import several as many
from tests.page.test_overlaps import DRAWN, critical, noticed, opened, several, walk, warned

SIZES: list[tuple[float, float]] = [(360, 740), (412, 915), (820, 1180), (1440, 900)]
LARGER = 1.5
#: Keys of the screen in front that no finger can reach: scrolled to, they lie outside the window or under another.
OUT_OF_REACH = """(root) => {
  const within = `${root ?? '#monitor'} :is(button, a[href], input, select)`;
  const keys = [...document.querySelectorAll(`${within}, .snack button`)];
  const seen = keys.filter((one) => !one.closest('[inert], .unseen, dialog:not([open])') && !one.disabled
    && one.checkVisibility({ visibilityProperty: true, opacityProperty: true, contentVisibilityAuto: true })
    && one.offsetWidth > 1 && getComputedStyle(one).pointerEvents !== 'none');
  return seen.filter((one) => {
    return !['center', 'start', 'end'].some((block) => {
      one.scrollIntoView({ block, inline: 'nearest' });
      const { left, right, top, bottom } = one.getBoundingClientRect();
      return [0.5, 0.15, 0.85].some((share) => {
        const at = document.elementFromPoint((left + right) / 2, top + share * (bottom - top));
        return at && (one.contains(at) || [...(one.labels ?? [])].some((it) => it.contains(at)));
      });
    });
  }).map((one) => one.dataset.f || one.id || one.textContent.trim());
}"""
#: Height of the speed's digits that is seen, and whether any of it is cut.
DIGITS = """() => {
  const one = document.querySelector('.gauge .speed');
  if (one.closest('[inert]')) return { isCut: false, isLarge: true };
  one.closest('.panel').scrollTop = 0;
  const { left, right, top, bottom } = one.getBoundingClientRect();
  const view = one.closest('.view').getBoundingClientRect();
  const isCut = left < view.left || right > view.right || top < view.top || bottom > view.bottom;
  return { isCut, isLarge: bottom - top > 16 };
}"""


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def large(chromium: str) -> AsyncIterator[Browser]:
    """A browser whose font has 24 px in place of 16."""
    async with async_playwright() as playwright:
        settings = f"--blink-settings=defaultFontSize={round(16 * LARGER)}"
        browser = await playwright.chromium.launch(executable_path=chromium, args=[*FLAGS, settings])
        yield browser
        await browser.close()


@pytest_asyncio.fixture(loop_scope="session")
async def grown(large: Browser) -> AsyncIterator[Phone]:
    phone = await new_phone(large)
    yield phone
    await phone.page.context.close()
    assert phone.faults == []


async def all_is_in_reach(phone: Phone, canned: Canned, sizes: list[tuple[float, float]], tab: str) -> None:
    """Quiet, with all notices, and beside a critical alarm."""
    canned.vehicle = "Ocelot"
    page = await opened(phone, canned, tab)
    assert await faults(page, sizes) == {}
    several(canned)
    await noticed(page, canned)
    await expect(page.locator(".snacks > .prompt:not(.other)")).to_be_attached()
    assert await faults(page, sizes) == {}
    canned.state["alarms"].append(critical())
    await expect(page.locator("#sheet-alarm")).to_be_visible()
    assert await faults(page, sizes, is_asked=True) == {}


async def faults(page: Page, sizes: list[tuple[float, float]], *, is_asked: bool = False) -> dict[str, object]:
    """What is covered, cut or out of reach at each of these sizes; `is_asked`: an alarm is answered first."""
    found: dict[str, object] = dict(await walk(page, [(round(width), round(height)) for width, height in sizes]))
    for width, height in sizes:
        await page.set_viewport_size({"width": round(width), "height": round(height)})
        await page.evaluate(DRAWN)
        keys = [] if is_asked else await page.evaluate(OUT_OF_REACH)
        digits = await page.evaluate(DIGITS)
        if keys or not digits["isLarge"] or digits["isCut"]:
            found[f"{width} × {height} reach"] = (keys, digits)
    return found


@pytest.mark.gate
@pytest.mark.own_phone
async def test_all_of_the_page_grows_with_the_browsers_font(grown: Phone, phone: Phone, canned: Canned) -> None:
    """As at 150 %: in a window that is larger by as much, the same parts stand in the same places."""
    parts = (
        "#monitor > .top .chip, .strip, .gauge, .tabs, #monitor > .rail, #monitor > .rail .slide, [data-part=nearest]"
    )
    boxes = """(parts) => [...document.querySelectorAll(parts)].filter((one) => one.checkVisibility()).map((one) => {
      const { left, top, width, height } = one.getBoundingClientRect();
      return [left, top, width, height];
    })"""
    found = []
    for one, larger in ((phone, 1.0), (grown, LARGER)):
        await one.page.set_viewport_size({"width": round(412 * larger), "height": round(900 * larger)})
        page = await opened(one, canned)
        await one.drawn(3)
        found.append([[px / larger for px in box] for box in await page.evaluate(boxes, parts)])
    usual, large_ = found
    assert len(usual) == 7
    for one, other in zip(usual, large_, strict=True):
        assert one == pytest.approx(other, abs=2.5)


@pytest.mark.gate
@pytest.mark.own_phone
async def test_each_key_is_in_reach_with_a_large_font(grown: Phone, canned: Canned) -> None:
    await all_is_in_reach(grown, canned, [SIZES[0], SIZES[3]], "home")


@pytest.mark.gate
@pytest.mark.own_phone
async def test_with_a_large_font_a_warning_leaves_a_planned_stop_and_the_distance_in_sight(
    grown: Phone, canned: Canned
) -> None:
    canned.state = at_a_planned_stop(live())
    page = await opened(grown, canned)
    await expect(page.locator("body[data-snack]")).to_be_attached()
    for width, height in ((360, 800), (412, 915)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function(
            """() => {
              const at = (one) => document.querySelector(one).getBoundingClientRect();
              const parts = ['.planned-stop', '.near [data-f=distance]', '.snack:not([hidden])'];
              const [stop, distance, notice] = parts.map(at);
              const isSeen = stop.height > 20 && distance.height > 12;
              return isSeen && stop.bottom <= distance.top && distance.bottom <= notice.top;
            }"""
        )
    canned.state = warned()
    canned.state["signals"]["distance"] |= {"freshness": "stale", "age_s": 123.4}
    await expect(page.locator("[data-part=nearest] .age[data-ink=stale]")).to_be_attached()
    found = await walk(page, [(360, 800), (375, 812), (412, 915)])
    assert [what for wrong in found.values() for what in wrong if "nearest object" in what] == []
    for width, height in ((360, 640), (360, 740), (375, 667)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function(
            """() => {
              const at = (one) => document.querySelector(one).getBoundingClientRect();
              const notice = at('.snack:not([hidden])').top;
              return at('.near [data-f=distance]').bottom <= notice
                && at('[data-part=nearest] .age').top + 24 <= notice;
            }"""
        )


@pytest.mark.gate
@pytest.mark.own_phone
async def test_each_key_of_the_alarms_is_in_reach_with_a_large_font(grown: Phone, canned: Canned) -> None:
    """The keys of a waiting alarm, and those at the foot of the list; none hangs over the edge of the window."""
    hangs = """() => [...document.querySelectorAll('.view > .screen button')]
      .filter((one) => one.checkVisibility() && one.getBoundingClientRect().right > innerWidth + 0.5)
      .map((one) => one.ariaLabel ?? one.textContent)"""
    page = await opened(grown, canned)
    canned.state = many()
    await grown.f("sound-off").tap()
    await page.evaluate("dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: 'alarms' } }))")
    await expect(page.locator(".view > .screen .alarms [data-waits]").first).to_be_visible()
    for width, height in (SIZES[0], (360, 640), SIZES[1]):
        await page.set_viewport_size({"width": round(width), "height": round(height)})
        await grown.drawn()
        assert await page.evaluate(hangs) == [], (width, height)
        assert await page.evaluate(OUT_OF_REACH, "#monitor .view > .screen") == [], (width, height)


@pytest.mark.timeout(300)
@pytest.mark.parametrize("tab", ["home", "map", "scan", "files", "settings"])
async def test_each_is_with_a_large_font_in_each_window(grown: Phone, canned: Canned, tab: str) -> None:
    await all_is_in_reach(grown, canned, SIZES, tab)


@pytest.mark.timeout(300)
@pytest.mark.parametrize("tab", ["home", "map", "scan", "files", "settings"])
async def test_each_is_at_150_percent(phone: Phone, canned: Canned, tab: str) -> None:
    await all_is_in_reach(phone, canned, [(width / LARGER, height / LARGER) for width, height in SIZES], tab)


#: Without a thread of its own the page draws the scan: the numbers of its rings, as boxes within the window.
NUMBERS = """() => {
  window.Worker = undefined;
  const kept = CanvasRenderingContext2D.prototype.fillText;
  let now = [];
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
    if (/^\\d+$/.test(text) && this.canvas.matches('.scanc')) now.push([text, x, y, this.measureText(text).width]);
    return kept.apply(this, arguments);
  };
  const begin = CanvasRenderingContext2D.prototype.drawImage;
  CanvasRenderingContext2D.prototype.drawImage = function () {
    if (this.canvas.matches('.scanc')) [window.numbers, now] = [now, []];
    return begin.apply(this, arguments);
  };
}"""
#: Those of the newest drawing of which the caption covers a part.
UNDER_CAPTION = """() => {
  const caption = document.querySelector('#panel-scan [data-f=straight]').getBoundingClientRect();
  const plot = document.querySelector('.scanc').getBoundingClientRect();
  const isUnder = ([, x, y, width]) => plot.left + x < caption.right && plot.left + x + width > caption.left
    && plot.top + y - 6 < caption.bottom && plot.top + y + 6 > caption.top;
  return { of: numbers.length, height: caption.height, covered: numbers.filter(isUnder).map(([text]) => text) };
}"""


@pytest.mark.own_phone
async def test_no_number_of_the_scan_is_under_its_caption_with_a_large_font(grown: Phone, canned: Canned) -> None:
    page = grown.page
    await page.add_init_script(f"({NUMBERS})()")
    await page.set_viewport_size({"width": 1920, "height": 1000})  # of 80 × 42 em: all panes
    await opened(grown, canned)
    await expect(page.locator("#panel-scan [data-f=straight]")).to_be_visible()
    found = []
    for key in ["farther"] * 4 + ["nearer"] * 9:
        await page.evaluate("window.numbers = null")
        await page.wait_for_function("() => window.numbers?.length")
        found.append(await page.evaluate(UNDER_CAPTION))
        await page.locator(f"#panel-scan [data-f={key}]").click()
    assert max(one["height"] for one in found) > 28
    assert [one["covered"] for one in found] == [[]] * len(found)
