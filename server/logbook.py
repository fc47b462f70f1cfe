"""What one vehicle's session writes into the log: transitions of alarms, its own doings, settings from → to."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from monitor.alarm import Alarm, Transition
from server import wire
from server.bus import LocalBus
from server.tuning import Tuning


class Logbook:
    """Every event carries the version of the settings in force. `wall_ms` is the time of day in ms since 1970;
    `also` is told of each with its number."""

    def __init__(
        self,
        vehicle: str,
        bus: LocalBus,
        tuning: Tuning,
        *,
        wall_ms: Callable[[], int],
        also: Callable[[list[dict[str, Any]]], None] = lambda _: None,
    ) -> None:
        self._vehicle = vehicle
        self._bus = bus
        self._tuning = tuning
        self._wall_ms = wall_ms
        self._also = also

    def tell(self, transitions: Collection[Transition], alarms: Mapping[str, Alarm], now_s: float) -> None:
        """What happened to alarms, at `now_s` of the monitor's clock."""
        at_ms = self._wall_ms()
        self._write(
            [
                wire.event(t, alarms[t.alarm_id].spec, at_ms, now_s=now_s, settings_version=self._version)
                for t in transitions
            ]
        )

    def note(self, change: str, text: str, *, by: str | None = None, **more: Any) -> None:
        """Something of no alarm."""
        event = {"at_ms": self._wall_ms(), "alarm": None, "change": change, "text": text, "by": by}
        self._write([event | {"settings_version": self._version} | more])

    def started(self, address: str, shown: str, *, by: str | None) -> None:
        """Monitoring of a car begins; with all settings in force, so that the log alone says what was judged by."""
        self.note("started", f"Monitoring of {shown} begins.", by=by, address=address, settings=self._tuning.in_force())
        self._tuning.changes()  # told herewith

    def settings(self, text: str, *, by: str | None) -> None:
        """Settings changed: `text` for people, each value from → to for whoever reconstructs them."""
        self.note("settings", text, by=by, changes=self._tuning.changes())

    def _write(self, events: list[dict[str, Any]]) -> None:
        numbered = self._bus.append(self._vehicle, events)
        if numbered:
            self._also(numbered)

    @property
    def _version(self) -> int:
        return self._tuning.settings.version
