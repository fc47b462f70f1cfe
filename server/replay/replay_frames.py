"""What a page sees of a run through a recording: the state and the scan at the moment it has come to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from monitor.alarm import Alarm
from monitor.check import Verdict
from monitor.driving_mode import meaning
from monitor.inhibition import standing
from monitor.reading import Reading
from monitor.values import DriveMode, Mode
from server.judge.offline import OfflineRun
from server.judge.run_state import RunState
from server.judge.topics import Source
from server.judge.unit_watch import unit_questions
from server.protocol import serialize
from server.protocol.driving_state import ModeState, WhyUnknown
from server.protocol.state import RecordedState
from server.vehicle.scan_feed import judged
from server.vehicle.state_frame import Facts, silent_at, state_frame

TRENDS_A_FRAME = 4


def frame(run: OfflineRun, *, vehicle: str, name: str, settings_version: int, track_number: int) -> RecordedState:
    """The state of docs/protocol.md at this moment, without `server`, `replay` and `live`. Reading it changes nothing
    of what is judged later."""
    run_state, epoch = run.run_state, run.epoch
    now_s = run_state.at_s
    wall_ms = round((run.drive.start_s + now_s) * 1000)
    facts = Facts(
        vehicle=vehicle,
        now_s=now_s,
        wall_ms=wall_ms,
        phase="monitoring",
        address=None,
        ros_version=run.drive.ros_version,
        connected_s=0.0,
        paused_since_s=run_state.paused_s,
        paused_by=run_state.paused_by,
        planned_stop=run_state.planned_stop,
        held=None,
        load=run_state.load.at(now_s),
        log_trouble=None,
        profile=epoch.tuning.profile.title,
        settings_version=settings_version,
        since_s=0.0,
        dialled_s=0.0,
        problem=None,
        link=None,
        last_message_s=run_state.last_message_s,
        ros_answered_s=now_s,
        ros_alive=True,
        behind=None,
        offers_nothing=False,
        bridge_answers=True,
        reception=run_state.reception,
        sources=epoch.sources,
        topics_heard=len(run_state.topics_received),
        trends=run_state.trends.piece(now_s, at_most=TRENDS_A_FRAME),
        track_number=track_number,
        recording={"state": "off", "for_s": None},
        decelerate=run_state.slow_down.as_json(now_s, run.drive.start_s, epoch.tuning.limits.slow_down),
        mode=_mode_shown(
            run_state.state.get("mode"), epoch.sources.get("mode"), run_state.monitor.limits.driving, now_s
        ),
        operators={"control": {"holder": None}, "reach": None},  # not applicable to a recording
        questions=(
            *epoch.questions,
            *unit_questions(run_state.reception.units, epoch.sources, epoch.tuning.settings.units),
        ),
    )
    shown = state_frame(facts, run_state.state.glance(now_s), run_state.monitor)
    shown["session"]["name"] = name
    # What is not in the file is no failure of a link: each value keeps its age.
    link = shown["link"]
    link["cut"] = link["since_ms"] = link["problem"] = None
    link["topics_subscribed"] = len(epoch.published)
    if run.drive.recorded.has_alarms:
        silent, off_ms = silent_at(run_state.planned_stop, run_state.monitor), run_state.off_duty_ms
        standing_then = _recorded_standing(run_state)
        shown["alarms"] = [serialize.alarm(alarm, now_s, wall_ms, silent, off_ms) for alarm in standing_then]
        shown["alarm_load"] = serialize.load(facts.load, run_state.recorded_alarms)
    return shown


def scan_bytes(run: OfflineRun) -> bytes | None:
    """The newest scan as the page gets it; None before the first."""
    run_state = run.run_state
    snapshot = run_state.state.glance(run_state.at_s)
    reading = snapshot.get("scan")
    if reading is None:
        return None
    obstacle = run_state.monitor.alarms.get("obstacle")
    return serialize.scan_frame(
        reading.value,
        number=run_state.scans,
        age_s=reading.age_s(run_state.at_s),
        kinds_kept=run_state.kinds_kept,
        judged=judged(
            reading.value,
            snapshot,
            run_state.monitor.limits.obstacle,
            was_active=obstacle is not None and obstacle.active,
        ),
    )


def _recorded_standing(run_state: RunState) -> list[Alarm]:
    """The alarms as they were announced then, each with the finding of its check as judged now."""
    findings = run_state.monitor.findings
    return [
        replace(alarm, finding=findings[alarm.id])
        if alarm.active and alarm.id in findings and findings[alarm.id].verdict is Verdict.FAULT
        else alarm
        for alarm in standing(run_state.recorded_alarms.values())
    ]


def _mode_shown(reading: Reading[DriveMode] | None, source: Source | None, limits: Any, now_s: float) -> ModeState:
    """The mode where only one moment is known. `limits`: of the group `driving`; times on the reading's clock."""
    mode: Mode = "unknown"
    why: WhyUnknown | None = "no_source" if source is None else "silent"
    if reading is not None and (reading.is_fresh(now_s) or 0.0 <= now_s - reading.received_s <= limits.holds_s):
        mode = meaning(reading.value, limits)
        why = "unclear" if mode == "unknown" else None
    return {
        "mode": mode,
        "why": why,
        "since_ms": None,
        "way_m": None,
        "source": source.topic if source is not None else "",
        "open": [],
    }
