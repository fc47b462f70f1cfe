"""The newest laser scan for the pages that watch it: encoded once, at most 20 a second, not at all unwatched."""

from __future__ import annotations

import math

from monitor.instruments import ObstacleLimits, stopping_m
from monitor.obstacle_view import corridor_ahead, is_blind, sweep_ahead, why_unseen
from monitor.state import Snapshot
from monitor.values import LaserScan, Twist
from server.bus.bus import SessionBus
from server.protocol import serialize

SCAN_FRAME_S = 0.05  # pages are offered at most 20 scans a second


class ScanFeed:
    """The scans of one car since it was dialled."""

    def __init__(self, vehicle: str, bus: SessionBus) -> None:
        self._vehicle = vehicle
        self._bus = bus
        self._number = 0
        self._due_s = -math.inf

    @property
    def is_empty(self) -> bool:
        return self._number == 0

    def count(self) -> None:
        """One more came, shown or not."""
        self._number += 1

    def is_due(self, now_s: float) -> bool:
        return now_s >= self._due_s and self._bus.wanted(self._vehicle, "scan")

    def put(self, snapshot: Snapshot, limits: ObstacleLimits, *, was_active: bool, kinds_kept: bool) -> None:
        """Publish the newest scan and its judgement. `was_active`: an obstacle alarm is active; `kinds_kept`: the
        transport distinguishes NaN and ±Inf."""
        reading = snapshot.get("scan")
        if reading is not None and isinstance(reading.value, LaserScan):
            # Counted from when it was due: scans that come at just this rate come a little early as often as late.
            self._due_s = max(self._due_s, snapshot.now_s - SCAN_FRAME_S) + SCAN_FRAME_S
            frame = serialize.scan_frame(
                reading.value,
                number=self._number,
                age_s=reading.age_s(snapshot.now_s),
                kinds_kept=kinds_kept,
                judged=judged(reading.value, snapshot, limits, was_active=was_active),
            )
            self._bus.put(self._vehicle, "scan", frame, made_s=snapshot.now_s)


def _is_out_of_place(scan: LaserScan) -> bool:
    return scan.mounting is not None and scan.mounting.why_not is not None


def judged(scan: LaserScan, snapshot: Snapshot, limits: ObstacleLimits, *, was_active: bool) -> serialize.Judged:
    """The geometry by which the obstacle check judges this scan at this moment, and what it sees."""
    corridor = corridor_ahead(snapshot, limits, was_active=was_active)
    sight = sweep_ahead(snapshot, scan, corridor)
    is_seen = why_unseen(scan, sight) is None
    speed = snapshot.get("speed")
    twist = speed.value if speed is not None and speed.is_fresh(snapshot.now_s) else None
    is_known = isinstance(twist, Twist) and math.isfinite(twist.speed_mps)
    return serialize.Judged(
        wider_m=corridor.half_width_m - limits.half_width_m,
        tyre_angle_rad=corridor.tyre_angle_rad,
        gap_m=sight.gap_m,
        bearing_rad=sight.bearing_rad,
        is_blind=not is_seen and (sight.gap_m is None or is_blind(sight) or _is_out_of_place(scan)),
        stopping_m=stopping_m(twist.speed_mps, limits) if twist is not None and is_known else None,
    )
