"""Does the car slow down when catgraph orders it? The only proof is the car's own speed.

First a change must be proven that the order explains (monitor/slow_proof.py): the ramp starts at the measured speed, so
a car that is no faster than commanded proves nothing. After that, half of the ordered deceleration is enough, because a
real car follows loosely and the slope is known over 0.6 s only; so is a speed no higher than commanded. A standing car
raises no alarm, whatever stopped it.
"""

from __future__ import annotations

from typing import Any

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
    absent,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.motion import STANDS_BELOW_MPS
from monitor.slow_proof import NOTHING_SHOWN, SHARE, SlowProof
from monitor.snapshot import Snapshot

TILE = "Slow-down"
STANDS_ALREADY = "The car was already standing: nothing to slow"
BEFORE_UNKNOWN = "too few speeds were received before the order to prove that it slows the car"
STANDS_UNPROVEN = "The car stands; its speed does not prove that the order stopped it"
WITHIN_S = 1.0  # of the first command
FOLLOWS_WITHIN_MPS = 0.5  # once it is shown to slow, a car so near the commanded speed follows it
ENDED_REPORTED_S = 30.0


def _switch(label: str, help: str) -> Any:
    return threshold(
        0.0,
        label,
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help=f"{help} 1: after a countdown of 2 s the car is slowed, if the slow-down is armed and nobody vetoes.",
    )


def _after(label: str, default_s: float) -> Any:
    return threshold(default_s, label, unit="s", low=0.0, high=60.0, step=0.1)


class SlowDownLimits(Limits):
    """How the car is slowed; the page, the sender and the checks use the same values."""

    deceleration_mps2: float = threshold(
        1.5,
        "Slow down with",
        unit="m/s²",
        low=0.3,
        high=4.6,
        step=0.1,
        help="From the measured speed to zero. 4.6 is the car's hardest braking.",
    )
    longest_s: float = threshold(
        600.0,
        "Hold at most",
        unit="s",
        low=10.0,
        high=3600.0,
        step=10.0,
        help="An order that is not released ends after this time, with an alarm; then the controllers drive again.",
    )
    on_speed: float = _switch("Slow down when too fast", "Speed above its limit for the time below.")
    on_speed_after_s: float = _after("Too fast for", 3.0)
    on_obstacle: float = _switch("Slow down before an obstacle", "An obstacle within the stopping distance.")
    on_obstacle_after_s: float = _after("Obstacle for", 0.3)
    on_reach: float = _switch(
        "Slow down when nobody can hear alarms", "No operator's phone is reachable while the car moves."
    )
    on_reach_after_s: float = _after("Nobody reachable for", 10.0)
    on_rate_speed: float = _switch(
        "Slow down when speed is slow", "Speed arrives less often than expected, or not at all."
    )
    on_rate_distance: float = _switch("… when distance is slow", "The nearest object likewise.")
    on_rate_position: float = _switch("… when position is slow", "The position likewise.")
    on_rate_scan: float = _switch("… when the laser is slow", "The laser's scans likewise.")
    on_rate_after_s: float = _after("Too slow for", 2.0)


def is_followed(snapshot: Snapshot, limits: SlowDownLimits, was_active: bool) -> Finding:
    facts = snapshot.slowing
    if facts.ordered_s is None:
        return absent("The car is not ordered to slow down", brief="not ordered")
    if facts.sending_s is None or facts.commanded_mps is None:
        return fault(
            "NOT CONFIRMED: the order does not reach the bridge. Use the physical stop",
            brief="not sent",
            causes=("not sent",),
        )
    for_s = snapshot.now_s - facts.sending_s
    speed = snapshot.get("speed")
    if speed is None or not speed.is_fresh(snapshot.now_s):
        if for_s < WITHIN_S:
            return unknown("No speed received since the order", short="no speed")
        return fault(
            "NOT CONFIRMED: no speed received from the car. Use the physical stop",
            brief="no speed",
            causes=("no speed",),
        )
    speed_mps = abs(speed.value.speed_mps)
    proof = proof_of(snapshot)
    if speed_mps < STANDS_BELOW_MPS or snapshot.standing_since_s is not None:
        return ok(_standing(proof))
    text = f"{abs(facts.commanded_mps):.1f} m/s ordered, {speed_mps:.1f} m/s driven"
    slope_mps2 = snapshot.speed_slope_mps2
    braking_mps2 = None if slope_mps2 is None else max(0.0, -slope_mps2 if speed.value.speed_mps > 0 else slope_mps2)
    measured = None if braking_mps2 is None else Quantity(label="Braking", value=braking_mps2, unit="m/s²")
    least_mps2 = SHARE * facts.deceleration_mps2 * (1.2 if was_active else 1.0)
    limit = Quantity(label="At least", value=least_mps2, unit="m/s²")
    if proof.shown is None:
        if for_s < WITHIN_S:
            return unknown(f"{text}: ordered {for_s:.1f} s ago", short="waiting")
        why = "its speed does not prove that the order slows it" if proof.is_before_known else BEFORE_UNKNOWN
        return fault(
            f"NOT CONFIRMED: {text}, and {why}. Use the physical stop",
            brief=f"{speed_mps:.1f} m/s",
            measured=measured,
            limit=limit,
            causes=("not shown",),
        )
    if speed_mps - abs(facts.commanded_mps) <= FOLLOWS_WITHIN_MPS * (0.6 if was_active else 1.0):
        return ok(f"{text}: the car follows")
    if braking_mps2 is not None and braking_mps2 >= least_mps2:
        return ok(f"{text}: the car slows by {braking_mps2:.1f} m/s²", measured=measured, limit=limit)
    if for_s < WITHIN_S or (proof.shown_s is not None and snapshot.now_s - proof.shown_s < WITHIN_S):
        return ok(f"{text}: the car slows")
    if braking_mps2 is None:
        return fault(f"NOT CONFIRMED: {text}, too few speed messages. Use the physical stop", causes=("no speed",))
    return fault(
        f"NOT CONFIRMED: {text}, braking {braking_mps2:.1f} m/s², {least_mps2:.2f} needed. Use the physical stop",
        brief=f"{speed_mps:.1f} m/s",
        measured=measured,
        limit=limit,
        causes=("no braking",),
    )


