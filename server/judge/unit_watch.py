"""The unit of every signal of one drive: decided once by all values so far and applied to each, or a question."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from monitor.signals import SIGNALS
from monitor.values import Effort, GpsFix, Level, Odometry, Steering, Twist
from server.judge.active_settings import PERCENT_A_RAD
from server.judge.message_fields import NotMeasured, Rejected
from server.judge.profiles import Profile
from server.judge.topics import Source, plain_type
from server.judge.unit_evidence import Decision, Evidence, decide, new_evidence
from server.judge.units import BY_RATIO, FASTEST_MPS, LITRES, TOO_FAST, Unit, UnitRule, rule_for, unit_named
from server.protocol.questions import Question

PLACES = (Odometry, GpsFix)
MOVES_MPS = 1.0
MANY = 1000  # values, after which a car that does not move, or has no speed, gets the question
UNDECIDED = Decision(unit=None, why="")
MOST_TOPICS = 200  # of one drive; what is beyond is judged by its definition alone

Key = tuple[str, str]  # signal, topic
_NUMBERS: Mapping[type, Callable[[Any], float]] = {
    Effort: lambda value: value.percent,
    Level: lambda value: value.value,
    Steering: lambda value: value.percent,
    Twist: lambda value: value.speed_mps,
}

NOT_EVALUATED = "It is not evaluated."


def number_of(value: Any) -> float | None:
    """The number of a value that has a unit of its own; None: it has none."""
    get = _NUMBERS.get(type(value))
    return None if get is None else get(value)


def read(source: Source, message: Any) -> Any | None:
    """The value of a message, or None where it has none."""
    try:
        return None if source.decode is None else source.decode(message)
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError, IndexError):
        return None


class UnitUnknown(NotMeasured):
    """A proper message whose unit is not known; `str()` is the reason."""


class UnitBasis(NamedTuple):
    """What is known beforehand of the units of a car."""

    profile: Profile
    chosen: Mapping[str, str]  # signal → name of its unit, by the operator
    tyre_rad_per_unit: float = 0.0  # of the steering signal; 0: not known

    def unit_of(self, signal: str) -> Unit | None:
        """By the kind of car; None: it does not say."""
        if signal != "steering":
            return unit_named(signal, self.profile.units.get(signal))
        if self.profile.steering == "unknown":
            return BY_RATIO if self.tyre_rad_per_unit else None
        return unit_named(signal, "percent" if self.profile.steering == "percent" else "tyre_rad")


@dataclass(slots=True, kw_only=True)
class _Watched:
    """One topic that carries one signal."""

    rule: UnitRule
    evidence: Evidence
    known: tuple[str, str | None, float]  # profile, choice and ratio that `chosen` and `profiled` follow from
    chosen: Unit | None
    profiled: Unit | None
    decision: Decision = UNDECIDED
    was_used: Unit | None = None  # values in it were passed on
    void: str | None = None  # what was taken for what it is not


class UnitWatch:
    """Of one drive. Times are on the receiver's clock."""

    def __init__(self, evidence: Mapping[Key, Evidence] | None = None) -> None:
        """`evidence`: of the whole drive, where it was surveyed."""
        self._surveyed = dict(evidence or {})
        self._watched: dict[Key, _Watched] = {}
        self._speeds: dict[str, Evidence] = {}  # by topic
        self.has_moved = False
        self._voided: set[Key] = set()  # changed their unit with the newest place
        self.is_void = False  # by the newest message: what was received of its signal was of another unit, or of none

    def see(self, signal: str, value: Any, at_s: float) -> None:
        """Compare a value of any signal: its way decides the unit of a speed."""
        kind = type(value)
        if kind is Twist:
            self.has_moved = self.has_moved or abs(value.speed_mps) > MOVES_MPS
        elif kind in PLACES:
            for topic, evidence in self._speeds.items():
                ways = evidence.ways if at_s > evidence.until_s else None
                if ways is not None and ways.add_place(signal, value, at_s):
                    self._decide("speed", topic)  # every topic in `_speeds` carries it

    def convert(self, source: Source, value: Any, at_s: float, basis: UnitBasis) -> Any:
        """The value in the unit of its signal. Raises UnitUnknown, and Rejected for what its unit does not allow."""
        self.is_void = False
        get = _NUMBERS.get(type(value))
        if get is None:
            return value
        key = (source.signal, source.topic)
        watched = self._watched.get(key)
        known = (basis.profile.name, basis.chosen.get(source.signal), basis.tyre_rad_per_unit)
        if watched is None:
            watched = self._begin(key, source, basis, known)
            if watched is None:
                return value
        elif watched.known != known:
            watched.known, watched.chosen = known, unit_named(source.signal, known[1])
            watched.profiled = basis.unit_of(source.signal)
            self._decide(*key)
        number, evidence = get(value), watched.evidence
        if at_s > evidence.until_s:
            if evidence.add(number, watched.rule.units):
                self._decide(*key)
            if evidence.ways is not None and not evidence.is_whole:
                evidence.ways.add_speed(number, at_s)
        decision = watched.decision
        has_none = not decision.is_rest if decision.unit is None else not decision.unit.converts
        if has_none or (self._voided and key in self._voided):
            self._voided.discard(key)
            self.is_void = source.carries
        return self._in_unit(value, number, watched, basis)

    def decision(self, signal: str, topic: str) -> Decision | None:
        """What is decided of a topic; None: nothing came, or its unit is not in doubt."""
        found = self._watched.get((signal, topic))
        return None if found is None else found.decision

    def unconverted(self, source: Source) -> Unit | None:
        """The unit of numbers that it makes no values of the signal; None: it does, or is not known."""
        found = self.decision(source.signal, source.topic)
        return None if found is None or found.unit is None or found.unit.converts else found.unit

    def is_to_ask(self, signal: str, topic: str) -> bool:
        """Whether the operator can say what the values do not show."""
        found = self._watched.get((signal, topic))
        if found is None or found.decision.unit is not None or not found.decision.fits:
            return False
        return not found.decision.is_rest and (
            self.has_moved or found.evidence.is_whole or found.evidence.count >= MANY or bool(found.evidence.beyond)
        )

    def highest(self, signal: str, topic: str) -> float:
        """The largest number so far, as published."""
        found = self._watched.get((signal, topic))
        return 0.0 if found is None else max(found.evidence.highest, -found.evidence.lowest)

    def note(self, signal: str, topic: str) -> str | None:
        """What is to be known of the unit: why it is unknown, what was void, or how it was found."""
        found = self._watched.get((signal, topic))
        if found is None:
            return None
        unit, why = found.decision.unit, found.decision.why
        if unit is None:
            return None if found.decision.is_rest else why
        if not unit.converts:
            return cannot_convert(unit)
        if found.void is not None:
            return f"published in {unit.label}, {why}; {found.void}"
        is_usual = unit == found.rule.definition or why.startswith("as this kind")
        return None if is_usual else f"published in {unit.label}, {why}"

    def _begin(
        self, key: Key, source: Source, basis: UnitBasis, known: tuple[str, str | None, float]
    ) -> _Watched | None:
        rule = rule_for(source.signal, plain_type(source.type or ""))
        if rule is None or len(self._watched) >= MOST_TOPICS:
            return None
        chosen, profiled = unit_named(source.signal, known[1]), basis.unit_of(source.signal)
        evidence = self._surveyed.get(key) or new_evidence(source.signal, rule)
        if rule.by_way:
            if profiled is not None:
                evidence.ways = None
            if evidence.ways is not None and not evidence.is_whole:
                self._speeds[source.topic] = evidence
        watched = self._watched[key] = _Watched(
            rule=rule, evidence=evidence, known=known, chosen=chosen, profiled=profiled
        )
        self._decide(*key)
        return watched

    def _decide(self, signal: str, topic: str) -> None:
        watched = self._watched[signal, topic]
        watched.decision = decide(watched.rule, watched.evidence, chosen=watched.chosen, profiled=watched.profiled)
        before = watched.was_used
        if before is not None and watched.decision.unit != before:
            watched.void = f"what came before was taken as {before.label} and is void"
            watched.was_used = None
            self._voided.add((signal, topic))

    def _in_unit(self, value: Any, number: float, watched: _Watched, basis: UnitBasis) -> Any:
        unit, is_rest = watched.decision.unit, watched.decision.is_rest
        if unit is None and not is_rest:
            raise UnitUnknown(watched.decision.why)
        if unit is not None:
            if not unit.converts:
                raise UnitUnknown(cannot_convert(unit))
            if not watched.rule.by_way and abs(number) > unit.most:
                raise Rejected(f"a value beyond {unit.label}")
            if not is_rest:
                watched.was_used = unit
        if type(value) is Steering:
            return _steered(number, unit, basis)
        factor = 1.0 if unit is None or unit.factor is None else unit.factor
        if type(value) is Level:
            return Level(value=number * factor, unit="l" if unit == LITRES else "%")
        if type(value) is Twist:
            if abs(number * factor) > FASTEST_MPS:
                raise Rejected(TOO_FAST)
            return value if factor == 1.0 else replace(value, speed_mps=number * factor)
        return value if factor == 1.0 else Effort(percent=number * factor)


