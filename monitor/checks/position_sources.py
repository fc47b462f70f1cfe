"""Do two sources of the position agree, and does the receiver behind a filtered position still have a fix?

Two places are compared by the gate of `agreement.gate_m`: the errors of both, and how far the car may have driven
between them. A filter goes on without its receiver, and its position looks as good as before: so the fix of every other
topic of positions is watched too.
"""

from __future__ import annotations

import re

from monitor.agreement import gate_m
from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Quantity,
    Sound,
    absent,
    beside,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.compared import SIGMA_UNKNOWN_M, Other
from monitor.geo import offset_m
from monitor.reading import Reading
from monitor.snapshot import Snapshot
from monitor.values import STATUS_UNSET, GpsFix

SILENT_AFTER_S = 5.0  # and after ten of its own periods
AWAITED_S = 10.0  # for the first message
RECEIVED = 3  # messages make a source
UNCERTAIN_S = 0.5  # how much later one source may be than the other
ONE_SOURCE = absent("Only one source gives a position, so there is nothing to compare it with", brief="one source")
FILTERED = re.compile(r"filter|fused|fusion|ekf|ukf|kalman|smooth|estimat|odom", re.IGNORECASE)


class PositionLimits(Limits):
    least_m: float = threshold(
        5.0,
        "Positions apart",
        unit="m",
        low=1.0,
        high=100.0,
        step=1.0,
        help="Two sources of the position may differ by this; more by their own errors, and while the car moves.",
    )


def _others(snapshot: Snapshot) -> list[Other]:
    if not snapshot.compared.others:
        return []
    carrier = snapshot.link.carriers.get("position")
    return [one for one in snapshot.compared.of("position") if one.topic != carrier]


def _awaited_s(snapshot: Snapshot) -> dict[str, float]:
    """Other topics of which nothing came yet, and for how long."""
    carrier, awaited = snapshot.link.carriers.get("position"), snapshot.compared.awaited.get("position", {})
    return {topic: max(0.0, snapshot.now_s - since_s) for topic, since_s in awaited.items() if topic != carrier}


def _why_not(snapshot: Snapshot, was_active: bool) -> Finding | None:
    """Why there is nothing to compare, None where there is."""
    if snapshot.get("position") is None and "position" not in snapshot.link.published:
        return absent("Position is not published")
    if not _others(snapshot) and not _awaited_s(snapshot):
        return unknown("No other source of the position sends any more", short="not sent") if was_active else ONE_SOURCE
    if snapshot.need("position").status < 0:
        return unknown("The receiver has no fix", short="no fix")
    return None


def _is_filter_of(topic: str, carrier: str | None) -> bool:
    """Whether, by the names, another topic is made of the one that carries the position."""
    return FILTERED.search(topic) is not None and (carrier is None or FILTERED.search(carrier) is None)


def _silent_s(one: Other, now_s: float) -> float | None:
    """How long a source has sent nothing, None while it sends."""
    silent_s = one.reading.silent_s(now_s)
    return silent_s if silent_s > max(SILENT_AFTER_S, one.reading.horizon_s) else None


def receives(snapshot: Snapshot, limits: PositionLimits, was_active: bool) -> Finding:
    why_not = _why_not(snapshot, was_active)
    if why_not is not None:
        return why_not
    carrier = snapshot.link.carriers.get("position")
    lost: list[tuple[str, str]] = []
    unclear: list[str] = []
    for one in _others(snapshot):
        silent_s, status = _silent_s(one, snapshot.now_s), one.reading.value.status
        if _is_filter_of(one.topic, carrier) or one.reading.count < RECEIVED:
            continue
        if silent_s is not None:
            lost.append((one.topic, f"Nothing from {one.topic} for {silent_s:.0f} s"))
        elif status == STATUS_UNSET:
            unclear.append(f"{one.topic} does not report whether it has a fix")
        elif status < 0:
            lost.append((one.topic, f"No fix at {one.topic}"))
    for topic, awaited_s in _awaited_s(snapshot).items():
        if awaited_s > AWAITED_S and not _is_filter_of(topic, carrier):
            lost.append((topic, f"Nothing from {topic} for {awaited_s:.0f} s, nor before"))
        else:
            unclear.append(f"No message from {topic} yet")
    if lost:
        goes_on = "the position" if carrier is None else f"the position of {carrier}"
        text = f"{'; '.join(sentence for _, sentence in lost)}; {goes_on} continues without it"
        return fault(text, brief="no receiver", causes=tuple(topic for topic, _ in lost))
    if unclear:
        return unknown("; ".join(unclear), short="unclear")
    return ok("Every source of the position has a fix")


