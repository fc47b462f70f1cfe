"""Injects the simulator's faults into a recording, to show which alarms they would raise."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from monitor.shell_facts import LinkFacts
from server.judge.message import Message
from server.simulator.effects import Effect, Silence
from server.simulator.scenario import Scenario
from server.simulator.scenarios import Planned, inject

# How a session learns that a bridge stopped: the link is dropped after this long without any sign of life.
FROZEN_FOUND_AFTER_S = 2.0
BRIDGE_SILENT_S = 1.4  # and so long until it no longer counts as answering

_LOST = {
    "freeze": "The bridge stopped answering (injected fault).",
    "kill": "The bridge closed the connection (an injected fault).",
}


class CannotInject(Exception):
    """The fault has no meaning on a recording. The text is one sentence."""


@dataclass(slots=True)
class Laid:
    """One fault and what it did. Times are seconds since the beginning of the recording."""

    planned: Planned
    from_s: float
    to_s: float
    touched: int = 0  # messages it changed or held back

    @property
    def name(self) -> str:
        return self.planned.scenario.name


class Faults:
    """All faults of one run; to be used for that one run."""

    def __init__(self, planned: Sequence[Planned]) -> None:
        """Raises CannotInject."""
        self.laid = [
            Laid(planned=one, from_s=one.after_s, to_s=one.after_s + _duration_s(one))
            for one in sorted(planned, key=lambda one: one.after_s)
        ]
        for one in self.laid:
            _effect(one.planned.scenario)

    def over(
        self, messages: Iterable[Message], origin_s: float, signal_of: Callable[[Message], str | None]
    ) -> Iterator[Message]:
        """The messages with the faults on them; `origin_s` is when the recording begins [s since 1970]."""
        stream = iter(messages)
        first = next(stream, None)
        if first is None:
            return
        begun_s = first.at_s - origin_s
        plan = []
        for one in self.laid:
            if one.to_s <= begun_s:
                continue
            starts_s = max(0.0, one.from_s - begun_s)
            scenario = replace(one.planned.scenario, effect=_counted(one, _effect(one.planned.scenario)))
            plan.append(Planned(scenario=scenario, after_s=starts_s, duration_s=one.to_s - begun_s - starts_s))
        yield from inject(_chained(first, stream), plan, signal_of)

    def link(self, facts: LinkFacts, now_s: float) -> LinkFacts:
        """The link as a session would know it at that moment; `facts` has it as it would be without the faults."""
        for one in self.laid:
            kind = one.planned.scenario.bridge
            if kind is None or now_s < one.from_s:
                continue
            lost_s = one.from_s + (FROZEN_FOUND_AFTER_S if kind == "freeze" else 0.0)
            if now_s >= one.to_s:
                if one.to_s > lost_s:
                    facts = replace(facts, since_s=max(facts.since_s, one.to_s))
            elif now_s >= lost_s:
                facts = replace(
                    facts, phase="lost", since_s=lost_s, bridge_answers=False, problem_title=_LOST[kind], attempts=1
                )
            else:
                facts = replace(facts, bridge_heard_s=one.from_s, bridge_answers=now_s - one.from_s < BRIDGE_SILENT_S)
        return facts


def _chained(first: Message, rest: Iterator[Message]) -> Iterator[Message]:
    yield first
    yield from rest


def _duration_s(planned: Planned) -> float:
    return planned.scenario.duration_s if planned.duration_s is None else planned.duration_s


def _effect(scenario: Scenario) -> Callable[[], Effect]:
    if scenario.bridge is not None:
        return Silence
    if scenario.effect is None:
        raise CannotInject(f"{scenario.name} is a fault of the car's motion, which a recording cannot repeat.")
    return scenario.effect


def _counted(laid: Laid, make: Callable[[], Effect]) -> Callable[[], Effect]:
    return lambda: _Counted(laid, make())


class _Counted(Effect):
    """Another effect, and how many messages it touched."""

    def __init__(self, laid: Laid, inner: Effect) -> None:
        super().__init__()
        self._laid = laid
        self._inner = inner

    @property
    def is_over(self) -> bool:
        return self._inner.is_over

    def end(self) -> None:
        self._inner.end()

    def apply(self, message: Message, signal: str | None) -> Sequence[Message]:
        made = self._inner.apply(message, signal)
        if len(made) != 1 or made[0] is not message:
            self._laid.touched += 1
        return made
