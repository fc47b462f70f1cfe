"""Input of the obstacle check: the corridor at the current steering, and the laser's returns in it."""

from __future__ import annotations

import math

from monitor.corridor import Corridor, Sight, look
from monitor.instruments import ObstacleLimits
from monitor.snapshot import Snapshot
from monitor.values import LaserScan

BLIND_AT_M = 5.0  # where the beams of the corridor are counted
BLIND_SHARE = 0.9  # of them without a return: nothing can be said
ANGLE_STEP_RAD = 0.005  # 10 cm aside at 10 m: a computed bend is reused for the next scan
WIDEST_TYRE_RAD = 0.6  # no car turns its wheels farther
ASIDE_DEADBAND_M = 0.2  # hysteresis at the corridor's edge


def corridor_ahead(snapshot: Snapshot, limits: ObstacleLimits, *, was_active: bool = False) -> Corridor:
    """Bent by the newest steering; straight where that is not known or too old. Wider while an obstacle is alarmed."""
    angle_rad = tyre_angle_rad(snapshot) or 0.0
    angle_rad = max(-WIDEST_TYRE_RAD, min(WIDEST_TYRE_RAD, angle_rad))
    angle_rad = round(angle_rad / ANGLE_STEP_RAD) * ANGLE_STEP_RAD
    return Corridor(
        half_width_m=limits.half_width_m + (ASIDE_DEADBAND_M if was_active else 0.0),
        wheelbase_m=limits.wheelbase_m,
        laser_ahead_m=limits.laser_ahead_m,
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


def is_blind(sight: Sight) -> bool:
    """Too few beams of the corridor have a return to detect an obstacle or its absence."""
    return sight.beams > 0 and sight.blind > BLIND_SHARE * sight.beams
