"""What the operator does about an alarm: acknowledge, silence or shelve it, take it off the shelf, take it over."""

from __future__ import annotations

from dataclasses import replace

from monitor.alarm import Alarm, AlarmState, Change, Refused, Transition, rebased, transition

SHELVE_AT_MOST_MIN = 15.0  # longer is forgotten
SILENCE_S = 30.0  # enough to speak with the driver, and too short to be forgotten


def acknowledge(alarm: Alarm, occurrence: int, by: str, now_s: float) -> tuple[Alarm, tuple[Transition, ...]]:
    """The operator has seen this very occurrence. Refused for any other, so that a late tap cannot hide a newer one."""
    title = alarm.spec.title
    if alarm.acknowledged:
        who = f" by {alarm.acknowledged_by}" if alarm.acknowledged_by and alarm.active else ""
        raise Refused(f"{title}: already acknowledged{who}" if alarm.active else f"{title}: nothing to acknowledge")
    if occurrence != alarm.occurrence:
        raise Refused(f"{title} was raised again meanwhile: check again")
    after = replace(alarm, acknowledged=True, acknowledged_by=by, silenced_until_s=None, silenced_by=None)
    transitions = [_transition(after, "acknowledged", by, now_s)]
    if alarm.latched:
        after = replace(after, active=False, latched=False, held_s=0.0, cleared_s=now_s, causes=())
        transitions.append(_transition(after, "cleared", None, now_s))
    return after, tuple(transitions)


def hand_over(alarm: Alarm, by: str, now_s: float, *, is_read_back: bool) -> tuple[Alarm, tuple[Transition, ...]]:
    """Control went to `by` with read-back. Of a standing alarm that somebody else has acknowledged they are the owner
    now, if they have read it back; else it is announced again, because nobody on duty has seen it."""
    if not (alarm.active and alarm.acknowledged) or alarm.acknowledged_by == by:
        return alarm, ()
    if is_read_back:
        after = replace(alarm, acknowledged_by=by)
        return after, (_transition(after, "handed_over", by, now_s),)
    after = replace(alarm, occurrence=alarm.occurrence + 1, acknowledged=False, acknowledged_by=None, announced_s=now_s)
    is_announced = after.state is AlarmState.UNACKED
    return after, (_transition(after, "unacknowledged", by, now_s, announces=is_announced),)


def silence(alarm: Alarm, occurrence: int, by: str, now_s: float) -> tuple[Alarm, tuple[Transition, ...]]:
    """No sound of this very occurrence for `SILENCE_S`. It is not acknowledged by that; a newer one sounds at once."""
    title = alarm.spec.title
    if alarm.state is not AlarmState.UNACKED:
        raise Refused(f"{title}: nothing sounds that could be silenced")
    if occurrence != alarm.occurrence:
        raise Refused(f"{title} was raised again meanwhile: check again")
    if alarm.silenced_until_s is not None:
        raise Refused(f"{title}: already silenced{f' by {alarm.silenced_by}' if alarm.silenced_by else ''}")
    after = replace(rebased(alarm, now_s), silenced_until_s=now_s + SILENCE_S, silenced_by=by)
    return after, (_transition(after, "silenced", by, now_s),)


def shelve(
    alarm: Alarm, occurrence: int, minutes: float, by: str, now_s: float, *, is_inhibitor: bool
) -> tuple[Alarm, tuple[Transition, ...]]:
    """Shelve the alarm for some minutes, at most 15, in the operator's name; it is still evaluated."""
    title = alarm.spec.title
    if not alarm.spec.shelvable:
        raise Refused(f"{title} is critical and cannot be shelved")
    if is_inhibitor:
        raise Refused(f"{title} explains other alarms and cannot be shelved")
    if not 0.0 < minutes <= SHELVE_AT_MOST_MIN:  # NaN is refused too
        raise Refused(f"Shelving is for at most {SHELVE_AT_MOST_MIN:.0f} minutes")
    if not by.strip():
        raise Refused("Shelving needs the name of the operator")
    if not alarm.is_standing:
        raise Refused(f"{title}: nothing to shelve")
    if occurrence != alarm.occurrence:
        raise Refused(f"{title} was raised again meanwhile: check again")
    after = replace(
        rebased(alarm, now_s),
        shelved_until_s=now_s + 60.0 * minutes,
        shelved_by=by,
        silenced_until_s=None,
        silenced_by=None,
    )
    return after, (_transition(after, "shelved", by, now_s),)


def unshelve(alarm: Alarm, by: str, now_s: float) -> tuple[Alarm, tuple[Transition, ...]]:
    """Back from the shelf before its time; if it is still active that is an announcement, as at the end of the time."""
    if alarm.shelved_until_s is None:
        raise Refused(f"{alarm.spec.title} is not shelved")
    after = replace(alarm, shelved_until_s=None, shelved_by=None)
    if alarm.active:
        after = replace(
            after, occurrence=alarm.occurrence + 1, acknowledged=False, acknowledged_by=None, announced_s=now_s
        )
    return after, (_transition(after, "unshelved", by, now_s, announces=alarm.active and not alarm.suppressed_by),)


def _transition(alarm: Alarm, change: Change, by: str | None, now_s: float, *, announces: bool = False) -> Transition:
    text = "" if alarm.finding is None else alarm.finding.text
    return transition(alarm, change, now_s, text=text, by=by, announces=announces)
