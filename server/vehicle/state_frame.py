"""The whole state of a vehicle as docs/protocol.md has it, from what the session, the monitor and the link know."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from monitor import catalog, values
from monitor.instruments import stopping_m, time_gap_s
from monitor.load import AlarmLoad
from monitor.planned_stop import PlannedStop
from monitor.runner import Monitor
from monitor.scan_shape import habit_words
from monitor.shell_facts import Phase
from monitor.signals import SIGNALS, Signal
from monitor.state import Reading, Snapshot
from monitor.trends import Piece
from server.judge.reception_stats import Reception, Tally
from server.judge.topics import Source
from server.protocol import serialize
from server.protocol.driving_state import ModeState
from server.protocol.operator_state import OperatorsState
from server.protocol.questions import Question
from server.protocol.recording_state import RecordingState
from server.protocol.signal_state import SignalFreshness, SignalState, SignalValue
from server.protocol.slow_down_state import SlowDownState
from server.protocol.state import (
    Cut,
    HeldState,
    LinkState,
    NearestState,
    PlannedStopState,
    RecordedState,
    SessionState,
)
from server.rosbridge import connection_errors
from server.rosbridge.address import Address
from server.rosbridge.connection_errors import Problem
from server.vehicle import phone
from server.vehicle.restore import RestoredState

if TYPE_CHECKING:  # a replay shows states too, and has no use for all that dials
    from server.rosbridge.live_source import LiveSource

CAR_SILENT_S = 1.4  # reported before 2 s are over
OVERDUE_PERIODS = 3
NO_MESSAGE_S = 5.0
MOST_SUPPRESSED = 20
FIRST_MESSAGE_S = 1.4  # where a part behind the bridge is known to have failed
ONCE_AFTER_S = 2.0  # a topic that comes more often has a second message by then
ROS_GONE_S = 2.5  # one unanswered question may be lost; three are a sign


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What only the session has; `…_s` without `for` are moments of its monotonic clock."""

    vehicle: str
    now_s: float
    wall_ms: int
    phase: Phase
    address: Address | None
    ros_version: int | None
    connected_s: float | None
    paused_since_s: float | None
    paused_by: str | None
    planned_stop: PlannedStop | None = None
    held: RestoredState | None  # what stood when the server ended, while no car is monitored yet
    load: AlarmLoad
    log_trouble: str | None
    profile: str  # the kind of car it is taken for
    settings_version: int
    since_s: float
    dialled_s: float
    problem: Problem | None
    link: LiveSource | None
    last_message_s: float | None
    other_message_s: float | None = None  # of a topic that is only recorded
    ros_answered_s: float | None
    ros_alive: bool | None
    offers_nothing: bool
    behind: Problem | None  # the part that failed behind the open bridge
    bridge_answers: bool
    reception: Reception
    sources: Mapping[str, Source]
    topics_heard: int
    trends: Piece
    track_number: int  # of this run of the server; another number is another track
    configured: str | None = None  # the address of the car the session was started for
    topics_judged: int = 0  # subscribed to for their signals
    recording: RecordingState
    decelerate: SlowDownState
    mode: ModeState
    operators: OperatorsState
    off_duty_ms: Callable[[str | None], int | None] = lambda _: None
    marks: int = 0  # of this drive
    questions: Sequence[Question] = ()
    of_unknown_age: Collection[str] = ()  # topics whose only message may have been kept for us


def state_frame(facts: Facts, snapshot: Snapshot, monitor: Monitor) -> RecordedState:
    """A state without its `server`."""
    return {
        "kind": "state",
        "vehicle": facts.vehicle,
        "session": _session(facts, snapshot),
        "link": _link(facts, snapshot),
        "signals": {name: _signal(signal, facts, snapshot) for name, signal in SIGNALS.items()},
        "nearest": _nearest(snapshot, monitor),
        "checks": [serialize.tile(tile) for tile in monitor.tiles()],
        "alarms": [
            serialize.alarm(
                alarm, facts.now_s, facts.wall_ms, silent_at(facts.planned_stop, monitor), facts.off_duty_ms
            )
            for alarm in monitor.standing()
        ],
        "suppressed": [
            serialize.suppressed(alarm, monitor.alarms, facts.now_s, facts.wall_ms)
            for alarm in monitor.suppressed()[:MOST_SUPPRESSED]
        ],
        "alarm_load": serialize.load(facts.load, monitor.alarms),
        "log_trouble": facts.log_trouble,
        "trends": serialize.trends(facts.trends),
        "limits": catalog.flat(monitor.limits),
        "recording": facts.recording,
        "decelerate": facts.decelerate,
        "mode": facts.mode,
        **facts.operators,
        "phone": phone.as_json(snapshot.phone, facts.now_s),
        "phones": phone.all_as_json(snapshot.phones, snapshot.phone, facts.now_s),
        "marks": facts.marks,
        "questions": list(facts.questions),
    }


