"""`make screenshots`: the page in each of its states, on phones, a tablet and desks, in both themes."""

from __future__ import annotations

import asyncio
import math
import os
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from playwright.async_api import Browser, Error, Page, async_playwright

from tests.chromium import FLAGS, find_chromium
from tests.page import canned_fleet
from tests.page.canned import Canned, alarm, check, idle, live, slow, slowed
from tests.page.canned_questions import NOT_CHOSEN, brake_unit, laser_offers, two_lasers
from tests.page.work_scenes import WORK_SCENES
from tests.server.web.map_files import png

OUT = Path(__file__).resolve().parents[2] / "out" / "screenshots"
PHONE: dict[str, Any] = {
    "viewport": {"width": 412, "height": 915},
    "device_scale_factor": 2,
    "has_touch": True,
    "is_mobile": True,
    "reduced_motion": "reduce",  # so that nothing stands half-way
}
# The windows of each picture, width by height; those of a row share a load of the page, which is resized.
THEMES: tuple[Literal["dark", "light"], ...] = ("dark", "light")
WINDOWS = (((412, 915), (360, 740), (740, 360)), ((1440, 900), (1920, 1080), (820, 1180)))
# The pictures of the drawing: which scene, in a window of which size, in which theme.
WATCH: dict[str, tuple[str, int, int, str]] = {
    "watch-desk": ("home", 1440, 900, "dark"),
    "watch-desk-light": ("home", 1440, 900, "light"),
    "watch-desk-critical": ("home-fault", 1440, 900, "dark"),
    "watch-desk-lost": ("link-lost", 1440, 900, "dark"),
    "watch-desk-replay": ("replay", 1440, 900, "dark"),
    "watch-desk-settings": ("settings", 1440, 900, "dark"),
    "watch-desk-files": ("files", 1440, 900, "dark"),
    "watch-wide": ("home-people", 1920, 1080, "dark"),
    "watch-wide-critical": ("home-fault", 1920, 1080, "dark"),
    "watch-tablet": ("home", 820, 1180, "dark"),
    "watch-tablet-alarms": ("alarms", 820, 1180, "dark"),
    "watch-tablet-critical": ("home-fault", 820, 1180, "light"),
    "watch-tablet-stale": ("home-stale", 820, 1180, "dark"),
    "watch-tablet-replay": ("replay", 820, 1180, "dark"),
    "watch-land": ("home", 915, 412, "dark"),
    "watch-crit-land": ("home-fault", 915, 412, "dark"),
    "watch-crit-412": ("home-fault", 412, 915, "light"),
    "watch-crit-320": ("home-fault", 320, 568, "light"),
    "watch-phone-home": ("home", 412, 915, "dark"),
    "watch-phone-home-360": ("home", 360, 800, "light"),
    "watch-phone-home-320": ("home", 320, 568, "dark"),
    "watch-phone-alarms": ("alarms", 412, 915, "dark"),
    "watch-phone-alarms-ended": ("alarms-ended", 412, 915, "light"),
    "watch-fleet-3": ("fleet-three", 1440, 900, "dark"),
    "watch-fleet-3-light": ("fleet-three", 1440, 900, "light"),
    "watch-fleet-100": ("fleet-hundred", 1440, 900, "light"),
    "watch-fleet-100-flood": ("fleet-flood", 1440, 900, "dark"),
    "watch-fleet-100-lap": ("fleet-flood", 1280, 720, "dark"),
    "watch-fleet-quiet": ("fleet-quiet", 1440, 900, "dark"),
    "watch-fleet-quiet-light": ("fleet-quiet", 1440, 900, "light"),
    "watch-fleet-two": ("fleet-asked", 1440, 900, "light"),
    "watch-fleet-broker-lost": ("fleet-lost", 1440, 900, "dark"),
    "watch-fleet-tablet": ("fleet-three", 820, 1180, "dark"),
    "watch-fleet-tablet-100": ("fleet-flood", 820, 1180, "light"),
    "watch-fleet-phone-3": ("fleet-three", 412, 915, "light"),
    "watch-fleet-phone-3-360": ("fleet-three", 360, 740, "dark"),
    "watch-fleet-phone-flood": ("fleet-flood", 412, 915, "dark"),
    "watch-fleet-phone-quiet": ("fleet-quiet", 412, 915, "dark"),
    "watch-fleet-phone-lost": ("fleet-lost", 412, 915, "light"),
    "watch-fleet-phone-cars": ("fleet-cars", 412, 915, "dark"),
    "watch-fleet-phone-map": ("fleet-map", 412, 915, "light"),
    "watch-fleet-land": ("fleet-three", 915, 412, "light"),
    "watch-phone-cars": ("cars", 412, 915, "dark"),
    "watch-bars-412": ("cars-bar", 412, 915, "dark"),
    "watch-bars-360": ("cars-bar", 360, 800, "dark"),
    "watch-bars-320": ("cars-bar", 320, 568, "dark"),
    "watch-phone-chart": ("chart", 412, 915, "dark"),
    "watch-phone-check": ("check", 412, 915, "dark"),
    "watch-phone-check-unknown": ("check-unknown", 412, 915, "light"),
}
# The Mark key and the head of sheets come seconds after the page.
COMPLETE = "() => !document.querySelector('#monitor:not([hidden])') || document.querySelector('.ledge > .mark-key')"
Scene = Callable[[Canned, Page], Awaitable[None]]
SCENES: dict[str, Scene] = {**WORK_SCENES}
# Roboto as on a phone: text takes the room it takes there.
FONTS = """<?xml version="1.0"?><!DOCTYPE fontconfig SYSTEM "fonts.dtd"><fontconfig><dir>/usr/share/fonts</dir>
<match target="pattern"><edit name="family" mode="prepend" binding="strong"><string>Roboto</string></edit></match>
<cachedir>{cache}</cachedir></fontconfig>"""


