"""What the values of one topic show of their unit so far, and the unit that follows. It never changes back."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from server.judge.speed_ways import Ways
from server.judge.units import Unit, UnitRule

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
