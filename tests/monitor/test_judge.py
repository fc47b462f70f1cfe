"""The whole judge on a car in virtual time: one cause is one announcement, and its end is none."""

from __future__ import annotations

from time import process_time

import pytest

from monitor import catalog
from monitor.alarm import AlarmState
from monitor.catalog import CHECKS, AllLimits
from monitor.checks.signal_slow import expected_rates
from monitor.runner import Monitor
from monitor.values import Diagnostics, Twist
from tests.monitor.drive import REAL_HZ, Drive

FOUNDATION = (
    *("speed_limit", "signal_", "all_slow", "car_silent", "car_unusable"),
    *("link_lost", "link_late", "no_message", "connect_failed", "bridge_fault"),
)
FAST = {name for name, hz in REAL_HZ.items() if hz >= 10.0}


def drive(hz: dict[str, float] = REAL_HZ) -> Drive:
    return Drive(hz, Monitor([check for check in CHECKS if check.id.startswith(FOUNDATION)]))


def standing(car: Drive) -> dict[str, AlarmState]:
    return {alarm.id: alarm.state for alarm in car.monitor.standing()}


def brief(car: Drive, tile: str) -> str:
    return next(found.brief for found in car.monitor.tiles() if found.id == tile)


@pytest.mark.parametrize(
    "hz",
    [
        pytest.param(REAL_HZ, id="the real car"),
        pytest.param({**REAL_HZ, "scan": 30.0, "distance": 30.0, "bearing": 30.0}, id="a simulated car"),
        pytest.param({**REAL_HZ, "scan": 10.0, "position": 1.0, "odometry": 5.0}, id="a slower car"),
        pytest.param({**REAL_HZ, "speed": 50.0, "diagnostics": 0.5}, id="another car"),
        pytest.param({"speed": 20.0}, id="speed alone"),
        pytest.param({"diagnostics": 1.0, "position": 1.0}, id="nothing fast"),
    ],
)
def test_a_healthy_car_never_alarms(hz: dict[str, float]) -> None:
    car = drive(hz).open().to(30.0)
    assert car.log == []
    assert brief(car, "rates") == "OK"
    assert brief(car, "link") == "OK"


def test_jittery_starts_at_any_phase_do_not_alarm() -> None:
    for phase in range(5):
        car = drive({**REAL_HZ, "position": 1.0})
        car.to(0.2 * phase).open().to(20.0)
        assert car.log == []


def test_one_silent_signal_is_one_alarm_within_a_second() -> None:
    car = drive().open().to(10.0)
    car.silent = {"brake"}
    car.to(13.0)
    assert car.announced == ["signal_stale.brake"]
    assert 10.9 <= car.happened[0].at_s <= 11.2
    assert brief(car, "signals") == "FAULT: Brake 3 s"
    car.silent = set()
    car.to(20.0)
    assert car.announced == ["signal_stale.brake"]
    assert standing(car) == {"signal_stale.brake": AlarmState.RTN_UNACKED}
    car.monitor.acknowledge("signal_stale.brake", 1, "Ann", 20.0)
    assert standing(car) == {}


def test_a_slow_signal_is_reported_and_clears() -> None:
    car = drive().open().to(10.0)
    car.hz["scan"] = 40.0
    car.to(30.0)
    assert car.announced == ["signal_slow.scan"]
    assert car.happened[0].at_s < 18.0
    assert brief(car, "rates") == "FAULT: Laser 40 Hz"
    car.hz["scan"] = 75.0
    car.to(45.0)
    assert standing(car) == {"signal_slow.scan": AlarmState.RTN_UNACKED}


@pytest.mark.parametrize("gap_s", [0.3, 0.6, 0.9])
def test_a_hiccup_shorter_than_silence_is_no_alarm(gap_s: float) -> None:
    """Wi-Fi loses everything for less than a second: nothing worth a report."""
    car = drive().open().to(20.0)
    car.silent = set(REAL_HZ)
    car.to(20.0 + gap_s)
    car.silent = set()
    car.to(40.0)
    assert car.log == []


def test_hiccups_that_come_again_and_again_are() -> None:
    car = drive().open().to(20.0)
    for n in range(20):
        car.silent = {"brake"}
        car.to(20.4 + n)
        car.silent = set()
        car.to(21.0 + n)
    assert car.announced == ["signal_slow.brake"]


def test_the_whole_car_silent_is_one_announcement_and_its_return_none() -> None:
    car = drive().open().to(10.0)
    car.silent = set(REAL_HZ)
    car.to(40.0)
    assert car.announced == ["car_silent"]
    assert car.happened[0].at_s <= 12.0
    assert brief(car, "speed") == "not checked: stale"
    assert brief(car, "signals") == "not checked: silent"
    car.silent = set()
    car.to(60.0)
    assert car.announced == ["car_silent"]
    assert standing(car) == {"car_silent": AlarmState.RTN_UNACKED}


