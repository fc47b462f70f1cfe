"""The pause of a vehicle's monitoring and the planned stop of its car: begun, ended, logged and restored."""

from __future__ import annotations

from monitor.planned_stop import REASONS, PlannedStop, is_moving
from monitor.runner import Refused
from monitor.shell_facts import Phase
from monitor.state import State
from server.protocol import drive_commands
from server.vehicle.event_log import EventLog
from server.vehicle.restore import RestoredState


class Pause:
    """The pause of a vehicle's monitoring.

    At most one at a time. `since_s` is on the session's monotonic clock; None: monitoring is on.
    """

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


class CarPlannedStop:
    """The planned stop of one car: begun and ended by commands, ended by motion, logged, and restored.

    At most one at a time; the session is the only writer. Times are on the session's monotonic clock, in seconds.
    """

    def __init__(self, event_log: EventLog) -> None:
        self._event_log = event_log
        self._stop: PlannedStop | None = None

    @property
    def stop(self) -> PlannedStop | None:
        """None: there is none."""
        return self._stop

    def execute(
        self,
        command: drive_commands.PlannedStopCommand,
        now_s: float,
        *,
        by: str,
        phase: Phase,
        speed_mps: float | None,
    ) -> None:
        """`speed_mps` None: not known now. Raises Refused."""
        if isinstance(command, drive_commands.EndPlannedStop):
            self.end("", by=by)
            return
        if phase == "idle":
            raise Refused("No car is monitored: there is nothing to stop.")
        if speed_mps is not None and is_moving(speed_mps):
            raise Refused(f"The car moves, {abs(speed_mps):.1f} m/s: a planned stop needs a car that stands.")
        if self._stop is None or self._stop.reason != command.reason:
            text = f"Planned stop: {REASONS[command.reason]}. {_unknown(speed_mps)}".strip()
            self._event_log.note("planned_stop", text, by=by, reason=command.reason)
            self._begin(PlannedStop(reason=command.reason, since_s=now_s, by=by))

    def tick(self, speed_mps: float | None) -> bool:
        """Whether the measured speed ended it."""
        if self._stop is None or speed_mps is None or not is_moving(speed_mps):
            return False
        self.end(f": the car moves, {abs(speed_mps):.1f} m/s", by=None)
        return True

    def end(self, why: str, *, by: str | None) -> None:
        """`why`: what follows in the sentence of the log."""
        if self._stop is not None:
            reason, self._stop, self._event_log.planned_stop = self._stop.reason, None, None
            self._event_log.note("planned_stop_ended", f"The planned stop ended{why}.", by=by, reason=reason)

    def go_on(self, stop: PlannedStop | None, now_s: float, wall_ms: int) -> None:
        """Restore the one of before a restart. It is logged again and shown."""
        if stop is not None:
            text = f"The server was restarted and the planned stop continues: {REASONS[stop.reason]}."
            since_ms = round(wall_ms - (now_s - stop.since_s) * 1000)
            self._event_log.note("planned_stop", text, by=stop.by, reason=stop.reason, since_ms=since_ms)
            self._begin(stop)

    def _begin(self, stop: PlannedStop) -> None:
        self._stop, self._event_log.planned_stop = stop, stop.reason


def _unknown(speed_mps: float | None) -> str:
    return "The speed is not known: it does not end by itself until it is." if speed_mps is None else ""
