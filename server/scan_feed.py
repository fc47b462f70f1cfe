"""The newest laser scan for the pages that watch it: encoded once, at most 20 a second, not at all unwatched."""

from __future__ import annotations

from monitor.state import Snapshot
from monitor.values import LaserScan
from server import wire
from server.bus import LocalBus

SCAN_FRAME_S = 0.05  # pages are offered at most 20 scans a second


class ScanFeed:
    """The scans of one car since it was dialled."""

    def __init__(self, vehicle: str, bus: LocalBus) -> None:
        self._vehicle = vehicle
        self._bus = bus
        self._number = 0
        self._put_s = -1.0

    @property
    def is_empty(self) -> bool:
        return self._number == 0

    def count(self) -> None:
        """One more came, shown or not."""
        self._number += 1

    def is_due(self, now_s: float) -> bool:
        return now_s - self._put_s >= SCAN_FRAME_S and self._bus.wanted(self._vehicle, "scan")

    def put(self, snapshot: Snapshot, *, kinds_kept: bool) -> None:
        """Offers the newest scan. `kinds_kept`: the transport told NaN and ±Inf apart."""
        reading = snapshot.get("scan")
        if reading is not None and isinstance(reading.value, LaserScan):
            self._put_s = snapshot.now_s
            frame = wire.scan_frame(
                reading.value,
                number=self._number,
                age_s=snapshot.now_s - reading.received_s,
                kinds_kept=kinds_kept,
            )
            self._bus.put(self._vehicle, "scan", frame)
