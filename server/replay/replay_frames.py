"""What a page sees of a run through a recording: the state and the scan at the moment it has come to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from monitor.alarm import Alarm
from monitor.alarm_order import standing
from monitor.check import Verdict
from server.protocol import serialize
from server.replay.run import Run
from server.replay.run_state import Known
from server.vehicle.scan_feed import judged
from server.vehicle.state_frame import Facts, state_frame

TRENDS_A_FRAME = 4


def frame(run: Run, *, vehicle: str, name: str, settings_version: int, track_number: int) -> dict[str, Any]:
    """The state of docs/protocol.md at this moment, without `server`, `replay` and `live`. Looking changes nothing
    of what is judged later."""
    known, epoch = run.known, run.epoch
    now_s = known.at_s
    wall_ms = round((run.drive.start_s + now_s) * 1000)
    facts = Facts(
        vehicle=vehicle,
        server={},
        now_s=now_s,
        wall_ms=wall_ms,
        phase="monitoring",
        address=None,
        ros_version=run.drive.ros_version,
        connected_s=0.0,
        paused_since_s=known.paused_s,
        paused_by=known.paused_by,
        held=None,
        load=known.load.at(now_s),
        log_trouble=None,
        profile=epoch.tuning.profile.title,
        settings_version=settings_version,
        since_s=0.0,
        dialled_s=0.0,
        problem=None,
        link=None,
        last_message_s=known.last_message_s,
        ros_answered_s=now_s,
        ros_alive=True,
        behind=None,
        offers_nothing=False,
        bridge_answers=True,
        reception=known.reception,
        sources=epoch.sources,
        topics_heard=len(known.heard),
        trends=known.trends.piece(now_s, at_most=TRENDS_A_FRAME),
        track_number=track_number,
    )
    shown = state_frame(facts, known.state.glance(now_s), known.monitor)
    del shown["server"]
    shown["session"]["name"] = name
    # Whatever is not in the file is nobody's silence: the band tells of it, and each value keeps its age.
    shown["link"] |= {"cut": None, "since_ms": None, "problem": None, "topics_subscribed": len(epoch.published)}
    shown["decelerate"] = known.slowed.as_json(now_s, run.drive.start_s, epoch.tuning.limits.slow_down)
    if run.drive.told.has_alarms:
        shown["alarms"] = [serialize.alarm(alarm, now_s, wall_ms) for alarm in _told_standing(known)]
    return shown


def scan_bytes(run: Run) -> bytes | None:
    """The newest scan as the page gets it; None before the first."""
    known = run.known
    snapshot = known.state.glance(known.at_s)
    reading = snapshot.get("scan")
    if reading is None:
        return None
    obstacle = known.monitor.alarms.get("obstacle")
    return serialize.scan_frame(
        reading.value,
        number=known.scans,
        age_s=reading.age_s(known.at_s),
        kinds_kept=known.kinds_kept,
        judged=judged(
            reading.value,
            snapshot,
            known.monitor.limits.obstacle,
            was_active=obstacle is not None and obstacle.active,
        ),
    )


def _told_standing(known: Known) -> list[Alarm]:
    """The alarms as they were told then, each with what its check says when it is asked anew."""
    findings = known.monitor.findings
    return [
        replace(alarm, finding=findings[alarm.id])
        if alarm.active and alarm.id in findings and findings[alarm.id].verdict is Verdict.FAULT
        else alarm
        for alarm in standing(known.told.values())
    ]
