"""After a restart of the server: what stood when it ended is held until a car is monitored again."""

from __future__ import annotations

from collections.abc import Callable

from server.bus.bus import SessionBus
from server.vehicle import restore
from server.vehicle.restore import RestoredState
from server.vehicle.session_parts import SessionParts

_BROUGHT_BACK = (
    "The newest events were brought back from recordings. What was in force is not restored: "
    "pause, planned stop, slow-down, departure check."
)


class Restoration:
    """Of one vehicle's session. `now` is a monotonic clock in seconds, `wall_ms` the time of day in ms since 1970."""

    def __init__(
        self,
        vehicle: str,
        bus: SessionBus,
        parts: SessionParts,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
    ) -> None:
        self._vehicle = vehicle
        self._bus = bus
        self._parts = parts
        self._now = now
        self._wall_ms = wall_ms
        self.held: RestoredState | None = None  # what stood when the server ended, until a car is monitored again

    def begin(self) -> None:
        """At the start: reads the log; numbers of occurrences and settings count on."""
        parts = self._parts
        judgement, event_log = parts.judgement, parts.event_log
        before = self._recall()
        settings_version = before.settings_version
        if restore.is_brought_back(self._bus, self._vehicle):  # what came after it in the drive is in no recording
            event_log.note("stopped", _BROUGHT_BACK)
            before = self._recall()
        judgement.monitor.number_on(before.transitions)
        judgement.add_load(before.recent)
        parts.marks.restore(self._bus, self._vehicle)
        judgement.ride(restore.phone_chosen(self._bus, self._vehicle), self._now())
        parts.driving.restore(self._bus, self._vehicle)
        departure = restore.recall_departure(self._bus, self._vehicle)
        parts.departure.restore(departure)
        if departure.signed is not None:
            parts.recording.remember([departure.signed])
        for sentence in (self._bus.log_complaint, parts.settings.complaint):
            if sentence:
                event_log.note("restarted", sentence)
        if parts.settings.number_on(settings_version):
            event_log.settings("The settings differ from the last ones in force, which were lost.", by=None)
        if before.address is not None or before.standing:
            self.held = before
            event_log.note("restarted", before.text())

    def of(self, url: str) -> RestoredState | None:
        """Before a car is dialled: the state of the same car, where the server ended while it was monitored. Its
        alarms stand again; so do those of another car, which end with its monitoring."""
        if self.held is None:
            return None
        self.held = None
        before = self._recall()
        self._parts.judgement.monitor.restore(before.transitions)
        self._parts.authorization.restore_off_duty(before.owners_off)
        if before.address != url:
            return None
        self._parts.recording.remember(before.stood)
        return before

    def _recall(self) -> RestoredState:
        return restore.recall(self._bus, self._vehicle, now_s=self._now(), wall_ms=self._wall_ms())
