"""What a page receives, as docs/protocol.md has it: signals, alarms and events as JSON, scans as bytes."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from monitor import values
from monitor.alarm import Alarm, AlarmState, Transition
from monitor.alarm_spec import Sound
from monitor.check import Finding, Quantity, Verdict
from monitor.load import AlarmLoad
from monitor.obstacle_view import ANGLE_STEP_RAD
from monitor.planned_stop import StopReason
from monitor.runner import Tile
from monitor.scan import Mounting, usable, within_half_turn
from monitor.trends import STEP_S, Piece
from server.protocol.alarm_state import AlarmLoad as LoadState
from server.protocol.alarm_state import NewEvent, StandingAlarm, SuppressedAlarm, Worst
from server.protocol.alarm_state import Quantity as QuantityState
from server.protocol.alarm_state import Tile as TileState
from server.protocol.signal_state import ComponentState, ScanValue, SignalValue
from server.protocol.state import Step, Trends

SCAN_MAGIC = 0x53
SCAN_VERSION = 2
SCAN_HEADER = struct.Struct("<BBHIHHffffbBH")  # 32 bytes, so that the ranges that follow are aligned
NO_BEAM, BLIND = 65535, 65534  # in the place of the nearest beam: nothing in the corridor; it could not be seen
STOPPING_UNKNOWN = 65535
LEAST_GAP_M = 0.01  # of what touches the nose: 0 is no gap
UNUSABLE, TOO_CLOSE, NOTHING, INVALID = 0, 65535, 65534, 65533
_STEPS = 65000  # units from 0 to range_max: 1.2 mm for a range of 81 m
_OPEN_RANGE_M = 200.0  # the scale's end for a sensor that states none
SHOWN_COMPONENTS = 50


def plain(number: float | None, digits: int = 4) -> float | None:
    """A number as JSON may carry it: rounded, never NaN or infinite."""
    return round(float(number), digits) if number is not None and math.isfinite(number) else None


def value(reading: Any) -> SignalValue | None:
    """The fields of a signal's value, as the table of docs/protocol.md names them."""
    match reading:
        case values.Twist():
            return {"speed_mps": plain(reading.speed_mps), "yaw_rate_radps": plain(reading.yaw_rate_radps)}
        case values.Acceleration():
            return {"acceleration_mps2": plain(reading.acceleration_mps2), "source": reading.source}
        case values.Effort():
            return {"percent": plain(reading.percent)}
        case values.Steering():
            return {"percent": plain(reading.percent), "tyre_rad": plain(reading.tyre_rad, 4)}
        case values.Distance():
            return {"distance_m": plain(reading.distance_m), "none_in_range": reading.none_in_range}
        case values.Bearing():
            return {"bearing_rad": plain(reading.bearing_rad)}
        case values.GpsFix():
            return {
                "lat_deg": plain(reading.lat_deg, 8),
                "lon_deg": plain(reading.lon_deg, 8),
                "alt_m": plain(reading.alt_m, 2),
                "status": reading.status,
                "sigma_m": plain(reading.sigma_m, 2),
                "covariance_m2": _rounded(reading.covariance_m2) if reading.covariance_m2 else None,
            }
        case values.Odometry():
            return {
                "x_m": plain(reading.x_m, 3),
                "y_m": plain(reading.y_m, 3),
                "yaw_rad": plain(reading.yaw_rad),
                "speed_mps": plain(reading.speed_mps),
            }
        case values.Heading():
            return {"heading_deg": plain(reading.heading_deg, 1), "source": reading.source}
        case values.LaserScan():
            return _scan_summary(reading)
        case values.Diagnostics():
            shown = sorted(reading.components, key=lambda c: -c.level)[:SHOWN_COMPONENTS]
            rows: list[ComponentState] = [{"name": c.name, "level": c.level, "message": c.message} for c in shown]
            return {"worst": max((c.level for c in reading.components), default=0), "components": rows}
        case values.MotionCommand():
            return {"speed_mps": plain(reading.speed_mps), "tyre_angle_rad": plain(reading.tyre_angle_rad)}
        case values.Level():
            return {"value": plain(reading.value, 1), "unit": reading.unit}
        case values.DriveMode():
            return {"mode": reading.mode, "said": reading.text}
        case values.Number():
            return {"value": plain(reading.value)}
    return None


def _rounded(covariance_m2: tuple[float, float, float]) -> tuple[float, float, float]:
    east, north, both = covariance_m2
    return round(east, 4), round(north, 4), round(both, 4)


def _scan_summary(scan: values.LaserScan) -> ScanValue:
    good = usable(scan.ranges_m, scan.range_min_m, scan.range_max_m)
    nearest = bearing = None
    if good.any():
        at = int(np.argmin(np.where(good, scan.ranges_m, np.inf)))
        nearest = float(scan.ranges_m[at])
        bearing = within_half_turn(scan.angle_min_rad + at * scan.angle_increment_rad)
    return {
        "beams": int(scan.ranges_m.size),
        "usable": int(np.count_nonzero(good)),
        "angle_min_rad": plain(scan.angle_min_rad),
        "angle_increment_rad": plain(scan.angle_increment_rad, 6),
        "range_min_m": plain(scan.range_min_m),
        "range_max_m": plain(scan.range_max_m),
        "nearest_m": plain(nearest),
        "nearest_bearing_rad": plain(bearing),
        "frame_id": scan.frame_id,
        "laser_ahead_m": plain(scan.mounting.x_m, 3) if scan.mounting is not None else None,
        "laser_left_m": plain(scan.mounting.y_m, 3) if scan.mounting is not None else 0.0,
        "mounting": None if scan.mounting is None else _mounting(scan.mounting),
    }


