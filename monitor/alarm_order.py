"""Which alarms are shown, and in which order."""

from __future__ import annotations

from collections.abc import Iterable

from monitor.alarm import Alarm
from monitor.check import Verdict


def standing(alarms: Iterable[Alarm]) -> list[Alarm]:
    """Alarms to show, most urgent first: active or unacknowledged, shelved ones last, suppressed ones not."""
    shown = [
        alarm
        for alarm in alarms
        if (alarm.is_standing or alarm.shelved_until_s is not None)
        and not alarm.suppressed_by
        and not alarm.out_of_service
    ]
    return sorted(
        shown,
        key=lambda alarm: (
            alarm.shelved_until_s is not None,
            alarm.spec.priority.rank,
            -(alarm.announced_s or 0.0),
        ),
    )


def suppressed(alarms: Iterable[Alarm]) -> list[Alarm]:
    """Alarms that would stand if nothing explained them, most urgent first."""
    hidden = [
        alarm
        for alarm in alarms
        if alarm.suppressed_by and (alarm.is_standing or (alarm.finding and alarm.finding.verdict is Verdict.FAULT))
    ]
    return sorted(hidden, key=lambda alarm: (alarm.spec.priority.rank, alarm.id))