def _session(facts: Facts, snapshot: Snapshot) -> SessionState:
    connected_for = facts.now_s - facts.connected_s if facts.connected_s is not None else None
    return {
        "phase": facts.phase,
        "address": facts.address.url if facts.address else None,
        "name": facts.address.shown if facts.address else None,
        "configured": facts.configured,
        "ros_version": facts.ros_version,
        "profile": facts.profile,
        "settings_version": facts.settings_version,
        "connected_for_s": serialize.plain(connected_for, 1),
        "paused": facts.paused_since_s is not None,
        "paused_by": facts.paused_by,
        "paused_for_s": round(facts.now_s - facts.paused_since_s, 1) if facts.paused_since_s is not None else 0.0,
        "planned_stop": _planned_stop(facts, snapshot),
        "held": _held(facts.held),
        "track_m": serialize.plain(snapshot.track_m, 1),
        "track": {"number": facts.track_number, "last": snapshot.track[-1].number if snapshot.track else 0},
        "received": facts.reception.received,
        "rejected": facts.reception.rejected,
    }


def silent_at(stop: PlannedStop | None, monitor: Monitor) -> Collection[str] | None:
    """Ids of the alarms that make no sound in it; None: there is none."""
    return None if stop is None else monitor.silent_at_stop


def _planned_stop(facts: Facts, snapshot: Snapshot) -> PlannedStopState | None:
    stop = facts.planned_stop
    if stop is None:
        return None
    return {
        "reason": stop.reason,
        "by": stop.by,
        "since_ms": round(facts.wall_ms - (facts.now_s - stop.since_s) * 1000),
        "is_speed_known": _fresh(snapshot, "speed") is not None,
    }


def _held(before: RestoredState | None) -> HeldState | None:
    if before is None:
        return None
    return {"address": before.address, "alarms": len(before.standing), "paused": before.paused_s is not None}


def _link(facts: Facts, snapshot: Snapshot) -> LinkState:
    cut, problem, heard_s = where_cut(facts, snapshot)
    link = facts.link
    bridge_heard_s = link.heard_s if link is not None else None
    return {
        "cut": cut,
        "since_ms": round(facts.wall_ms - (facts.now_s - heard_s) * 1000) if cut and heard_s is not None else None,
        "bridge_age_s": serialize.plain(facts.now_s - bridge_heard_s, 2) if bridge_heard_s is not None else None,
        "car_age_s": serialize.plain(facts.now_s - facts.last_message_s, 2)
        if facts.last_message_s is not None
        else None,
        "problem": problem.as_json() if problem else None,
        "attempts": link.attempts if link is not None else 0,
        "trying_for_s": round(facts.now_s - facts.dialled_s, 1)
        if facts.phase in ("connecting", "failed", "lost")
        else 0.0,
        "topics_subscribed": facts.topics_judged,
        "topics_heard": facts.topics_heard,
        "late_s": serialize.plain(snapshot.link.late_s, 2),
        "most_late_s": serialize.plain(snapshot.link.most_late_s, 2),
        "reduced": snapshot.link.reduced,
        "unreadable_frames": facts.reception.frames.rejected,
        "unreadable_why": facts.reception.frames.last_reason,
    }


def where_cut(facts: Facts, snapshot: Snapshot) -> tuple[Cut | None, Problem | None, float | None]:
    """The broken connection of the chain, its cause, the last contact beyond it; a cause alone: messages still come."""
    if facts.phase == "idle":
        return None, None, None
    heard_s = facts.link.heard_s if facts.link is not None else None
    if facts.phase in ("connecting", "failed"):
        return ("server-bridge" if facts.phase == "failed" else None), facts.problem, heard_s
    if facts.phase == "lost":
        return "server-bridge", facts.problem, heard_s
    if not facts.bridge_answers and facts.address is not None:
        return "server-bridge", connection_errors.bridge_silent(facts.address), heard_s
    return _behind_the_bridge(facts, snapshot)


def _behind_the_bridge(facts: Facts, snapshot: Snapshot) -> tuple[Cut | None, Problem | None, float | None]:
    last_s = facts.last_message_s
    opened_s = max(facts.since_s, facts.connected_s or facts.since_s)
    answered_s = facts.ros_answered_s
    behind = facts.behind
    ros_is_gone = facts.ros_alive is False and answered_s is not None and facts.now_s - answered_s > ROS_GONE_S
    if last_s is None:
        if facts.now_s - opened_s < (NO_MESSAGE_S if behind is None else FIRST_MESSAGE_S):
            return None, behind, None
        return (
            "bridge-car",
            behind or (connection_errors.NOTHING_KNOWN if facts.offers_nothing else connection_errors.NO_MESSAGE),
            None,
        )
    if facts.now_s - max(last_s, facts.since_s) < max(CAR_SILENT_S, OVERDUE_PERIODS * _shortest_period_s(snapshot)):
        return None, behind, None
    if ros_is_gone:
        return "bridge-car", behind or connection_errors.ROS_GONE, last_s
    others_come = facts.other_message_s is not None and facts.now_s - facts.other_message_s < CAR_SILENT_S
    silent = connection_errors.SIGNALS_SILENT if others_come else connection_errors.CAR_SILENT
    return "bridge-car", behind or silent, last_s