def cannot_convert(unit: Unit) -> str:
    """Why a value of a known unit is not evaluated."""
    return f"in {unit.label}, which cannot be converted to %"


def _steered(number: float, unit: Unit | None, basis: UnitBasis) -> Steering:
    """Raises UnitUnknown for a steering wheel whose ratio to the tyres is not set."""
    ratio = basis.tyre_rad_per_unit
    tyre_rad = number * ratio if ratio else None
    if unit is None or unit.name == "percent":
        return Steering(percent=number, tyre_rad=tyre_rad)
    if unit.name == "tyre_rad":
        is_chosen = unit.name == basis.chosen.get("steering")
        is_known = tyre_rad is not None or not is_chosen
        return Steering(percent=number * PERCENT_A_RAD, tyre_rad=tyre_rad if is_known else number)
    if unit.name == "tyre_deg" and tyre_rad is None:
        tyre_rad = math.radians(number)
    if tyre_rad is None:
        raise UnitUnknown("the tyre angle per unit of steering is not set, and the values are of the steering wheel")
    return Steering(percent=tyre_rad * PERCENT_A_RAD, tyre_rad=tyre_rad)


def unit_questions(units: UnitWatch, sources: Mapping[str, Source], chosen: Mapping[str, str]) -> tuple[Question, ...]:
    """The questions about units to the operator.

    One for each signal whose unit the values do not show, in the order of the signals. `chosen`: the operator's
    answers, signal → name of the unit, which hold from the next value on.
    """
    found = []
    for signal, source in _undecided(units, sources):
        decision = units.decision(signal, source.topic)
        assert decision is not None
        if chosen.get(signal) in [unit.name for unit in decision.fits]:
            continue
        highest = units.highest(signal, source.topic)
        fits = decision.fits
        question: Question = {
            "signal": signal,
            "kind": "unit",
            "words": f"{SIGNALS[signal].label}: in which unit is {source.topic}?",
            "options": [{"value": unit.name, "label": unit.label, "why": _why(unit, highest)} for unit in fits],
            "options_count": len(fits),
        }
        found.append(question)
    return tuple(found)


