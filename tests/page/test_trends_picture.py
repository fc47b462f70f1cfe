"""The drive's chart as a saved picture: limits, gaps, marks and cursor are in its pixels, and it names car and day."""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Callable
from pathlib import Path

from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.canned_drive import LOST_S, SILENT_S
from tests.page.conftest import Phone
from tests.page.screenshots import show
from tests.page.test_trends import chart
from tests.page.touch import DRAWN

#: The pixels of each colour of the theme: their places in CSS pixels, by name.
READ = """async ({ png, ratio }) => {
  const bytes = Uint8Array.from(atob(png), (letter) => letter.charCodeAt(0));
  const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [image.width, image.height];
  const g = canvas.getContext('2d');
  g.drawImage(image, 0, 0);
  const { data } = g.getImageData(0, 0, image.width, image.height);
  const found = { size: [image.width / ratio, image.height / ratio] };
  for (const name of ['ink', 'you', 'hatch', 'crit', 'warn-ink']) {
    const probe = document.createElement('i');
    probe.style.color = `var(--${name})`;
    document.body.append(probe);
    const [red, green, blue] = getComputedStyle(probe).color.match(/\\d+/g).map(Number);
    probe.remove();
    found[name] = [];
    for (let n = 0; n < data.length; n += 4) {
      const off = Math.max(Math.abs(data[n] - red), Math.abs(data[n + 1] - green), Math.abs(data[n + 2] - blue));
      if (off <= (name === 'crit' ? 56 : 0)) {  // a thin line may lie between two pixels
        found[name].push([Math.floor((n / 4) % image.width / ratio), Math.floor(n / 4 / image.width / ratio)]);
      }
    }
  }
  found.blue = [];  // a dashed line between two pixels is paler, and still the only blue there
  for (let n = 0; n < data.length; n += 4) {
    if (data[n + 2] - data[n] <= 40) continue;
    found.blue.push([Math.floor((n / 4) % image.width / ratio), Math.floor(n / 4 / image.width / ratio)]);
  }
  return found;
}"""
PANES = """() => {
  const plots = [...document.querySelectorAll('.trends-pane')].map((pane) => {
    const over = pane.querySelector('.u-over').getBoundingClientRect();
    return { name: pane.dataset.signal, left: over.left, right: over.right, top: over.top, bottom: over.bottom };
  });
  const stage = document.querySelector('.trends-panes').getBoundingClientRect();
  const marks = [...document.querySelectorAll('.trends-marks > g')].map(({ className, transform }) =>
    [className.baseVal, transform.baseVal.consolidate().matrix.e + 11]);
  return { plots, marks, left: stage.left, top: stage.top };
}"""
TITLE_PX, HEAD_PX = 30, 28
INK = {"critical": "crit", "warning": "warn-ink"}


