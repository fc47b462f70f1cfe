"""Who drove in a recording, its interventions and totals: follows an offline run."""

from __future__ import annotations

from collections.abc import Sequence

from monitor.alarm import Transition
from monitor.driving_summary import DrivingSummary
from server.judge.offline import Observer, OfflineRun


class DrivingObserver(Observer):
    """Times are seconds since the beginning of the recording."""

    def __init__(self) -> None:
        self.summary = DrivingSummary()

    def judged(self, transitions: Sequence[Transition], now_s: float) -> None:
        self.summary.announced(sum(one.announces for one in transitions))

    def ticked(self, run: OfflineRun, now_s: float) -> None:
        run_state = run.run_state
        monitor = run_state.monitor
        self.summary.step(
            run_state.state.glance(now_s),
            monitor.limits,
            lambda: [alarm.id for alarm in monitor.standing() if alarm.active],
        )
