"""What the values of one topic show of their unit so far, and the unit that follows. It never changes back.

The way that follows from a speed is compared with the way of a pose or of positions: is it m/s or km/h?
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from monitor.values import GpsFix, Odometry
from server.judge.units import Unit, UnitRule

STRETCH_M = 20.0  # so long a way gives a verdict
STEP_M = 5.0  # between two places whose distance is counted: below, the noise of a receiver is part of it
LONGEST_STEP_M = 100.0  # further is a jump of the pose, no way
SLOWEST_MPS = 2.0
GAP_S = 1.0  # between two speeds: longer, the way between them is not known
TOLERANCE = 0.1
M_PER_DEG = 111_195.0
RATIOS = {"mps": 1.0, "kmh": 3.6}  # name of the unit → its number for 1 m/s

REST = 0.005  # a number so near to zero is the same in every unit, as far as it is shown
GLITCHES = 2  # values beyond a unit are single wrong values, up to so many
CLEARLY = 2.0  # times the most of a unit: one value is enough to show that it is another one
ALTERNATES = 6  # such steps within the newest PAIRS: two publishers of different units on one topic
PAIRS = 40
STEP_OF_UNITS = {"speed": 3.6}  # between two units of a signal; of all others:
HUNDRED = 100.0
STEP_TOLERANCE = 0.1
SLOWEST = 1.0  # a step from a speed below is one of a car that starts


@dataclass(slots=True, kw_only=True)
class _Stretch:
    """Against one reference, from its newest place on."""

    place: Odometry | GpsFix
    at_s: float
    way: float  # in the unit of the speed times seconds, since the first speed
    gaps: int
    driven_m: float = 0.0
    by_speed: float = 0.0


@dataclass(slots=True)
class Ways:
    """Compares the way that follows from a speed with the way of a pose or of positions.

    Of one speed topic against odometry and positions. Times are on the receiver's clock.
    """

    shown: frozenset[str] = frozenset()  # names of units that a stretch showed; more than one: they contradict
    moved: bool = False
    _way: float = 0.0
    _gaps: int = 0
    _speed: float = 0.0
    _at_s: float = -math.inf
    _stretches: dict[str, _Stretch] = field(default_factory=dict)
    compared: set[str] = field(default_factory=set)  # references with a verdict

    def add_speed(self, speed: float, at_s: float) -> None:
        """A speed in the unit of its topic."""
        span_s = at_s - self._at_s
        size = abs(speed)
        if 0.0 <= span_s <= GAP_S:
            self._way += (size + self._speed) / 2 * span_s
        else:
            self._gaps += 1
        self._speed, self._at_s = size, at_s

    def add_place(self, signal: str, value: Odometry | GpsFix, at_s: float) -> bool:
        """A place by the odometry or the receiver; whether it shows another unit than before."""
        if isinstance(value, GpsFix) and (value.status < 0 or not math.isfinite(value.lat_deg)):
            return False
        way = self._way + self._speed * min(max(at_s - self._at_s, 0.0), GAP_S)
        before = self._stretches.get(signal)
        if before is not None and before.gaps == self._gaps:
            span_s, step_m = at_s - before.at_s, _distance_m(before.place, value)
            if 0.0 <= span_s <= STEP_M / SLOWEST_MPS and step_m < STEP_M:
                return False
            if 0.0 < span_s and SLOWEST_MPS * span_s <= step_m <= LONGEST_STEP_M and span_s <= 2 * GAP_S + 1.0:
                before.driven_m += step_m
                before.by_speed += way - before.way
                before.place, before.at_s, before.way = value, at_s, way
                return before.driven_m >= STRETCH_M and self._judge(signal, before)
        self._stretches[signal] = _Stretch(place=value, at_s=at_s, way=way, gaps=self._gaps)
        return False

    def _judge(self, signal: str, stretch: _Stretch) -> bool:
        ratio = stretch.by_speed / stretch.driven_m
        stretch.driven_m = stretch.by_speed = 0.0
        for name, expected in RATIOS.items():
            if abs(ratio / expected - 1.0) <= TOLERANCE:
                self.compared.add(signal)
                if name not in self.shown:
                    self.shown |= {name}
                    return True
        return False


def _distance_m(first: Odometry | GpsFix, second: Odometry | GpsFix) -> float:
    if isinstance(first, GpsFix) and isinstance(second, GpsFix):
        north_deg, east_deg = second.lat_deg - first.lat_deg, second.lon_deg - first.lon_deg
        return M_PER_DEG * math.hypot(north_deg, east_deg * math.cos(math.radians(first.lat_deg)))
    if isinstance(first, Odometry) and isinstance(second, Odometry):
        return math.hypot(second.x_m - first.x_m, second.y_m - first.y_m)
    return math.inf


@dataclass(slots=True, kw_only=True)
class Evidence:
    """Of one topic that carries one signal, in the unit of the topic."""

    step: float  # the quotient of two values where two units alternate
    count: int = 0  # values that are not at rest
    lowest: float = 0.0
    highest: float = 0.0
    beyond: dict[str, int] = field(default_factory=dict)  # unit → values that it does not allow
    ways: Ways | None = None  # of a speed
    is_whole: bool = False  # all values of the drive are in it: nothing is added
    until_s: float = -math.inf  # all values until then are in it; seconds since the beginning of the recording
    alternates: bool = False
    _last: float = 0.0
    _steps: deque[bool] = field(default_factory=lambda: deque(maxlen=PAIRS))

    def add(self, value: float, units: tuple[Unit, ...]) -> bool:
        """Take one value; whether another unit may follow from it."""
        if self.is_whole:
            return False
        last, self._last = self._last, value
        size = abs(value)
        if size <= REST:
            return False
        self.count += 1
        is_new = self.count == 1
        if value < self.lowest:
            self.lowest, is_new = value, True
        elif value > self.highest:
            self.highest, is_new = value, True
        if size > SLOWEST:
            for unit in units:
                if size > unit.most:
                    self.beyond[unit.name] = self.beyond.get(unit.name, 0) + 1
                    is_new = True
        return self._add_step(abs(last), size) or is_new

    def _add_step(self, last: float, size: float) -> bool:
        """Whether units alternate from now on."""
        if last <= REST or self.alternates:
            return False
        small, large = (last, size) if last < size else (size, last)
        is_step = (
            large > 2.0 * small  # nearly never, and cheap
            and large > SLOWEST
            and abs(large / (small * self.step) - 1.0) <= STEP_TOLERANCE
            and (self.step == HUNDRED or small > SLOWEST)
        )
        if not is_step and not self._steps:
            return False
        self._steps.append(is_step)
        self.alternates = is_step and sum(self._steps) >= ALTERNATES
        return self.alternates


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The unit of a signal, or why it is not known."""

    unit: Unit | None
    why: str  # of a unit: what decided; else the reason, as it follows the name of the signal
    fits: tuple[Unit, ...] = ()  # what the operator may choose
    is_rest: bool = False  # every value was zero, which is the same in all units


