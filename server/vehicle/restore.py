"""The state before this run, from the log: the monitored car, its alarms, the pause, the departure check."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, cast, get_args

from monitor.alarm import AlarmState, Transition
from monitor.load import KEPT, WINDOW_S
from monitor.planned_stop import REASONS, PlannedStop, reason_of
from monitor.response import SHELVE_AT_MOST_MIN
from server.bus.bus import SessionBus
from server.control.departure import Result, Signature
from server.judge.logged_transition import Clock, number_of, text_of, transition_of
from server.protocol.departure import DepartureCounts, DepartureResult
from server.protocol.people import ROLES

_PORTION = 50
_ENOUGH = 1000  # events of one alarm; the newest few give its state
_MODES = {  # change → the change by which the mode began
    "paused": "paused",
    "resumed": "paused",
    "planned_stop": "planned_stop",
    "planned_stop_ended": "planned_stop",
}
ORDER_ENDED = ("released", "ended")
ORDER_STANDS = ("ordered", "sent", "slows", "stands", "not_confirmed", "cut", "resumed")
LONGEST_HOLD_S = 3600.0  # as the setting allows

MOST_EVENTS = 3000  # of one check: 60 items that turn 20 times each, and what people do besides
_LARGE_PORTION = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class RestoredState:
    """Moments are on the clock that runs now; those of before it began are negative."""

    address: str | None = None  # of the car that was monitored when the server ended; None: none was
    paused_s: float | None = None  # since when its monitoring was paused
    paused_by: str | None = None
    planned_stop: PlannedStop | None = None
    settings_version: int = 0  # the highest in the log
    order: Mapping[str, Any] | None = None  # the event of the slow-down that stood when the server ended
    transitions: tuple[Transition, ...] = ()  # of each alarm since it was last at rest, oldest first
    stood: tuple[Mapping[str, Any], ...] = ()  # the newest event of each alarm that was not at rest
    recent: tuple[Transition, ...] = ()  # of all alarms in the last ten minutes, oldest first
    owners_off: Mapping[str, int] = field(default_factory=dict)  # who acted on these alarms → when their duty ended

    @property
    def standing(self) -> Mapping[str, Transition]:
        """The newest transition of each alarm that was not at rest."""
        newest = {transition.alarm_id: transition for transition in self.transitions}
        return {name: last for name, last in newest.items() if last.state is not AlarmState.NORMAL}

    def text(self) -> str:
        """The log text after a restart."""
        titles = [last.spec.title for last in self.standing.values()]
        stood = f" Active alarms: {', '.join(titles)}." if titles else " No alarm was active."
        paused = " Monitoring was paused." if self.paused_s is not None else ""
        stop = f" A planned stop was in force: {REASONS[self.planned_stop.reason]}." if self.planned_stop else ""
        car = f" They come back when {self.address} is monitored again." if titles and self.address else ""
        return f"The server was restarted; nothing was monitored meanwhile.{stood}{car}{paused}{stop}"


def recall(bus: SessionBus, vehicle: str, *, now_s: float, wall_ms: int) -> RestoredState:
    """Reads the log; `wall_ms` is the time of day at `now_s`. Ages across the restart are by the time of day."""

    def moment_s(at_ms: float) -> float:
        return now_s - max(0.0, wall_ms - at_ms) / 1000  # no restored time is in the future

    def shelf_s(until_ms: float) -> float:
        """A time of day that was set back must not hide an alarm for longer than anybody may."""
        return now_s + min((until_ms - wall_ms) / 1000, SHELVE_AT_MOST_MIN * 60)

    address, modes = _monitored(bus, vehicle)
    paused, stop = modes.get("paused"), modes.get("planned_stop")
    newest = bus.past_events(vehicle, limit=1)
    alarms = [_since_rest(bus, vehicle, alarm) for alarm in bus.logged_alarms(vehicle)]
    transitions = [
        transition
        for events in alarms
        for event in events
        if (transition := transition_of(event, moment_s, shelf_s)) is not None
    ]
    return RestoredState(
        address=address,
        paused_s=moment_s(number_of(paused.get("since_ms"), paused["at_ms"])) if paused else None,
        paused_by=text_of(paused.get("by")) if paused else None,
        planned_stop=PlannedStop(
            reason=reason_of(stop.get("reason")),
            since_s=moment_s(number_of(stop.get("since_ms"), stop["at_ms"])),
            by=text_of(stop.get("by")),
        )
        if stop
        else None,
        settings_version=int(number_of(newest[0].get("settings_version"), 0)) if newest else 0,
        order=_order(bus, vehicle, wall_ms) if address is not None else None,
        transitions=tuple(transitions),
        stood=tuple(events[-1] for events in alarms if events and events[-1].get("state") != AlarmState.NORMAL),
        recent=tuple(_recent(bus, vehicle, wall_ms, moment_s, shelf_s)),
        owners_off=_owners_off(bus, vehicle, alarms),
    )


def _owners_off(bus: SessionBus, vehicle: str, alarms: Iterable[Iterable[Mapping[str, Any]]]) -> dict[str, int]:
    """Whose duty ended after their last act on these alarms, as logged: the list of people may not have them now."""
    acted: dict[str, int] = {}  # by name: the number of their newest event
    for event in (event for events in alarms for event in events):
        if (by := text_of(event.get("by"))) is not None:
            acted[by] = max(acted.get(by, 0), _number(event))
    found: dict[str, int] = {}
    for event in _changes_backwards(bus, vehicle, "owner"):
        if not acted or _number(event) < min(acted.values()):
            break
        number, off_ms = acted.pop(str(event.get("owner")), None), event.get("off_duty_ms")
        if number is not None and number < _number(event) and type(off_ms) is int:
            found[str(event.get("owner"))] = off_ms
    return found


def _order(bus: SessionBus, vehicle: str, wall_ms: int) -> Mapping[str, Any] | None:
    """The newest event of an unreleased slow-down, if it is not older than the longest hold."""
    stopped = _newest(bus, vehicle, "stopped")
    for event in bus.past_events(vehicle, change="slow_down", limit=_PORTION):
        if event.get("step") in ORDER_ENDED or _number(event) < stopped:
            return None
        if event.get("step") in ORDER_STANDS:
            return event if wall_ms - event["at_ms"] < LONGEST_HOLD_S * 1000 else None
    return None


def is_brought_back(bus: SessionBus, vehicle: str) -> bool:
    """Whether the newest event is of a recording that had ended: the log lacks what happened after it."""
    return any(_is_history(event) for event in bus.past_events(vehicle, limit=1))


def _is_history(event: Mapping[str, Any]) -> bool:
    return "brought_from" in event and not event.get("was_cut")


def phone_chosen(bus: SessionBus, vehicle: str) -> str | None:
    """The phone in the car, as the operator chose it last."""
    newest = bus.past_events(vehicle, change="ride", limit=1)
    return text_of(newest[0].get("phone")) if newest and not _is_history(newest[0]) else None


def _recent(bus: SessionBus, vehicle: str, wall_ms: int, moment_s: Clock, shelf_s: Clock) -> list[Transition]:
    found: list[Transition] = []
    for event in _backwards(bus, vehicle, None):
        if wall_ms - event["at_ms"] > WINDOW_S * 1000 or len(found) >= KEPT:
            break
        transition = transition_of(event, moment_s, shelf_s)
        if transition is not None:
            found.append(transition)
    return found[::-1]


def _monitored(bus: SessionBus, vehicle: str) -> tuple[str | None, Mapping[str, Mapping[str, Any]]]:
    """The address that was monitored to the end, and by change the event of each mode that was in force then."""
    newest: dict[str, Mapping[str, Any]] = {}
    for event in _backwards(bus, vehicle, ""):
        change = event["change"]
        if change == "started":
            in_force = {mode: one for mode, one in newest.items() if one["change"] == mode}
            return text_of(event.get("address")), in_force
        if change == "stopped":
            break
        if change in _MODES:
            newest.setdefault(_MODES[change], event)
    return None, {}


def _since_rest(bus: SessionBus, vehicle: str, alarm: str) -> list[dict[str, Any]]:
    found = []
    for number, event in enumerate(_backwards(bus, vehicle, alarm)):
        found.append(event)
        if event.get("state") == AlarmState.NORMAL or number >= _ENOUGH:
            break
    return found[::-1]


def _backwards(bus: SessionBus, vehicle: str, alarm: str | None) -> Iterator[dict[str, Any]]:
    """Events of one alarm, of none (""), or all (None), newest first."""
    before: int | None = None
    while events := bus.past_events(vehicle, alarm=alarm, before=before, limit=_PORTION):
        yield from events
        before = events[-1]["n"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeparturePast:
    """The departure check of before this run.

    What stood when the server ended.
    """

    id: str | None = None  # None: no check stood
    by: str | None = None
    begun_ms: int = 0
    results: Mapping[str, Result] = field(default_factory=dict)
    signature: Signature | None = None
    signed: Mapping[str, Any] | None = None  # its event
    is_without_logged: bool = False  # it is in the log that the car drives without one
    is_of_drive: bool = False  # a car was monitored


def recall_departure(bus: SessionBus, vehicle: str) -> DeparturePast:
    """Reads the log. Monitoring that was stopped ended its check."""
    started, stopped = (_newest(bus, vehicle, change) for change in ("started", "stopped"))
    events: list[Mapping[str, Any]] = []
    for event in _changes_backwards(bus, vehicle, "departure"):
        if _number(event) < stopped or len(events) >= MOST_EVENTS:
            break
        events.insert(0, event)
        if event.get("step") == "begun":
            break
    is_without_logged = any(event.get("step") == "without" for event in events)
    if not events or events[0].get("step") != "begun":
        return DeparturePast(is_without_logged=is_without_logged, is_of_drive=started > stopped)
    begun, signed = events[0], None
    results: dict[str, Result] = {}
    for one in events[1:]:
        match one.get("step"):
            case "item" if (name := text_of(one.get("item"))) is not None:
                results[name] = _result(one, results.get(name, Result()))
            case "signed":
                signed = one
            case "reopened":
                signed = None
    return DeparturePast(
        id=text_of(begun.get("check")) or "",
        by=text_of(begun.get("by")),
        begun_ms=_moment_ms(begun),
        results=results,
        signature=None if signed is None else _signature(signed),
        signed=signed,
        is_without_logged=is_without_logged,
        is_of_drive=started > stopped,
    )


def _result(event: Mapping[str, Any], had: Result) -> Result:
    found = event.get("result")
    result = cast(DepartureResult, found) if found in get_args(DepartureResult) else "open"
    given_for = text_of(event.get("hash")) or text_of(event.get("item_title")) or ""
    return Result(
        given_for=given_for,
        result=result,
        value=text_of(event.get("value")) or "",
        note=text_of(event.get("note")) or "",
        by=text_of(event.get("by")),
        at_ms=None if result == "open" else _moment_ms(event),
        is_fixed=had.given_for == given_for and (had.is_fixed or had.result == "failed"),
    )


def _signature(event: Mapping[str, Any]) -> Signature:
    counts: DepartureCounts = {
        "done": int(number_of(event.get("done"), 0)),
        "failed": int(number_of(event.get("failed"), 0)),
        "not_applicable": int(number_of(event.get("not_applicable"), 0)),
        "of": int(number_of(event.get("of"), 0)),
    }
    return Signature(
        by=text_of(event.get("by")) or "",
        role=next((title for role, title in ROLES.items() if role == event.get("role")), ""),
        at_ms=_moment_ms(event),
        counts=counts,
        fixed=int(number_of(event.get("fixed"), 0)),
        hash=text_of(event.get("hash")) or "",
    )


def _moment_ms(event: Mapping[str, Any]) -> int:
    """When it happened; it is logged a moment later."""
    return int(number_of(event.get("moment_ms"), number_of(event.get("at_ms"), 0)))


def _number(event: Mapping[str, Any]) -> int:
    return int(number_of(event.get("n"), 0))


def _newest(bus: SessionBus, vehicle: str, change: str) -> int:
    found = bus.past_events(vehicle, change=change, limit=1)
    return _number(found[0]) if found else -1


def _changes_backwards(bus: SessionBus, vehicle: str, change: str) -> Iterator[dict[str, Any]]:
    before: int | None = None
    while events := bus.past_events(vehicle, change=change, before=before, limit=_LARGE_PORTION):
        yield from events
        before = events[-1]["n"]