def scene(name: str) -> Callable[[Scene], Scene]:
    """Declares how a state is reached; the page is loaded afterwards, then `act` of it is done."""

    def keep(how: Scene) -> Scene:
        SCENES[name] = how
        return how

    return keep


def at(clock: str) -> int:
    """A time of day as milliseconds since 1970."""
    hour, minute, second = (int(part) for part in clock.split(":"))
    return int(
        datetime.now().astimezone().replace(hour=hour, minute=minute, second=second, microsecond=0).timestamp() * 1000
    )


async def front(page: Page, tab: str) -> None:
    """Brings a tab to the front; on a wide screen the map and the scan are panes, which are in sight already."""
    key = page.locator(f"#monitor [data-tab={tab}]")
    await key.wait_for(state="attached")
    if await key.is_visible():
        await key.tap()


@scene("home")
async def home(server: Canned, page: Page) -> None:
    server.state = live()


@scene("home-people")
async def home_people(server: Canned, page: Page) -> None:
    state = live()
    rows = (("a", "Desk 1", True, None), ("b", "Desk 2", True, None), ("c", "Field 2", False, "its sound is off"))
    people = [
        {"page": name, "name": label, "can": can, "why": None if can else "sound", "why_text": why, "here": True,
         "awake": "ready", "vibrates": False, "battery": None, "charging": None, "heard_s": 0.1 + 0.1 * n}
        for n, (name, label, can, why) in enumerate(rows)
    ]  # fmt: skip
    state["reach"] = {"can": 2, "of": 3, "why": "Field 2: its sound is off", "pages": people, "left_out": 0}
    state["control"] |= {"page": "a", "holder": "Desk 1"}
    server.state = state


@scene("home-lower")
async def home_lower(server: Canned, page: Page) -> None:
    server.state = live()
    await page.wait_for_selector(".checks li")
    await page.evaluate("document.querySelector('[data-panel=home]').scrollTo(0, 9999)")


@scene("chart")
async def chart(server: Canned, page: Page) -> None:
    await home_lower(server, page)
    key = page.locator("[data-trend=distance]")
    if await key.is_visible():  # on a wide screen the chart is a pane
        await key.tap()
    await page.wait_for_selector(".trends-strip .line[d]")
    box = await page.locator(".trends-panes .u-over").first.bounding_box()
    assert box is not None
    await page.touchscreen.tap(box["x"] + 0.6 * box["width"], box["y"] + 40)


@scene("home-fault")
async def home_fault(server: Canned, page: Page) -> None:
    server.state = too_fast(live())


def too_fast(state: dict[str, Any]) -> dict[str, Any]:
    """A state with its critical alarm in a dialog."""
    state["signals"]["speed"]["value"]["speed_mps"] = 12.6
    state["signals"]["acceleration"]["value"]["acceleration_mps2"] = 1.1
    state["signals"]["accelerator"]["value"]["percent"] = 38
    state["signals"]["steering"]["value"]["percent"] = 2
    state["signals"]["distance"]["value"]["distance_m"] = 18.7
    state["signals"]["bearing"]["value"]["bearing_rad"] = 0.0175
    state["nearest"] = {"time_gap_s": 1.5, "stopping_m": 18.2}
    state["checks"][0] |= {"verdict": "fault", "brief": "FAULT 12.6 m/s"}
    state["alarms"] = [
        alarm(
            "Speed", "Speed above limit", priority="critical", place="dialog", sound="high", needs_ack=True,
            text="12.6 m/s, limit 11.0 m/s", measured={"label": "Speed", "value": 12.6, "unit": "m/s"},
            limit={"label": "Limit", "value": 11.0, "unit": "m/s"}, actions=["acknowledge", "decelerate"],
            worst={"label": "Speed", "value": 12.8, "unit": "m/s", "side": "above"},
            advice="The safety driver must slow the car.", raised_ms=at("14:07:31"),
        )
    ]  # fmt: skip
    return state


@scene("home-warning")
async def home_warning(server: Canned, page: Page) -> None:
    state = live()
    state["signals"]["speed"]["value"]["speed_mps"] = 0.0
    state["signals"]["acceleration"]["value"]["acceleration_mps2"] = 0.0
    state["signals"]["brake"]["value"]["percent"] = 42
    state["signals"]["accelerator"]["value"]["percent"] = 0
    state["signals"]["steering"]["value"]["percent"] = 0
    state["nearest"] = {"time_gap_s": None, "stopping_m": 0.0}
    state["recording"]["for_s"] = 698.0
    state["checks"][4] |= {"verdict": "fault", "brief": "FAULT 6.3 m"}
    state["alarms"] = [alarm("GPS drift", "GPS drift", text="6.3 m from where it stopped 41 s ago; 2.0 m are allowed")]
    server.state = state


@scene("slow-down-off")
async def slow_down_off(server: Canned, page: Page) -> None:
    server.state = live() | {"decelerate": slow("not_available", why="/catvehicle/cmd_vel is not on the car.")}


@scene("slow-down-arm")
async def slow_down_arm(server: Canned, page: Page) -> None:
    server.state = live() | {"decelerate": slow("not_armed", rivals=["/lap_driver"])}
    await page.wait_for_timeout(400)
    await page.tap(".board > .rail .slide")
    await page.wait_for_selector("#sheet-slow[open]")


@scene("slow-down-armed")
async def slow_down_armed(server: Canned, page: Page) -> None:
    server.state = live() | {"decelerate": slow("armed")}


@scene("slow-down-sliding")
async def slow_down_sliding(server: Canned, page: Page) -> None:
    await slow_down_armed(server, page)
    await page.wait_for_selector('.board > .rail .slide[data-kind="armed"]')
    knob = await page.locator(".board > .rail .slide .knob").bounding_box()
    assert knob is not None
    await page.mouse.move(knob["x"] + 30, knob["y"] + 30)
    await page.mouse.down()
    await page.mouse.move(knob["x"] + 165, knob["y"] + 20, steps=4)


