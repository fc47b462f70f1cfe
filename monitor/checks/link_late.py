"""Is the link too slow, so that what comes is old when it comes?"""

from __future__ import annotations

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    End,
    Finding,
    Limits,
    Place,
    Priority,
    Quantity,
    Scope,
    Sound,
    absent,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.inhibition import GRACE_S
from monitor.motion import MOVES_ABOVE_MPS
from monitor.snapshot import Snapshot

QUIET_S = 2.0  # nothing for longer than this and the delay: that is silence, which has its own alarms
HYSTERESIS = 0.7


class LateLimits(Limits):
    late_s: float = threshold(
        1.0, "Messages late by", unit="s", low=0.3, high=10.0, step=0.1, help="From the car to this server."
    )
    critical_s: float = threshold(
        2.0,
        "Critical while moving, late by",
        unit="s",
        low=0.5,
        high=20.0,
        step=0.1,
        help="Once the car moves, or may move.",
    )


def ends(limits: LateLimits) -> End:
    return _end(limits.late_s)


def ends_moving(limits: LateLimits) -> End:
    return _end(limits.critical_s)


def _end(limit_s: float) -> End:
    return End("below", limit_s * HYSTERESIS, "s")


def late(snapshot: Snapshot, limits: LateLimits, was_active: bool) -> Finding:
    return _judge(snapshot, limits.late_s, was_active)


def late_moving(snapshot: Snapshot, limits: LateLimits, was_active: bool) -> Finding:
    found = _judge(snapshot, limits.critical_s, was_active)
    speed = snapshot.get("speed")
    if speed is None:
        return absent("Whether the car moves is unknown", brief="no speed")
    if abs(speed.value.speed_mps) <= MOVES_ABOVE_MPS:
        return ok("The car was standing at the last measurement")
    return found


def _judge(snapshot: Snapshot, limit_s: float, was_active: bool) -> Finding:
    link, now_s = snapshot.link, snapshot.now_s
    if link.phase != "monitoring" or link.late_s is None:
        return absent("The delay of messages is unknown", brief="not known")
    late_s = link.late_s
    text = f"{late_s:.1f} s late"
    if late_s <= (_end(limit_s).value if was_active else limit_s):
        return ok(f"Messages arrive {text}")
    heard_s = max((at_s for at_s in (link.last_message_s, snapshot.heard_s) if at_s is not None), default=None)
    if heard_s is None or now_s - heard_s > QUIET_S + late_s:
        return unknown("No message arrives", short="silent")
    rest = f". {link.reduced}" if link.reduced else ""
    return fault(
        f"{text}: the link is too slow{rest}",
        brief=text,
        measured=Quantity(label="Late", value=late_s, unit="s"),
        limit=Quantity(label="Allowed", value=limit_s, unit="s"),
        causes=("link",),
    )


def _alarm(
    priority: Priority, place: Place, sound: Sound, advice: str, *, on_delay_s: float, by: tuple[str, ...]
) -> AlarmSpec:
    return AlarmSpec(
        title="The link is too slow",
        ended="The link was too slow",
        priority=priority,
        place=place,
        sound=sound,
        needs_ack=True,
        on_delay_s=on_delay_s,
        off_delay_s=3.0,
        actions=(Action.ACKNOWLEDGE,),
        advice=advice,
        inhibited_by=by,
        grace_s=GRACE_S,
    )


CHECKS = (
    Check(
        id="link_late",
        label="Link delay",
        tile="Link",
        order=120,
        checked_when="Checked while messages arrive and their delay is known.",
        group="link_late",
        alarm=_alarm(
            Priority.WARNING,
            Place.SNACKBAR,
            Sound.MEDIUM,
            "Values are as old as shown: wait, or reduce the distance between car and server.",
            on_delay_s=1.0,  # packets that a fair radio loses twice are repeated by then
            by=("link_late_moving", "link_lost"),
        ),
        limits=LateLimits,
        find=late,
        ends=ends,
        scope=Scope.LINK,
    ),
    Check(
        id="link_late_moving",
        label="Link delay, moving",
        tile="Link",
        order=120,
        checked_when="Checked while the car moves, messages arrive and their delay is known.",
        group="link_late",
        alarm=_alarm(
            Priority.CRITICAL,
            Place.DIALOG,
            Sound.HIGH,
            "The car is not where it is shown: watch the car.",
            on_delay_s=0.5,  # a hiccup of the radio is over by then
            by=("link_lost",),
        ),
        limits=LateLimits,
        find=late_moving,
        ends=ends_moving,
        scope=Scope.LINK,
    ),
)
