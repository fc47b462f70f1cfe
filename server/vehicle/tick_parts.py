"""The parts of a tick beside the checks: one that fails raises an alarm and does not stop the others."""

from __future__ import annotations

import logging
from collections.abc import Callable

from server.bus.bus import SessionBus
from server.recording.read.steady_time import span
from server.system import process_limits
from server.vehicle.event_log import EventLog

log = logging.getLogger("catgraph.session")

SET_S = 1.0  # a clock that is slewed changes less from one tick to the next
EVERY_S = 1.0  # interval of checking the log and counting open files


class TickParts:
    """Which parts fail now, and how."""

    def __init__(self, vehicle: str) -> None:
        self._vehicle = vehicle
        self._failed: dict[str, str] = {}

    def attempt(self, part: str, work: Callable[[], object]) -> None:
        """Does the work of one part. Its failure is logged once, until it works again."""
        try:
            work()
        except Exception as error:
            if part not in self._failed:
                log.exception("part failed: part=%s vehicle=%s", part, self._vehicle)
            self._failed[part] = f"{type(error).__name__}: {error}"[:200]
        else:
            self._failed.pop(part, None)

    @property
    def failed(self) -> tuple[str, ...]:
        return tuple(self._failed)

    def problems(self) -> tuple[str, ...]:
        """A sentence each."""
        return tuple(f"The part “{part}” fails: {why}." for part, why in self._failed.items())


class LogKeeper:
    """Checks periodically whether the event log is stored."""

    def __init__(self, event_log: EventLog, bus: SessionBus) -> None:
        self._event_log = event_log
        self._bus = bus
        self._looked_s = -EVERY_S
        self.trouble: str | None = None  # why it is not kept on the disk, as a sentence

    def tick(self, now_s: float) -> None:
        if now_s - self._looked_s >= EVERY_S:
            self._looked_s = now_s
            self._event_log.retry()
            self.trouble = self._event_log.trouble or self._bus.save_events()


class ClockWatch:
    """Notes where the server's clock was set; ages and recordings go on by the time that passes."""

    def __init__(self, event_log: EventLog, *, wall_ms: Callable[[], int]) -> None:
        self._event_log = event_log
        self._wall_ms = wall_ms
        self._zero_s: float | None = None  # the time of day at 0 of the session's clock

    def tick(self, now_s: float) -> None:
        """`now_s`: the session's clock, which is never set."""
        zero_s = self._wall_ms() / 1000 - now_s
        before_s, self._zero_s = self._zero_s, zero_s
        by_s = 0.0 if before_s is None else zero_s - before_s
        if abs(by_s) >= SET_S:
            how = f"ahead by {span(by_s)}, or it was suspended" if by_s > 0 else f"back by {span(-by_s)}"
            self._event_log.note("clock_set", f"The server's clock was set {how}: ages are not changed by it.")


class OpenFilesWatch:
    """Checks periodically whether files and connections can be opened."""

    def __init__(self) -> None:
        self._looked_s = -EVERY_S
        self._fails = False

    def tick(self, now_s: float) -> None:
        """Raises OSError while the process has none left."""
        if now_s - self._looked_s >= EVERY_S or self._fails:
            self._looked_s, self._fails = now_s, True
            process_limits.demand_free()
            self._fails = False
