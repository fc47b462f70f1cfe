"""The real recordings before the whole judge: what they truly hold and no more, and that a fault laid over is found."""

from __future__ import annotations

from pathlib import Path

import pytest

from monitor.check import Verdict
from server.analysis.faults import CannotInject, Faults
from server.analysis.rehearse import Extract, Rehearsed, rehearse
from server.recording.read.read import open_recording
from server.simulator.scenarios import SCENARIOS, planned
from tests.monitor.recorded import DRIVE

BAG = "catvehicle_2016-06-01.bag"
FAULT_AT_S = 36.0  # the car drives 3.5 m/s
# The rates are settled before the fault; the drive's own obstacle, at 52.8 s, lies behind the end.
EXTRACT = Extract(start_s=24.0, duration_s=27.0)


def run(recordings: Path, name: str, *faults: str, extract: Extract | None = None) -> Rehearsed:
    with open_recording([recordings / name]) as recording:
        return rehearse(recording, extract=extract, faults=[planned(fault) for fault in faults])


def raised(found: Rehearsed) -> list[str]:
    return [transition.alarm_id for transition in found.transitions if transition.announces]


@pytest.mark.slow
@pytest.mark.parametrize("name", [BAG, "catvehicle_2016-06-01_mcap"], ids=["ROS 1", "ROS 2"])
def test_the_healthy_drive_raises_what_is_true_and_no_more(recordings: Path, name: str) -> None:
    """It stands for half a minute, and ends 4.1 m before an object. No GPS, scan, pedal, rate, clock or command alarm,
    although its accelerator never moves, its estimator repeats itself and its commands are followed loosely."""
    assert (recordings / DRIVE).is_dir()
    found = run(recordings, name)
    assert raised(found) == ["not_moving", "obstacle_nearest"]
    assert found.crashes == ()


@pytest.mark.slow
def test_a_real_laser_in_a_room_raises_what_is_true_and_no_more(recordings: Path) -> None:
    """A Hokuyo carried through a room: walls half a metre away, and 13 342 beams of its own below range_min."""
    found = run(recordings, "lidar/scan_tools_hokuyo_demo.bag")
    assert raised(found) == ["obstacle"]
    checked = {one.alarm_id for one in found.transitions}
    assert not checked & {"laser_blind", "scan_shape", "signal_frozen.scan", "clock_jump", "clock_offset"}


# Scenario → what it raises over the real drive, and how soon. None: the drive has no message that it could change.
OVER_THE_DRIVE: dict[str, tuple[list[str], float] | None] = {
    "speeding": (["obstacle_nearest", "no_response", "speed_limit", "speed_sources"], 1.5),
    "obstacle": (["obstacle_nearest"], 0.2),
    "near-object": (["obstacle_nearest"], 0.2),
    "command-ignored": (["no_response"], 2.2),
    "standing": None,
    "pedal-conflict": (["pedals"], 0.5),
    "gps-drift": None,  # it does not stand
    "gps-jump": (["gps_jump"], 0.5),
    "phone-mismatch": ([], 0.0),  # no phone
    "stale-gps": (["signal_stale.position"], 1.5),
    "no-fix": (["gps_fix"], 3.3),
    "silent-scan": None,
    "blind-laser": ([], 0.0),  # it has no laser, only the estimator, of which nothing near is healthy
    "frozen-speed": (["signal_frozen.speed"], 2.5),
    "short-scan": None,
    "frozen-position": (["signal_frozen.position"], 2.5),
    "frozen-scan": None,
    "slow-rate": (["signal_slow.speed"], 8.0),
    "all-slow": (["all_slow"], 8.0),
    "clock-jump": (["clock_jump"], 0.5),
    "clock-slow": (["clock_offset"], 11.0),
    "diagnostics-error": None,
    "diagnostics-warning": None,
    "controller-silent": None,
    "all-silent": (["car_silent"], 1.5),
    "bridge-frozen": (["link_lost"], 2.5),
    "bridge-killed": (["link_lost"], 0.5),
    "manual-takeover": None,
    "driver-brakes": None,
    "mode-flaps": None,  # it has no topic of a mode
}


def test_every_scenario_was_thought_of() -> None:
    assert OVER_THE_DRIVE.keys() == SCENARIOS.keys()


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "raises"), OVER_THE_DRIVE.items(), ids=OVER_THE_DRIVE.keys())
def test_a_fault_laid_over_the_real_drive_is_found(
    recordings: Path, scenario: str, raises: tuple[list[str], float] | None
) -> None:
    fault = f"{scenario}@{FAULT_AT_S:g}"
    if SCENARIOS[scenario].effect is None and SCENARIOS[scenario].bridge is None:
        with pytest.raises(CannotInject):
            Faults([planned(fault)])
        return
    found = run(recordings, BAG, fault, extract=EXTRACT)
    alarms, within_s = raises or ([], 0.0)
    during = [t for t in found.transitions if t.announces and t.at_s >= FAULT_AT_S]
    assert [t.alarm_id for t in during] == alarms
    if alarms:
        assert during[0].at_s <= FAULT_AT_S + within_s
    if raises is None:
        assert any("changed nothing" in note for note in found.notes), "and a note states it"


@pytest.mark.slow
def test_what_is_checked_on_the_real_drive(recordings: Path) -> None:
    """Checks that find nothing because they do not look would pass all of the above."""
    found = run(recordings, BAG, extract=Extract(start_s=24.0, duration_s=14.0))
    looked_s = {timeline.label: timeline.seconds(Verdict.OK) for timeline in found.timelines}
    for tile in ("Frozen", "Clock", "Response", "Rates", "Pedals"):
        assert looked_s[tile] > 5.0, tile