def test_diagnostics_alone_do_not_make_a_speaking_car() -> None:
    car = drive().open().to(10.0)
    car.silent = FAST
    car.to(40.0)
    assert car.announced == ["car_silent"]


def test_a_dead_laser_is_its_signals_alarm_not_the_cars() -> None:
    car = drive().open().to(10.0)
    car.silent = {"scan", "distance", "bearing"}
    car.to(15.0)
    assert sorted(car.announced) == ["signal_stale.bearing", "signal_stale.distance", "signal_stale.scan"]


@pytest.mark.parametrize("found_after_s", [0.0, 0.9, 1.2, 2.5])
@pytest.mark.parametrize("lost_for_s", [0.2, 2.0, 12.0])
def test_a_lost_link_is_one_announcement_and_its_return_none(found_after_s: float, lost_for_s: float) -> None:
    """Half-open links are found within 2.5 s; until then it is unknown whether the car or the link is silent."""
    car = drive().open().to(20.0)
    car.bridge_alive = False
    car.to(20.0 + found_after_s).lose().to(20.0 + found_after_s + lost_for_s)
    assert car.announced == ["link_lost"]
    assert brief(car, "speed") == "not checked: no link"
    car.bridge_alive = True
    car.open().to(car.now_s + 15.0)
    assert car.announced == ["link_lost"]
    assert standing(car) == {"link_lost": AlarmState.RTN_UNACKED}
    assert car.monitor.alarms["link_lost"].place == "list"


def test_signals_that_come_back_slowly_after_a_loss_have_their_time() -> None:
    car = drive({**REAL_HZ, "diagnostics": 0.2}).open().to(60.0)
    car.lose().to(200.0).open().to(260.0)
    assert car.announced == ["link_lost"]


def test_what_was_wrong_before_the_loss_and_still_is_is_not_reported_again() -> None:
    car = drive().open().to(10.0)
    car.values["speed"] = Twist(speed_mps=12.0)
    car.silent = {"brake"}
    car.to(12.0)
    assert car.announced == ["speed_limit", "signal_stale.brake"]
    car.monitor.acknowledge("speed_limit", 1, "Ann", 12.0)
    car.lose().to(30.0)
    assert standing(car) == {"link_lost": AlarmState.UNACKED, "speed_limit": AlarmState.ACKED}
    car.open().to(60.0)
    assert car.announced == ["speed_limit", "signal_stale.brake", "link_lost"]
    assert standing(car) == {
        "link_lost": AlarmState.RTN_UNACKED,
        "speed_limit": AlarmState.ACKED,
        "signal_stale.brake": AlarmState.UNACKED,  # unseen before, unseen still
    }


def test_what_went_wrong_during_the_loss_is_reported_at_once_after_it() -> None:
    """A new danger waits for no grace."""
    car = drive().open().to(10.0).lose().to(20.0)
    car.values["speed"] = Twist(speed_mps=12.0)
    car.open().to(20.5)
    assert car.announced == ["link_lost", "speed_limit"]


def test_a_signal_that_does_not_come_back_is_reported_after_the_grace() -> None:
    car = drive().open().to(10.0).lose().to(20.0)
    car.silent = {"brake"}
    car.open().to(40.0)
    assert car.announced == ["link_lost", "signal_stale.brake"]
    assert 23.0 <= car.happened[-1].at_s <= 24.3


def test_case_03_nothing_published_is_one_announcement() -> None:
    car = drive()
    car.silent = set(REAL_HZ)
    car.open().to(30.0)
    assert car.announced == ["no_message"]
    assert car.happened[0].at_s <= 5.2
    car.silent = set()
    car.to(60.0)
    assert car.announced == ["no_message"]
    assert standing(car) == {}


def test_a_roscore_that_is_started_anew_behind_a_living_bridge() -> None:
    """After the loss the link opens, and nothing comes: one more announcement, of another thing."""
    car = drive().open().to(10.0).lose().to(15.0)
    car.silent = set(REAL_HZ)
    car.open().to(60.0)
    assert car.announced == ["link_lost", "no_message"]


def test_cases_05_and_06_a_topic_that_is_there_and_never_speaks() -> None:
    car = drive()
    car.silent = {"scan", "position"}
    car.open().to(20.0)
    assert sorted(car.announced) == ["signal_stale.position", "signal_stale.scan"]


