"""What operators did about the alarms of a recorded drive, done again to the alarms of a re-evaluation."""

from __future__ import annotations

from monitor.alarm import Transition
from monitor.response import SHELVE_AT_MOST_MIN
from monitor.runner import Monitor


def answered(monitor: Monitor, event: Transition, now_s: float) -> tuple[Transition, ...]:
    """What the operator's answer that `event` records brings about here; raises Refused."""
    alarm_id, by = event.alarm_id, event.by or ""
    match event.change:
        case "acknowledged":
            return monitor.acknowledge(alarm_id, event.occurrence, by, now_s)
        case "silenced":
            return monitor.silence(alarm_id, event.occurrence, by, now_s)
        case "shelved" if event.shelved_until_s is not None:
            minutes = min((event.shelved_until_s - now_s) / 60, SHELVE_AT_MOST_MIN)  # the log has whole ms
            return monitor.shelve(alarm_id, event.occurrence, minutes, by, now_s)
        case "unshelved":
            return monitor.unshelve(alarm_id, by, now_s)
        case "handed_over" | "unacknowledged":
            return monitor.take_over(alarm_id, by, now_s, is_read_back=event.change == "handed_over")
    return ()
