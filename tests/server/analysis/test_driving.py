"""Who drove in recordings: the real drives say nothing of it, so nothing is known and nothing is invented."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from monitor.alarm import Transition
from monitor.driving_summary import DrivingSummary
from server.judge.drive import Drive
from server.judge.offline import Observer, OfflineRun
from server.recording.delay import recorded_delay
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import open_recording

REAL = ["catvehicle_2016-06-01.bag", "catvehicle_2016-06-01_mcap"]


class _DrivingObserver(Observer):
    """Sums up an offline run as a live session does."""

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


def summary_of(path: Path) -> dict[str, object]:
    observer = _DrivingObserver()
    with open_recording([path]) as recording:
        drive = Drive(recording, read_recorded_events(recording), delay=recorded_delay(recording))
        OfflineRun(recording, drive, opens_with_message=True, observer=observer).advance(1e9, to_last_message=True)
    return observer.summary.as_json()


@pytest.mark.slow
@pytest.mark.parametrize("name", REAL, ids=["ROS 1", "ROS 2"])
def test_of_the_real_drives_it_is_not_known_who_drove(recordings: Path, name: str) -> None:
    found = summary_of(recordings / name)
    modes = found["modes"]
    assert isinstance(modes, dict)
    assert modes["autonomous"] == modes["manual"] == {"s": 0.0, "m": 0.0}
    assert modes["unknown"]["s"] > 50.0
    assert modes["unknown"]["m"] > 50.0
    assert (found["mode_source"], found["changes"], found["interventions"]) == ("none", [], [])
    assert found["per_km"]["interventions"] is None  # type: ignore[index]
    assert found["per_km"]["alarms"] > 0.0  # type: ignore[index]