def agree(snapshot: Snapshot, limits: PositionLimits, was_active: bool) -> Finding:
    why_not = _why_not(snapshot, was_active)
    if why_not is not None:
        return why_not
    reading = snapshot.readings["position"]
    mps = _speed_mps(snapshot)
    if mps is None:
        return unknown("How fast the car moves is not known", short="no speed")
    apart: list[tuple[float, float, float, str]] = []
    near: list[str] = []
    unclear = [f"No message from {topic} yet" for topic in _awaited_s(snapshot)]
    for one in _others(snapshot):
        fix: GpsFix = one.reading.value
        if not one.reading.is_fresh(snapshot.now_s):
            unclear.append(f"{one.topic} is {one.reading.age_s(snapshot.now_s):.0f} s old")
        elif fix.status < 0:
            unclear.append(f"{one.topic} has no fix")
        else:
            distance_m, allowed_m = _apart_m(reading, one.reading, mps, limits)
            part = f"{beside(distance_m, allowed_m)} m from that of {one.topic}; up to {allowed_m:.1f} m is normal"
            if distance_m > allowed_m * (0.8 if was_active else 1.0):
                apart.append((distance_m / allowed_m, distance_m, allowed_m, part))
            else:
                near.append(part)
    if apart:
        _, distance_m, allowed_m, part = max(apart)
        return fault(
            f"The position is {part}",
            brief=f"{distance_m:.0f} m",
            measured=Quantity(label="Distance apart", value=distance_m, unit="m"),
            limit=Quantity(label="Allowed", value=allowed_m, unit="m"),
            causes=("position",),
        )
    if not near:
        return unknown("; ".join(unclear), short="not sent" if len(unclear) > 1 else "old")
    return ok(f"The position is {'; '.join((*near, *unclear))}")


def _speed_mps(snapshot: Snapshot) -> float | None:
    """The highest of what is known of the speed [m/s]."""
    speed, made = snapshot.get("speed"), snapshot.compared.made.get("position")
    known = [abs(speed.value.speed_mps)] if speed is not None and speed.is_fresh(snapshot.now_s) else []
    return max([*known, made.mps] if made is not None else known, default=None)


def _apart_m(a: Reading[GpsFix], b: Reading[GpsFix], mps: float, limits: PositionLimits) -> tuple[float, float]:
    """How far two positions are apart [m], and how far they may be."""
    one, other = a.value, b.value
    east_m, north_m = offset_m(one.lat_deg, one.lon_deg, other.lat_deg, other.lon_deg)
    gate = gate_m(
        east_m,
        north_m,
        car_sigma_m=SIGMA_UNKNOWN_M if one.sigma_m is None else one.sigma_m,
        phone_sigma_m=SIGMA_UNKNOWN_M if other.sigma_m is None else other.sigma_m,
    )
    driven_m = mps * (UNCERTAIN_S + abs((a.received_s - a.delay_s) - (b.received_s - b.delay_s)))
    return (east_m**2 + north_m**2) ** 0.5, max(limits.least_m, gate) + driven_m


CHECKS = (
    Check(
        id="position_receiver",
        label="Receiver",
        tile="GPS fix",
        order=42,
        checked_when="Checked while Position is fresh with a fix and another topic gives positions too.",
        group="position_sources",
        alarm=AlarmSpec(
            title="GPS: a receiver has no fix",
            ended="A GPS receiver had no fix",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            on_delay_s=3.0,
            off_delay_s=5.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="The shown position may be reckoned without satellites, and drift: watch where the car is.",
        ),
        limits=PositionLimits,
        find=receives,
        needs=frozenset({"position"}),
    ),
    Check(
        id="position_sources",
        label="Positions",
        tile="GPS fix",
        order=43,
        checked_when="Checked while Position and a second source of it are fresh and have a fix.",
        alarm=AlarmSpec(
            title="Sources of the position disagree",
            ended="Sources of the position disagreed",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            on_delay_s=3.0,
            off_delay_s=5.0,
            actions=(Action.ACKNOWLEDGE,),
            advice="Trust neither until it is known which is wrong.",
            inhibited_by=("gps_jump", "gps_drift"),
        ),
        limits=PositionLimits,
        find=agree,
        needs=frozenset({"position"}),
    ),
)