async def test_the_picture_holds_what_is_seen(phone: Phone, canned: Canned) -> None:
    await chart(phone, canned)
    stage = phone.page.locator(".trends-stage")
    await phone.page.locator(".trends-tools button").nth(2).tap()  # the whole drive
    await phone.page.wait_for_function("() => document.querySelector('.trends-stage').ariaValueMin === '0.0'")
    box = await phone.page.locator(".trends-panes .u-over").first.bounding_box()
    assert box is not None
    await phone.page.touchscreen.tap(box["x"] + box["width"] * 0.1, box["y"] + 20)
    await expect(phone.page.locator(".tag-text")).to_have_text(re.compile(r"\d\d:\d\d:\d\d"))
    await phone.page.locator(".trends-tools .key").tap()
    await expect(phone.page.locator(".trends-pick button", has_text="Picture")).to_be_visible()
    await phone.page.evaluate(DRAWN)  # what the list covers has another height beneath it
    places = await phone.page.evaluate(PANES)
    length_s = float(await stage.get_attribute("aria-valuemax") or "nan")
    async with phone.page.expect_download() as waiting:
        await phone.page.locator(".trends-pick button", has_text="Picture").tap()
    saved = await (await waiting.value).path()
    if folder := os.environ.get("CATGRAPH_LOOK"):
        (Path(folder) / "chart.png").write_bytes(saved.read_bytes())
    ratio = await phone.page.evaluate("devicePixelRatio")
    png = base64.b64encode(saved.read_bytes()).decode()
    pixels = await phone.page.evaluate(READ, {"png": png, "ratio": ratio})

    above = TITLE_PX + HEAD_PX - places["top"]
    panes = {one["name"]: one for one in places["plots"]}

    def column(at_s: float) -> float:
        speed = panes["speed"]
        return float(speed["left"] - places["left"] + (speed["right"] - speed["left"]) * at_s / length_s)

    def inside(name: str) -> Callable[[float, float], bool]:
        pane = panes[name]
        return lambda x, y: pane["top"] + above <= y < pane["bottom"] + above and x >= pane["left"] - places["left"]

    def columns(colour: str, where: Callable[[float, float], bool]) -> set[int]:
        return {x for x, y in pixels[colour] if where(x, y)}

    def in_head(_x: float, y: float) -> bool:
        return TITLE_PX <= y < TITLE_PX + HEAD_PX

    # Its title.
    title = {x for x, y in pixels["ink"] if y < TITLE_PX}
    assert title
    assert max(title) - min(title) > 150

    # Marks by their shapes and colours, and the tag of the cursor.
    kinds = [kind for kind, _ in places["marks"]]
    assert kinds.count("critical") >= 2
    assert "warning" in kinds
    for kind, at_px in places["marks"]:
        assert any(abs(x - at_px) <= 12 for x in columns(INK[kind], in_head)), (kind, at_px)
    assert any(abs(x - column(length_s / 10)) <= 42 for x in columns("you", in_head))

    # A line down through every pane where a critical alarm came, and the cursor.
    for name in panes:
        for at_px in (at_px for kind, at_px in places["marks"] if kind == "critical"):
            assert any(abs(x - at_px) <= 1.5 for x in columns("crit", inside(name))), (name, at_px)
        assert any(abs(x - column(length_s / 10)) <= 1.5 for x in columns("you", inside(name))), name

    # The blind time is hatched in every pane, the silence of one signal in its own alone.
    for name in panes:
        hatched = columns("hatch", inside(name))
        assert any(column(LOST_S[0]) <= x <= column(LOST_S[1]) for x in hatched), name
        assert any(column(SILENT_S[0]) <= x <= column(SILENT_S[1]) for x in hatched) == (name == "distance"), name
        assert not any(column(LOST_S[1]) + 2 < x < column(SILENT_S[0]) - 2 for x in hatched), name

    # The limit of the nearest object: a dashed line from end to end at one height.
    rows: dict[int, set[int]] = {}
    for x, y in pixels["blue"]:
        if inside("distance")(x, y):
            rows.setdefault(y, set()).add(x)
    width = panes["distance"]["right"] - panes["distance"]["left"]
    assert max(map(len, rows.values())) > width / 3


#: Marks of alarms that lie over the cursor's tag, and whether any gave way to it.
OVER_TAG = """() => {
  const tag = document.querySelector('.tag-box').getBoundingClientRect();
  const isOver = (at) => at.left < tag.right - 1 && at.right > tag.left + 1 && at.top < tag.bottom - 0.5;
  const over = [...document.querySelectorAll('.trends-marks > g')]
    .map((mark) => mark.lastElementChild.getBoundingClientRect()).filter((at) => at.width < 1 || isOver(at));
  return [over.length, document.querySelectorAll('.trends-marks > g > rect').length];
}"""


async def test_no_mark_of_an_alarm_lies_over_the_digits_of_the_cursors_tag(phone: Phone, canned: Canned) -> None:
    await chart(phone, canned)
    await phone.page.locator(".trends-tools button").nth(2).tap()  # the whole drive
    await phone.page.wait_for_function("() => document.querySelector('.trends-stage').ariaValueMin === '0.0'")
    box = await phone.page.locator(".trends-panes .u-over").first.bounding_box()
    assert box is not None
    narrow = 0
    for share in range(5, 96, 6):
        await phone.page.touchscreen.tap(box["x"] + box["width"] * share / 100, box["y"] + 20)
        await expect(phone.page.locator(".tag-text")).to_have_text(re.compile(r"\d\d:\d\d:\d\d"))
        over, bars = await phone.page.evaluate(OVER_TAG)
        assert over == 0, share
        narrow += bars
    assert narrow > 0  # where there was no place beside them


#: How far the middle of the tag stands beside the cursor of the first pane, and beyond its ends [px].
BESIDE = """() => {
  const tag = document.querySelector('.tag-box').getBoundingClientRect();
  const { left, right } = document.querySelector('.trends-panes .u-over').getBoundingClientRect();
  const stage = document.querySelector('.trends-stage');
  const share = (stage.ariaValueNow - stage.ariaValueMin) / (stage.ariaValueMax - stage.ariaValueMin);
  const x = left + share * (right - left);
  return Math.max(tag.left - x, x - tag.right, left - tag.left - 1, tag.right - right - 1);
}"""


async def test_the_tag_follows_its_cursor_into_another_window_while_a_replay_is_paused(
    phone: Phone, canned: Canned
) -> None:
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await show(canned, phone.page, "replay")
    await expect(phone.page.locator(".tag-text")).to_be_visible()
    for width in (1920, 1440):
        await phone.page.set_viewport_size({"width": width, "height": 1000})
        await phone.page.evaluate(DRAWN)
        assert await phone.page.evaluate(BESIDE) <= 24, width
