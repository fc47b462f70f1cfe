"""Is one signal silent, or the whole car? So that the whole car is one announcement and not twelve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from monitor.signals import SIGNALS
from monitor.state import Reading, Snapshot

OVERDUE_PERIODS = 3
OVERDUE_S = 0.3  # later than this nothing of Wi-Fi's usual bunching explains
FAST_HORIZON_S = 2.0  # signals that would be missed within the 2 s in which silence is to be named
FALTERS_AT = 0.5  # of its horizon: a silence that was told is over when no gap comes near another
CROWD = 3  # so many fast signals do not die at one moment by themselves
BRIDGE_WITHIN_S = 2.6  # a half-open link is found within 2.5 s: then it has been called lost, or the bridge is alive


@dataclass(frozen=True, slots=True, kw_only=True)
class Silence:
    """How silent the car is at one moment."""

    heard: int  # signals heard on this connection that ought to come regularly
    fresh: int  # of those, the ones still fresh
    is_quiet: bool  # nothing where several things ought to have come: too early to blame one signal
    is_silent: bool  # all that comes fast is stale at once
    falters: bool  # nothing fast for half as long: after a silence it is not over yet
    silent_s: float  # since the newest fast message
    is_bridge_proved: bool  # the bridge has been heard from since


def silence(snapshot: Snapshot) -> Silence | None:
    """None while nothing regular was heard on this connection."""
    now_s, opened_s = snapshot.now_s, snapshot.link.opened_s
    heard = [
        reading
        for name, reading in snapshot.readings.items()
        if reading.derived_from is None
        and not SIGNALS[name].event_like
        and (opened_s is None or reading.received_s >= opened_s)
    ]
    if not heard:
        return None
    horizon_s = max(FAST_HORIZON_S, min(reading.horizon_s for reading in heard))
    fast = [reading for reading in heard if reading.horizon_s <= horizon_s]
    fresh = sum(reading.is_fresh(now_s) for reading in heard)
    newest_s = max(reading.received_s for reading in fast)
    margin_s = min(_overdue_s(reading) for reading in fast)
    newest_of_all_s = newest_s if snapshot.heard_s is None else snapshot.heard_s
    nothing_since = newest_of_all_s - newest_s <= margin_s
    all_overdue = all(now_s - reading.received_s > _overdue_s(reading) for reading in fast)
    bridge_s = max((s for s in (snapshot.link.bridge_heard_s, snapshot.heard_s) if s is not None), default=newest_s)
    return Silence(
        heard=len(heard),
        fresh=fresh,
        is_quiet=all_overdue and (len(fast) >= CROWD or now_s - newest_of_all_s > margin_s),
        is_silent=not any(reading.is_fresh(now_s) for reading in fast) and (len(fast) >= CROWD or nothing_since),
        falters=all(now_s - reading.received_s > FALTERS_AT * reading.horizon_s for reading in fast),
        silent_s=max(0.0, now_s - newest_s),
        is_bridge_proved=bridge_s - newest_s > margin_s,
    )


def _overdue_s(reading: Reading[Any]) -> float:
    return max(OVERDUE_S, OVERDUE_PERIODS * (reading.period_s or 0.0))
