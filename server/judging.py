"""From a message that came to a judgement: decoded, applied, judged. What is live and what is rehearsed go this way."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from monitor.runner import Monitor, Transition
from monitor.state import State
from monitor.values import Steering
from server.decode import stamp_s
from server.profiles import Profile
from server.reception import Reception
from server.topics import Source
from server.tuning import PERCENT_A_RAD

TICK_S = 0.1  # time judges this often

ByTopic = Mapping[str, tuple[Source, ...]]


def by_topic(sources: Iterable[Source]) -> dict[str, tuple[Source, ...]]:
    """Which signals each topic fills."""
    found: dict[str, tuple[Source, ...]] = {}
    for source in sources:
        found[source.topic] = (*found.get(source.topic, ()), source)
    return found


def published(sources: Iterable[Source]) -> frozenset[str]:
    """The signals that the car has in a form that can be read."""
    return frozenset(source.signal for source in sources if source.decode is not None)


def receive(
    sources: tuple[Source, ...],
    message: Any,
    at_s: float,
    note: str | None,
    *,
    reception: Reception,
    state: State,
    profile: Profile,
) -> tuple[str, ...]:
    """One message of one topic into the state; the signals that changed by it. `at_s` is the receiver's clock."""
    reception.received += 1
    changed: tuple[str, ...] = ()
    is_proper = True
    for source in sources:
        value = reception.read(source, message, note)
        if value is None:
            is_proper = False
            continue
        if type(value) is Steering and profile.steering == "tyre_angle":
            value = Steering(percent=value.percent * PERCENT_A_RAD)
        changed += state.receive(source.signal, value, at_s, stamp_s(message) if "header" in message else None)
    if not is_proper:
        reception.rejected += 1
    return changed


def judge(
    monitor: Monitor, state: State, now_s: float, changed: tuple[str, ...] | None = None
) -> tuple[Transition, ...]:
    """Judges what changed, at once; None: time passed, everything."""
    if changed is not None and not monitor.heeds(changed, state):
        return ()
    return monitor.step(state.snapshot(now_s), changed)
