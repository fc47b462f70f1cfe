"""What surrounds a drive, in canned states for pictures and for axe: marks, interventions, people, the check."""

from __future__ import annotations

import time
from typing import Any

from playwright.async_api import Page, expect

from tests.page.canned import Canned, alarm, check, live, slowed

Json = dict[str, Any]
MODE: Json = {"mode": "autonomous", "why": None, "source": "/mode", "way_m": 1240.0, "open": []}
# A microphone that hums: the browser of the pictures has none.
MICROPHONE = """() => {
  navigator.mediaDevices.getUserMedia = async () => {
    const audio = new AudioContext();
    const [tone, volume, to] = [audio.createOscillator(), audio.createGain(), audio.createMediaStreamDestination()];
    volume.gain.value = 0.4;
    tone.connect(volume).connect(to);
    tone.start();
    return to.stream;
  };
}"""


def now_ms() -> int:
    return time.time_ns() // 1_000_000


def driving(**more: Any) -> Json:
    """A state of a car whose mode is known."""
    return live() | {"mode": MODE | {"since_ms": now_ms() - 252_000} | more}


def stored_marks() -> list[Json]:
    rows = (
        (
            12,
            "control",
            "Steering hunts at the stop line, twice in a row, and the car then creeps.",
            False,
            False,
            "page",
        ),
        (95, None, "", True, False, "page"),
        (260, "object", "Box behind the corner", False, True, "page"),
        (431, None, "", False, False, "car"),
        (780, "comfort", "", False, False, "page"),
    )
    return [
        {"mark": f"m{n}", "marked_ms": now_ms() - 1000 * ago_s, "category": category, "words": words, "voice": voice,
         "photo": photo, "source": source, "by": None if source == "car" else "A. K. (Pixel 7)"}
        for n, (ago_s, category, words, voice, photo, source) in enumerate(rows)
    ]  # fmt: skip


async def mark_fresh(server: Canned, page: Page) -> None:
    server.state = driving()
    await page.locator("[data-f=mark]").tap()
    await expect(page.locator(".fresh")).to_contain_text("stored")


async def mark_voice(server: Canned, page: Page) -> None:
    server.state = driving()
    await page.evaluate(MICROPHONE)
    box = await page.locator("[data-f=mark]").bounding_box()
    assert box is not None
    await page.mouse.move(box["x"] + 40, box["y"] + 28)
    await page.mouse.down()
    await expect(page.locator(".fresh .m")).to_contain_text("Listening, 7")


async def mark_sheet(server: Canned, page: Page) -> None:
    await mark_fresh(server, page)
    await page.locator("[data-f=mark-words]").tap()
    sheet = page.locator("#sheet-mark")
    await sheet.get_by_role("button", name="Control").tap()
    await sheet.locator("textarea").fill("Steering hunts at the stop line")
    await page.evaluate("document.activeElement.blur()")


async def marks(server: Canned, page: Page) -> None:
    server.state = driving()
    server.drive_marks = stored_marks()
    await page.tap("#monitor [data-f=menu]")
    await page.tap("#sheet-menu [data-f=marks]")
    await expect(page.locator("#sheet-marks .mark-rows li")).to_have_count(5)


async def marks_wait(server: Canned, page: Page) -> None:
    """Two marks of this phone are refused by a server without room."""
    server.refuses["mark"] = "No room for marks on this disk."
    await mark_fresh_refused(server, page)
    server.drive_marks = stored_marks()
    await page.tap("#monitor [data-f=menu]")
    await page.tap("#sheet-menu [data-f=marks]")
    await expect(page.locator("#sheet-marks .mark-rows li")).to_have_count(7)


async def mark_fresh_refused(server: Canned, page: Page) -> None:
    server.state = driving()
    for _ in range(2):
        await page.locator("[data-f=mark]").tap()
        await page.wait_for_timeout(700)


