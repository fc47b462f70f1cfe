"""From a message that came to a judgement: decoded, applied, judged. What is live and what is rehearsed go this way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, Protocol

from monitor.catalog import AllLimits
from monitor.runner import Monitor, Transition
from monitor.state import State
from monitor.values import DriveMode, LaserScan
from server.judge.body_axes import TYPES, in_body_axes
from server.judge.frames import Frames
from server.judge.message_fields import stamp_s
from server.judge.profiles import Profile
from server.judge.reception_stats import Reception
from server.judge.topics import Source
from server.judge.unit_watch import UnitBasis, number_of
from server.judge.units import UNITS, Unit

TICK_S = 0.05  # every check is judged this often

OF_THE_CAR = (LaserScan, DriveMode)  # what their values mean depends on the car
NO_UNITS: Mapping[str, str] = MappingProxyType({})
ByTopic = Mapping[str, tuple[Source, ...]]
# Signal, number as it was published, its unit (None: not known), seconds, and stamp by the car.
OnNumber = Callable[[str, float, Unit | None, float, float | None], None]


class Delays(Protocol):
    """The source of a message's age on arrival: TransportDelay, or a recording of its estimates."""

    def receive(self, topic: str, at_s: float, stamp_s: float | None = None) -> float: ...


def by_topic(sources: Iterable[Source]) -> dict[str, tuple[Source, ...]]:
    """Which signals each topic fills."""
    found: dict[str, tuple[Source, ...]] = {}
    for source in sources:
        found[source.topic] = (*found.get(source.topic, ()), source)
    return found


def published(sources: Iterable[Source]) -> frozenset[str]:
    """The signals that the car has in a form that can be read."""
    return frozenset(source.signal for source in sources if source.decode is not None and source.carries)


def carriers(sources: Iterable[Source]) -> dict[str, str]:
    """Signal → the topic that carries it."""
    return {source.signal: source.topic for source in sources if source.decode is not None and source.carries}


def compared(sources: Iterable[Source]) -> dict[str, tuple[str, ...]]:
    """Signal → the further topics that are compared with it."""
    found: dict[str, tuple[str, ...]] = {}
    for source in sources:
        if not source.carries:
            found[source.signal] = (*found.get(source.signal, ()), source.topic)
    return found


def receive(
    sources: tuple[Source, ...],
    message: Any,
    at_s: float,
    note: str | None,
    *,
    reception: Reception,
    state: State,
    profile: Profile,
    tyre_rad_per_unit: float,
    units: Mapping[str, str] = NO_UNITS,
    transport: Delays | None = None,
    frames: Frames | None = None,
    limits: AllLimits | None = None,
    on_value: Callable[[str, Any, float, float | None], None] | None = None,
    on_number: OnNumber | None = None,
    steady_stamp: Callable[[float], float] | None = None,
) -> tuple[str, ...]:
    """One message of one topic into the state; the signals that changed by it, none by what is only compared. `at_s` is
    the receiver's clock; `tyre_rad_per_unit` of the steering signal, 0: not known; `units` are the operator's choices,
    signal → name; `transport` None: it came without delay, as far as is known. `frames` and `limits`: by which a laser
    is mounted; None: at the nose. `on_value` receives each decoded value: signal, value, `at_s`, stamp; `on_number`
    each number of which no value follows, as it was published; `steady_stamp` corrects a stamp by a clock that was set.
    """
    reception.received += 1
    stamp = stamp_s(message)
    reception.note_frame(sources[0].topic, message)
    steady_s = stamp if stamp is None or steady_stamp is None else steady_stamp(stamp)
    delay_s = 0.0 if transport is None else transport.receive(sources[0].topic, at_s, steady_s)
    changed: tuple[str, ...] = ()
    is_proper = True
    if frames is not None and sources[0].type in TYPES:
        message, why_not = in_body_axes(frames, sources[0].topic, sources[0].type, message)
        if why_not is not None:
            _refuse(sources, why_not, at_s, reception, state)
            return ()
    for source in sources:
        if not source.carries:
            other = reception.read_other(source, message, at_s, profile)
            state.receive_other(source.signal, source.topic, other, at_s, steady_s, delay_s)
            continue
        value = reception.read(source, message, note)
        if value is not None and source.signal in UNITS:
            basis = UnitBasis(profile=profile, chosen=units, tyre_rad_per_unit=tyre_rad_per_unit)
            published, value = value, reception.in_unit(source, value, at_s, basis)
            if reception.units.is_void:
                _void(source, reception, state, None if value is not None else published, at_s, stamp, on_number)
        if value is None:
            is_proper &= _without_value(source, reception, state, at_s)
            continue
        reception.units.see(source.signal, value, at_s)
        if type(value) in OF_THE_CAR:
            value = _of_the_car(value, source.topic, profile, frames, limits)
        if on_value is not None:
            on_value(source.signal, value, at_s, stamp)
        changed += state.receive(source.signal, value, at_s, steady_s, delay_s)
    if not is_proper:
        reception.rejected += 1
    return changed


def _of_the_car(value: Any, topic: str, profile: Profile, frames: Frames | None, limits: AllLimits | None) -> Any:
    """A scan from where the laser is mounted, a mode by the names in the profile of this kind of car."""
    if type(value) is LaserScan and frames is not None and limits is not None:
        return frames.mounted(topic, value, limits)
    if type(value) is DriveMode and (mode := profile.modes.get(value.text.casefold())) is not None:
        return DriveMode(mode=mode, text=value.text)
    return value


def _without_value(source: Source, reception: Reception, state: State, at_s: float) -> bool:
    """A message has no value of a signal; whether it is proper all the same."""
    tally = reception.tally(source.signal)
    if tally.why_not_measured is not None:
        state.refuse(source.signal, tally.why_not_measured, at_s, is_declared=True)
        return True
    if source.decode is not None:
        state.refuse(source.signal, tally.last_reason or "unreadable", at_s)
    return False


def _void(
    source: Source,
    reception: Reception,
    state: State,
    published: Any | None,
    at_s: float,
    stamp: float | None,
    on_number: OnNumber | None,
) -> None:
    """What was received of a signal is of another unit, or of none; `published`: a value of which none follows."""
    state.forget(source.signal)
    number = number_of(published)
    if number is not None and on_number is not None:
        on_number(source.signal, number, reception.units.unconverted(source), at_s, stamp)


def _refuse(sources: tuple[Source, ...], why: str, at_s: float, reception: Reception, state: State) -> None:
    carrying = [source for source in sources if source.carries]
    reception.rejected += bool(carrying)
    for source in carrying:
        tally = reception.tally(source.signal)
        tally.received += 1
        tally.reject(why)
        if source.decode is not None:
            state.refuse(source.signal, why, at_s)


def judge(
    monitor: Monitor, state: State, now_s: float, changed: tuple[str, ...] | None = None
) -> tuple[Transition, ...]:
    """Judge the immediate checks of what changed, or with None every check."""
    if changed is not None and not monitor.has_immediate(changed):
        return ()
    return monitor.step(state.snapshot(now_s), changed)
