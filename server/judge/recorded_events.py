"""What a recording of ours holds beside the car's messages: alarms, pauses, planned stops, settings, phones,
slow-downs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from monitor.alarm import Transition
from monitor.checks.slow_down import SlowDownLimits
from monitor.phones import PhoneReport
from monitor.planned_stop import PlannedStop
from monitor.response import SHELVE_AT_MOST_MIN
from monitor.runner import Monitor
from monitor.shell_facts import SlowingFacts
from server.protocol import serialize
from server.protocol.slow_down_state import SlowDownOrder, SlowDownPhase, SlowDownState

CHANGES = ("armed", "disarmed", "slow_down")


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowDownEvent:
    """One event of the log."""

    change: str
    step: str
    by: str | None
    order: int | None
    why: str
    topic: str | None
    commanded_mps: float | None
    stood_before: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedOrder:
    """An order that stood. Times are seconds since the recording's beginning."""

    number: int
    by: str
    why: str
    ordered_s: float
    sent_s: float | None = None  # the first command
    ramp_s: float | None = None  # start of the current ramp; None: no commands are sent
    from_mps: float | None = None  # where it began
    ramp_mps: float = 0.0
    slows_s: float | None = None
    is_unconfirmed: bool = False
    stands: Literal["before", "unproven"] | None = None  # as in a live order


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedSlowDown:
    """The slow-down as the recording has it: armed, ordered, on its way, proven or not, released.

    What is known of it at one moment.
    """

    armed_by: str | None = None
    topic: str | None = None
    order: RecordedOrder | None = None

    def after(self, event: SlowDownEvent, at_s: float) -> RecordedSlowDown:
        """With one event more."""
        topic = event.topic or self.topic
        if event.change == "armed":
            return replace(self, armed_by=event.by or "somebody")
        if event.change == "disarmed":
            return replace(self, armed_by=None)
        order = self.order
        match event.step:
            case "released" | "ended":
                return replace(self, order=None)
            case "ordered" | "resumed" | "sent" | "slows" | "stands" | "not_confirmed" | "cut" if (
                event.order is not None
            ):
                if order is None or order.number != event.order:
                    order = RecordedOrder(number=event.order, by=event.by or "catgraph", why=event.why, ordered_s=at_s)
                return replace(self, topic=topic, order=_after(order, event, at_s))
        return self

    def facts(self, now_s: float, limits: SlowDownLimits) -> SlowingFacts:
        """For the checks."""
        order = self.order
        return SlowingFacts(
            is_armed=self.armed_by is not None,
            topic=self.topic or "",
            ordered_s=order.ordered_s if order else None,
            sending_s=order.ramp_s if order else None,
            deceleration_mps2=limits.deceleration_mps2,
            commanded_mps=_commanded(order, now_s, limits) if order else None,
        )

    def as_json(self, now_s: float, start_s: float, limits: SlowDownLimits) -> SlowDownState:
        """The `decelerate` of a replay's state; `start_s`: since 1970."""
        order = self.order
        ordered_mps = _commanded(order, now_s, limits) if order else None
        state: SlowDownPhase = "not_armed" if self.armed_by is None else "armed"
        if order is not None:
            state = "holding" if ordered_mps == 0.0 and order.ramp_s is not None else "ordered"
        return {
            "state": state,
            "why": None,
            "topic": self.topic,
            "type": None,
            "rivals": None,
            "armed_by": self.armed_by,
            "deceleration_mps2": round(limits.deceleration_mps2, 2),
            "order": None if order is None else _order(order, ordered_mps, now_s, start_s, limits),
            "countdown": None,
            "guard": None,
        }


def read_slowdown(row: Mapping[str, Any]) -> SlowDownEvent | None:
    """The event from its row of the log; None: it is of something else."""
    if row.get("change") not in CHANGES:
        return None
    number, speed = row.get("order"), row.get("commanded_mps")
    by = row.get("by") or row.get("ordered_by")
    return SlowDownEvent(
        change=str(row["change"]),
        step=str(row.get("step") or ""),
        by=by if isinstance(by, str) else None,
        order=number if type(number) is int else None,
        why=str(row.get("why") or ""),
        topic=row["topic"] if isinstance(row.get("topic"), str) else None,
        commanded_mps=float(speed) if isinstance(speed, int | float) and not isinstance(speed, bool) else None,
        stood_before=row.get("stands") == "before",
    )