def _slowing(confirmed: bool | None, **more: Any) -> dict[str, Any]:
    state = live() | {"decelerate": slowed(confirmed, **more)}
    for name, value in (
        ("speed", {"speed_mps": 2.9}),
        ("acceleration", {"acceleration_mps2": -1.4, "source": "speed"}),
        ("brake", {"percent": 24.0}),
        ("accelerator", {"percent": 0.0}),
        ("distance", {"distance_m": 9.6, "none_in_range": False}),
    ):
        state["signals"][name]["value"] |= value
    state["nearest"] = {"time_gap_s": 3.3, "stopping_m": 4.3}
    return state


@scene("slow-down-ordered")
async def slow_down_ordered(server: Canned, page: Page) -> None:
    server.state = _slowing(True)


@scene("slow-down-release")
async def slow_down_release(server: Canned, page: Page) -> None:
    await slow_down_ordered(server, page)
    await page.tap("[data-f=release]")


@scene("slow-down-not-confirmed")
async def slow_down_not_confirmed(server: Canned, page: Page) -> None:
    server.state = _slowing(False)
    server.state["signals"]["speed"]["value"]["speed_mps"] = 4.2
    server.state["alarms"] = [
        alarm(
            "slow_down_unconfirmed", "Slow-down NOT CONFIRMED", priority="critical", place="dialog", sound="high",
            needs_ack=True, text="The car does not slow: 4.2 m/s, 2.2 m/s ordered", actions=["acknowledge"],
            trip_text="", advice="Use the physical stop.", raised_ms=at("14:07:31"),
        )
    ]  # fmt: skip


@scene("slow-down-not-confirmed-seen")
async def slow_down_not_confirmed_seen(server: Canned, page: Page) -> None:
    await slow_down_not_confirmed(server, page)
    server.state["alarms"][0]["state"] = "ACKED"


@scene("slow-down-not-confirmed-warned")
async def slow_down_not_confirmed_warned(server: Canned, page: Page) -> None:
    await slow_down_not_confirmed_seen(server, page)
    server.state["alarms"].append(alarm("phone_missing", "Phone position missing", text="No fix for 12 s."))


@scene("slow-down-in-dialog")
async def slow_down_in_dialog(server: Canned, page: Page) -> None:
    await home_fault(server, page)
    server.state["decelerate"] = slow("armed")


@scene("countdown")
async def countdown(server: Canned, page: Page) -> None:
    await home_fault(server, page)
    server.state["decelerate"] = slow(
        "armed",
        countdown={
            "trigger": "speed", "title": "Speed above limit", "text": "12.6 m/s, limit 11.0 m/s", "left_s": 1.4,
        },
    )  # fmt: skip


def _cut(state: dict[str, Any], cut: str, **link: Any) -> dict[str, Any]:
    state["link"] |= {"cut": cut, "since_ms": at("14:07:31")} | link
    state["recording"]["state"] = "held"
    for one in state["checks"]:
        one |= {"verdict": "unknown", "brief": "not checked: stale"}
    return state


@scene("home-stale")
async def home_stale(server: Canned, page: Page) -> None:
    server.state = silent_car(live())


def silent_car(state: dict[str, Any]) -> dict[str, Any]:
    """A state whose car fell silent."""
    problem = {
        "code": "car_silent", "title": "The car fell silent.", "mark": "silent",
        "hint": "Server and bridge answer; no signal comes from the car.",
    }  # fmt: skip
    return _cut(state, "bridge-car", car_age_s=3.35, problem=problem)


@scene("server-silent")
async def server_silent(server: Canned, page: Page) -> None:
    server.state = live()
    await page.wait_for_selector(".checks li")
    server.silent = True
    await page.wait_for_timeout(3300)


@scene("link-lost")
async def link_lost(server: Canned, page: Page) -> None:
    state = _cut(live(), "server-bridge", bridge_age_s=6.15, attempts=3, trying_for_s=6.2)
    state["session"]["phase"] = "lost"
    state["alarms"] = [
        alarm(
            "link_lost", "Connection lost", priority="critical", place="dialog", sound="high", raised_ms=at("14:07:31"),
            actions=["acknowledge", "reconnect", "change_address", "exit"],
        )
    ]  # fmt: skip
    server.state = state


@scene("no-messages")
async def no_messages(server: Canned, page: Page) -> None:
    state = idle("monitoring")
    state["checks"] = [one | {"verdict": "unknown", "brief": "not checked: stale"} for one in live()["checks"]]
    state["session"] |= {"address": "ws://192.168.4.1:9090", "connected_for_s": 4.95}
    problem = {
        "code": "no_message", "title": "The bridge answers, the car publishes nothing.", "mark": "silent",
        "hint": "Seen after a restart of roscore: restart rosbridge too.",
    }  # fmt: skip
    state["link"] |= {"cut": "bridge-car", "car_age_s": None, "topics_heard": 0, "problem": problem}
    state["recording"]["state"] = "off"
    server.state = state


@scene("paused")
async def paused(server: Canned, page: Page) -> None:
    state = live()
    state["session"] |= {"paused": True, "paused_for_s": 42.1}
    server.state = state