def proof_of(snapshot: Snapshot) -> SlowProof:
    """The proof of the active order by the car's speed."""
    proof = snapshot.slow_proof
    return proof if proof.ordered_s == snapshot.slowing.ordered_s else NOTHING_SHOWN


def _standing(proof: SlowProof) -> str:
    if proof.shown is not None:
        return "The car stands, as ordered"
    return STANDS_ALREADY if proof.stood_before else STANDS_UNPROVEN


def is_alone(snapshot: Snapshot, limits: SlowDownLimits, was_active: bool) -> Finding:
    facts = snapshot.slowing
    if not facts.is_armed:
        return absent("Slow-down is not armed", brief="not armed")
    if not facts.rivals:
        return ok(f"No other node publishes on {facts.topic}")
    names = ", ".join(facts.rivals[:3]) + (f" and {len(facts.rivals) - 3} more" if len(facts.rivals) > 3 else "")
    return fault(
        f"{names} also command{'s' if len(facts.rivals) == 1 else ''} the car on {facts.topic}: the last message wins",
        brief="another node" if len(facts.rivals) == 1 else f"{len(facts.rivals)} other nodes",
        causes=facts.rivals,
    )


def goes_on(snapshot: Snapshot, limits: SlowDownLimits, was_active: bool) -> Finding:
    facts = snapshot.slowing
    ended_s = facts.ended_at_longest_s
    if ended_s is not None and snapshot.now_s - ended_s < ENDED_REPORTED_S:
        text = f"The order ended after {limits.longest_s:.0f} s: the car is no longer held, and may drive off"
        return fault(text, brief="hold ended")
    if facts.ordered_s is None:
        return absent("The car is not held", brief="not ordered")
    left_s = limits.longest_s - (snapshot.now_s - facts.ordered_s)
    return ok(f"The car is held for {max(0.0, left_s):.0f} s more")


CHECKS = (
    Check(
        id="slow_down_unconfirmed",
        label="Car complies",
        order=110,
        checked_when="Checked while the car is being slowed.",
        group="slow_down",
        tile=TILE,
        alarm=AlarmSpec(
            title="Slow-down NOT CONFIRMED",
            ended="Slow-down was NOT CONFIRMED",
            priority=Priority.CRITICAL,
            place=Place.DIALOG,
            sound=Sound.HIGH,
            needs_ack=True,
            off_delay_s=1.0,
            place_after=Place.LIST,
            actions=(Action.ACKNOWLEDGE,),
            advice="Use the physical stop: tell the safety driver now.",
        ),
        limits=SlowDownLimits,
        find=is_followed,
        needs=frozenset({"speed"}),
    ),
    Check(
        id="slow_down_hold_ended",
        label="Car held",
        order=111,
        checked_when="Checked while the car is being slowed.",
        group="slow_down",
        tile=TILE,
        alarm=AlarmSpec(
            title="Hold ended by itself",
            ended="Hold had ended by itself",
            priority=Priority.CRITICAL,
            place=Place.DIALOG,
            sound=Sound.HIGH,
            needs_ack=True,
            actions=(Action.DECELERATE, Action.ACKNOWLEDGE),
            advice="The car may drive off: order it again, or tell the safety driver.",
        ),
        limits=SlowDownLimits,
        find=goes_on,
    ),
    Check(
        id="slow_down_rivals",
        label="Alone on the topic",
        order=112,
        checked_when="Checked while the slow-down is armed or the car is being slowed.",
        group="slow_down",
        tile=TILE,
        alarm=AlarmSpec(
            title="Another node is driving the car",
            ended="Another node was driving the car",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.LOW,
            needs_ack=True,
            off_delay_s=2.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="It may override a slow-down. Stop that node, or place the guard between it and the car.",
        ),
        limits=SlowDownLimits,
        find=is_alone,
    ),
)