def test_case_01_connecting_failed_and_then_succeeded() -> None:
    car = drive().phase("failed", problem_title="No such host.").to(10.0)
    assert car.announced == ["connect_failed"]
    car.phase("connecting").to(11.0).phase("failed", problem_title="Nobody answers.").to(20.0)
    assert car.announced == ["connect_failed"]  # keeps trying, reports it once
    car.open().to(30.0)
    assert standing(car) == {}


def test_case_17_speeding_is_reported_within_its_delay_and_clears_below_the_deadband() -> None:
    car = drive().open().to(10.0)
    car.values["speed"] = Twist(speed_mps=12.0)
    car.to(12.0)
    assert car.log == [(10.3, "raised", "speed_limit")]
    car.monitor.acknowledge("speed_limit", 1, "Ann", 12.0)
    car.values["speed"] = Twist(speed_mps=10.8)
    car.to(20.0)
    assert standing(car) == {"speed_limit": AlarmState.ACKED}
    car.values["speed"] = Twist(speed_mps=10.4)
    car.to(23.0)
    assert standing(car) == {}


def test_a_spike_shorter_than_the_delay_is_none() -> None:
    car = drive().open().to(10.0)
    car.send("speed", Twist(speed_mps=30.0)).to(20.0)
    assert car.log == []


def test_a_stale_speed_does_not_clear_the_speed_alarm() -> None:
    car = drive().open().to(10.0)
    car.values["speed"] = Twist(speed_mps=12.0)
    car.to(12.0)
    car.silent = {"speed"}
    car.to(60.0)
    assert standing(car) == {"speed_limit": AlarmState.UNACKED, "signal_stale.speed": AlarmState.UNACKED}
    assert car.announced == ["speed_limit", "signal_stale.speed"]


def test_paused_nothing_is_reported_but_the_link() -> None:
    car = drive().open().to(10.0).pause()
    car.values["speed"] = Twist(speed_mps=12.0)
    car.silent = {"brake"}
    car.to(20.0)
    assert car.announced == []
    assert brief(car, "speed") == "not checked: paused"
    car.lose().to(21.0)
    assert car.announced == ["link_lost"]
    car.open().to(30.0).pause(False).to(32.0)
    assert sorted(car.announced) == ["link_lost", "signal_stale.brake", "speed_limit"]


def test_the_end_of_monitoring_leaves_nothing_standing() -> None:
    car = drive().open().to(10.0).lose().to(12.0).phase("idle").to(13.0)
    assert standing(car) == {}
    assert [t.change for t in car.happened] == ["raised", "cleared"]


def test_the_operators_rate_is_what_a_signal_is_held_to() -> None:
    car = drive()
    car.monitor.limits = catalog.changed(AllLimits(), {"signals.command_hz": 5.0, "signals.speed_hz": 40.0})
    car.state.expect(expected_rates(car.monitor.limits))
    car.open().to(20.0)
    assert car.announced == ["signal_slow.speed"]
    assert car.monitor.alarms["signal_slow.speed"].finding is not None
    assert "expected 40.0 Hz" in car.monitor.alarms["signal_slow.speed"].finding.text


@pytest.mark.parametrize("back_s", [2.0, 3600.0])
def test_a_clock_that_goes_back_raises_nothing_and_clears_nothing(back_s: float) -> None:
    """A recording that begins again. The car of the test has only one clock, so the judge is given another."""
    car = drive().open().to(20.0)
    car.values["speed"] = Twist(speed_mps=12.0)
    car.to(21.0)
    assert car.announced == ["speed_limit"]
    receive, snapshot = car.state.receive, car.state.snapshot
    car.state.receive = lambda name, value, at_s: receive(name, value, at_s - back_s)  # type: ignore[method-assign,assignment]
    car.state.snapshot = lambda at_s: snapshot(at_s - back_s)  # type: ignore[method-assign,assignment]
    car.to(60.0)
    assert car.announced == ["speed_limit"]
    assert standing(car) == {"speed_limit": AlarmState.UNACKED}


def test_no_chattering_at_the_edge_of_a_threshold() -> None:
    car = drive().open().to(10.0)
    for n in range(200):
        car.values["speed"] = Twist(speed_mps=10.95 + 0.1 * (n % 2))
        car.to(10.0 + 0.5 * (n + 1))
    assert len(car.happened) <= 1


def test_components_of_diagnostics_are_no_signals() -> None:
    car = drive().open().to(10.0)
    car.values["diagnostics"] = Diagnostics()
    car.to(20.0)
    assert car.log == []


def test_judging_the_full_load_of_a_car_is_a_small_part_of_a_core() -> None:
    """Some 360 messages a second and ten ticks: 1 % of a core when it was written. Ten times that is a defect."""
    car = drive().open().to(5.0)
    before_s = process_time()
    car.to(25.0)
    assert process_time() - before_s < 0.1 * 20.0
