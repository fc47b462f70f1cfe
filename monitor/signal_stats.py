"""What is kept of one signal between its messages: rate, repetitions, stamps and range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from monitor.car_clock import StampFollower
from monitor.freeze_detection import COMPARED, RepeatFollower, Wheels
from monitor.rates import Rate, RateMeter
from monitor.reading import Reading, ReadingHistory, ReadingTable
from monitor.signals import Signal

RATES_EVERY_S = 0.5  # a rate over 5 s does not change faster


class SignalStats:
    """The measurements of one signal since connecting."""

    __slots__ = ("alone", "count", "headline", "highest", "history", "jump_s", "lowest", "meter", "repeats", "stamps")

    def __init__(self, signal: Signal, set_hz: float | None, *, one_writer: bool) -> None:
        """`set_hz`: the operator's rate; `one_writer`: whether its stamps are of one clock."""
        self.alone = (signal.name,)
        self.headline = signal.headline
        self.lowest, self.highest = math.inf, -math.inf  # headline since connecting
        self.history: ReadingHistory | None = None  # where a check needs an older reading
        self.meter = RateMeter(signal.expected_hz, set_hz)
        self.repeats = RepeatFollower()
        self.stamps = StampFollower() if one_writer else None
        self.count = 0
        self.jump_s: float | None = None  # of the car's clock, where the newest message confirmed one

    def read(
        self, value: Any, received_s: float, stamp_s: float | None, delay_s: float, wheels: Wheels
    ) -> Reading[Any]:
        """Take one message of the signal; its reading."""
        self.count += 1
        meter, stamps = self.meter, self.stamps
        meter.receive(received_s)
        if stamp_s is None or stamps is None:
            self.jump_s = stamp_change_s = None
        else:
            self.jump_s = stamps.receive(stamp_s, received_s)
            stamp_change_s = stamps.change_s
        reading = Reading(
            value=value,
            received_s=received_s,
            stamp_s=stamp_s,
            horizon_s=meter.horizon_s,
            period_s=meter.period_s,
            count=self.count,
            delay_s=delay_s,
            repeats=None
            if stamp_s is None and type(value) not in COMPARED
            else self.repeats.receive(value, stamp_s, received_s, wheels),
            stamp_change_s=stamp_change_s,
        )
        if self.history is not None:
            self.history.add(reading)
        return reading

    def restart(self) -> None:
        """Restart the measurement after a discontinuity."""
        self.meter.restart()
        self.repeats.restart()
        if self.stamps is not None:
            self.stamps.restart()

    def widen(self, number: float) -> bool:
        """Include a headline number in the range; whether that changed the range."""
        if self.lowest <= number <= self.highest or not math.isfinite(number):
            return False
        self.lowest, self.highest = min(self.lowest, number), max(self.highest, number)
        return True


def extend(signal: str, number: float, stats: SignalStats, table: ReadingTable) -> None:
    """Include a headline number of a signal in its range."""
    if stats.widen(number):
        table.put_extent(signal, stats.lowest, stats.highest)


def keep(signal: str, reading: Reading[Any], stats: SignalStats, table: ReadingTable) -> None:
    """Put a reading that was derived into the table, and its headline number into the range."""
    table.put(signal, reading)
    number = None if stats.headline is None else getattr(reading.value, stats.headline, None)
    if number is not None:
        extend(signal, number, stats, table)


class MeasuredRates:
    """The rates of all signals, measured every RATES_EVERY_S."""

    def __init__(self, stats: Mapping[str, SignalStats]) -> None:
        """`stats`: by signal."""
        self._stats = stats
        self._rates: Mapping[str, Rate] = MappingProxyType({})
        self._at_s: float | None = None

    def copy(self) -> MeasuredRates:
        """Another one that has measured the same."""
        other = MeasuredRates(self._stats)
        other._rates, other._at_s = self._rates, self._at_s
        return other

    def at(self, now_s: float) -> Mapping[str, Rate]:
        """The rates by signal, at most RATES_EVERY_S old."""
        if self._at_s is None or not 0.0 <= now_s - self._at_s < RATES_EVERY_S:
            self._at_s = now_s
            self._rates = MappingProxyType({name: stats.meter.rate(now_s) for name, stats in self._stats.items()})
        return self._rates