def intervention() -> Json:
    """The safety driver brakes and takes over at 6.4 m/s."""
    samples = [
        {"at_s": n / 5, "speed_mps": 6.4 if n < 0 else max(0.4, 6.4 - 1.1 * n / 5),
         "brake_percent": 0.0 if n < -2 else min(38.0, 9.0 * (n + 3))}
        for n in range(-50, 31)
    ]  # fmt: skip
    return {
        "id": "i1", "at_ms": now_ms() - 9000, "kind_of": "to_manual", "speed_mps": 6.4, "lat_deg": 32.2,
        "lon_deg": -110.9, "initiated_by": "driver", "brake_percent": 38.0, "acted_before_s": 0.2,
        "active": ["Laser slower than expected"],
        "last_alarm_ago_s": 41.0, "samples": samples, "what": None, "category": None, "described_by": None, "left": 2,
    }  # fmt: skip


async def take_over_key(server: Canned, page: Page) -> None:
    opened = [{"id": "i1", "at_ms": now_ms() - 9000, "kind_of": "to_manual"}]
    server.state = driving(mode="manual", since_ms=now_ms() - 9000, way_m=31.0, open=opened)
    server.interventions = {"i1": intervention()}
    await page.wait_for_selector("button[data-f=mode-key]:visible")


async def take_over(server: Canned, page: Page) -> None:
    await take_over_key(server, page)
    await page.locator("[data-f=mode-key]").tap()
    await expect(page.locator("#sheet-take-over [data-f=fact-at]")).to_contain_text("m/s")


def duty(me: Json | None) -> Json:
    return {"kind": "duty", "me": me, "signs": "Pixel 7", "ended": None, "people": 4, "on_duty": [me] if me else []}


def me() -> Json:
    return {"person": "mr", "name": "M. R.", "role": "operator", "title": "operator", "device": "Pixel 7",
            "since_ms": now_ms() - 60_000}  # fmt: skip


async def again(server: Canned, page: Page) -> None:
    """The page from anew: who is on duty and the ids of the checks are sent once."""
    await page.evaluate("sessionStorage.clear()")  # the page prompts once for who is on duty
    await page.goto("about:blank")
    await page.goto(f"{server.address}/#home")
    await page.wait_for_selector("#monitor:not([hidden])")
    await page.tap("#monitor .top .rec")  # any touch lets the page sound


async def sign_on(server: Canned, page: Page) -> None:
    server.state, server.duty = driving(), duty(None)
    await again(server, page)
    await page.locator("#sheet-duty [data-person]").first.tap()


async def left(server: Canned, page: Page) -> None:
    """Alarms that somebody left acknowledged."""
    server.state, server.duty = driving(), duty(me())
    gone: Json = {"state": "ACKED", "acknowledged_by": "A. K. (Desk in the control room)", "place": "list"}
    gone["off_duty_ms"] = now_ms() - 3_600_000
    server.state["alarms"] = [
        alarm(
            "drift",
            "GPS drift at standstill",
            text="6.3 m from where it stopped",
            raised_ms=now_ms() - 4e6,
            for_s=4000.0,
            **gone,
        ),
        alarm("fuel", "Fuel low", text="8 %, 10 % are needed", raised_ms=now_ms() - 5e6, for_s=5000.0, **gone),
        alarm("slow", "Laser slower than expected", text="61 of 75 Hz", raised_ms=now_ms() - 6e6, for_s=6000.0, **gone),
    ]
    await again(server, page)
    await expect(page.locator("#sheet-left li")).to_have_count(3)


