"""The one owner of what is known of a vehicle: takes messages as they come, gives snapshots to judge."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from monitor.car_clock import MANY_WRITERS, ClockJump, merged
from monitor.components import Components
from monitor.derived_signals import SOURCES, DerivedSignals, forget
from monitor.freeze_detection import Wheels
from monitor.phones import PhoneReport, Phones
from monitor.reading import (
    Extent,
    Freshness,
    Reading,
    ReadingHistory,
    ReadingTable,
    Unusable,
    with_unusable,
    without_unusable,
)
from monitor.scan_shape import Scans
from monitor.shell_facts import LinkFacts, Phase, ReachFacts, RecorderFacts, SlowingFacts
from monitor.signal_stats import MeasuredRates, SignalStats, extend, keep
from monitor.signals import SIGNALS
from monitor.slow_proof import ProofFollower
from monitor.snapshot import NotFresh, ReceivedModes, Snapshot
from monitor.tracks import TrackPoint
from monitor.values import Diagnostics, DriveMode, GpsFix, LaserScan, Twist, Value

__all__ = ["Extent", "Freshness", "LinkFacts", "NotFresh", "Phase", "Reading", "Snapshot", "State", "TrackPoint"]

CLOCK_BACK_S = 0.5


class State:
    """The one owner of what is known; only the session writes to it."""

    def __init__(self, expected_hz: Mapping[str, float] | None = None) -> None:
        self._expected_hz = dict(expected_hz or {})
        self.reset()

    def reset(self) -> None:
        """Reset everything except the operator's rates: another car, or a new start of monitoring."""
        self._stats = {
            name: SignalStats(signal, self._expected_hz.get(name), one_writer=name not in MANY_WRITERS)
            for name, signal in SIGNALS.items()
        }
        self._table = ReadingTable()
        self.age = self._table.age
        self._derived = DerivedSignals(self._table)
        self._rates = MeasuredRates(self._stats)
        self._heard_s: float | None = None
        self._unusable: Mapping[str, Unusable] = MappingProxyType({})
        self._latest_s = -math.inf
        self._wheels = Wheels()
        self._clock_jump: ClockJump | None = None
        self._components = Components()
        self._scans = Scans()
        self._phones = Phones()
        self._fix_s = -math.inf  # when the newest position was sent
        self._phone_in_car: str | None = None
        self._scan_history = self._stats["scan"].history = ReadingHistory()
        self._distance_history = self._stats["distance"].history = ReadingHistory()
        # Public to read, written by `link` and `set_paused` only: read at every message.
        self.link_facts = LinkFacts()
        self.paused = False
        self._recorder = RecorderFacts()
        self._reach: ReachFacts | None = None
        self._slowing = SlowingFacts()
        self._slow_proof = ProofFollower()
        self._modes = ReceivedModes()
        self._paused_since_s: float | None = None

    def expect(self, expected_hz: Mapping[str, float]) -> None:
        """The operator's rates [Hz] by signal; 0 or absent: learn the car's own."""
        self._expected_hz = dict(expected_hz)
        for name, stats in self._stats.items():
            stats.meter.expect(self._expected_hz.get(name))

    def receive(
        self, signal: str, value: Value, received_s: float, stamp_s: float | None = None, delay_s: float = 0.0
    ) -> tuple[str, ...]:
        """Take one decoded value; returns the signals that changed by it, derived ones included, for `Monitor.step`.
        `delay_s`: how old it was when it came, at most."""
        if received_s >= self._latest_s:
            self._latest_s = received_s
        else:
            self._follow_clock(received_s)
        self._heard_s = received_s
        if signal in self._unusable:
            self._unusable = without_unusable(self._unusable, signal)
        kind = type(value)
        if kind is Twist:
            self._wheels.add(received_s, value.speed_mps)  # type: ignore[union-attr, arg-type]
            self._slow_proof.add(received_s, value.speed_mps)  # type: ignore[union-attr, arg-type]
        elif kind is Diagnostics:
            value = self._components.merge(value, received_s)  # type: ignore[arg-type]
            components = self._components
            self._stats[signal].meter.hold(components.horizon_s(received_s), components.period_s(received_s))
        elif kind is DriveMode:
            self._modes.add(received_s, value)  # type: ignore[arg-type]
        stats = self._stats[signal]
        reading = stats.read(value, received_s, stamp_s, delay_s, self._wheels)
        if stats.jump_s is not None:
            self._clock_jump = merged(self._clock_jump, signal, received_s, stats.jump_s)
        self._table.put(signal, reading)
        if kind is LaserScan:
            self._scans.add(reading)
        if stats.headline is not None:
            number = getattr(value, stats.headline, None)
            if number is not None and not stats.lowest <= number <= stats.highest:
                extend(signal, number, stats, self._table)
        if kind not in SOURCES:
            return stats.alone
        if kind is GpsFix:
            self._fix_s = max(self._fix_s, received_s - delay_s)  # the phone's time is when it was measured too
            self._phones.car(value, self._fix_s)  # type: ignore[arg-type]
        derived = self._derived.receive(signal, reading)
        if derived is None:
            return stats.alone
        name, newer = derived
        keep(name, newer, self._stats[name], self._table)
        return signal, name

    def receive_other(
        self, signal: str, topic: str, value: Value | None, received_s: float, stamp_s: float | None, delay_s: float = 0
    ) -> None:
        """Take one decoded value, None: unusable, of a further source of a signal, to be compared with the signal."""
        self._derived.comparisons.receive_other(signal, topic, value, received_s, stamp_s, delay_s)

    def refuse(self, signal: str, reason: str, received_s: float, *, is_declared: bool = False) -> None:
        """A message without a usable value of this signal, and the reason. `is_declared`: it declares the value as not
        measured; an earlier value that is not fresh is then no longer known, and a derived one may take its place."""
        self._follow_clock(received_s)
        if is_declared:
            self._derived.not_measured(signal, received_s)
        meter = self._stats[signal].meter
        meter.receive(received_s)
        self._heard_s = received_s
        self._unusable = with_unusable(
            self._unusable, signal, reason, received_s, meter.horizon_s, meter.period_s, is_declared=is_declared
        )

    def forget(self, signal: str) -> None:
        """Discard what was received of a signal and what was derived from it: its unit has changed."""
        forget(signal, self._stats[signal], self._table, self._derived)

    def receive_phone(self, report: PhoneReport, now_s: float) -> None:
        """Take the report of an operator's phone; judged on the next tick."""
        self._follow_clock(now_s)
        self._phones.receive(report, now_s)

    def ride(self, phone: str | None, now_s: float) -> None:
        """Set the phone in the car, chosen by the operator; None: no choice."""
        self._follow_clock(now_s)
        self._phone_in_car = phone
        self._phones.ride(phone, now_s)

    def get(self, signal: str) -> Reading[Any] | None:
        """The newest reading of a signal, whatever its age."""
        return self._table.newest.get(signal)

    def phones(self, now_s: float) -> int:
        """The number of phones that reported within the last minute."""
        return self._phones.view.count if self._phones.view.is_there(now_s) else 0

    def link(self, facts: LinkFacts) -> None:
        """Set the facts of the link. A link that opens restarts the measurement of rates."""
        before, self.link_facts = self.link_facts, facts
        self._derived.comparisons.link(facts, self._latest_s)
        if before.opened_s is not None and facts.opened_s is None:
            self._components.closed(facts.since_s)
        if facts.opened_s is not None and facts.opened_s != before.opened_s:
            for stats in self._stats.values():
                stats.restart()
            self._clock_jump = None
            self._scans = Scans()
            self._components.opened(facts.opened_s)
            self._unusable = MappingProxyType({})

    def recorder(self, facts: RecorderFacts) -> None:
        """What is now known of the recorder."""
        self._recorder = facts

    def slow(self, facts: SlowingFacts) -> None:
        """What is now known of an order to slow the car."""
        self._slowing = facts
        self._slow_proof.order(facts)

    def reach(self, facts: ReachFacts) -> None:
        """Set which operators can hear an alarm."""
        self._reach = facts

    def set_paused(self, paused: bool, since_s: float | None = None) -> None:
        """Pause or resume monitoring. `since_s`: an earlier start of the pause."""
        if self._paused_since_s is not None and not paused:
            self._components.miss(self._paused_since_s, self._latest_s)
        self.paused = paused
        self._paused_since_s = since_s if paused else None

    @property
    def track_m(self) -> float | None:
        """Distance driven until now, from positions [m]; None: never had one."""
        return self._derived.track.distance_m

    @property
    def track_ahead_m(self) -> float:
        """How far the car is ahead of that, which is smoothed."""
        return self._derived.track.ahead_m

    def snapshot(self, now_s: float) -> Snapshot:
        """What is known at `now_s`, which later messages do not change."""
        self._components.watch(now_s)
        return self._known(now_s)

    def _known(self, now_s: float) -> Snapshot:
        self._follow_clock(now_s)
        if self.paused and self._paused_since_s is None:
            self._paused_since_s = now_s
        derived, table = self._derived, self._table
        return Snapshot(
            now_s=now_s,
            readings=table.readings(),
            link=self.link_facts,
            rates=self._rates.at(now_s),
            paused=self.paused,
            paused_since_s=self._paused_since_s,
            heard_s=self._heard_s,
            unusable=self._unusable,
            extents=table.extents(),
            track=derived.track.points,
            track_m=derived.track.distance_m,
            gps=derived.gps,
            compared=derived.comparisons.known,
            phone=self._phones.view,
            phones=self._phones.views,
            scan_habit=self._scans.habit.usual,
            scan_before=self._scan_history.before,
            scan_parts=self._scans.parts.others(now_s),
            distance_before=self._distance_history.before,
            standing_since_s=derived.standstill.since_s if table.is_fresh("speed", now_s) else None,
            speed_slope_mps2=derived.slope_mps2,
            clock_jump=self._clock_jump,
            recorder=self._recorder,
            reach=self._reach,
            slowing=self._slowing,
            slow_proof=self._slow_proof.proof,
            modes_received=self._modes.changes,
        )

    def glance(self, now_s: float) -> Snapshot:
        """Like `snapshot`, for display only: it does not affect later evaluations."""
        kept = self._rates, self._latest_s
        self._rates = self._rates.copy()
        try:
            return self._known(now_s)
        finally:
            self._rates, self._latest_s = kept

    def _follow_clock(self, at_s: float) -> None:
        """Keep all ages when the clock goes back; otherwise old values would look new for a long time."""
        if at_s >= self._latest_s:
            self._latest_s = at_s
            return
        shift_s = at_s - self._latest_s
        if shift_s > -CLOCK_BACK_S:
            return  # a message waited a moment between its arrival and here
        self._latest_s = at_s
        self._slow_proof.forget()
        self._modes.forget()
        self._fix_s = -math.inf
        self._scans.forget_times()
        self._derived.comparisons.restart()
        self._phones = Phones()  # they report again within seconds
        self._phones.ride(self._phone_in_car, at_s)
        self._table.shift(shift_s)
        self._unusable = MappingProxyType({})
        if self._heard_s is not None:
            self._heard_s += shift_s
        if self._paused_since_s is not None:
            self._paused_since_s += shift_s
        self._clock_jump = None
        for stats in self._stats.values():
            stats.restart()
