"""The simulated car before the judge in virtual time, the way messages go live."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from monitor import catalog
from monitor.catalog import AllLimits
from monitor.phones import PhoneReport
from monitor.runner import Monitor, Transition
from monitor.shell_facts import LinkFacts
from monitor.state import State
from monitor.values import PhoneFix
from server.analysis.faults import Faults
from server.judge import pipeline, profiles
from server.judge.comparisons import comparison_sources
from server.judge.reception_stats import Reception
from server.judge.sources.choice import choose
from server.simulator.car import SimulatedCar
from server.simulator.scenarios import Planned


@dataclass(frozen=True, slots=True, kw_only=True)
class Raised:
    """One announcement."""

    at_s: float  # since the beginning of the drive
    alarm: str
    text: str


def judged(
    plan: Sequence[Planned],
    seconds: float,
    *,
    seed: int = 1,
    limits: Mapping[str, float] | None = None,
    phone: bool = False,
    crew: Callable[[State, float], None] = lambda state, now_s: None,
) -> list[Raised]:
    """Every alarm that a drive of so long with these faults raises. `limits` are thresholds by their full names;
    `phone`: there is one in the car, and it knows where it is. `crew(state, now_s)` is called before each tick: what
    pages tell of themselves.

    A fault of the bridge is what a session would see of it: no messages, and the link lost when that is found out.
    """
    own = [one for one in plan if one.scenario.bridge is None]
    bridge = Faults([one for one in plan if one.scenario.bridge is not None])
    car = SimulatedCar(seed=seed, plan=own)
    offered = {p.topic: p.type for p in car.published}
    chosen = choose(offered).sources
    kind = profiles.choose(profiles.load(), offered, 1)  # its pedals have the unit of their kind of car
    sources = pipeline.by_topic((*chosen.values(), *comparison_sources(offered, chosen)))
    monitor = Monitor(limits=catalog.changed(AllLimits(), limits or {}))
    reception, state = Reception(), State()
    raised: list[Raised] = []
    start_s, tick_s, last_s, phone_s = car.now_s, 0.0, None, 0.0
    carriers = pipeline.carriers(chosen.values())
    published = pipeline.published(source for group in sources.values() for source in group)

    def note(transitions: Iterable[Transition]) -> None:
        raised.extend(Raised(at_s=t.at_s, alarm=t.alarm_id, text=t.text) for t in transitions if t.announces)

    def link(now_s: float) -> LinkFacts:
        facts = LinkFacts(
            phase="monitoring",
            connected_s=0.0,
            bridge_answers=True,
            bridge_heard_s=now_s,
            last_message_s=last_s,
            topics_subscribed=len(sources),
            published=published,
            carriers=carriers,
            wall_zero_s=start_s,
        )
        return bridge.link(facts, now_s)

    for step in car.steps():
        now_s = step.at_s - start_s
        if now_s > seconds:
            return raised
        while tick_s <= now_s:
            state.link(link(tick_s))
            crew(state, tick_s)
            note(pipeline.judge(monitor, state, tick_s))
            tick_s += pipeline.TICK_S
        if any(one.from_s <= now_s < one.to_s for one in bridge.laid):
            continue
        if phone and now_s >= phone_s:
            phone_s += 1.0
            truth = car.state()["truth"]
            fix = PhoneFix(lat_deg=truth["lat_deg"], lon_deg=truth["lon_deg"], accuracy_m=5.0)
            state.receive_phone(PhoneReport(phone="in the car", is_handheld=True, fix=fix, measured_s=now_s), now_s)
        for message in step.messages:
            source = sources.get(message.topic)
            if source is None:
                continue
            last_s = now_s
            changed = pipeline.receive(
                source,
                message.message,
                now_s,
                None,
                reception=reception,
                state=state,
                profile=kind,
                tyre_rad_per_unit=-0.00536,  # the car that is simulated
            )
            note(pipeline.judge(monitor, state, now_s, changed))
    return raised
