"""The simulated car before the judge in virtual time, the way messages go live."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from monitor.link import LinkFacts
from monitor.runner import Monitor, Transition
from monitor.state import State
from server import judging
from server.profiles import GENERIC
from server.reception import Reception
from server.simulator.car import SimulatedCar
from server.topics import map_signals


@dataclass(frozen=True, slots=True, kw_only=True)
class Raised:
    """One announcement."""

    at_s: float  # since the beginning of the drive
    alarm: str
    text: str


def judged(car: SimulatedCar, seconds: float) -> list[Raised]:
    """Every alarm that a drive of so long raises. Faults of the bridge are not laid over: the link is always there."""
    sources = judging.by_topic(map_signals({p.topic: p.type for p in car.published}).values())
    reception, state, monitor = Reception(), State(), Monitor()
    raised: list[Raised] = []
    start_s, tick_s, last_s = car.now_s, 0.0, None
    published = judging.published(source for group in sources.values() for source in group)

    def note(transitions: Iterable[Transition]) -> None:
        raised.extend(
            Raised(at_s=t.at_s, alarm=t.alarm_id, text=t.text)
            for t in transitions
            if t.change in ("raised", "recaused")
        )

    def link(now_s: float) -> None:
        state.link(
            LinkFacts(
                phase="monitoring",
                connected_s=0.0,
                bridge_answers=True,
                bridge_heard_s=now_s,
                last_message_s=last_s,
                topics_subscribed=len(sources),
                published=published,
            )
        )

    for step in car.steps():
        now_s = step.at_s - start_s
        if now_s > seconds:
            return raised
        while tick_s <= now_s:
            link(tick_s)
            note(judging.judge(monitor, state, tick_s))
            tick_s += judging.TICK_S
        for message in step.messages:
            heard = sources.get(message.topic)
            if heard is None:
                continue
            last_s = now_s
            changed = judging.receive(
                heard, message.message, now_s, None, reception=reception, state=state, profile=GENERIC
            )
            note(judging.judge(monitor, state, now_s, changed))
    return raised
