"""What the operator is asked of units, and the same as sentences for who checks a recording."""

from __future__ import annotations

from collections.abc import Mapping

from monitor.signals import SIGNALS
from server.judge.topics import Source
from server.judge.unit_watch import UnitWatch, cannot_convert
from server.judge.units import Unit
from server.protocol.questions import Question

NOT_EVALUATED = "It is not evaluated."


def unit_questions(units: UnitWatch, sources: Mapping[str, Source], chosen: Mapping[str, str]) -> tuple[Question, ...]:
    """One for each signal whose unit the values do not show, in the order of the signals. `chosen`: the operator's
    answers, signal → name of the unit, which hold from the next value on."""
    found = []
    for signal, source in _asked(units, sources):
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
    asked = {signal for signal, _ in _asked(units, sources)}
    found = []
    for signal, source in sources.items():
        decision = units.decision(signal, source.topic)
        if decision is not None and decision.unit is not None and not decision.unit.converts:
            found.append(f"{SIGNALS[signal].label} ({source.topic}): {cannot_convert(decision.unit)}. {NOT_EVALUATED}")
        if decision is None or decision.unit is not None or decision.is_rest:
            continue
        words = f"{SIGNALS[signal].label} ({source.topic}): {decision.why}. {NOT_EVALUATED}"
        if signal in asked:
            names = " or ".join(f'"{unit.name}"' for unit in decision.fits)
            words += f" Choose it in the file for --settings: [units] {signal} = {names}."
        found.append(words)
    return found


def _asked(units: UnitWatch, sources: Mapping[str, Source]) -> list[tuple[str, Source]]:
    return [(name, sources[name]) for name in SIGNALS if name in sources and units.is_to_ask(name, sources[name].topic)]


def _why(unit: Unit, highest: float) -> str:
    """What the values would mean."""
    if unit.factor is None:
        return f"its numbers are at most {highest:.3g}"
    most = highest * unit.factor
    return f"highest so far {most:.3g} {'l' if unit.name == 'litres' else '%'} ({highest:.3g} as published)"
