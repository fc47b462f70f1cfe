"""The pause of a vehicle's monitoring: start, operator and log texts."""

from __future__ import annotations

from monitor.state import State
from server.vehicle.event_log import EventLog
from server.vehicle.restore import RestoredState


class Pause:
    """At most one at a time. `since_s` is on the session's monotonic clock; None: monitoring is on."""

    def __init__(self, logbook: EventLog) -> None:
        self._logbook = logbook
        self.since_s: float | None = None
        self.by: str | None = None

    def begin(self, state: State, now_s: float, *, by: str) -> None:
        if self.since_s is None:
            self.since_s, self.by = now_s, by
            state.set_paused(True)
            self._logbook.note("paused", "Monitoring is paused: no alarm is raised.", by=by)

    def end(self, state: State, *, by: str) -> bool:
        """Whether there was one."""
        if self.since_s is None:
            return False
        self.forget()
        state.set_paused(False)
        self._logbook.note("resumed", "Monitoring continues.", by=by)
        return True

    def forget(self) -> None:
        """The car is not monitored any more."""
        self.since_s = self.by = None

    def go_on(self, state: State, before: RestoredState, now_s: float, wall_ms: int) -> None:
        """Restore a pause after a restart, because its operator relies on it. It is logged again and shown."""
        if before.paused_s is not None:
            self.since_s, self.by = before.paused_s, before.paused_by
            state.set_paused(True, before.paused_s)
            self._logbook.note(
                "paused",
                "The server was restarted and monitoring is still paused: no alarm is raised.",
                by=before.paused_by,
                since_ms=round(wall_ms - (now_s - before.paused_s) * 1000),
            )
