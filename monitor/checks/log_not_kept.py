"""Is the alarm log kept on the disk?"""

from __future__ import annotations

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Scope,
    Sound,
    fault,
    ok,
)
from monitor.snapshot import Snapshot


class LogLimits(Limits):
    pass


def find(snapshot: Snapshot, limits: LogLimits, was_active: bool) -> Finding:
    trouble = snapshot.link.log_trouble
    return ok("The alarm log is stored") if trouble is None else fault(trouble, brief="not kept")


CHECKS = (
    Check(
        id="log_not_kept",
        label="Alarm log",
        order=128,
        checked_when="Always checked.",
        alarm=AlarmSpec(
            title="Alarm log not stored",
            ended="Alarm log was not stored",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,  # events may have been lost although it is kept again
            on_delay_s=2.0,  # another program that reads the file for a moment
            off_delay_s=5.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Alarms continue; a restart would lose what is in memory. Free space on the server's disk.",
        ),
        limits=LogLimits,
        find=find,
        scope=Scope.SERVER,
    ),
)
