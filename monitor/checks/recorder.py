"""Does the recorder record: keeps it up, has it room, did it stop?"""

from __future__ import annotations

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
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
TOLD_S = 10.0  # a drop is spoken of so long: the disk may refuse again at once


class RecordingLimits(Limits):
    """What is recorded and how much of the disk it may have; the three checks judge by some of them."""

    automatic: float = threshold(
        1.0,
        "Record from the start",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: recording begins with monitoring. 0: by hand only.",
    )
    all_topics: float = threshold(
        1.0,
        "Record all topics",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="0: only the topics that catgraph itself reads.",
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
        help="A link that returns within this time goes on with the same recording, in a second part.",
    )
    quota_gb: float = threshold(
        0.0,
        "Disk for recordings",
        unit="GB",
        low=0.0,
        high=10_000.0,
        step=1.0,
        help="All recordings together may take this much; 0: as much as there is. Nothing is ever deleted for it.",
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
        help="You are warned when less than this may still be recorded.",
    )
    behind_s: float = threshold(
        2.0,
        "Recorder behind after",
        unit="s",
        low=0.5,
        high=30.0,
        step=0.5,
        help="A message that waits longer than this to be written says that the disk is too slow.",
    )


def keeps_up(snapshot: Snapshot, limits: RecordingLimits, was_active: bool) -> Finding:
    facts = snapshot.recorder
    if facts.state not in ("recording", "saving"):
        return absent("Nothing is recorded now", brief="not recording")
    dropped_ago_s = snapshot.now_s - facts.dropped_s if facts.dropped_s is not None else None
    if dropped_ago_s is not None and dropped_ago_s < TOLD_S:
        many = f"{facts.dropped} message{' was' if facts.dropped == 1 else 's were'} not recorded"
        return fault(f"The disk is too slow: {many}", brief="lost some", causes=("dropped",))
    measured = Quantity(label="Behind", value=round(facts.behind_s, 1), unit="s")
    limit = Quantity(label="At most", value=limits.behind_s, unit="s")
    text = f"Messages wait {facts.behind_s:.1f} s to be written, at most {limits.behind_s:g} s is usual"
    if facts.behind_s > limits.behind_s * (0.5 if was_active else 1.0):
        return fault(text, brief=f"{facts.behind_s:.0f} s", measured=measured, limit=limit, causes=("behind",))
    return ok("All that comes is recorded", measured=measured, limit=limit)


def has_room(snapshot: Snapshot, limits: RecordingLimits, was_active: bool) -> Finding:
    facts = snapshot.recorder
    if facts.state not in ("recording", "saving", "held"):
        return absent("Nothing is recorded now", brief="not recording")
    if facts.left_gb is None:
        return unknown("The disk has not said how much room it has", short="no word")
    left_gb, warn_gb = facts.left_gb, limits.warn_gb
    measured = Quantity(label="Room", value=round(left_gb, 2), unit="GB")
    limit = Quantity(label="Warn below", value=warn_gb, unit="GB")
    text = f"Room for {left_gb:.2f} GB more, then recording stops{f': {facts.limit}' if facts.limit else ''}"
    if left_gb < warn_gb * (1.1 if was_active else 1.0):
        return fault(text, brief=f"{left_gb:.1f} GB", measured=measured, limit=limit)
    return ok(text, measured=measured, limit=limit)


def goes_on(snapshot: Snapshot, limits: RecordingLimits, was_active: bool) -> Finding:
    facts = snapshot.recorder
    if facts.state == "stopped":
        return fault(facts.trouble or "Recording stopped by itself", brief="stopped")
    if facts.state == "off":
        return absent("Nothing is to be recorded", brief="not recording")
    return ok("It is recorded" if facts.state != "held" else "What was recorded is saved")


CHECKS = (
    Check(
        id="recording_stopped",
        label="Recorder",
        order=129,
        group="recording",
        tile=RECORDING,
        alarm=AlarmSpec(
            title="Recording stopped",
            priority=Priority.WARNING,
            place=Place.DIALOG,  # whoever drives to record must not find it out afterwards
            sound=Sound.MEDIUM,
            needs_ack=True,
            off_delay_s=1.0,
            actions=(Action.ACKNOWLEDGE,),
            advice="What was recorded so far is kept. Make room or mend the disk, then start recording again.",
        ),
        limits=RecordingLimits,
        find=goes_on,
        scope=Scope.SERVER,
    ),
    Check(
        id="recorder_behind",
        label="Recorder keeps up",
        order=130,
        group="recording",
        tile=RECORDING,
        alarm=AlarmSpec(
            title="Recorder behind",
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
        scope=Scope.SERVER,
    ),
    Check(
        id="disk_nearly_full",
        label="Room on the disk",
        order=131,
        group="recording",
        tile=RECORDING,
        alarm=AlarmSpec(
            title="Disk nearly full",
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
        scope=Scope.SERVER,
    ),
)