def _mounting(of: Mounting) -> str | None:
    """The limits of the laser's view of the road."""
    return of.why_not or " · ".join(text for text in (of.reservation, of.gap_words) if text) or None


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """What the obstacle check made of a scan."""

    wider_m: float  # than its half-width by the settings: while an obstacle in it is alarmed
    tyre_angle_rad: float  # of the corridor; 0: straight, also where the steering is not known
    gap_m: float | None  # along the corridor to the nearest thing; None: nothing seen
    bearing_rad: float | None  # of it
    is_blind: bool  # too little of the corridor was seen to say anything
    stopping_m: float | None  # None: the speed is not known


def scan_frame(scan: values.LaserScan, *, number: int, age_s: float, kinds_kept: bool, judged: Judged) -> bytes:
    """The scan's binary frame. `kinds_kept`: the transport kept NaN and ±Inf apart; else they are all one code.

    Source of the meaning of ±Inf and NaN: REP-117.
    """
    ranges = scan.ranges_m
    end_m = scan.range_max_m if math.isfinite(scan.range_max_m) else _OPEN_RANGE_M
    scale = max(end_m, 0.1) / _STEPS
    codes = np.zeros(ranges.size, dtype="<u2")
    good = usable(scan.ranges_m, scan.range_min_m, scan.range_max_m)
    codes[good] = np.clip(np.rint(ranges[good] / scale), 1, _STEPS)
    with np.errstate(invalid="ignore"):
        codes[(ranges > 0) & (ranges < scan.range_min_m)] = TOO_CLOSE
        beyond = (ranges > scan.range_max_m) if not kinds_kept else (ranges > scan.range_max_m) | np.isposinf(ranges)
        codes[beyond & ~good] = NOTHING
        if kinds_kept:
            codes[np.isneginf(ranges)] = TOO_CLOSE
            codes[np.isnan(ranges)] = INVALID
    header = SCAN_HEADER.pack(
        SCAN_MAGIC,
        SCAN_VERSION,
        ranges.size,
        number & 0xFFFFFFFF,
        max(0, min(65535, round(age_s * 1000))),
        STOPPING_UNKNOWN if judged.stopping_m is None else min(STOPPING_UNKNOWN - 1, round(judged.stopping_m * 100)),
        scan.angle_min_rad,
        scan.angle_increment_rad,
        end_m,
        0.0 if judged.is_blind or judged.gap_m is None else max(LEAST_GAP_M, judged.gap_m),
        round(judged.tyre_angle_rad / ANGLE_STEP_RAD),
        round(judged.wider_m * 100),
        _nearest_beam(scan, judged),
    )
    return header + codes.tobytes()


def _nearest_beam(scan: values.LaserScan, judged: Judged) -> int:
    if judged.is_blind:
        return BLIND
    if judged.bearing_rad is None or not scan.angle_increment_rad:
        return NO_BEAM
    # The bearing is from −π to π, and the beams may be counted from anywhere.
    beams = (judged.bearing_rad - scan.angle_min_rad) / scan.angle_increment_rad
    turn = math.tau / abs(scan.angle_increment_rad)
    beam = round(beams - turn * math.floor((beams + 0.5) / turn))
    return beam if beam < scan.beams else NO_BEAM  # it is of another part of the sweep


def tile(tile: Tile) -> TileState:
    return {
        "id": tile.id,
        "label": tile.label,
        "verdict": tile.verdict,
        "text": tile.text,
        "brief": tile.brief,
        "checks": list(tile.checks),
    }


