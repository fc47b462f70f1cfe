"""Does the car's clock jump, and does it agree with the time of this server?

Only changes of the difference between stamp and arrival are used, which needs no common clock, and the time of day if
it is given. A difference of more than a day is a recording, a simulation with its own time, or a clock that was never
set. These cannot be distinguished, so the offset is then *not checked*; jumps are judged on any clock.
"""

from __future__ import annotations

from collections.abc import Callable

from monitor.car_clock import JUMP_S
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
from monitor.reading import Reading
from monitor.signals import SIGNALS
from monitor.snapshot import Snapshot

REPORTED_S = 10.0  # a jump is instantaneous; it is reported for this time
ANOTHER_TIME_S = 86_400.0
STUCK_AFTER = 3  # equal stamps: a constant stamp has its own alarm and proves nothing about the clock


class ClockLimits(Limits):
    jump_s: float = threshold(1.0, "Clock jump above", unit="s", low=JUMP_S, high=60.0, step=0.5)
    late_s: float = threshold(
        2.0,
        "Stamps late or ahead by",
        unit="s",
        low=0.5,
        high=60.0,
        step=0.5,
        help="Relative to the usual offset since connecting: late messages, or a clock that runs slow or fast.",
    )
    offset_s: float = threshold(
        5.0,
        "Car's clock off by",
        unit="s",
        low=0.5,
        high=3600.0,
        step=0.5,
        help="Against this server's time of day.",
    )


def jumps(snapshot: Snapshot, limits: ClockLimits, was_active: bool) -> Finding:
    jump = snapshot.clock_jump
    if jump is None:
        if not _stamped(snapshot):
            return absent("No message of the car has a stamp", brief="no stamps")
        return ok("The car's clock has not jumped since connecting")
    ago_s = max(0.0, snapshot.now_s - jump.at_s)
    how = f"{'ahead' if jump.by_s > 0 else 'back'} by {_duration_text(abs(jump.by_s))}"
    if abs(jump.by_s) <= limits.jump_s or ago_s > REPORTED_S:
        return ok(f"It jumped {how} {_duration_text(ago_s)} ago and is steady since then")
    labels = ", ".join(SIGNALS[name].label for name in jump.signals)
    return fault(
        f"The car's clock jumped {how} ({labels})",
        brief=f"{'+' if jump.by_s > 0 else '−'}{_duration_text(abs(jump.by_s))}",
        measured=Quantity(label="Jump", value=jump.by_s, unit="s"),
        limit=Quantity(label="Allowed", value=limits.jump_s, unit="s"),
        causes=("clock",),
    )


def differs(snapshot: Snapshot, limits: ClockLimits, was_active: bool) -> Finding:
    stamped = [reading for reading in _stamped(snapshot) if reading.is_fresh(snapshot.now_s)]
    if not stamped:
        if any(True for _ in _stamped(snapshot)):
            return unknown("No stamped message is fresh", short="stale")
        return absent("No message of the car has a stamp", brief="no stamps")
    offset_s = _offset_s(stamped, snapshot.link.wall_zero_s)
    if offset_s is not None and abs(offset_s) > ANOTHER_TIME_S:
        return unknown(
            f"The stamps are {_duration_text(abs(offset_s))} {'ahead of' if offset_s > 0 else 'behind'} this server:"
            " a recording, a simulation, or a clock that was never set",
            short="another",
        )
    # Only what every stamped signal shows is due to the clock or the radio; a single one is due to its own driver.
    change_s = _nearest(stamped, lambda reading: reading.stamp_change_s or 0.0)
    slack = 0.8 if was_active else 1.0
    if abs(change_s) > limits.late_s * slack:
        return _changed(change_s, limits)
    if offset_s is None:
        return ok(f"Stamps {abs(change_s):.1f} s from usual; the time of day is unknown")
    text = f"Car's clock {_duration_text(abs(offset_s))} {'ahead of' if offset_s > 0 else 'behind'} this server"
    if abs(offset_s) > limits.offset_s * slack:
        return fault(
            text,
            brief=f"{'+' if offset_s > 0 else '−'}{_duration_text(abs(offset_s))}",
            measured=Quantity(label="Offset", value=offset_s, unit="s"),
            limit=Quantity(label="Allowed", value=limits.offset_s, unit="s"),
            causes=("offset",),
        )
    return ok(text)


def _changed(change_s: float, limits: ClockLimits) -> Finding:
    by_s = abs(change_s)
    return fault(
        f"Messages come {by_s:.1f} s late, or the car's clock runs slow"
        if change_s < 0
        else f"The car's clock runs fast: {by_s:.1f} s ahead since connecting",
        brief=f"{by_s:.1f} s {'late' if change_s < 0 else 'ahead'}",
        measured=Quantity(label="Against usual", value=change_s, unit="s"),
        limit=Quantity(label="Allowed", value=limits.late_s, unit="s"),
        causes=("late",) if change_s < 0 else ("fast",),
    )


def _stamped(snapshot: Snapshot) -> list[Reading[object]]:
    return [
        reading
        for reading in snapshot.readings.values()
        if reading.stamp_change_s is not None and (reading.repeats is None or reading.repeats.stamp_n < STUCK_AFTER)
    ]


def _offset_s(stamped: list[Reading[object]], wall_zero_s: float | None) -> float | None:
    """Of the stamps against the time of day at their arrival; None where that is not known."""
    if wall_zero_s is None:
        return None
    return _nearest(stamped, lambda reading: (reading.stamp_s or 0.0) - reading.received_s - wall_zero_s)


def _nearest(stamped: list[Reading[object]], difference_s: Callable[[Reading[object]], float]) -> float:
    return min((difference_s(reading) for reading in stamped), key=abs)


def _duration_text(seconds: float) -> str:
    """A time in the unit a person would name it in."""
    for unit, size in (("years", 365.25 * 86_400), ("days", 86_400), ("h", 3600), ("min", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.1f} s"


def _alarm(title: str, advice: str, *, on_delay_s: float, off_delay_s: float, by: tuple[str, ...]) -> AlarmSpec:
    return AlarmSpec(
        title=title,
        priority=Priority.WARNING,
        place=Place.SNACKBAR,
        sound=Sound.LOW,
        needs_ack=True,
        on_delay_s=on_delay_s,
        off_delay_s=off_delay_s,
        actions=(Action.ACKNOWLEDGE,) if not by else (Action.SHELVE, Action.ACKNOWLEDGE),
        advice=advice,
        inhibited_by=by,
    )


CHECKS = (
    Check(
        id="clock_jump",
        label="Clock jump",
        tile="Clock",
        order=125,
        checked_when="Checked while the car's messages carry a time stamp.",
        group="clock",
        alarm=_alarm(
            "The car's clock jumped",
            "Times before and after do not match: values computed from them restart.",
            on_delay_s=0.0,
            off_delay_s=0.0,
            by=(),
        ),
        limits=ClockLimits,
        find=jumps,
    ),
    Check(
        id="clock_offset",
        label="Clock offset",
        tile="Clock",
        order=126,
        checked_when="Checked while messages with a time stamp of about now arrive.",
        group="clock",
        alarm=_alarm(
            "Car's clock and server differ",
            "Values may be older than shown, and times in recordings are wrong by this amount.",
            on_delay_s=2.0,  # a burst after a gap of the radio is over by then
            off_delay_s=5.0,
            by=("clock_jump", "link_late", "link_late_moving"),
        ),
        limits=ClockLimits,
        find=differs,
    ),
)
