"""What the page may load and run: its policy stops nothing that it does, and everything that it never does."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.async_api import expect

from server.app.config import Config
from server.vehicle.vehicle import Vehicle
from tests.page.conftest import Phone
from tests.page.roamer import roaming
from tests.page.test_map import plan
from tests.page.test_tabs import TABS
from tests.server.conftest import serving
from tests.server.recording.made import record

NOTE_VIOLATIONS = """
  window.violations = [];
  addEventListener('securitypolicyviolation', (event) => window.violations.push(
    `${event.effectiveDirective}: ${event.blockedURI} ${event.sample} ${event.sourceFile}:${event.lineNumber}`), true);
"""


async def violations(phone: Phone) -> list[str]:
    found: list[str] = await phone.page.evaluate("window.violations")
    return found


@pytest.mark.own_phone
async def test_nothing_the_page_does_is_against_its_policy(phone: Phone, tmp_path: Path) -> None:
    """Every tab with all it can draw: tiles by Leaflet, sparklines by uPlot, a replay, every screen of the menu."""
    await phone.page.add_init_script(NOTE_VIOLATIONS)
    async with roaming() as car:
        ground = plan(tmp_path, car.lat_deg, car.lon_deg)
        record(tmp_path / "data" / "recordings" / "car" / "car_20160601T120000Z.mcap", seconds=6.0)
        config = Config(vehicles=(Vehicle(name="car", address=car.address),), data=tmp_path / "data", maps=(ground,))
        async with serving(config) as address:
            await phone.open(address)
            await phone.live()
            for tab in TABS:
                await phone.page.locator(f"#tab-{tab}").tap()
                await expect(phone.page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
                if tab == "map":
                    await phone.page.wait_for_selector(
                        "#panel-map .leaflet-tile-loaded", state="attached", timeout=20_000
                    )
                if tab == "home":
                    await phone.page.wait_for_selector("#panel-home .uplot, #panel-home canvas", state="attached")
                if tab == "files":
                    row = phone.page.locator("#panel-files [data-f=recordings] [data-id]").first
                    await expect(row).to_have_attribute("data-state", "read", timeout=20_000)
            assert await violations(phone) == []
            assert await phone.page.evaluate("Boolean(trustedTypes.defaultPolicy)")


FORBIDDEN = {
    "markup": ("document.body.innerHTML = '<b>x</b>'", "require-trusted-types-for"),
    "markup that was inserted": (
        "document.body.insertAdjacentHTML('beforeend', '<i></i>')",
        "require-trusted-types-for",
    ),
    "a frame's document": ("document.createElement('iframe').srcdoc = 'x'", "require-trusted-types-for"),
    "a script's address": ("document.createElement('script').src = '/static/js/main.js'", "require-trusted-types-for"),
    "a script's text": ("document.createElement('script').textContent = '1'", "require-trusted-types-for"),
    "text as code": ("eval('1')", "require-trusted-types-for"),
    "a function of text": ("new Function('return 1')", "require-trusted-types-for"),
    "another policy": ("trustedTypes.createPolicy('mine', {createHTML: (s) => s})", "trusted-types"),
    "another default": ("trustedTypes.createPolicy('default', {createHTML: (s) => s})", "trusted-types"),
    "another worker": ("navigator.serviceWorker.register('/static/js/main.js')", "require-trusted-types-for"),
}


@pytest.fixture(scope="module")
def forbidden_at_once() -> str:
    """All of them in one visit: a browser is slow to start. Answers what each ended with."""
    tries = ", ".join(f"[{name!r}, () => ({script})]" for name, (script, _) in FORBIDDEN.items())
    return f"""async () => {{
      const ends = {{}};
      for (const [name, run] of [{tries}]) {{
        const before = window.violations.length;
        try {{ await run(); ends[name] = 'done'; }} catch (error) {{ ends[name] = 'refused'; }}
        await new Promise((then) => setTimeout(then, 60));
        ends[name] += ' ' + window.violations.slice(before).map((one) => one.split(':')[0]).join();
      }}
      return ends;
    }}"""


@pytest.mark.own_phone
@pytest.mark.parametrize("phone", [{"service_workers": "allow"}], indirect=True, ids=["workers allowed"])
async def test_what_the_page_never_does_is_refused(phone: Phone, forbidden_at_once: str) -> None:
    await phone.page.add_init_script(NOTE_VIOLATIONS)
    async with serving(Config()) as address:
        await phone.open(address)
        await phone.page.wait_for_function("() => Boolean(trustedTypes.defaultPolicy)")
        ends = await phone.page.evaluate(forbidden_at_once)
        for name, (_, directive) in FORBIDDEN.items():
            assert ends[name] == f"refused {directive}", (name, ends)
        assert await phone.page.evaluate("document.body.querySelectorAll('i').length") == 0
    phone.complaints.clear()


@pytest.mark.own_phone
async def test_the_description_of_the_interface_is_within_the_policy(phone: Phone) -> None:
    await phone.page.add_init_script(NOTE_VIOLATIONS)
    async with serving(Config()) as address:
        await phone.open(f"{address}/docs")
        await expect(phone.page.locator("h1")).to_contain_text("catgraph")
        assert await violations(phone) == []


async def test_no_other_page_can_show_this_one(phone: Phone) -> None:
    async with serving(Config()) as address, serving(Config()) as other:
        await phone.open(f"{other}/docs")  # another port is another origin
        shown = await phone.page.evaluate(
            """async (address) => {
              const frame = document.createElement('iframe');
              frame.src = address;
              document.body.append(frame);
              await new Promise((then) => setTimeout(then, 500));
              try { return frame.contentDocument ? 'readable' : 'shut'; } catch { return 'shut'; }
            }""",
            address,
        )
        assert shown == "shut"
        read = await phone.page.evaluate(
            "(address) => fetch(`${address}/api/health`, {mode: 'no-cors'}).then(() => 'got', () => 'refused')", address
        )
        assert read == "refused"
    phone.complaints.clear()