def alarm(
    alarm: Alarm,
    now_s: float,
    wall_ms: int,
    silent_at_stop: Collection[str] | None = None,
    off_duty_ms: Callable[[str | None], int | None] = lambda _: None,
) -> StandingAlarm:
    """A standing alarm. Its times are turned from the monitor's clock into time of day by their age.
    `silent_at_stop`: in a planned stop, the ids of alarms without a sound; None: there is none.
    `off_duty_ms`: when the duty of who acted under a name ended.
    """
    spec = alarm.spec
    finding = alarm.finding or alarm.trip
    raised_for_s = now_s - alarm.raised_s if alarm.raised_s is not None else 0.0
    place = spec.place if alarm.active or spec.place_after is None else spec.place_after
    until_s, quiet_s = alarm.shelved_until_s, alarm.silenced_until_s
    return {
        "id": alarm.id,
        "occurrence": alarm.occurrence,
        "title": spec.title,
        "ended_title": (finding.ended if finding else "") or spec.ended_title,
        "priority": spec.priority,
        "place": place,
        "sound": Sound.NONE if silent_at_stop is not None and alarm.id in silent_at_stop else spec.sound,
        "planned_stop": silent_at_stop is not None,
        "state": alarm.state,
        "active": alarm.active,
        "needs_ack": spec.needs_ack,
        "raised_ms": round(wall_ms - raised_for_s * 1000),
        "for_s": round(raised_for_s, 1),
        "verdict": finding.verdict if finding else Verdict.UNKNOWN,
        "text": finding.text if finding else "",
        "trip_text": alarm.trip.text if alarm.trip else "",
        "measured": quantity(finding.measured if finding else None),
        "limit": quantity(finding.limit if finding else None),
        "worst": _worst(alarm.worst),
        "causes": list(finding.causes) if finding else [],
        "actions": list(alarm.actions),
        "advice": spec.advice,
        "acknowledged_by": alarm.acknowledged_by if alarm.acknowledged else None,
        "off_duty_ms": off_duty_ms(alarm.acknowledged_by) if alarm.state is AlarmState.ACKED else None,
        "shelved_until_ms": round(wall_ms + (until_s - now_s) * 1000) if until_s is not None else None,
        "shelved_by": alarm.shelved_by,
        "silenced_until_ms": round(wall_ms + (quiet_s - now_s) * 1000) if quiet_s is not None else None,
        "silenced_by": alarm.silenced_by,
    }


def suppressed(alarm: Alarm, alarms: Mapping[str, Alarm], now_s: float, wall_ms: int) -> SuppressedAlarm:
    """An alarm that is not announced because others explain it, or because monitoring is paused."""
    raised_for_s = now_s - alarm.raised_s if alarm.active and alarm.raised_s is not None else None
    return {
        "id": alarm.id,
        "title": alarm.spec.title,
        "priority": alarm.spec.priority,
        "by": explained_by(alarm, alarms),
        "raised_ms": round(wall_ms - raised_for_s * 1000) if raised_for_s is not None else None,
    }


def explained_by(alarm: Alarm, alarms: Mapping[str, Alarm]) -> list[str]:
    """Titles of what explains the alarm away now."""
    titles = {name: one.spec.title for name, one in alarms.items()} | {"paused": "Monitoring is paused"}
    return [titles.get(name, name) for name in alarm.suppressed_by]


def quantity(of: Quantity | None) -> QuantityState | None:
    if of is None:
        return None
    return {"label": of.label, "value": plain(of.value), "unit": of.unit}


def _worst(finding: Finding | None) -> Worst | None:
    """The measured value that was furthest beyond its limit, and on which side of it."""
    if finding is None or finding.measured is None or finding.limit is None:
        return None
    side: Literal["above", "below"] = "above" if finding.measured.value >= finding.limit.value else "below"
    return {
        "label": finding.measured.label,
        "value": plain(finding.measured.value),
        "unit": finding.measured.unit,
        "side": side,
    }


def load(load: AlarmLoad, alarms: Mapping[str, Alarm]) -> LoadState:
    """What the alarms ask of the operator now."""
    titles = [alarms[name].spec.title if name in alarms else name for name in load.chattering]
    return {"in_10_min": load.in_10_min, "flood": load.is_flood, "bearable": load.is_bearable, "chattering": titles}


def trends(piece: Piece) -> Trends:
    """Steps of the last minute: of each signal its lowest and highest in a step, "none" or null."""

    def ends(which: int) -> dict[str, list[Step]]:
        return {
            name: [plain(row[which], 3) if isinstance(row, tuple) else row for row in rows]
            for name, rows in piece.rows.items()
        }

    return {
        "step_s": STEP_S,
        "since": piece.since,
        "first": piece.first,
        "now": round(piece.now, 2),
        "lowest": ends(0),
        "highest": ends(1),
    }


def event(
    transition: Transition, at_ms: int, *, now_s: float, settings_version: int, planned_stop: StopReason | None = None
) -> NewEvent:
    """A transition as the log keeps it and the pages get it, at `at_ms`, which is `now_s`; the log adds its number.

    It alone gives a restart the state of the alarm (`server.vehicle.restore`).
    """
    finding, spec = transition.finding, transition.spec
    until_s = transition.shelved_until_s
    found: NewEvent = {
        "at_ms": at_ms,
        "alarm": transition.alarm_id,
        "occurrence": transition.occurrence,
        "change": transition.change,
        "title": spec.title,
        "priority": spec.priority,
        "place": spec.place,
        "sound": spec.sound,
        "text": transition.text,
        "by": transition.by,
        "announces": transition.announces,
        "state": transition.state,
        "causes": list(transition.causes),
        "suppressed_by": list(transition.suppressed_by),
        "shelved_until_ms": round(at_ms + (until_s - now_s) * 1000) if until_s is not None else None,
        "settings_version": settings_version,
        "measured": quantity(finding.measured if finding else None),
        "limit": quantity(finding.limit if finding else None),
        "worst": _worst(transition.worst),
    }
    if planned_stop is not None:
        found["planned_stop"] = planned_stop
    return found
