"""A re-evaluation does again what operators did about alarms, a hand-over of control among it."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.judge.drive import Drive
from server.judge.offline import Observer, OfflineRun
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import open_recording
from tests.server.recording.drive.story import logged, recorded

ANN, BEN = "A. K. (Pixel)", "M. R. (Tablet)"


@pytest.mark.parametrize(
    ("change", "state", "owner"),
    [("handed_over", "ACKED", BEN), ("unacknowledged", "UNACKED", None), (None, "ACKED", ANN)],
    ids=["read back", "not read back", "no hand-over"],
)
def test_an_acknowledged_alarm_goes_to_the_taker(tmp_path: Path, change: str | None, state: str, owner: str) -> None:
    own = [
        logged(2.0, "raised", "speed_limit", state="UNACKED", text="10.0 m/s"),
        logged(5.0, "acknowledged", "speed_limit", state="ACKED", by=ANN),
    ]
    if change is not None:
        own.append(logged(8.0, change, "speed_limit", state=state, by=BEN))
    with open_recording([recorded(tmp_path, own, length_s=20.0)]) as recording:
        run = OfflineRun(recording, Drive(recording, read_recorded_events(recording)), observer=Observer())
        run.advance(15.0)
        alarm = run.run_state.monitor.alarms["speed_limit"]
    assert (alarm.active, alarm.acknowledged_by, alarm.acknowledged) == (True, owner, owner is not None)
