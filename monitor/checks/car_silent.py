"""Have all messages of the car stopped while the link is open?

Other checks use `silence` to distinguish one silent signal from a silent car, which is one announcement and not twelve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Quantity,
    Sound,
    fault,
    ok,
    unknown,
)
from monitor.inhibition import GRACE_S
from monitor.signals import SIGNALS
from monitor.snapshot import Snapshot

OVERDUE_PERIODS = 3
OVERDUE_S = 0.3  # later than this nothing of Wi-Fi's usual bunching explains
FAST_HORIZON_S = 2.0  # signals that would be missed within the 2 s in which silence is to be named
FALTERS_AT = 0.5  # of its horizon: an announced silence ends when no gap comes near another
CROWD = 3  # so many fast signals do not die at one moment by themselves
OTHERS_S, OTHERS_PERIODS = 1.5, 1.5  # another signal continues if its newest message is no older than this
BRIDGE_WITHIN_S = 2.6  # a half-open link is found within 2.5 s: then it has been called lost, or the bridge is alive
REGULAR = frozenset(name for name, one in SIGNALS.items() if not (one.event_like or one.by_parts))


@dataclass(frozen=True, slots=True, kw_only=True)
class Silence:
    """How silent the car is at one moment."""

    regular: int  # signals received on this connection that have a regular rate
    fresh: int  # of those, the ones that still come
    is_quiet: bool  # nothing where several things ought to have come: too early to blame one signal
    is_silent: bool  # nothing comes of all that comes fast
    falters: bool  # nothing fast for half as long: after a silence it is not over yet
    silent_s: float  # since the newest fast message
    is_bridge_proved: bool  # the bridge has answered since


def silence(snapshot: Snapshot) -> Silence | None:
    """None before the first regular signal on this connection."""
    now_s, opened_s = snapshot.now_s, snapshot.link.opened_s
    arrivals = [one for one in _arrivals(snapshot) if opened_s is None or one.at_s >= opened_s]
    if not arrivals:
        return None
    horizon_s = max(FAST_HORIZON_S, min([one.horizon_s for one in arrivals]))
    fast = [one for one in arrivals if one.horizon_s <= horizon_s]
    newest_s = max([one.at_s for one in fast])
    margin_s = min([_overdue_s(one) for one in fast])
    newest_of_all_s = newest_s if snapshot.heard_s is None else snapshot.heard_s
    nothing_since = newest_of_all_s - newest_s <= margin_s
    coming = [one for one in arrivals if one.is_coming(now_s)]
    newer = [one for one in arrivals if one.at_s - newest_s > margin_s]
    others_come = any(now_s - one.at_s <= max(OTHERS_S, OTHERS_PERIODS * (one.period_s or 0.0)) for one in newer)
    all_overdue = all(now_s - one.at_s > _overdue_s(one) for one in fast)
    bridge_s = max((s for s in (snapshot.link.bridge_heard_s, snapshot.heard_s) if s is not None), default=newest_s)
    return Silence(
        regular=len(arrivals),
        fresh=len(coming),
        is_quiet=all_overdue and not others_come and (len(fast) >= CROWD or now_s - newest_of_all_s > margin_s),
        is_silent=not (others_come or any(one.horizon_s <= horizon_s for one in coming))
        and (len(fast) >= CROWD or nothing_since),
        falters=not others_come and all(now_s - one.at_s > FALTERS_AT * one.horizon_s for one in fast),
        silent_s=max(0.0, now_s - newest_s),
        is_bridge_proved=bridge_s - newest_s > margin_s,
    )


def is_heard(snapshot: Snapshot) -> bool:
    """Whether anything came on this connection, regular or not."""
    opened_s = snapshot.link.opened_s
    return snapshot.heard_s is not None and (opened_s is None or snapshot.heard_s >= opened_s)


def _arrivals(snapshot: Snapshot) -> list[_Arrival]:
    """Of each signal that ought to come regularly, whether what came can be used or not."""
    unusable = snapshot.unusable
    found = [
        _Arrival(reading.received_s, reading.horizon_s, reading.period_s)
        for name, reading in snapshot.readings.items()
        if name in REGULAR and reading.derived_from is None and name not in unusable
    ]
    found += [_Arrival(one.at_s, one.horizon_s, one.period_s) for name, one in unusable.items() if name in REGULAR]
    return found


class _Arrival(NamedTuple):
    """The newest message of a signal."""

    at_s: float
    horizon_s: float
    period_s: float | None

    def is_coming(self, now_s: float) -> bool:
        return -self.horizon_s <= now_s - self.at_s <= self.horizon_s


def _overdue_s(arrival: _Arrival) -> float:
    return max(OVERDUE_S, OVERDUE_PERIODS * (arrival.period_s or 0.0))


def find(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    found = silence(snapshot)
    if found is None:
        what = "No regular signal" if is_heard(snapshot) else "Nothing"
        return unknown(f"{what} received since connecting", short="no data")
    if not found.is_silent and not (was_active and found.falters):
        return ok(f"{found.fresh} of {found.regular} signals come")
    if not (found.is_bridge_proved or was_active or found.silent_s > BRIDGE_WITHIN_S):
        # Car or link? Wait for the bridge's next sign of life: a lost link has its own text.
        return unknown(f"No message for {found.silent_s:.1f} s, pinging the bridge", short="silent")
    if not found.is_silent:
        proof = "messages come with gaps"
    elif found.is_bridge_proved:
        proof = "the bridge answers, no signal of the car comes"
    else:
        proof = "neither car nor bridge answers"
    if snapshot.link.behind_title:
        proof = snapshot.link.behind_title
    return fault(
        f"No message for {found.silent_s:.1f} s: {proof}",
        brief=f"{found.silent_s:.0f} s",
        measured=Quantity(label="Silent for", value=found.silent_s, unit="s"),
        causes=("car",),
    )


CHECKS = (
    Check(
        id="car_silent",
        label="Car sends data",
        tile="Link",
        order=120,
        checked_when="Checked once the first message has come.",
        alarm=AlarmSpec(
            title="The car fell silent",
            ended="The car was silent",
            priority=Priority.CRITICAL,
            place=Place.DIALOG,
            sound=Sound.HIGH,
            needs_ack=True,
            off_delay_s=1.0,
            actions=(Action.ACKNOWLEDGE, Action.RECONNECT, Action.EXIT),
            advice="The car may still be moving: watch the car.",
            inhibited_by=("link_lost", "link_late", "link_late_moving"),
            grace_s=GRACE_S,
            place_after=Place.LIST,
        ),
        limits=Limits,
        find=find,
    ),
)
