"""What items of a departure check need to see: the facts, what an automatic item finds, what an active one has seen.

Pure; `now_s` is on a monotonic clock.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from server.control.departure_list import Item
from server.protocol.departure import DepartureResult

STANDS_MPS = 0.10  # noise of the wheel speed at rest reaches 0.084 m/s


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What is known of the car and its server now; None: not known."""

    is_monitored: bool = False
    checks: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # id → ok, fault or unknown, and its sentence
    rates_hz: Mapping[str, float | None] = field(default_factory=dict)  # by topic, in small letters
    is_recording: bool = False
    recorder: str = ""  # why it does not record
    phones: int = 0  # that would sound an alarm
    room_gb: float | None = None
    ahead_s: float | None = None  # of the car's clock against the server's
    brake_percent: float | None = None
    accelerator_percent: float | None = None
    tyre_rad: float | None = None  # positive = left
    speed_mps: float | None = None
    slow_down: str = "not_available"


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """What an active item has seen since the check began. Percent, degrees or seconds, as its kind needs."""

    now: float | None = None
    highest: float | None = None
    left: float | None = None  # of steering: the furthest to the left
    since_s: float | None = None  # of the slow-down: held at standstill since
    is_reached: bool = False
    value: str = ""


def judge(item: Item, seen: Seen) -> tuple[DepartureResult, str]:
    """What an automatic item finds now: done or failed; open: it cannot be judged. And the value as text."""
    need = item.need or 0.0
    match item.kind:
        case "recorder":
            if seen.is_recording:
                return "done", "records"
            return "failed", seen.recorder or "not recording"
        case "sound":
            text = "on no phone" if not seen.phones else f"on {seen.phones} phone{'s' if seen.phones > 1 else ''}"
            return ("done" if seen.phones >= need else "failed"), text
        case "disk":
            if seen.room_gb is None:
                return "open", "known once it records"
            return ("done" if seen.room_gb >= need else "failed"), f"{_number(seen.room_gb)} GB free"
    if not seen.is_monitored:
        return "open", "no car is monitored"
    match item.kind:
        case "check":
            return _check(item, seen)
        case "topic":
            rate = seen.rates_hz.get(item.of.lower())
            if rate is None:
                return "failed", "no message"
            return ("done" if rate >= need else "failed"), f"{rate:.1f} Hz"
        case "clock":
            if seen.ahead_s is None:
                return "open", "the car does not send its time"
            return ("done" if abs(seen.ahead_s) <= need else "failed"), f"differs {abs(seen.ahead_s):.2f} s"
    return "open", ""


def _check(item: Item, seen: Seen) -> tuple[DepartureResult, str]:
    verdict, text = seen.checks.get(item.of, ("", ""))
    if verdict == "ok":
        return "done", "OK"
    if verdict == "fault":
        return "failed", text
    return "open", f"not checked: {text}" if verdict else "there is no such check"


def see(item: Item, had: Peak, seen: Seen, now_s: float) -> Peak:
    """What an active item has seen, one moment later."""
    need = item.need or 0.0
    match item.kind:
        case "brake":
            return _pressed(had, seen.brake_percent, need)
        case "accelerator":
            return _pressed(had, seen.accelerator_percent, need)
        case "steering":
            return _steered(had, seen.tyre_rad, need)
        case "slow_down":
            return _slowed(had, seen, need, now_s)
    return had


def _pressed(had: Peak, percent: float | None, need: float) -> Peak:
    if percent is None:
        return replace(had, now=None)
    highest = percent if had.highest is None else max(had.highest, percent)
    return replace(had, now=percent, highest=highest, is_reached=highest >= need, value=f"{highest:.0f} %")


def _steered(had: Peak, tyre_rad: float | None, need: float) -> Peak:
    """Left first, then right: an angle to the right counts once the left was reached."""
    if tyre_rad is None:
        return replace(had, now=None)
    degrees = math.degrees(tyre_rad)
    left = degrees if had.left is None else max(had.left, degrees)
    right = had.highest
    if left >= need:
        right = -degrees if right is None else max(right, -degrees)
    reached = right is not None and right >= need
    value = f"{left:.1f}° left, {max(0.0, right or 0.0):.1f}° right"
    return Peak(now=degrees, left=left, highest=right, is_reached=reached, value=value)


def _slowed(had: Peak, seen: Seen, need: float, now_s: float) -> Peak:
    """The slow-down was ordered and the car stood still without a break."""
    is_ordered = seen.slow_down in ("ordered", "holding")
    stands = seen.speed_mps is not None and abs(seen.speed_mps) < STANDS_MPS
    if not (is_ordered and stands and seen.is_monitored):
        return replace(had, now=0.0, since_s=None)
    since_s = now_s if had.since_s is None else had.since_s
    held_s = now_s - since_s
    highest = max(had.highest or 0.0, held_s)
    is_reached = highest >= need
    return Peak(
        now=held_s, since_s=since_s, highest=highest, is_reached=is_reached, value=f"0 m/s held {highest:.0f} s"
    )


def _number(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}"