async def handover(server: Canned, page: Page) -> None:
    """This page takes control over, the first line is read."""
    server.state, server.duty = driving(), duty(me())
    await again(server, page)
    await page.wait_for_timeout(500)
    mine = next(one["page"] for one in reversed(server.received) if one.get("kind") == "hello")
    rows = (
        ("alarm", "Speed above limit", "12.6 m/s, limit 11.0 m/s. Acknowledged by A. K. (Desk).", "critical"),
        ("alarm", "GPS drift at standstill", "6.3 m from where it stopped. Acknowledged by B. (Tablet).", "warning"),
        ("limit", "Speed limit: 9 m/s", "default 11 m/s", None),
        ("rides", "In the car: S. D., safety driver", "", None),
        ("driving", "Autonomous", "1.24 km", None),
        ("departure", "Departure check signed", "by A. K., 10 of 10", None),
    )
    lines = [
        {"key": "driving:autonomous:" if kind == "driving" else f"l{n}", "kind": kind, "title": title, "text": text,
         "priority": priority, "until_ms": None,
         "since_ms": now_ms() - 90_000 if priority else None, "read": n == 0,
         "off_duty_ms": now_ms() - 60_000 if n == 1 else None}
        for n, (kind, title, text, priority) in enumerate(rows)
    ]  # fmt: skip
    server.state["control"] = {"holder": "A. K. (Desk)", "page": "desk", "fence": 3, "handover": {
        "by": "A. K. (Desk)", "by_page": "desk", "name": "M. R. (Pixel 7)", "page": mine, "since_ms": now_ms(),
        "lines": lines, "left": 5, "version": "1",
    }}  # fmt: skip
    await expect(page.locator("#sheet-handover li")).to_have_count(6)


async def departure(server: Canned, page: Page) -> None:
    server.state = driving()
    await page.tap("#monitor [data-f=menu]")
    await page.get_by_role("button", name="Departure check").tap()
    await page.wait_for_selector(".departure .dep-list li, .departure .sign")


async def files_search(server: Canned, page: Page) -> None:
    """Recordings found by a word of a mark in them."""
    server.state = driving()
    await page.tap("[data-tab=files]")
    await page.wait_for_selector("[data-f=recordings] .file")
    await page.get_by_role("searchbox", name="Search recordings").fill("control")
    await page.wait_for_timeout(500)
    await page.evaluate("document.activeElement.blur()")


async def car_complies(server: Canned, page: Page) -> None:
    """The tile of the slow-down while the car does not slow, and its checks."""
    server.state = driving() | {"decelerate": slowed(False)}
    tile = next(one for one in server.state["checks"] if one["id"] == "Command")
    tile |= {"id": "slow_down_unconfirmed", "label": "Slow-down", "verdict": "fault", "brief": "FAULT 4.2 m/s"}
    tile["checks"] = ["slow_down_unconfirmed"]
    text = "The car does not slow: 4.2 m/s, 2.2 m/s ordered"
    rows = (("slow_down_unconfirmed", "Car complies", "fault", text),
            ("slow_down_hold_ended", "Car held", "ok", "The car is held for 597 s more"),
            ("slow_down_rivals", "Alone on the topic", "ok", "OK"))  # fmt: skip
    server.checks["slow_down_unconfirmed"] = check(
        "slow_down_unconfirmed", "Slow-down", verdict="fault", text=text, for_s=2.3, priority="critical",
        checked_when="Checked while the car is being slowed.", title="Slow-down NOT CONFIRMED",
        checks=[{"id": id, "label": label, "verdict": verdict, "text": text,
                 "priority": "critical"} for id, label, verdict, text in rows],
    )  # fmt: skip
    await again(server, page)
    await page.locator(".checks li button:visible", has_text="Slow-down").tap()
    await page.wait_for_selector(".check-view")


async def keys_help(server: Canned, page: Page) -> None:
    """The list of keys."""
    server.state = driving()
    await page.wait_for_selector(".ledge > .mark-key")  # keys act once the page is complete
    for _ in range(10):
        await page.keyboard.press("?")
        if await page.locator("#sheet-keys[open]").count():
            return
        await page.wait_for_timeout(500)
    await page.wait_for_selector("#sheet-keys[open]", timeout=1000)


async def left_hand(server: Canned, page: Page) -> None:
    """The page under the left thumb."""
    server.state = driving()
    await page.evaluate("document.documentElement.dataset.hand = 'left'")


WORK_SCENES = {
    "help": keys_help,
    "left-hand": left_hand,
    "mark-fresh": mark_fresh,
    "mark-voice": mark_voice,
    "mark-sheet": mark_sheet,
    "marks": marks,
    "marks-wait": marks_wait,
    "take-over-key": take_over_key,
    "take-over": take_over,
    "sign-on": sign_on,
    "left": left,
    "handover": handover,
    "departure": departure,
    "files-search": files_search,
    "car-complies": car_complies,
}
