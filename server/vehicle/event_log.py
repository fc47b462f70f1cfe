"""What one vehicle's session writes into the log: transitions of alarms, its own doings, settings from → to."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import Any

from typing_extensions import Unpack

from monitor.alarm import Transition
from monitor.planned_stop import StopReason
from server.bus.bus import SessionBus
from server.control.duty import acting
from server.judge.active_settings import ActiveSettings
from server.protocol import serialize
from server.protocol.alarm_state import EventDetails, NotedEvent
from server.system.clean_text import cleaned

log = logging.getLogger("catgraph.logbook")

MAX_WAITING = 1000  # events that the log refused and that are tried again


class EventLog:
    """Every event carries the version of the settings in force. `wall_ms` is the time of day in ms since 1970;
    `also` is called with each event and its number.

    No method raises if the log fails, because the reported event has already happened. Events that cannot be appended
    wait for `retry`, in order, and `trouble` reports them.
    """

    def __init__(
        self,
        vehicle: str,
        bus: SessionBus,
        tuning: ActiveSettings,
        *,
        wall_ms: Callable[[], int],
        also: Callable[[list[dict[str, Any]]], None] = lambda _: None,
    ) -> None:
        self._vehicle = vehicle
        self._bus = bus
        self._tuning = tuning
        self._wall_ms = wall_ms
        self._also = also
        self._waiting: deque[NotedEvent] = deque()
        self._lost = 0
        self._why: str | None = None
        self.planned_stop: StopReason | None = None  # what happens to alarms meanwhile bears it

    @property
    def trouble(self) -> str | None:
        """Why events are not appended, as a sentence; None: they are."""
        if self._why is None:
            return None
        lost = f", {self._lost} lost" if self._lost else ""
        return f"The event log fails: {self._why}. Events that wait: {len(self._waiting)}{lost}."

    def trouble_of_disk(self) -> str | None:
        """Why the events logged so far would not survive the end of the server, as a sentence; None: they would."""
        return self.trouble or self._bus.save_events()

    def retry(self) -> None:
        """Tries to append what waits; to be called now and then."""
        if self._waiting:
            self._write([])

    def log_transitions(self, transitions: Collection[Transition], now_s: float) -> None:
        """What happened to alarms, at `now_s` of the monitor's clock."""
        at_ms = self._wall_ms()
        events = [
            serialize.event(one, at_ms, now_s=now_s, settings_version=self._version, planned_stop=self.planned_stop)
            for one in transitions
        ]
        self._write(events)

    def note(self, change: str, text: str, *, by: str | None = None, **more: Unpack[EventDetails]) -> None:
        """Something of no alarm."""
        event: NotedEvent = {
            "at_ms": self._wall_ms(),
            "alarm": None,
            "change": change,
            "text": text,
            "by": by,
            "settings_version": self._version,
            **more,
        }
        self._write([event])

    def started(self, address: str, shown: str, *, by: str | None, resumes: bool = False) -> None:
        """Log the start of monitoring with all settings in force, so that the log is complete by itself."""
        more: EventDetails = {"address": address, "settings": self._tuning.in_force()}
        if resumes:
            more["resumes"] = True
        self.note("started", f"Monitoring of {shown} begins.", by=by, **more)
        self._tuning.changes()  # logged by this event

    def settings(self, text: str, *, by: str | None) -> None:
        """Log changed settings: `text` for people, each value from → to for tools."""
        self.note("settings", text, by=by, changes=self._tuning.changes())

    def _write(self, events: Sequence[NotedEvent]) -> None:
        due = [*self._waiting, *(events := [cleaned(_signed(event)) for event in events])]
        try:
            numbered = self._bus.append(self._vehicle, due)
        except Exception as error:
            self._why = f"{type(error).__name__}: {error}"[:200]
            log.exception("events not logged: count=%d vehicle=%s", len(due), self._vehicle)
            self._waiting.extend(events)
            while len(self._waiting) > MAX_WAITING:
                self._waiting.popleft()
                self._lost += 1
            return
        self._waiting.clear()
        self._why = None
        try:
            if numbered:
                self._also(numbered)
        except Exception as error:  # the recording of events; the log has them
            self._why = f"{type(error).__name__}: {error}"[:200]
            log.exception("events not recorded: count=%d vehicle=%s", len(numbered), self._vehicle)

    @property
    def _version(self) -> int:
        return self._tuning.settings.version


def _signed(event: NotedEvent) -> NotedEvent:
    """With the person who is on duty where it was done; what nobody did, or another, has none."""
    found = acting.get()
    if found is None or event.get("by") != found[0]:
        return event
    return {**event, "person": found[1].name, "role": found[1].role}
