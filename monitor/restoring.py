"""Where the alarms stood, from the transitions that the log has kept: a restart is a replay of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from monitor.alarm import Alarm, AlarmState, Cause, Transition

_FLAGS = {  # state → active, acknowledged; a log that begins in the middle of an alarm's life has no more
    AlarmState.UNACKED: (True, False),
    AlarmState.ACKED: (True, True),
    AlarmState.RTN_UNACKED: (False, False),
}
MOST = 400  # alarms: a log of catgraph has fewer


def restore(alarms: Mapping[str, Alarm], transitions: Iterable[Transition]) -> dict[str, Alarm]:
    """The alarms after the transitions, oldest first, with times on the current clock (they may be negative).

    The announced state is restored: active, acknowledged and by whom, shelved until when, suppressed by what, causes
    and values of the trip, number of the occurrence. Findings are not: every condition is unknown until it is evaluated
    again, and unknown clears nothing. An alarm that is not among `alarms` is added as its transitions declare it.
    """
    restored = dict(alarms)
    for transition in transitions:
        alarm = restored.get(transition.alarm_id)
        if alarm is None and len(restored) < MOST:
            alarm = Alarm(id=transition.alarm_id, spec=transition.spec)
        if alarm is not None:
            restored[alarm.id] = _after(alarm, transition)
    return restored


def numbered_on(alarms: Mapping[str, Alarm], transitions: Iterable[Transition]) -> dict[str, Alarm]:
    """The alarms as they are, but with occurrences that count on from those of the transitions."""
    last = {name: alarm.occurrence for name, alarm in restore(alarms, transitions).items()}
    return {name: replace(alarm, occurrence=last[name]) for name, alarm in alarms.items()}


def _after(alarm: Alarm, transition: Transition) -> Alarm:
    occurrence = max(alarm.occurrence, transition.occurrence)  # a number is never given twice
    if transition.state is AlarmState.NORMAL:
        return Alarm(id=alarm.id, spec=alarm.spec, occurrence=occurrence, out_of_service=alarm.out_of_service)
    alarm = replace(
        alarm,
        occurrence=occurrence,
        suppressed_by=transition.suppressed_by,
        shelved_until_s=transition.shelved_until_s,
        shelved_by=alarm.shelved_by if transition.shelved_until_s is not None else None,
        causes=tuple(Cause(name=name) for name in transition.causes),
    )
    if transition.state in _FLAGS:
        active, acknowledged = _FLAGS[transition.state]
        raised_s = transition.at_s if active and alarm.raised_s is None else alarm.raised_s
        alarm = replace(alarm, active=active, acknowledged=acknowledged, raised_s=raised_s)
    match transition.change:
        case "raised":
            alarm = replace(alarm, active=True, raised_s=transition.at_s, worst=transition.finding)
            if transition.state is AlarmState.ACKED:  # it came back soon, and was not announced again
                return alarm
            return _announced(alarm, transition)
        case "recaused":
            return _announced(replace(alarm, active=True), transition)
        case "cleared":
            acknowledged = alarm.acknowledged or not alarm.spec.needs_ack
            return replace(alarm, active=False, acknowledged=acknowledged, cleared_s=transition.at_s)
        case "acknowledged" | "handed_over":
            return replace(alarm, acknowledged=True, acknowledged_by=transition.by)
        case "unacknowledged":
            return _announced(alarm, transition)
        case "shelved":
            return replace(alarm, shelved_by=transition.by)
        case "unshelved" if alarm.active:  # its end announces the alarm again
            return _announced(alarm, transition)
    return alarm


def _announced(alarm: Alarm, transition: Transition) -> Alarm:
    return replace(
        alarm,
        acknowledged=False,
        acknowledged_by=None,
        announced_s=transition.at_s,
        trip=transition.finding or alarm.trip,
    )
