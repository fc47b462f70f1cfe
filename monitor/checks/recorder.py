"""Does the recorder record: keeps it up, has it room, did it stop?"""

from __future__ import annotations

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    End,
    Finding,
    Limits,
    Place,
    Priority,
    Quantity,
    Scope,
    Sound,
    absent,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.snapshot import Snapshot

RECORDING = "Recording"
REPORTED_S = 10.0  # a drop is reported for so long: the disk may refuse again at once


class RecordingLimits(Limits):
    """What is recorded and how much of the disk it may have; the three checks judge by some of them."""

    automatic: float = threshold(
        1.0,
        "Record from the start",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: recording starts with monitoring. 0: manually only.",
    )
    all_topics: float = threshold(
        1.0,
        "Record all topics",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="0: only the topics that catgraph reads.",
    )
    bulky: float = threshold(
        0.0,
        "Record images and clouds",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: images, point clouds and other bulky topics too; they load the car's network.",
    )
    hold_s: float = threshold(
        30.0,
        "Hold a lost recording",
        unit="s",
        low=0.0,
        high=600.0,
        step=5.0,
        help="If the link returns within this time, the same recording continues in a second part.",
    )
    quota_gb: float = threshold(
        0.0,
        "Disk for recordings",
        unit="GB",
        low=0.0,
        high=10_000.0,
        step=1.0,
        help="Limit for all recordings together; 0: no limit. Nothing is ever deleted for it.",
    )
    min_free_gb: float = threshold(
        0.5,
        "Disk to leave free",
        unit="GB",
        low=0.05,
        high=100.0,
        step=0.05,
        help="Recording stops when less than this is free.",
    )
    warn_gb: float = threshold(
        2.0,
        "Disk nearly full below",
        unit="GB",
        low=0.0,
        high=1000.0,
        step=0.5,
        help="A warning is raised when less than this remains.",
    )
    behind_s: float = threshold(
        2.0,
        "Recorder behind after",
        unit="s",
        low=0.5,
        high=30.0,
        step=0.5,
        help="A message that waits longer than this to be written means that the disk is too slow.",
    )


def caught_up(limits: RecordingLimits) -> End:
    return End("below", 0.5 * limits.behind_s, "s")


def has_room_again(limits: RecordingLimits) -> End:
    return End("above", 1.1 * limits.warn_gb, "GB")


def keeps_up(snapshot: Snapshot, limits: RecordingLimits, was_active: bool) -> Finding:
    facts = snapshot.recorder
    if facts.state not in ("recording", "saving"):
        return absent("Nothing is recorded now", brief="not recording")
    dropped_ago_s = snapshot.now_s - facts.dropped_s if facts.dropped_s is not None else None
    if dropped_ago_s is not None and dropped_ago_s < REPORTED_S:
        many = f"{facts.dropped} message{' was' if facts.dropped == 1 else 's were'} not recorded"
        return fault(f"The disk is too slow: {many}", brief="lost some", causes=("dropped",))
    measured = Quantity(label="Behind", value=round(facts.behind_s, 1), unit="s")
    limit = Quantity(label="At most", value=limits.behind_s, unit="s")
    text = f"Messages wait {facts.behind_s:.1f} s to be written, at most {limits.behind_s:g} s is normal"
    if facts.behind_s > (caught_up(limits).value if was_active else limits.behind_s):
        return fault(text, brief=f"{facts.behind_s:.0f} s", measured=measured, limit=limit, causes=("behind",))
    return ok("All messages are recorded", measured=measured, limit=limit)


def has_room(snapshot: Snapshot, limits: RecordingLimits, was_active: bool) -> Finding:
    facts = snapshot.recorder
    if facts.state not in ("recording", "saving", "held"):
        return absent("Nothing is recorded now", brief="not recording")
    if facts.left_gb is None:
        return unknown("The free space of the disk is unknown", short="no data")
    left_gb, warn_gb = facts.left_gb, limits.warn_gb
    measured = Quantity(label="Room", value=round(left_gb, 2), unit="GB")
    limit = Quantity(label="Warn below", value=warn_gb, unit="GB")
    text = f"Space for {left_gb:.2f} GB more, then recording stops{f': {facts.limit}' if facts.limit else ''}"
    if left_gb < (has_room_again(limits).value if was_active else warn_gb):
        return fault(text, brief=f"{left_gb:.1f} GB", measured=measured, limit=limit)
    return ok(text, measured=measured, limit=limit)


def goes_on(snapshot: Snapshot, limits: RecordingLimits, was_active: bool) -> Finding:
    facts = snapshot.recorder
    if facts.state == "stopped":
        return fault(facts.trouble or "Recording stopped by itself", brief="stopped")
    if facts.state == "off":
        return absent("Recording is off", brief="not recording")
    return ok("Recording" if facts.state != "held" else "What was recorded is saved")


CHECKS = (
    Check(
        id="recording_stopped",
        label="Recorder",
        order=129,
        checked_when="Checked while a recording is made.",
        group="recording",
        tile=RECORDING,
        alarm=AlarmSpec(
            title="Recording stopped",
            ended="Recording had stopped",
            priority=Priority.WARNING,
            place=Place.DIALOG,  # the driver of a recorded test must know at once
            sound=Sound.MEDIUM,
            needs_ack=True,
            off_delay_s=1.0,
            actions=(Action.ACKNOWLEDGE,),
            advice="What was recorded is kept. Free space or repair the disk, then start recording again.",
        ),
        limits=RecordingLimits,
        find=goes_on,
        scope=Scope.SERVER,
    ),
    Check(
        id="recorder_behind",
        label="Recorder keeps up",
        order=130,
        checked_when="Checked while a recording is made.",
        group="recording",
        tile=RECORDING,
        alarm=AlarmSpec(
            title="Recorder behind",
            ended="Recorder was behind",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.LOW,
            needs_ack=True,  # what is missing stays missing
            on_delay_s=0.5,
            off_delay_s=5.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Record fewer topics, or record to a faster disk.",
            inhibited_by=("recording_stopped",),
        ),
        limits=RecordingLimits,
        find=keeps_up,
        ends=caught_up,
        scope=Scope.SERVER,
    ),
    Check(
        id="disk_nearly_full",
        label="Disk space",
        order=131,
        checked_when="Checked while recording is switched on and the free space is known.",
        group="recording",
        tile=RECORDING,
        alarm=AlarmSpec(
            title="Disk nearly full",
            ended="Disk was nearly full",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.LOW,
            needs_ack=True,
            on_delay_s=2.0,
            off_delay_s=5.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Copy recordings away and delete them in Files, before recording must stop.",
            inhibited_by=("recording_stopped",),
        ),
        limits=RecordingLimits,
        find=has_room,
        ends=has_room_again,
        scope=Scope.SERVER,
    ),
)