def new_evidence(signal: str, rule: UnitRule) -> Evidence:
    return Evidence(step=STEP_OF_UNITS.get(signal, HUNDRED), ways=Ways() if rule.by_way else None)


def decide(rule: UnitRule, evidence: Evidence, *, chosen: Unit | None, profiled: Unit | None) -> Decision:
    """The unit by all values so far. `chosen`: by the operator; `profiled`: by the kind of car."""
    fits = tuple(unit for unit in rule.units if not _is_beyond(unit, evidence))
    if evidence.alternates:
        return _unknown("values of two units alternate, as of two publishers on one topic", ())
    known, by = (chosen, "as chosen") if chosen is not None else (profiled, "as this kind of car has it")
    if rule.by_way:
        return _by_way(rule, evidence, known, by)
    if known is not None:
        if evidence.beyond.get(known.name, 0) <= GLITCHES:
            return Decision(unit=known, why=by)
        return _unknown(f"{known.label} {by}, but values are beyond it", fits)
    if evidence.count == 0:
        return Decision(unit=rule.definition, why="by definition", is_rest=True)
    if evidence.lowest < -REST and not rule.is_signed:
        return _unknown("values below zero", fits)
    possible = [unit for unit in rule.by_values if unit in fits]
    if rule.definition in possible:
        return Decision(unit=rule.definition, why="by definition", fits=fits)
    if len(possible) == 1 and all(one in possible or _is_clearly_beyond(one, evidence) for one in rule.by_values):
        return Decision(unit=possible[0], why="by its values", fits=fits)
    if not possible and rule.by_values:
        return _unknown(f"values beyond {' and '.join(unit.label for unit in rule.by_values)}", fits)
    return _unknown(_listed(fits), fits)


def _by_way(rule: UnitRule, evidence: Evidence, known: Unit | None, by: str) -> Decision:
    shown = evidence.ways.shown if evidence.ways is not None else frozenset()
    if len(shown) > 1:
        return _unknown("against odometry or positions it is m/s at one time and km/h at another", ())
    found = next((unit for unit in rule.units if unit.name in shown), None)
    if known is not None and found not in (None, known):
        assert found is not None
        return _unknown(f"{known.label} {by}, but against odometry or positions it is {found.label}", (found,))
    if known is not None:
        return Decision(unit=known, why=by)
    if found is not None:
        return Decision(unit=found, why="by the way driven")
    return Decision(unit=rule.definition, why="by convention (REP-103)")


def _is_beyond(unit: Unit, evidence: Evidence) -> bool:
    size = max(-evidence.lowest, evidence.highest)
    return size > unit.most or size <= unit.above


def _is_clearly_beyond(unit: Unit, evidence: Evidence) -> bool:
    """Whether another unit follows: a single value a little beyond may be wrong."""
    is_far = max(-evidence.lowest, evidence.highest) > CLEARLY * unit.most
    return is_far or evidence.beyond.get(unit.name, 0) > GLITCHES


def _unknown(why: str, fits: tuple[Unit, ...]) -> Decision:
    return Decision(unit=None, why=f"unit unknown: {why}", fits=fits)


def _listed(units: tuple[Unit, ...]) -> str:
    names = [unit.label for unit in units]
    return " or ".join(names) if names else "values beyond every unit"