def _after(order: RecordedOrder, event: SlowDownEvent, at_s: float) -> RecordedOrder:
    speed_mps = event.commanded_mps
    match event.step:
        case "sent":
            order = replace(order, sent_s=at_s, ramp_s=at_s, ramp_mps=speed_mps or 0.0, from_mps=speed_mps)
        case "resumed" if speed_mps is not None:
            order = replace(order, ramp_s=at_s, ramp_mps=speed_mps, sent_s=order.sent_s or at_s)
        case "cut":
            order = replace(order, ramp_s=None)
        case "slows":
            order = replace(order, slows_s=order.slows_s or at_s, is_unconfirmed=False, stands=None)
        case "stands":
            order = replace(order, is_unconfirmed=False, stands="before" if event.stood_before else "unproven")
        case "not_confirmed":
            order = replace(order, is_unconfirmed=True, stands=None)
    return order


def _commanded(order: RecordedOrder, now_s: float, limits: SlowDownLimits) -> float | None:
    """From the last recorded command and the ramp."""
    if order.ramp_s is None:
        return None
    left_mps = abs(order.ramp_mps) - limits.deceleration_mps2 * max(0.0, now_s - order.ramp_s)
    return max(0.0, left_mps) * (-1.0 if order.ramp_mps < 0 else 1.0)


def _order(
    order: RecordedOrder, ordered_mps: float | None, now_s: float, start_s: float, limits: SlowDownLimits
) -> SlowDownOrder:
    def at_ms(moment_s: float | None) -> int | None:
        return None if moment_s is None else round((start_s + moment_s) * 1000)

    return {
        "number": order.number,
        "by": order.by,
        "why": order.why,
        "for_s": round(now_s - order.ordered_s, 1),
        "from_mps": serialize.plain(order.from_mps, 2),
        "ordered_mps": serialize.plain(ordered_mps, 2),
        "deceleration_mps2": round(limits.deceleration_mps2, 2),
        "sending": order.ramp_s is not None,
        "confirmed": False if order.is_unconfirmed else True if order.slows_s is not None else None,
        "stands": order.stands,
        "steps": {
            "pressed_ms": None,
            "server_ms": at_ms(order.ordered_s),
            "bridge_ms": at_ms(order.sent_s),
            "slows_ms": at_ms(order.slows_s),
        },
        "longest_s": round(limits.longest_s, 0),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause:
    """Monitoring was paused or went on."""

    is_paused: bool
    by: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StopChange:
    """A planned stop began; None: it ended."""

    stop: PlannedStop | None


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnerChange:
    """The duty of who had acknowledged alarms ended; None: they are on duty again."""

    owner: str  # as they signed
    off_duty_ms: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSettings:
    """The settings from here on, as the file of all of them."""

    toml: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenPhone:
    """The operator chose the phone that is in the car; None: no phone any more."""

    phone: str | None


RecordedEvent = Transition | Pause | StopChange | OwnerChange | NewSettings | PhoneReport | ChosenPhone | SlowDownEvent


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedEvents:
    """Everything of one recording, in the order of time. Times are seconds since its beginning."""

    events: tuple[tuple[float, RecordedEvent], ...] = ()
    has_alarms: bool = False  # it holds the alarms as they were announced
    settings: str | None = None  # that were in force at its start; None: unknown
    clock_was_set: bool = False  # of the server, while it recorded
    notes: tuple[str, ...] = field(default=())


def answered(monitor: Monitor, event: Transition, now_s: float) -> tuple[Transition, ...]:
    """Do again what an operator did about an alarm then, to the alarms of a re-evaluation: what it brings about here.

    Raises Refused.
    """
    alarm_id, by = event.alarm_id, event.by or ""
    match event.change:
        case "acknowledged":
            return monitor.acknowledge(alarm_id, event.occurrence, by, now_s)
        case "silenced":
            return monitor.silence(alarm_id, event.occurrence, by, now_s)
        case "shelved" if event.shelved_until_s is not None:
            minutes = min((event.shelved_until_s - now_s) / 60, SHELVE_AT_MOST_MIN)  # the log has whole ms
            return monitor.shelve(alarm_id, event.occurrence, minutes, by, now_s)
        case "unshelved":
            return monitor.unshelve(alarm_id, by, now_s)
        case "handed_over" | "unacknowledged":
            return monitor.take_over(alarm_id, by, now_s, is_read_back=event.change == "handed_over")
    return ()