def unit_sentences(units: UnitWatch, sources: Mapping[str, Source]) -> list[str]:
    """Of each signal of unknown unit: why, and how to choose one."""
    undecided = {signal for signal, _ in _undecided(units, sources)}
    found = []
    for signal, source in sources.items():
        decision = units.decision(signal, source.topic)
        if decision is not None and decision.unit is not None and not decision.unit.converts:
            found.append(f"{SIGNALS[signal].label} ({source.topic}): {cannot_convert(decision.unit)}. {NOT_EVALUATED}")
        if decision is None or decision.unit is not None or decision.is_rest:
            continue
        sentence = f"{SIGNALS[signal].label} ({source.topic}): {decision.why}. {NOT_EVALUATED}"
        if signal in undecided:
            names = " or ".join(f'"{unit.name}"' for unit in decision.fits)
            sentence += f" Choose it in the file for --settings: [units] {signal} = {names}."
        found.append(sentence)
    return found


def _undecided(units: UnitWatch, sources: Mapping[str, Source]) -> list[tuple[str, Source]]:
    return [(name, sources[name]) for name in SIGNALS if name in sources and units.is_to_ask(name, sources[name].topic)]


def _why(unit: Unit, highest: float) -> str:
    """What the values would mean."""
    if unit.factor is None:
        return f"its numbers are at most {highest:.3g}"
    most = highest * unit.factor
    return f"highest so far {most:.3g} {'l' if unit.name == 'litres' else '%'} ({highest:.3g} as published)"
