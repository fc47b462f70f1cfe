"""Input of the obstacle check: the corridor at the current steering, and the laser's returns in it."""

from __future__ import annotations

import math
from dataclasses import replace

from monitor.corridor import Corridor, Sight, covered, look
from monitor.instruments import ObstacleLimits
from monitor.snapshot import Snapshot
from monitor.values import LaserScan

BLIND_AT_M = 5.0  # where the beams of the corridor are counted
BLIND_SHARE = 0.9  # of them without a return: nothing is known
ANGLE_STEP_RAD = 0.005  # 10 cm aside at 10 m: a computed bend is reused for the next scan
WIDEST_TYRE_RAD = 0.6  # no car turns its wheels farther
ASIDE_DEADBAND_M = 0.2  # hysteresis at the corridor's edge
COVERED_SHARE = 0.9  # of the corridor's directions: in the rest, something could stand unseen


def corridor_ahead(snapshot: Snapshot, limits: ObstacleLimits, *, was_active: bool = False) -> Corridor:
    """Bent by the newest steering; straight where that is not known or too old. Wider while an obstacle is alarmed."""
    angle_rad = tyre_angle_rad(snapshot) or 0.0
    angle_rad = max(-WIDEST_TYRE_RAD, min(WIDEST_TYRE_RAD, angle_rad))
    angle_rad = round(angle_rad / ANGLE_STEP_RAD) * ANGLE_STEP_RAD
    scan = snapshot.get("scan")
    mounting = scan.value.mounting if scan is not None else None
    is_placed = mounting is not None and mounting.x_m is not None
    return Corridor(
        half_width_m=limits.half_width_m + (ASIDE_DEADBAND_M if was_active else 0.0),
        wheelbase_m=limits.wheelbase_m,
        laser_ahead_m=mounting.x_m if mounting is not None and mounting.x_m is not None else limits.laser_ahead_m,
        laser_left_m=mounting.y_m if mounting is not None else 0.0,
        # Of a laser that is placed behind the rear axle, the nose is at least there.
        nose_ahead_m=limits.bumper_ahead_m if is_placed else limits.bumper_ahead_m or None,
        tyre_angle_rad=angle_rad,
    )


def tyre_angle_rad(snapshot: Snapshot) -> float | None:
    """As it is measured now; None: not known, or too old."""
    steering = snapshot.get("steering")
    if steering is None or not steering.is_fresh(snapshot.now_s):
        return None
    angle_rad = steering.value.tyre_rad
    return angle_rad if angle_rad is not None and math.isfinite(angle_rad) else None


def look_ahead(scan: LaserScan, corridor: Corridor) -> Sight:
    """What the scan shows of the corridor; blind beams are counted where it is BLIND_AT_M long."""
    return look(scan, corridor, BLIND_AT_M)


def sweep_ahead(snapshot: Snapshot, scan: LaserScan, corridor: Corridor) -> Sight:
    """What the newest scan shows of the corridor, and where it covers only a part of it, what the other parts of
    its sweep show."""
    newest = look_ahead(scan, corridor)
    if newest.covered >= COVERED_SHARE or not snapshot.scan_parts:
        return newest
    parts = (part.value for part in snapshot.scan_parts)
    scans = [scan, *(part for part in parts if part.mounting is None or part.mounting.why_not is None)]
    sights = [look_ahead(one, _from(one, scan, corridor)) for one in scans]
    gap_m, bearing_rad = min(((s.gap_m, s.bearing_rad) for s in sights if s.gap_m is not None), default=(None, None))
    geometries = tuple((one.beams, one.angle_min_rad, one.angle_increment_rad) for one in scans)
    return Sight(
        beams=sum(sight.beams for sight in sights),
        blind=sum(sight.blind for sight in sights),
        gap_m=gap_m,
        bearing_rad=bearing_rad,
        covered=covered(geometries, corridor, BLIND_AT_M),
    )


def _from(part: LaserScan, newest: LaserScan, corridor: Corridor) -> Corridor:
    """The corridor of the newest scan as the laser of a part looks into it: it may be another one."""
    theirs = part.mounting
    if theirs is None or theirs == newest.mounting:
        return corridor
    ahead_m = corridor.laser_ahead_m if theirs.x_m is None else theirs.x_m
    return replace(corridor, laser_ahead_m=ahead_m, laser_left_m=theirs.y_m, nose_ahead_m=corridor.nose_m)


def is_blind(sight: Sight) -> bool:
    """Too few beams of the corridor have a return to detect an obstacle or its absence."""
    return sight.beams > 0 and sight.blind > BLIND_SHARE * sight.beams


def is_covered(sight: Sight) -> bool:
    """Whether the laser covers the whole corridor: only then a scan without returns shows that it is free."""
    return sight.covered >= COVERED_SHARE


def why_unseen(scan: LaserScan, sight: Sight) -> str | None:
    """Why an obstacle in the corridor could be there and not be seen; None: it would be seen."""
    if scan.mounting is not None and scan.mounting.why_not is not None:
        return scan.mounting.why_not
    if not is_covered(sight):
        return "The laser does not look ahead" if sight.beams == 0 else "The laser looks into a part of the corridor"
    return "The laser sees nothing in the corridor" if is_blind(sight) else None
