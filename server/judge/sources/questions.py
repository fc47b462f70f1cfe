"""What is asked where evidence does not decide between topics, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from server.judge.sources.candidates import Candidate
from server.protocol.questions import Question

MOST_OPTIONS = 12
ORDER = ("scan", "speed", "position", "odometry")  # the most urgent first
_NUMBERS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
_KINDS = {
    "scan": ("lasers", "which looks ahead?"),
    "speed": ("sources of speed", "which is the car's?"),
    "odometry": ("odometries", "which is the car's?"),
    "position": ("GPS receivers", "which is the car's?"),
    "mode": ("reports of the driving mode", "which is the car's?"),
    "diagnostics": ("topics of diagnostics", "which is the car's?"),
}
_OTHER = ("topics", "which is the car's?")


def counted(count: int, what: str) -> str:
    """ "Two lasers", "12 lasers"."""
    return f"{_NUMBERS[count] if count < len(_NUMBERS) else count} {what}"


def title(signal: str, among: Sequence[Candidate]) -> str:
    """What there are several of: "Two lasers"."""
    is_odometry = signal == "speed" and all(one.plain_type == "nav_msgs/Odometry" for one in among)
    return counted(len(among), "odometries" if is_odometry else _KINDS.get(signal, _OTHER)[0])


def question(signal: str, among: Sequence[Candidate], known: Mapping[str, str], cars: Sequence[str] = ()) -> Question:
    """The question which of the candidates carries a signal. `known`: topic → what is known of it; `cars`: the
    namespaces of several cars, of which one is asked for."""
    if cars:
        last = f"{len(cars) - 3} more" if len(cars) > 4 else cars[-1]
        named = f"{', '.join(cars[: 3 if len(cars) > 4 else len(cars) - 1])} and {last}"
        words = f"{counted(len(cars), 'cars')}: {named}: which is this?"
    elif signal == "speed" and title(signal, among).endswith("odometries"):
        words = f"{title(signal, among)}: which is the car's speed?"
    else:
        words = f"{title(signal, among)}: {_KINDS.get(signal, _OTHER)[1]}"
    return {
        "signal": signal,
        "kind": "source",
        "words": words,
        "options": [
            {"value": one.topic, "label": one.topic, "why": known.get(one.topic, "")} for one in among[:MOST_OPTIONS]
        ],
        "options_count": len(among),
    }