def _shortest_period_s(snapshot: Snapshot) -> float:
    """Of the received signals; 0 if none has a known period. A car whose fastest signal has 1 Hz gets 3 s."""
    return min((r.period_s for r in snapshot.readings.values() if r.period_s and r.count), default=0.0)


def _signal(signal: Signal, facts: Facts, snapshot: Snapshot) -> SignalState[SignalValue]:
    source = facts.sources.get(signal.name)
    undecided = snapshot.link.undecided.get(signal.name)  # then what came before is not trusted either
    reading: Reading[Any] | None = None if undecided else snapshot.readings.get(signal.name)
    tally = facts.reception.by_signal.get(signal.name) or Tally()
    rate = snapshot.rates.get(signal.name)
    extent = snapshot.extents.get(signal.name)
    unusable = snapshot.unusable.get(signal.name)
    freshness: SignalFreshness
    if reading is not None:
        freshness = reading.freshness(facts.now_s)
    elif unusable is not None:
        freshness = "not_measured" if unusable.is_declared else "no_value"
    elif source is not None and source.decode is not None:
        freshness = "never"
    else:
        freshness = "not_published"
    return {
        "label": signal.label,
        "unit": signal.unit if source is None or _is_unit_known(facts, source) else "",
        "freshness": freshness,
        "age_s": serialize.plain(reading.age_s(facts.now_s), 3) if reading else None,
        "delay_s": serialize.plain(reading.delay_s, 3) if reading else None,
        "horizon_s": serialize.plain(reading.horizon_s, 2) if reading else None,
        "period_s": serialize.plain(reading.period_s, 4) if reading else None,
        "expected_hz": serialize.plain(rate.expected_hz, 1) if rate else signal.expected_hz,
        "rate_hz": serialize.plain(rate.measured_hz, 1) if rate else None,
        "topic": source.topic if source else None,
        "type": source.type if source else None,
        "why": source.why if source else None,
        "frame": facts.reception.frame_of(source.topic) if source else None,
        "note": (unusable.text if unusable else None)
        or (_scan_note(source, snapshot) if signal.name == "scan" else None)
        or (_old_sample(facts, reading, tally, source) if reading and source else None)
        or (source.note if source else undecided)
        or (_unknown_part(reading.value) if reading else None)
        or (facts.reception.units.note(signal.name, source.topic) if source else None),
        "unusable": unusable.text if unusable else None,
        "count": tally.received,
        "rejected": tally.rejected,
        "rejected_why": tally.last_reason,
        "repaired": tally.repaired,
        "repaired_why": tally.repaired_why,
        "value": serialize.value(reading.value) if reading else None,
        "lowest": serialize.plain(extent.lowest) if extent else None,
        "highest": serialize.plain(extent.highest) if extent else None,
    }


def _is_unit_known(facts: Facts, source: Source) -> bool:
    decision = facts.reception.units.decision(source.signal, source.topic)
    if decision is None or decision.unit is None:
        return decision is None or decision.is_rest
    return decision.unit.converts


def _scan_note(source: Source | None, snapshot: Snapshot) -> str | None:
    """Of the laser all is to be known at once: the choice of its topic, its mounting, how its driver counts."""
    scan = snapshot.get("scan")
    mounting = scan.value.mounting if scan is not None else None
    mounted = mounting.notes if mounting else []
    notes = (source.note if source else None, *mounted, habit_words(snapshot.scan_habit))
    return "; ".join(note for note in notes if note) or None


def _old_sample(facts: Facts, reading: Reading[Any], tally: Tally, source: Source) -> str | None:
    """What is known of a sample that the bridge kept for new subscriptions."""
    if tally.repeats:
        return "sent again by the bridge after a renewed subscription: not new"
    if source.topic in facts.of_unknown_age and reading.silent_s(facts.now_s) > ONCE_AFTER_S:
        return "one message since connecting: it may be older than its age here"
    return None


def _unknown_part(value: Any) -> str | None:
    """What a proper message leaves open: the real car's cmd_vel has a NaN angle in every message."""
    if isinstance(value, values.MotionCommand):
        parts = (("linear.x", value.speed_mps), ("angular.z", value.tyre_angle_rad))
        missing = [name for name, known in parts if known is None]
        return f"{' and '.join(missing)} is null: unknown" if missing else None
    return None


def _nearest(snapshot: Snapshot, monitor: Monitor) -> NearestState:
    """Time gap and stopping distance, from speed and nearest object while both are fresh."""
    speed: values.Twist | None = _fresh(snapshot, "speed")
    distance: values.Distance | None = _fresh(snapshot, "distance")
    if speed is None:
        return {"time_gap_s": None, "stopping_m": None}
    metres = distance.distance_m if distance is not None else None
    gap_s = time_gap_s(metres, speed.speed_mps) if metres is not None else None
    return {
        "time_gap_s": serialize.plain(gap_s, 2),
        "stopping_m": serialize.plain(stopping_m(speed.speed_mps, monitor.limits.obstacle), 2),
    }


def _fresh(snapshot: Snapshot, name: str) -> Any:
    reading = snapshot.readings.get(name)
    return reading.value if reading is not None and reading.is_fresh(snapshot.now_s) else None
