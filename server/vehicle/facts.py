"""Facts about a session for the monitor, the pages and the health check, collected from its parts."""

from __future__ import annotations

from dataclasses import dataclass

from monitor.shell_facts import RecorderFacts
from monitor.state import LinkFacts
from server.judge.unit_watch import unit_questions
from server.protocol.departure import DepartureState
from server.protocol.state import LiveState, RecordedState, ServerState
from server.rosbridge.connection_errors import Problem
from server.vehicle.restore import RestoredState
from server.vehicle.session_parts import SessionParts
from server.vehicle.state_frame import Facts

FLOWS_S = 2.0  # a message of the car so lately: data flow
TRENDS_A_FRAME = 4  # steps of the trends in each state: so many frames in a row may be lost without a gap
LATE_TICK_S = 1.0  # twenty ticks
LATE_STATE_S = 2.0  # pages cover their values by then
LATE_RECORDER_S = 2.0


def behind(parts: SessionParts, now_s: float) -> Problem | None:
    """The part that failed behind the open bridge, whether or not messages still come."""
    if parts.connection.phase != "monitoring":
        return None
    last_s = parts.judgement.last_message_s
    return parts.connection.subscriptions.problem(now_s, flows=last_s is not None and now_s - last_s < FLOWS_S)


def link_facts(parts: SessionParts, now_s: float, *, wall_ms: int, log_trouble: str | None) -> LinkFacts:
    """The input of the connection checks."""
    connection, judgement = parts.connection, parts.judgement
    link, topics, problem = connection.link, connection.subscriptions, connection.problem
    failed = behind(parts, now_s)
    return LinkFacts(
        phase=connection.phase,
        since_s=connection.since_s,
        attempts=link.attempts if link is not None else 0,
        bridge_heard_s=link.heard_s if link is not None else None,
        bridge_answers=connection.bridge_answers(now_s),
        problem_title=problem.title if problem else None,
        problem_hint=problem.hint if problem else None,
        behind_title=failed.title if failed else None,
        behind_hint=failed.hint if failed else None,
        behind_mark=failed.mark if failed else None,
        topics_subscribed=topics.table.judged,
        connected_s=connection.connected_s,
        last_message_s=judgement.last_message_s,
        published=topics.published(),
        carriers=topics.signals.carriers,
        compared=topics.signals.compared_topics,
        undecided=topics.signals.undecided,
        log_trouble=log_trouble,
        late_s=judgement.transport.late_s(now_s) if connection.phase == "monitoring" else None,
        most_late_s=judgement.transport.most_late_s(now_s) if connection.phase == "monitoring" else None,
        throttled=topics.table.load.throttled(now_s),
        reduced=f"{topics.table.load.level.text}." if topics.table.load.step else None,
        wall_zero_s=wall_ms / 1000 - now_s,
    )


def live_state(shown: RecordedState, departure: DepartureState, server: ServerState, lag_s: float) -> LiveState:
    """A whole state; `lag_s`: how late the newest tick was."""
    return {**shown, "departure": departure, "server": {**server, "loop_lag_ms": round(lag_s * 1000, 1)}}


def frame_facts(
    vehicle: str,
    parts: SessionParts,
    now_s: float,
    *,
    wall_ms: int,
    configured: str | None,
    held: RestoredState | None,
    log_trouble: str | None,
) -> Facts:
    """What a state is made of. `configured`: the address of the car the session was started for; `held`: what stood
    when the server ended, while no car is monitored yet."""
    operators = parts.authorization.as_json(now_s, wall_ms)
    operators["control"]["handover"] = parts.handover.as_json(now_s, wall_ms)
    connection, judgement, topics = parts.connection, parts.judgement, parts.connection.subscriptions
    asked_units = unit_questions(judgement.reception.units, topics.signals.sources, parts.settings.settings.units)
    return Facts(
        vehicle=vehicle,
        now_s=now_s,
        wall_ms=wall_ms,
        phase=connection.phase,
        address=connection.address,
        configured=configured,
        ros_version=topics.ros_version,
        connected_s=connection.connected_s,
        paused_since_s=parts.pause.since_s,
        paused_by=parts.pause.by,
        planned_stop=parts.planned_stop.stop,
        held=held,
        load=judgement.load,
        log_trouble=log_trouble,
        profile=parts.settings.profile.title,
        settings_version=parts.settings.settings.version,
        since_s=connection.since_s,
        dialled_s=connection.dialled_s,
        problem=connection.problem,
        link=connection.link,
        last_message_s=judgement.last_message_s,
        other_message_s=judgement.other_message_s,
        ros_answered_s=topics.ros.answered_s,
        ros_alive=topics.ros.alive,
        offers_nothing=topics.signals.offers_nothing,
        behind=behind(parts, now_s),
        bridge_answers=connection.bridge_answers(now_s),
        reception=judgement.reception,
        sources=topics.signals.sources,
        topics_heard=len(judgement.topics),
        of_unknown_age=judgement.transport.of_unknown_age(),
        topics_judged=topics.table.judged,
        recording=parts.recording.frame(now_s),
        trends=judgement.trends.piece(now_s, at_most=TRENDS_A_FRAME),
        track_number=judgement.track_number,
        operators=operators,
        off_duty_ms=parts.authorization.off_duty_ms,
        decelerate=parts.slow_down.frame(),
        mode=parts.driving.frame(now_s, wall_ms),
        marks=parts.marks.count,
        questions=(*topics.signals.questions, *asked_units) if connection.phase == "monitoring" else (),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Vitals:
    """The input of the health check. Ages in seconds."""

    tick_age_s: float  # since every check was last judged
    state_age_s: float | None  # since a state was made for the pages; None: no page is connected
    log_trouble: str | None  # why the event log is not kept, as a sentence
    recorder: RecorderFacts
    task_problems: tuple[str, ...]  # of supervised tasks, a sentence each


def problems(vitals: Vitals) -> list[str]:
    """What is wrong, a sentence each, worst first; empty: well."""
    found = []
    if vitals.tick_age_s > LATE_TICK_S:
        found.append(f"No check was evaluated for {vitals.tick_age_s:.1f} s.")
    if vitals.state_age_s is not None and vitals.state_age_s > LATE_STATE_S:
        found.append(f"No state was sent to pages for {vitals.state_age_s:.1f} s.")
    found += vitals.task_problems
    if vitals.log_trouble is not None:
        found.append(vitals.log_trouble)
    if vitals.recorder.trouble is not None:
        found.append(vitals.recorder.trouble)
    if vitals.recorder.behind_s > LATE_RECORDER_S:
        found.append(f"The recorder is {vitals.recorder.behind_s:.1f} s behind.")
    return found
