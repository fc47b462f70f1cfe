"""The simulated car before the judge: a fault raises its own alarm, once, in time; a healthy drive raises none.

Tables for whatever there is: a new scenario, or a new check, without a row here fails.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest

from monitor.catalog import CHECKS
from monitor.signals import SIGNALS
from server.simulator.effects import Silence
from server.simulator.faults import OtherClock
from server.simulator.scenario import Scenario
from server.simulator.scenarios import SCENARIOS, Planned, planned
from tests.server.judged import judged
from tests.tree import PROJECT

FAULT_AT_S = 12.0  # rates are settled by then, and the car is on its way
AFTER_S = 8.0  # after the fault, for what its end may bring


@dataclass(frozen=True)
class Row:
    """What a scenario raises, in this order, and how soon after its beginning the first of them."""

    raises: list[str]
    within_s: float
    phone: bool = False


ROWS = {
    "speeding": Row(["speed_limit"], 8.0),  # the car must gain speed first
    "obstacle": Row(["obstacle"], 1.0),
    "near-object": Row(["obstacle_nearest"], 0.2),
    "command-ignored": Row(["no_response"], 2.0),  # its own second, and one until the slope of the speed shows it
    "standing": Row(["not_moving"], 16.0),  # it stops first
    "pedal-conflict": Row(["pedals"], 0.5),
    "gps-drift": Row(["gps_drift", "not_moving"], 16.0),
    "gps-jump": Row(["gps_jump"], 0.5),
    "phone-mismatch": Row(["phone_car"], 30.0, phone=True),
    "stale-gps": Row(["signal_stale.position"], 1.5),
    "no-fix": Row(["gps_fix"], 3.3),
    "silent-scan": Row(["signal_stale.scan"], 1.5),
    "blind-laser": Row(["laser_blind"], 1.5),
    "frozen-speed": Row(["signal_frozen.speed"], 2.3),
    "short-scan": Row(["scan_shape"], 0.8),
    "frozen-position": Row(["signal_frozen.position"], 2.5),
    "frozen-scan": Row(["signal_frozen.scan"], 2.3),
    "slow-rate": Row(["signal_slow.speed"], 8.0),
    "all-slow": Row(["all_slow"], 8.0),
    "clock-jump": Row(["clock_jump"], 0.5),
    "clock-slow": Row(["clock_offset"], 11.0),  # 2 s are lost after 8 s
    "diagnostics-error": Row(["diagnostics_error"], 1.5),
    "diagnostics-warning": Row(["diagnostics_warn"], 1.5),
    "controller-silent": Row(["not_moving"], 16.0),
    "all-silent": Row(["car_silent"], 1.5),
    "bridge-frozen": Row(["link_lost"], 2.5),
    "bridge-killed": Row(["link_lost"], 0.5),
    "manual-takeover": Row([], 0.0),  # what a person does is no fault
    "driver-brakes": Row([], 0.0),
    "mode-flaps": Row([], 0.0),
}
QUICK_S = 20.0  # longer scenarios are for the long run

# Documented consequences that depend on where the car is.
MAY_FOLLOW = {
    "frozen-speed": {"no_response", "obstacle", "obstacle_nearest"},
    "frozen-position": {"gps_drift"},  # it ends with a leap, and the car may stand by then
    "frozen-scan": {"obstacle"},
    "gps-jump": {"gps_drift", "phone_car"},
    "obstacle": {"obstacle_nearest", "not_moving"},  # where the car stood, the stopper keeps it standing
}

# Checks that no fault of the simulated car can raise, and the tests that raise them.
ELSEWHERE = {
    "connect_failed": "tests/monitor/test_judge.py::test_case_01_connecting_failed_and_then_succeeded",
    "no_message": "tests/monitor/test_judge.py::test_case_03_nothing_published_is_one_announcement",
    "paused_long": "tests/monitor/checks/test_paused_long.py::test_a_forgotten_pause_is_reported_ever_more_seldom",
    "fuel_low": "tests/monitor/checks/test_fuel_low.py::test_it_is_reported_once",  # the car publishes none
    "gps_quality": "tests/server/judge/test_judged.py::test_the_strict_setting_rejects_the_cars_own_receiver",
    "reach": "tests/monitor/checks/test_reach.py::test_a_reload_and_a_tap_raise_nothing_and_15_s_of_silence_do",
    "log_not_kept": "tests/monitor/checks/test_log_not_kept.py",
    "signal_unusable": "tests/world/test_unusable.py",
    "car_unusable": "tests/world/test_unusable.py",
    "link_late": "tests/monitor/test_hovering.py::test_a_link_about_as_late_as_is_allowed",
    "link_late_moving": "tests/monitor/test_hovering.py::test_a_link_about_as_late_as_is_allowed",
    "bridge_fault": "tests/monitor/checks/test_three_answers.py",
    "recording_stopped": "tests/monitor/checks/test_recorder.py",
    "recorder_behind": "tests/monitor/checks/test_recorder.py",
    "disk_nearly_full": "tests/monitor/checks/test_recorder.py",
    "slow_down_unconfirmed": "tests/server/slowdown/test_sender.py::test_a_rival_is_named_and_the_order_not_confirmed",
    "slow_down_rivals": "tests/server/slowdown/test_sender.py::test_a_rival_is_named_and_the_order_not_confirmed",
    "slow_down_hold_ended": "tests/server/slowdown/test_sender.py::test_a_hold_that_nobody_releases_ends",
    "speed_sources": "tests/monitor/checks/test_speed_sources.py::test_a_drive_whose_sources_disagree_is_one_alarm",
    "position_receiver": "tests/monitor/checks/test_position_sources.py::test_the_sentences",
    "position_sources": "tests/monitor/checks/test_position_sources.py::test_positions_that_part_are_noticed",
    "phone_missing": "tests/monitor/checks/test_phone.py::test_each_reason_is_reported_after_10_s",
    "phone_tracks": "tests/monitor/checks/test_phone.py::test_the_correlation_has_a_deadband_and_a_setting",
}


def rows() -> Iterator[Any]:
    for name, row in ROWS.items():
        long = name in SCENARIOS and SCENARIOS[name].duration_s >= QUICK_S
        yield pytest.param(name, row, id=name, marks=[pytest.mark.soak if long else pytest.mark.slow])


def test_every_scenario_has_its_row() -> None:
    assert ROWS.keys() == SCENARIOS.keys()


def test_every_check_is_raised_by_a_scenario_or_elsewhere() -> None:
    """Of a family, made for each signal by the same lines, one member will do."""
    raised = {alarm.partition(".")[0] for row in ROWS.values() for alarm in row.raises}
    there = {check.id.partition(".")[0] for check in CHECKS}
    assert raised | ELSEWHERE.keys() == there
    assert not raised & ELSEWHERE.keys()


@pytest.mark.parametrize(("check", "test"), ELSEWHERE.items(), ids=ELSEWHERE.keys())
def test_what_is_raised_elsewhere_is(check: str, test: str) -> None:
    file, _, name = test.partition("::")
    source = (PROJECT / file).read_text(encoding="utf-8")
    assert check in source
    assert f"def {name}" in source


@pytest.mark.parametrize(("scenario", "row"), list(rows()))
def test_a_fault_raises_its_own_alarm_once_and_in_time(scenario: str, row: Row) -> None:
    seconds = FAULT_AT_S + SCENARIOS[scenario].duration_s + AFTER_S
    raised = judged([planned(f"{scenario}@{FAULT_AT_S:g}")], seconds, phone=row.phone)
    assert [one.alarm for one in raised] == row.raises
    if raised:
        assert FAULT_AT_S <= raised[0].at_s <= FAULT_AT_S + row.within_s


@pytest.mark.soak
@pytest.mark.parametrize(("begins_s", "seed"), [(24.0, 2), (33.0, 3), (41.0, 2)])
@pytest.mark.parametrize("scenario", ROWS)
def test_a_fault_raises_no_other_alarm_wherever_it_begins(scenario: str, begins_s: float, seed: int) -> None:
    """In the bends, at the stop line, with another noise: its own alarms, each at most once; none where it stands."""
    row = ROWS[scenario]
    seconds = begins_s + SCENARIOS[scenario].duration_s + AFTER_S
    raised = [one.alarm for one in judged([planned(f"{scenario}@{begins_s:g}")], seconds, seed=seed, phone=row.phone)]
    assert set(raised) <= {*row.raises, *MAY_FOLLOW.get(scenario, ())}
    assert len(raised) == len(set(raised))


@pytest.mark.slow
@pytest.mark.parametrize("signal", [name for name, signal in SIGNALS.items() if not signal.optional])
def test_each_signal_that_falls_silent_is_its_own_alarm(signal: str) -> None:
    silent = Scenario(
        name="silent", sentence="One signal is silent.", duration_s=60.0, alarm="", effect=lambda: Silence(signal)
    )
    raised = judged([Planned(scenario=silent, after_s=8.0)], 20.0 if signal == "diagnostics" else 11.0)
    assert [one.alarm for one in raised] == [f"signal_stale.{signal}"]


@pytest.mark.slow
def test_the_strict_setting_rejects_the_cars_own_receiver() -> None:
    """gps_quality: the real receiver marks a covariance of zeros as known."""
    raised = judged([], 8.0, limits={"gps_fix.strict": 1.0})
    assert [one.alarm for one in raised] == ["gps_quality"]
    assert raised[0].at_s <= 3.2


@pytest.mark.slow
def test_an_old_recording_played_in_a_loop_is_one_jump_of_the_clock() -> None:
    """Stamps that are ten years old raise no alarm; their jump back by half a minute is reported once."""

    def looped(step_s: float, after_s: float) -> Planned:
        old = Scenario(
            name=f"{step_s} s", sentence="Old.", duration_s=600.0, alarm="", effect=lambda: OtherClock(step_s=step_s)
        )
        return Planned(scenario=old, after_s=after_s)

    raised = judged([looped(-3.0e8, 0.0), looped(-30.0, 15.0)], 40.0)
    assert [one.alarm for one in raised] == ["clock_jump"]
    assert "back by 30.0 s" in raised[0].text


@pytest.mark.parametrize(
    ("seed", "seconds"),
    [
        pytest.param(3, 60.0, marks=[pytest.mark.slow]),
        pytest.param(1, 600.0, marks=[pytest.mark.soak, pytest.mark.timeout(1200)]),
        pytest.param(2, 600.0, marks=[pytest.mark.soak, pytest.mark.timeout(1200)]),
    ],
)
def test_a_healthy_drive_raises_none(seed: int, seconds: float) -> None:
    assert judged([], seconds, seed=seed, phone=True) == []
