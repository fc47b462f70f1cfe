"""Which part of the car or of its surroundings an alarm is about, for the faults by component of the logbook."""

from __future__ import annotations

from collections.abc import Sequence

from monitor import catalog
from monitor.alarm import LEVEL
from monitor.signals import SIGNALS

_ABOUT_NEEDS = {check.id: sorted(check.needs) for check in catalog.CHECKS}
# The first part of an alarm's id, where its check names no signal.
_BY_PREFIX = (
    ("laser", "Laser"),
    ("link", "Link"),
    ("connect", "Link"),
    ("no_message", "Link"),
    ("car_silent", "Link"),
    ("bridge", "Link"),
    ("all_slow", "Link"),
    ("phone", "Phone"),
    ("slow_down", "Slow-down"),
    ("clock", "Clock"),
    ("record", "Recorder"),
    ("disk", "Recorder"),
    ("log_", "Recorder"),
    ("reach", "Operators"),
    ("paused", "Operators"),
)


def component_of(alarm_id: str, causes: Sequence[str] = ()) -> str:
    """A name for people. Diagnostics name the component themselves, as their cause."""
    check_id, _, signal = alarm_id.partition(".")
    if check_id.startswith("diagnostics"):
        return next((cause[:60] for cause in causes if cause and not cause.startswith(LEVEL)), "Diagnostics")
    if signal in SIGNALS:
        return SIGNALS[signal].label
    for prefix, name in _BY_PREFIX:
        if check_id.startswith(prefix):
            return name
    needs = _ABOUT_NEEDS.get(check_id)
    return SIGNALS[needs[0]].label if needs else "Other"