def at_a_planned_stop(state: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A state of a car in the workshop, with an alarm of it that bears the mark."""
    stop = {"reason": "workshop", "by": "A. K. (Pixel 7)", "since_ms": at("13:58:02"), "is_speed_known": True}
    state["session"]["planned_stop"] = stop | more
    state["signals"]["speed"]["value"]["speed_mps"] = 0.0
    state["signals"]["acceleration"]["value"]["acceleration_mps2"] = 0.0
    state["alarms"] = [alarm("GPS drift", "GPS drift", text="6.3 m, limit 2.0 m", sound="none", planned_stop=True)]
    return state


@scene("planned-stop")
async def planned_stop(server: Canned, page: Page) -> None:
    server.state = at_a_planned_stop(live())


@scene("planned-stop-critical")
async def planned_stop_critical(server: Canned, page: Page) -> None:
    server.state = at_a_planned_stop(live())
    server.state["alarms"] = [one | {"planned_stop": True} for one in too_fast(live())["alarms"]]


@scene("planned-stop-returned")
async def planned_stop_returned(server: Canned, page: Page) -> None:
    server.state = at_a_planned_stop(live())
    for one in server.state["alarms"]:
        one |= {"state": "RTN_UNACKED", "active": False, "needs_ack": True}


@scene("planned-stop-stale")
async def planned_stop_stale(server: Canned, page: Page) -> None:
    server.state = silent_car(at_a_planned_stop(live(), is_speed_known=False))


@scene("planned-stop-no-data")
async def planned_stop_no_data(server: Canned, page: Page) -> None:
    await no_messages(server, page)
    server.state["session"]["planned_stop"] = at_a_planned_stop(live(), is_speed_known=False)["session"]["planned_stop"]


@scene("scan")
async def scan(server: Canned, page: Page) -> None:
    server.state = live()
    await front(page, "scan")


@scene("question")
async def question(server: Canned, page: Page) -> None:
    state = live()
    state["questions"] = [two_lasers(), brake_unit()]
    state["signals"]["scan"] |= NOT_CHOSEN
    state["signals"]["brake"] |= NOT_CHOSEN
    server.state = state
    server.candidates = {"scan": laser_offers()}
    await page.wait_for_selector("[data-f=question-open]:visible")


@scene("question-sheet")
async def question_sheet(server: Canned, page: Page) -> None:
    await question(server, page)
    await page.tap("[data-f=question-open]")
    await page.wait_for_selector("#sheet-question .sketch")


@scene("signal")
async def signal(server: Canned, page: Page) -> None:
    server.state = live()
    server.candidates = {"distance": laser_offers()}
    await page.tap('[data-part="nearest"] [data-f=age]')
    await page.wait_for_selector(".sig-more .others")


@scene("signals")
async def signals(server: Canned, page: Page) -> None:
    state = live()
    state["signals"]["odometry"] |= {"freshness": "ageing", "age_s": 0.33}
    state["signals"]["diagnostics"] |= {"freshness": "stale", "age_s": 7.35, "rate_hz": 0.0}
    state["alarms"] = [alarm("signal_stale", "Diagnostics stale", state="ACKED")]
    server.state = state
    await page.tap("#monitor [data-f=menu]")
    await page.tap("#sheet-menu [data-screen=signals]")


@scene("alarm-log")
async def alarm_log(server: Canned, page: Page) -> None:
    state = live()
    state["alarms"] = [alarm("GPS drift", "GPS drift", state="ACKED", text="6.3 m, limit 2.0 m")]
    server.state = state
    rows = (
        ("14:07:38", "cleared", "critical", "Speed above limit", "back under 10.5 m/s for 2 s", None),
        ("14:07:33", "acknowledged", "critical", "Speed above limit", "", "Pixel 7"),
        ("14:07:31", "raised", "critical", "Speed above limit", "12.6 m/s, limit 11.0 m/s", None),
        ("14:06:12", "settings", None, None, "Speed limit: 9.0 m/s → 11.0 m/s", "Pixel 7"),
        ("14:05:02", "raised", "warning", "GPS drift", "6.3 m from where it stopped 41 s ago; 2.0 m are allowed", None),
        ("14:04:51", "shelved", "warning", "Scan slow", "until 14:14", "Pixel 7"),
        ("14:04:40", "raised", "warning", "Scan slow", "61 of 75 Hz", None),
        ("14:03:58", "cleared", "advisory", "Vehicle not moving", "", None),
        ("14:03:40", "raised", "advisory", "Vehicle not moving", "standing for 10 s", None),
        ("14:02:17", "connected", None, None, "Connected to 192.168.4.1:9090.", None),
    )
    server.log = [
        {"n": 117 - i, "at_ms": at(clock), "change": change, "priority": priority, "alarm": title, "title": title,
         "text": text, "by": by, "occurrence": 1}
        for i, (clock, change, priority, title, text, by) in enumerate(rows)
    ]  # fmt: skip
    await page.tap("#monitor [data-f=menu]")
    await page.tap("#sheet-menu [data-screen=log]")
    await page.tap("text=Older")
    await page.evaluate("document.querySelector('.screen').scrollTo(0, 9999)")


def several() -> dict[str, Any]:
    """A state with an alarm of every kind."""
    gone: dict[str, Any] = {"state": "RTN_UNACKED", "active": False, "place": "list"}
    speed, limit = (
        {"label": name, "value": value, "unit": "m/s"} for name, value in (("Speed", 12.6), ("Limit", 11.0))
    )
    state = live()
    state["signals"]["speed"]["value"]["speed_mps"] = 12.6
    state["checks"][0] |= {"verdict": "fault", "brief": "FAULT 12.6 m/s"}
    state["alarms"] = [
        alarm(
            "Speed",
            "Speed above limit",
            priority="critical",
            place="list",
            sound="high",
            measured=speed,
            limit=limit,
            text="12.6 m/s, limit 11.0 m/s",
            raised_ms=at("14:07:31"),
            advice="The safety driver must slow the car.",
        ),
        alarm("phone_missing", "Phone position missing", place="list", text="none for 16 s", raised_ms=at("14:07:12")),
        alarm(
            "drift",
            "GPS drift at standstill",
            place="list",
            text="6.3 m from where it stopped",
            raised_ms=at("14:07:02"),
            silenced_until_ms=at("14:08:01"),
            silenced_by="Desk 1",
        ),
        alarm(
            "link_lost",
            "Connection lost",
            priority="critical",
            trip_text="The bridge, for 6.2 s",
            raised_ms=at("14:06:02"),
            **gone,
        ),
        alarm(
            "quality",
            "GPS quality unknown",
            state="ACKED",
            acknowledged_by="Desk 1",
            place="list",
            text="no covariance",
            raised_ms=at("14:03:50"),
        ),
        alarm(
            "slow",
            "Laser slower than expected",
            state="SHELVED",
            shelved_by="Ann",
            place="list",
            shelved_until_ms=at("14:14:00"),
            text="61 of 75 Hz",
            raised_ms=at("14:04:51"),
        ),
    ]
    state["suppressed"] = [
        {
            "id": "near",
            "title": "Nearest object slow",
            "priority": "warning",
            "by": ["Laser slower than expected"],
            "raised_ms": at("14:04:51"),
        }
    ]
    return state


@scene("alarms")
async def alarms(server: Canned, page: Page) -> None:
    server.state = several()
    await page.tap("[data-f=strip]")
    await page.wait_for_selector("ul[data-f=alarms] li")
    await page.wait_for_timeout(1200)  # until what is in sight can be acknowledged together


@scene("alarms-ended")
async def alarms_ended(server: Canned, page: Page) -> None:
    state = several()
    gone: dict[str, Any] = {"state": "RTN_UNACKED", "active": False, "place": "list"}
    state["signals"]["speed"]["value"]["speed_mps"] = 4.2
    state["checks"][0] |= {"verdict": "ok", "brief": "OK"}
    lost = next(one for one in state["alarms"] if one["id"] == "link_lost")
    missing = next(one for one in state["alarms"] if one["id"] == "phone_missing") | gone
    shelved = next(one for one in state["alarms"] if one["state"] == "SHELVED")
    state["alarms"] = [lost, missing, shelved]
    server.state = state
    await page.tap("[data-f=strip]")
    await page.wait_for_selector("ul[data-f=alarms] li")
    await page.wait_for_timeout(1200)


def car(name: str, speed_mps: float, *, holder: str | None = None, cut: str | None = None, **worst: Any) -> Any:
    """One car of several, with its worst alarm."""
    age_s, waiting = 41.0 if cut else 0.1, int(worst.get("state") == "UNACKED")
    raised_ms = time.time_ns() // 1_000_000 - 7000
    summary = {
        "phase": "lost" if cut else "monitoring", "paused": False, "waiting": waiting,
        "link": {"cut": cut, "bridge_age_s": age_s, "car_age_s": age_s, "trying_for_s": 0.0, "connected_for_s": 252.3},
        "worst": {"id": "a", "occurrence": 1, "active": True, "sound": "none", "raised_ms": raised_ms, **worst}
        if worst else None,
        "speed": {"value_mps": speed_mps, "freshness": "stale" if cut else "fresh", "age_s": age_s, "horizon_s": 1.0},
        "holder": holder, "page": None, "recording": "held" if cut else "recording", "recording_for_s": 252.0,
        "slow_down": "not_available",
    }  # fmt: skip
    return {"name": name, "age_s": 0.1, "summary": summary}


async def _several_cars(server: Canned, page: Page, *others: Any) -> None:
    server.vehicle = "Ocelot"
    server.cars = [car("Ocelot", 4.2, holder="You"), *others]
    server.state = live() | {"decelerate": slow("not_armed")}
    await page.goto("about:blank")
    await page.goto(f"{server.address}/#home")
    await page.wait_for_selector("#monitor:not([hidden])")
    await page.tap("#monitor .top .rec")
    await page.wait_for_selector("#monitor [data-f=car-badge]:not([hidden])")


@scene("cars-bar")
async def cars_bar(server: Canned, page: Page) -> None:
    """The bar with a badge: the name, who is in control, the chain, the recording, the menu."""
    drift: dict[str, Any] = {"title": "GPS drift", "priority": "warning", "state": "UNACKED"}
    await _several_cars(server, page, car("Caracal", 0.0, **drift))


@scene("cars")
async def cars(server: Canned, page: Page) -> None:
    await _several_cars(
        server, page,
        car("Serval", 12.6, title="Speed above limit", priority="critical", state="UNACKED"),
        car("Margay", 3.1, cut="bridge-car", title="Car silent", priority="critical", state="UNACKED"),
        car("Caracal", 0.0, holder="Desk 2", title="GPS drift", priority="warning", state="ACKED"),
        car("Kodkod", 8.0),
    )  # fmt: skip
    await page.tap("#monitor [data-f=who]")
    await page.wait_for_selector("#sheet-cars[open]")


async def _fleet(server: Canned, page: Page, cars: list[Any], show: str = "queue") -> None:
    """The page of all cars."""
    server.cars, server.fleet_events = cars, canned_fleet.events()
    await page.goto(f"{server.address}/fleet")
    await page.wait_for_selector("#fleet tbody tr", state="attached")
    await page.mouse.click(4, 4)  # any touch lets the page sound
    if await page.locator(f"[data-f=show-{show}]").is_visible():
        await page.tap(f"[data-f=show-{show}]")
    await page.wait_for_timeout(900)


@scene("fleet-three")
async def fleet_three(server: Canned, page: Page) -> None:
    await _fleet(server, page, canned_fleet.three())


@scene("fleet-quiet")
async def fleet_quiet(server: Canned, page: Page) -> None:
    await _fleet(server, page, canned_fleet.quiet())


@scene("fleet-hundred")
async def fleet_hundred(server: Canned, page: Page) -> None:
    await _fleet(server, page, canned_fleet.hundred())


@scene("fleet-flood")
async def fleet_flood(server: Canned, page: Page) -> None:
    await _fleet(server, page, canned_fleet.hundred(31))


@scene("fleet-cars")
async def fleet_cars(server: Canned, page: Page) -> None:
    await _fleet(server, page, canned_fleet.hundred(31), "cars")


@scene("fleet-map")
async def fleet_map(server: Canned, page: Page) -> None:
    await _fleet(server, page, canned_fleet.hundred(31), "map")


@scene("fleet-asked")
async def fleet_asked(server: Canned, page: Page) -> None:
    """One item is offered to this page, another is its own."""
    await _fleet(server, page, canned_fleet.three())
    me = next(one["page"] for one in server.received if one.get("kind") == "hello" and one["page"] != "")
    mine = canned_fleet.holder({"page": me, "name": "Me"})
    offered = {"by": "Desk 2", "name": "Me", "page": me, "since_ms": canned_fleet.now_ms() - 12_000}
    server.cars[1]["summary"]["attention"] = canned_fleet.attention(ago_s=7, assigned=mine)
    server.cars[2]["summary"]["attention"] = canned_fleet.attention(
        ago_s=156, assigned=canned_fleet.holder(canned_fleet.DESK_2), offered=offered
    )
    await page.wait_for_selector("[data-act=accept]:visible")


@scene("fleet-offered")
async def fleet_offered(server: Canned, page: Page) -> None:
    """An item is offered to somebody else, and control of a car is requested."""
    cars = canned_fleet.three()
    offered = {"by": "Desk 2", "name": "Field 2", "page": "field2", "since_ms": canned_fleet.now_ms() - 12_000}
    assigned = canned_fleet.holder(canned_fleet.DESK_2)
    cars[2]["summary"]["attention"] = canned_fleet.attention(ago_s=156, assigned=assigned, offered=offered)
    requests = [{"page": "a", "name": "A. K. (Pixel 7)", "left_s": 14.0}, {"page": "b", "name": "Ben", "left_s": 19.0}]
    cars[3]["summary"]["requests"] = requests
    await _fleet(server, page, cars)


@scene("fleet-lost")
async def fleet_lost(server: Canned, page: Page) -> None:
    await _fleet(server, page, canned_fleet.three())
    server.silent = True
    await page.wait_for_selector("#fleet[data-state=lost]")


@scene("check")
async def one_check(server: Canned, page: Page) -> None:
    server.state = several()
    speed, limit = server.state["alarms"][0]["measured"], server.state["alarms"][0]["limit"]
    values = [6.0 + 1.2 * math.sin(n / 40) for n in range(280)] + [6.0 + 0.34 * n for n in range(20)]
    server.checks["Speed"] = check(
        "Speed", "Speed", verdict="fault", text="12.6 m/s, limit 11.0 m/s", for_s=2.3, measured=speed, limit=limit,
        settings=["speed_limit.max_mps", "speed_limit.deadband_mps"], priority="critical", signal="speed",
        minute={"step_s": 0.2, "values": values, "limits": [11.0] * 300},
    )  # fmt: skip
    await page.tap("[data-f=tiles] li button")
    await page.wait_for_selector(".check-view canvas:not([hidden])")


@scene("check-change")
async def check_change(server: Canned, page: Page) -> None:
    await one_check(server, page)
    await page.tap("[data-f=check-change]")


@scene("check-unknown")
async def unknown_check(server: Canned, page: Page) -> None:
    server.state = live()
    server.checks["GPS drift"] = check(
        "GPS drift", "GPS drift", verdict="unknown", text="The car moves", for_s=32.0,
        checked_when="Checked at standstill with a fix, once three positions have come since the car stopped.",
        checks=[{"id": "GPS drift", "label": "GPS drift", "verdict": "unknown", "text": "The car moves",
                 "priority": "warning"},
                {"id": "gps_jump", "label": "GPS jump", "verdict": "ok", "text": "OK", "priority": "warning"}],
    )  # fmt: skip
    await page.wait_for_selector("[data-f=tiles] li")
    await page.tap("[data-f=tiles] li:nth-child(5) button")
    await page.wait_for_selector(".check-view[data-verdict=unknown] .others button")


@scene("tablet")
async def tablet(server: Canned, page: Page) -> None:
    server.state = live()
    await page.set_viewport_size({"width": 1280, "height": 800})
    await page.wait_for_timeout(1500)  # the track is requested once a second


@scene("connect")
async def connect(server: Canned, page: Page) -> None:
    server.state = idle()
    await page.wait_for_selector("#connect:not([hidden])")
    await page.fill("#address", "192.168.4.1:9090")
    await page.tap("[data-f=go]")
    await page.wait_for_timeout(300)
    await page.evaluate("document.activeElement.blur()")


@scene("connect-saved")
async def connect_saved(server: Canned, page: Page) -> None:
    server.state = idle() | {"recording": {"state": "off", "for_s": None}}
    await page.wait_for_selector("#connect:not([hidden])")
    await page.tap("#connect [data-f=saved]")
    await page.wait_for_selector(".saved-board .file:not([hidden])")


@scene("connect-recent")
async def connect_recent(server: Canned, page: Page) -> None:
    """The cars that were dialled from this device."""
    await connect(server, page)
    dialled = ["192.168.4.1:9090", "ocelot:9090"]
    await page.evaluate("(all) => localStorage.setItem('catgraph.addresses', JSON.stringify(all))", dialled)
    await page.tap("#connect [data-f=history]")
    await page.wait_for_selector("#sheet-history[open] li")


@scene("connect-failed")
async def connect_failed(server: Canned, page: Page) -> None:
    await connect(server, page)
    state = idle("failed")
    state["session"]["address"] = "ws://192.168.4.1:9090"
    state["link"] |= {
        "cut": "server-bridge", "attempts": 3, "trying_for_s": 4.0,
        "problem": {
            "code": "refused", "title": "192.168.4.1 is there, but nothing listens on port 9090.", "mark": "refused",
            "hint": "Start rosbridge on the car, or check the port.",
        },
    }  # fmt: skip
    server.state = state


@scene("menu")
async def menu(server: Canned, page: Page) -> None:
    server.state = live()
    await page.tap("#monitor [data-f=menu]")


@scene("stop")
async def stop(server: Canned, page: Page) -> None:
    server.state = live()
    await page.tap("[data-f=stop]")


@scene("map")
async def map_(server: Canned, page: Page) -> None:
    server.state = live()
    await front(page, "map")
    await page.wait_for_timeout(1500)  # the track is requested once a second


@scene("map-heading-up")
async def map_heading_up(server: Canned, page: Page) -> None:
    await map_(server, page)
    await page.tap("#panel-map [data-f=north]")
    await page.tap("#panel-map [data-f=fit]")


@scene("map-tiles")
async def map_tiles(server: Canned, page: Page) -> None:
    server.ground["layers"] = [
        {"title": "Plan", "tiles": "/map/{z}/{x}/{y}", "min_zoom": 0, "max_zoom": 19, "attribution": "Plan: test track",
         "bounds": [-180, -85, 180, 85]}
    ]  # fmt: skip
    server.tile = lambda z, x, y: png(*((176, 190, 168) if (x + y) % 2 else (198, 205, 186)))
    await page.reload()  # a map in sight reads its layers once
    await page.wait_for_selector("#monitor:not([hidden])")
    await page.tap("#monitor .top .rec")
    await map_(server, page)
    await page.wait_for_timeout(800)


@scene("map-stale")
async def map_stale(server: Canned, page: Page) -> None:
    await map_(server, page)
    server.state["signals"]["position"] |= {"freshness": "stale", "age_s": 3.35}
    server.state["signals"]["heading"] |= {"freshness": "stale", "age_s": 3.35}
    server.state["phone"] |= {
        "used": False, "why": "hidden",
        "why_text": "No position while the page is in the background on the phone",
        "age_s": 12.4,
    }  # fmt: skip
    server.state["checks"][5] |= {"verdict": "unknown", "brief": "not checked: hidden"}
    await page.wait_for_timeout(500)


@scene("map-coarse")
async def map_coarse(server: Canned, page: Page) -> None:
    """A car whose heading and accuracy nobody knows, and a phone that knows its place to 60 m."""
    await map_(server, page)
    server.state["signals"]["position"]["value"] |= {"sigma_m": None}
    server.state["signals"]["heading"] |= {"freshness": "stale", "age_s": 12.0}
    server.state["phone"] |= {
        "accuracy_m": 60.0, "used": False, "why": "coarse",
        "why_text": "Position of the phone is accurate to 60 m only; 50 m is needed",
    }  # fmt: skip
    server.state["checks"][5] |= {"verdict": "unknown", "brief": "not checked: coarse"}


@scene("map-none")
async def map_none(server: Canned, page: Page) -> None:
    state = live()
    state["signals"]["position"] |= {"freshness": "never", "value": None, "age_s": None}
    state["signals"]["heading"] |= {"freshness": "never", "value": None, "age_s": None}
    state["phone"], state["session"]["track"] = None, {"number": 1, "last": 0}
    state["checks"][5] |= {"verdict": "unknown", "brief": "not checked: no phone"}
    server.state = state
    await front(page, "map")


@scene("files")
async def files(server: Canned, page: Page) -> None:
    server.state = live()
    server.state["recording"] |= {"state": "recording", "part": 1, "bytes": 18_600_000, "dropped": 0, "reason": None}
    await page.tap("[data-tab=files]")
    await page.wait_for_selector("[data-f=recordings] .file")


@scene("files-menu")
async def files_menu(server: Canned, page: Page) -> None:
    await files(server, page)
    await page.tap('[data-id="car_2"]')


@scene("replay")
async def replay(server: Canned, page: Page) -> None:
    """The speed above its limit, four minutes into a recording that is paused there."""
    server.state, server.timeline = replayed(live()), replayed_timeline()
    await page.goto(f"{server.address}/?replay=car_0&t=246#home")
    await page.wait_for_selector("#monitor:not([hidden])")
    await page.tap(".gauge")  # any touch lets the page sound


def replayed(state: dict[str, Any]) -> dict[str, Any]:
    """A state of a recording."""
    start_ms, at_s, length_s = at("14:05:05"), 246.0, 512.0
    for name, value in (
        ("speed", {"speed_mps": 12.1}),
        ("acceleration", {"acceleration_mps2": 0.4, "source": "speed"}),
        ("accelerator", {"percent": 31.0}),
        ("steering", {"percent": 2.0}),
        ("bearing", {"bearing_rad": -0.0175}),
        ("distance", {"distance_m": 18.7, "none_in_range": False}),
    ):
        state["signals"][name]["value"] |= value
    state["nearest"] = {"time_gap_s": 1.5, "stopping_m": 17.9}
    state["checks"][0] |= {"verdict": "fault", "brief": "FAULT 12.1 m/s"}
    state["live"] = {
        "phase": "monitoring", "name": "CATVehicle", "paused": False, "cut": None, "problem": None, "alarms": [],
        "alarms_in_all": 0, "recording": {"state": "recording", "for_s": 698.0}, "control": state["control"],
        "reach": None, "decelerate": state["decelerate"],
    }  # fmt: skip
    state["replay"] = {
        "id": "car_0", "vehicle": "car", "title": "", "token": "0",
        "at_s": at_s, "at_ms": start_ms + round(at_s * 1000), "start_ms": start_ms,
        "end_ms": start_ms + round(length_s * 1000), "length_s": length_s, "is_playing": False, "rate": 1.0,
        "reached_rate": None, "is_seeking": False, "is_settled": True, "silent_s": 0.0, "seek": 1,
        "alarms_from": "recording", "settings_from": "recording", "hangs_s": None,
    }  # fmt: skip
    state["alarms"] = [
        alarm(
            "Speed",
            "Speed above limit",
            priority="critical",
            state="ACKED",
            text="12.1 m/s, limit 11.0 m/s",
            raised_ms=start_ms + 237_000,
        )
    ]
    return state


def replayed_timeline() -> dict[str, Any]:
    """The whole of that recording: speed, alarms."""
    length_s = 512.0
    marks = ((237.0, "critical", "Speed above limit"), (368.0, "warning", "GPS drift"), (446.0, "critical", "Obstacle"))
    speeds = [max(0.0, 6.0 + 5.5 * math.sin(n / 19.0) + 1.2 * math.sin(n / 5.0)) for n in range(128)]
    return {
        "kind": "timeline", "length_s": length_s, "done_s": length_s, "is_done": True, "bucket_s": 4.0,
        "speed_mps": speeds, "gaps": [], "marks_left_out": 0, "notes": [],
        "marks": [
            {"at_s": at_s, "alarm": title, "title": title, "priority": priority, "text": "", "duration_s": 12.4}
            for at_s, priority, title in marks
        ],
    }  # fmt: skip


@scene("mail")
async def mail(server: Canned, page: Page) -> None:
    await files_menu(server, page)
    await page.tap("dialog[open] >> text=E-mail")
    await page.wait_for_selector("#sheet-mail[open]")
    await page.fill("#mail-to", "ann@example.org, bob@example.org")


@scene("outbox")
async def outbox(server: Canned, page: Page) -> None:
    def part(state: str, reply: str, refused: str | None = None) -> dict[str, Any]:
        recipient = {"address": "ann@example.org", "state": "refused" if refused else "accepted", "said": refused or ""}
        return {
            "part": 1, "parts": 1, "state": state, "said": reply, "attempts": 1,
            "next_ms": at("14:21:00") if state == "queued" else None, "recipients": [recipient],
        }  # fmt: skip

    rows = (
        ("queued", "The mail server does not answer; tried again by itself.", "14:07:02", "Lap 3", 57.1, None),
        ("sent", "Taken by the mail server.", "13:40:10", "Rehearsal lot", 99.4, None),
        ("failed", "Every recipient was refused.", "11:12:44", "Lap 1", 16.2, "550 no such user"),
    )
    server.mails = [
        {"n": 3 - i, "ordered_ms": at(clock), "recordings": ["car_0"], "format": "mcap", "to": ["ann@example.org"],
         "subject": subject, "state": state, "said": reply, "is_ready": True, "share": None, "way": "attached",
         "size_bytes": round(size * 1e6), "parts": [part(state, reply, refused)]}
        for i, (state, reply, clock, subject, size, refused) in enumerate(rows)
    ]  # fmt: skip
    await mail(server, page)
    await page.tap("[data-f=mail-outbox]")
    await page.wait_for_selector("#sheet-outbox[open] [data-mail]")


@scene("settings")
async def settings(server: Canned, page: Page) -> None:
    server.state = live()
    await page.tap("[data-tab=settings]")
    await page.wait_for_selector(".set")


@scene("settings-lower")
async def settings_lower(server: Canned, page: Page) -> None:
    await settings(server, page)
    await page.evaluate("document.querySelector('.topics').scrollIntoView()")


@scene("topic")
async def topic(server: Canned, page: Page) -> None:
    await settings(server, page)
    await page.tap("#panel-settings [data-signal=speed]")


@scene("preferences")
async def preferences(server: Canned, page: Page) -> None:
    server.state = live()
    await page.tap("#monitor [data-f=menu]")
    await page.tap("[data-screen=preferences]")


async def show(server: Canned, page: Page, name: str) -> None:
    """Brings the page into a state, from anew."""
    server.reset()
    await page.goto("about:blank")
    await page.goto(f"{server.address}/#home")
    await page.wait_for_selector("#monitor:not([hidden])")
    if "connect" not in name:
        await page.tap("#monitor .top .rec")  # any touch lets the page sound
    await SCENES[name](server, page)


@asynccontextmanager
async def opened(browser: Browser, name: str, theme: str, width: int, height: int) -> AsyncIterator[Page]:
    """A page of its own in this state."""
    server = Canned()
    scale = 2 if min(width, height) < 600 else 1
    options = PHONE | {"viewport": {"width": width, "height": height}, "device_scale_factor": scale}
    async with server.running():
        context = await browser.new_context(
            **options, color_scheme="dark" if theme == "dark" else "light", permissions=[]
        )
        page = await context.new_page()
        page.on("console", lambda message: print(name, "console:", message.text) if message.type != "log" else None)
        page.on("pageerror", lambda error: print(name, "error:", error))
        try:
            await show(server, page, name)
            await page.wait_for_function(COMPLETE)
            await page.wait_for_timeout(700)
            yield page
        finally:
            await context.close()


async def take(browser: Browser, name: str) -> None:
    """The pictures of a scene."""
    for windows in WINDOWS:
        async with opened(browser, name, "dark", *windows[0]) as page:
            for width, height in windows:
                await page.set_viewport_size({"width": width, "height": height})
                await page.wait_for_timeout(900)
                for theme in THEMES:
                    await page.emulate_media(color_scheme=theme, reduced_motion="reduce")
                    await page.wait_for_timeout(350)
                    path = OUT / f"{name}-{theme}-{width}.png"
                    await page.screenshot(path=path)
                    print(path)


async def take_watch(browser: Browser, name: str) -> None:
    """One picture of the drawing, from the running page."""
    what, width, height, theme = WATCH[name]
    async with opened(browser, what, theme, width, height) as page:
        path = OUT / f"{name}.png"
        await page.screenshot(path=path)
        print(path)


async def take_all(names: list[str], fonts: Path) -> list[str]:
    """All pictures, or those whose names are given, into out/screenshots; returns the names of those that failed."""
    failed = []
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=find_chromium(), args=[*FLAGS], env={**os.environ, "FONTCONFIG_FILE": str(fonts)}
        )
        for name in names or [*WATCH, *SCENES]:
            try:
                await (take_watch if name in WATCH else take)(browser, name)
            except Error as why:  # the others are taken all the same
                print(f"{name}: {why}")
                failed.append(name)
        await browser.close()
    return failed


def main(names: list[str]) -> None:
    """Set up the fonts, then take the pictures."""
    OUT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="catgraph-fonts-") as folder:
        fonts = Path(folder, "fonts.conf")
        fonts.write_text(FONTS.format(cache=Path(folder, "cache")), encoding="utf-8")
        if failed := asyncio.run(take_all(names, fonts)):
            sys.exit(f"Not taken: {', '.join(failed)}")


if __name__ == "__main__":
    main(sys.argv[1:])
