"""What the log says of the time before this run: which car was monitored, where its alarms stood, was it paused?"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast, get_args

from monitor.alarm import LEVEL, Alarm, AlarmState, Change, Transition
from monitor.check import Finding, Quantity, fault
from monitor.load import KEPT, WINDOW_S
from monitor.response import SHELVE_AT_MOST_MIN
from server.bus.bus import LocalBus

_PORTION = 50
_ENOUGH = 1000  # events of one alarm; the newest few say where it stands
ORDER_ENDED = ("released", "ended")
ORDER_STANDS = ("ordered", "sent", "slows", "stands", "not_confirmed", "cut", "resumed")
LONGEST_HOLD_S = 3600.0  # as the setting allows
Clock = Callable[[float], float]
_CHANGES = frozenset(get_args(Change))


@dataclass(frozen=True, slots=True, kw_only=True)
class RestoredState:
    """Moments are on the clock that runs now; those of before it began are negative."""

    address: str | None = None  # of the car that was monitored when the server ended; None: none was
    paused_s: float | None = None  # since when its monitoring was paused
    paused_by: str | None = None
    settings_version: int = 0  # the highest that the log knows
    order: Mapping[str, Any] | None = None  # the event of the slow-down that stood when the server ended
    transitions: tuple[Transition, ...] = ()  # of each alarm since it was last at rest, oldest first
    stood: tuple[Mapping[str, Any], ...] = ()  # the newest event of each alarm that was not at rest
    recent: tuple[Transition, ...] = ()  # of all alarms in the last ten minutes, oldest first

    @property
    def standing(self) -> Mapping[str, Transition]:
        """The newest transition of each alarm that was not at rest."""
        newest = {transition.alarm_id: transition for transition in self.transitions}
        return {name: last for name, last in newest.items() if last.state is not AlarmState.NORMAL}

    def words(self, alarms: Mapping[str, Alarm]) -> str:
        """What a restart has to say of it, for the log."""
        titles = [alarms[name].spec.title for name in self.standing if name in alarms]
        stood = f" Alarms that stand: {', '.join(titles)}." if titles else " No alarm stood."
        paused = " Monitoring was paused." if self.paused_s is not None else ""
        car = f" They come back when {self.address} is monitored again." if titles and self.address else ""
        return f"The server was restarted; what happened meanwhile was not watched.{stood}{car}{paused}"


def recall(bus: LocalBus, vehicle: str, *, now_s: float, wall_ms: int) -> RestoredState:
    """Reads the log; `wall_ms` is the time of day at `now_s`. Ages across the restart are by the time of day."""

    def moment_s(at_ms: float) -> float:
        return now_s - max(0.0, wall_ms - at_ms) / 1000  # nothing of the past lies in the future

    def shelf_s(until_ms: float) -> float:
        """A time of day that was set back must not hide an alarm for longer than anybody may."""
        return now_s + min((until_ms - wall_ms) / 1000, SHELVE_AT_MOST_MIN * 60)

    address, paused = _monitored(bus, vehicle)
    newest = bus.past_events(vehicle, limit=1)
    alarms = [_since_rest(bus, vehicle, alarm) for alarm in bus.logged_alarms(vehicle)]
    told = [
        transition
        for events in alarms
        for event in events
        if (transition := transition_of(event, moment_s, shelf_s)) is not None
    ]
    return RestoredState(
        address=address,
        paused_s=moment_s(_number(paused.get("since_ms"), paused["at_ms"])) if paused else None,
        paused_by=_text(paused.get("by")) if paused else None,
        settings_version=int(_number(newest[0].get("settings_version"), 0)) if newest else 0,
        order=_order(bus, vehicle, wall_ms) if address is not None else None,
        transitions=tuple(told),
        stood=tuple(events[-1] for events in alarms if events and events[-1].get("state") != AlarmState.NORMAL),
        recent=tuple(_recent(bus, vehicle, wall_ms, moment_s, shelf_s)),
    )


def _order(bus: LocalBus, vehicle: str, wall_ms: int) -> Mapping[str, Any] | None:
    """The newest word of a slow-down that nobody has released, if it is not older than anything is ever held."""
    for event in bus.past_events(vehicle, change="slow_down", limit=_PORTION):
        if event.get("step") in ORDER_ENDED:
            return None
        if event.get("step") in ORDER_STANDS:
            return event if wall_ms - event["at_ms"] < LONGEST_HOLD_S * 1000 else None
    return None


def phone_chosen(bus: LocalBus, vehicle: str) -> str | None:
    """The phone that rides in the car, as the operator said last."""
    newest = bus.past_events(vehicle, change="ride", limit=1)
    return _text(newest[0].get("phone")) if newest else None


def _recent(bus: LocalBus, vehicle: str, wall_ms: int, moment_s: Clock, shelf_s: Clock) -> list[Transition]:
    found: list[Transition] = []
    for event in _backwards(bus, vehicle, None):
        if wall_ms - event["at_ms"] > WINDOW_S * 1000 or len(found) >= KEPT:
            break
        transition = transition_of(event, moment_s, shelf_s)
        if transition is not None:
            found.append(transition)
    return found[::-1]


def _monitored(bus: LocalBus, vehicle: str) -> tuple[str | None, Mapping[str, Any] | None]:
    """The address that was monitored to the end, and the event which paused it."""
    paused: Mapping[str, Any] | None = None
    is_known = False  # whether it was paused
    for event in _backwards(bus, vehicle, ""):
        match event["change"]:
            case "started":
                return _text(event.get("address")), paused
            case "stopped":
                return None, None
            case "paused" if not is_known:
                paused, is_known = event, True
            case "resumed":
                is_known = True
    return None, None


def _since_rest(bus: LocalBus, vehicle: str, alarm: str) -> list[dict[str, Any]]:
    found = []
    for number, event in enumerate(_backwards(bus, vehicle, alarm)):
        found.append(event)
        if event.get("state") == AlarmState.NORMAL or number >= _ENOUGH:
            break
    return found[::-1]


def _backwards(bus: LocalBus, vehicle: str, alarm: str | None) -> Iterator[dict[str, Any]]:
    """Events of one alarm, of none (""), or all (None), newest first."""
    before: int | None = None
    while events := bus.past_events(vehicle, alarm=alarm, before=before, limit=_PORTION):
        yield from events
        before = events[-1]["n"]


def transition_of(event: Mapping[str, Any], moment_s: Clock, shelf_s: Clock) -> Transition | None:
    """What an event tells, or None where it tells nothing that can be used: the log may be older than this program."""
    change = event.get("change")
    if not isinstance(change, str) or change not in _CHANGES or not isinstance(event.get("at_ms"), (int, float)):
        return None
    try:
        state = AlarmState(event.get("state", ""))
    except ValueError:
        return None
    until_ms = event.get("shelved_until_ms")
    causes = _texts(event.get("causes"))
    return Transition(
        alarm_id=str(event["alarm"]),
        occurrence=int(_number(event.get("occurrence"), 0)),
        change=cast(Change, change),
        at_s=moment_s(event["at_ms"]),
        text=_text(event.get("text")) or "",
        by=_text(event.get("by")),
        announces=event.get("announces") is True,
        state=state,
        finding=_finding(event, causes),
        causes=causes,
        suppressed_by=_texts(event.get("suppressed_by")),
        shelved_until_s=shelf_s(until_ms) if isinstance(until_ms, (int, float)) else None,
    )


def _finding(event: Mapping[str, Any], causes: tuple[str, ...]) -> Finding:
    return fault(
        _text(event.get("text")) or "",
        measured=_quantity(event.get("measured")),
        limit=_quantity(event.get("limit")),
        causes=tuple(name for name in causes if not name.startswith(LEVEL)),
        level=sum(name.startswith(LEVEL) for name in causes),
    )


def _quantity(body: Any) -> Quantity | None:
    match body:
        case {"label": str(label), "value": float() | int() as value, "unit": str(unit)}:
            return Quantity(label=label, value=float(value), unit=unit)
    return None


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) else None


def _texts(value: Any) -> tuple[str, ...]:
    return tuple(name for name in value if isinstance(name, str)) if isinstance(value, list) else ()


def _number(value: Any, otherwise: float) -> float:
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else otherwise
