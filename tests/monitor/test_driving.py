"""Who drives, interventions and totals: single cases by made-up snapshots, and any flickering within its bounds."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from monitor.catalog import AllLimits, changed
from monitor.driving_mode import CONFIRM_S, FLICKERS, FLICKERS_WITHIN_S, SETTLE_S
from monitor.driving_summary import DrivingSummary
from monitor.shell_facts import LinkFacts
from monitor.snapshot import Snapshot
from monitor.state import State
from monitor.values import DriveMode, Effort, GpsFix, Mode, MotionCommand, Steering, Twist

LIMITS = AllLimits()
STEP_S = 0.05
BY_RULE = {"driving.by_rule": 1.0}


class Car:
    """Sends the given values 20 times a second; every moment is judged."""

    def __init__(self, **limits: float) -> None:
        self.state = State()
        self.now_s = 0.0
        self.limits = changed(LIMITS, {name.replace("__", "."): value for name, value in limits.items()})
        self.summary = DrivingSummary()
        self.active: list[str] = []

    def drive(
        self,
        for_s: float,
        *,
        mode: Mode | DriveMode | None = "autonomous",
        speed: float | None = 5.0,
        command: float | None = 5.0,
        brake: float = 0.0,
        tyre: float = 0.0,
        tyre_command: float = 0.0,
    ) -> None:
        for _ in range(round(for_s / STEP_S)):
            self.now_s = round(self.now_s + STEP_S, 4)
            at_s = self.now_s
            self.state.link(LinkFacts(phase="monitoring", published=frozenset({"speed", "brake"})))
            if mode is not None:
                value = mode if isinstance(mode, DriveMode) else DriveMode(mode=mode, text=mode)
                self.state.receive("mode", value, at_s)
            if speed is not None:
                self.state.receive("speed", Twist(speed_mps=speed), at_s)
            if command is not None:
                self.state.receive("command", MotionCommand(speed_mps=command, tyre_angle_rad=tyre_command), at_s)
            self.state.receive("brake", Effort(percent=brake), at_s)
            self.state.receive("steering", Steering(percent=0.0, tyre_rad=tyre), at_s)
            self.state.receive("position", GpsFix(lat_deg=32.2, lon_deg=-110.9), at_s)
            self.summary.step(self.state.snapshot(at_s), self.limits, lambda: self.active)

    @property
    def modes(self) -> list[Mode]:
        return [change.mode for change in self.summary.changes]

    @property
    def kinds(self) -> list[str]:
        return [one.kind_of for one in self.summary.interventions]


def test_without_a_source_nothing_is_known_and_nothing_is_invented() -> None:
    car = Car()
    car.drive(10.0, mode=None)
    car.drive(5.0, mode=None, brake=60.0, speed=2.0)
    assert (car.modes, car.kinds) == ([], [])
    assert car.summary.driving.watch.mode == "unknown"
    assert car.summary.as_json()["per_km"]["interventions"] is None


def test_a_take_over_is_one_intervention_with_what_was_known_of_it() -> None:
    car = Car()
    car.drive(12.0)
    car.active = ["obstacle"]
    car.drive(0.2, brake=46.0)
    began_s = car.now_s + STEP_S
    car.drive(6.0, mode="manual", brake=46.0, speed=4.0)
    assert car.modes == ["autonomous", "manual"]
    (one,) = car.summary.interventions
    assert one.at_s == pytest.approx(began_s, abs=0.01)
    assert (one.kind_of, one.initiated_by, one.active) == ("to_manual", "driver", ("obstacle",))
    assert one.speed_mps == pytest.approx(5.0, abs=1.01)
    assert (one.lat_deg, one.lon_deg) == (32.2, -110.9)
    assert one.brake_percent == 46.0
    assert one.acted_before_s == pytest.approx(0.2, abs=0.06)
    before = car.summary.as_json()["interventions"][0]["before"]
    assert len(before) == 21
    assert -10.3 <= before[0]["at_s"] <= -9.7
    assert before[-1]["at_s"] == pytest.approx(0.0, abs=0.26)


@pytest.mark.parametrize(
    ("speed", "kinds"), [(0.0, []), (0.25, []), (0.5, ["to_manual"])], ids=["stands", "creeps", "moves"]
)
def test_manual_at_standstill_is_no_intervention(speed: float, kinds: list[str]) -> None:
    car = Car()
    car.drive(3.0, speed=speed, command=speed)
    car.drive(3.0, speed=speed, command=speed, mode="manual")
    assert car.modes == ["autonomous", "manual"]
    assert car.kinds == kinds


def test_a_gap_between_autonomous_and_manual_hides_no_take_over_and_invents_none() -> None:
    car = Car(driving__holds_s=0.0)
    car.drive(5.0)
    car.drive(12.0, mode=None)
    car.drive(2.0, mode="manual")
    assert car.modes == ["autonomous", "unknown", "manual"]
    assert car.kinds == ["to_manual"]
    car.drive(12.0, mode=None)
    car.drive(2.0, mode="manual")
    assert car.kinds == ["to_manual"], "a hand drove before the gap and after it"


def test_brake_against_the_command_is_reported_once_and_a_commanded_one_is_not() -> None:
    car = Car()
    car.drive(3.0)
    car.drive(3.0, brake=40.0, speed=3.0, command=0.0)
    car.drive(3.0)
    assert car.kinds == []
    began_s = car.now_s
    car.drive(3.0, brake=40.0, speed=4.0)
    car.drive(3.0)
    (one,) = car.summary.interventions
    assert (one.kind_of, one.initiated_by) == ("brake", "driver")
    assert began_s <= one.at_s <= began_s + 0.2


def test_a_server_that_stalls_in_the_moment_of_the_take_over_still_sees_who_began_it() -> None:
    car = Car()
    car.drive(5.0)
    step, car.summary.step = car.summary.step, lambda *_: None  # type: ignore[assignment, method-assign]
    car.drive(0.2, brake=46.0)
    car.drive(0.2, mode="manual", brake=46.0, command=None)
    car.summary.step = step  # type: ignore[method-assign]
    car.drive(2.0, mode="manual", brake=46.0, command=None)
    (one,) = car.summary.interventions
    assert one.initiated_by == "driver"


def test_brake_after_the_controller_fell_silent_is_not_the_drivers() -> None:
    car = Car()
    car.drive(3.0)
    car.drive(0.35, command=None)
    car.drive(3.0, command=None, brake=50.0, speed=3.0)
    assert car.kinds == []


def test_the_wheel_held_against_the_command() -> None:
    car = Car()
    car.drive(3.0, tyre=0.1, tyre_command=0.0)
    assert car.kinds == []
    car.drive(2.0, tyre=0.3, tyre_command=0.0)
    car.drive(3.0)
    assert car.kinds == ["steer"]


def test_the_braking_that_ends_in_manual_is_one_intervention() -> None:
    car = Car()
    car.drive(3.0)
    car.drive(1.0, brake=40.0, speed=4.0)
    car.drive(3.0, brake=40.0, speed=2.0, mode="manual")
    assert car.kinds == ["brake"]


def test_time_and_distance_belong_to_the_mode_from_its_first_report_on() -> None:
    car = Car()
    car.drive(10.0)
    car.drive(10.0, mode="manual", speed=2.0)
    summary = car.summary.as_json()
    assert summary["modes"]["autonomous"]["s"] == pytest.approx(10.0, abs=0.11)
    assert summary["modes"]["autonomous"]["m"] == pytest.approx(50.0, abs=0.6)
    assert summary["modes"]["manual"] == {"s": pytest.approx(10.0, abs=0.11), "m": pytest.approx(20.0, abs=0.6)}
    assert car.summary.driving.mode_way_m == pytest.approx(20.0, abs=0.6)
    assert summary["per_km"]["interventions"] == pytest.approx(20.0, rel=0.02)


@pytest.mark.parametrize(("number", "mode"), [(1, "autonomous"), (0, "manual"), (7, "unknown")])
def test_a_plain_number_means_what_the_settings_say(number: int, mode: Mode) -> None:
    car = Car()
    car.drive(2.0, mode=DriveMode(mode="unknown", text=str(number), number=number))
    assert car.summary.driving.watch.mode == mode
    other = Car(driving__autonomous_number=7.0)
    other.drive(2.0, mode=DriveMode(mode="unknown", text=str(number), number=number))
    assert (other.summary.driving.watch.mode == "autonomous") == (number == 7)


def test_a_topic_that_speaks_on_changes_only_is_stale_unless_a_setting_holds_it() -> None:
    for holds_s, expected in ((0.0, "unknown"), (600.0, "autonomous")):
        car = Car(driving__holds_s=holds_s)
        car.drive(1.0)
        car.drive(60.0, mode=None)
        assert car.summary.driving.watch.mode == expected


def test_by_rule_commands_that_are_followed_are_autonomous_and_others_are_manual() -> None:
    car = Car(driving__by_rule=1.0)
    car.drive(4.0, mode=None)
    car.drive(6.0, mode=None, command=None, speed=4.0)
    assert car.modes == ["autonomous", "manual"]
    assert car.kinds == ["to_manual"]
    car.drive(4.0, mode=None, command=None, speed=None)
    assert car.summary.driving.watch.mode == "unknown", "a speed that is not known follows nothing"


def test_a_clock_that_goes_back_invents_nothing() -> None:
    car = Car()
    car.drive(5.0)
    car.now_s -= 30.0
    car.drive(5.0)
    assert car.kinds == []
    assert set(car.modes) <= {"autonomous", "unknown"}


def test_a_mode_that_holds_is_not_believed_once_the_link_is_lost() -> None:
    car = Car(driving__holds_s=3600.0)
    car.drive(5.0)
    car.drive(60.0, mode=None)
    assert car.modes == ["autonomous"], "it is reported once, and holds"
    car.state.link(LinkFacts(phase="lost", published=frozenset({"speed", "brake"})))
    for _ in range(20):
        car.now_s += STEP_S
        car.summary.step(car.state.snapshot(car.now_s), car.limits, lambda: car.active)
    assert car.modes == ["autonomous", "unknown"]


def test_by_rule_a_car_that_stands_without_commands_is_not_known_to_be_autonomous() -> None:
    car = Car(driving__by_rule=1.0)
    car.drive(10.0, mode=None)
    car.drive(5.0, mode=None, speed=0.0, command=0.0)
    assert car.modes == ["autonomous"], "it waits at a crossing"
    car.drive(10.0, mode=None, speed=0.0, command=None)
    assert car.modes == ["autonomous", "unknown"]


# -- flickering ------------------------------------------------------------------------------------------------------

REPORTED: dict[Mode, DriveMode] = {
    mode: DriveMode(mode=mode, text=mode) for mode in ("autonomous", "manual", "unknown")
}


def runs() -> st.SearchStrategy[list[tuple[Mode, float]]]:
    """Modes, each reported for a while."""
    return st.lists(
        st.tuples(st.sampled_from(["autonomous", "manual", "unknown"]), st.floats(0.02, 4.0)), min_size=1, max_size=40
    )


def reported(periods: Iterable[tuple[Mode, float]]) -> Iterator[tuple[float, Mode]]:
    at_s = 0.0
    for mode, for_s in periods:
        end_s = at_s + for_s
        while at_s < end_s:
            yield at_s, mode
            at_s += 0.02


@given(runs())
@example([("autonomous", 3.0), *[("manual", 0.2), ("autonomous", 0.2)] * 20])
@example([("manual", 0.5), ("autonomous", 0.5)] * 20)
@settings(max_examples=60, deadline=None)
def test_whatever_the_topic_reports_changes_are_bounded_ordered_and_counted(periods: list[tuple[Mode, float]]) -> None:
    summary, state, tick_s = DrivingSummary(), State(), 0.0
    state.link(LinkFacts(phase="monitoring"))
    spoken: list[Mode] = []
    for at_s, mode in reported(periods):
        state.receive("mode", REPORTED[mode], at_s)
        state.receive("speed", Twist(speed_mps=5.0), at_s)
        spoken.append(mode)
        while tick_s <= at_s:
            summary.step(state.snapshot(at_s), LIMITS)
            tick_s += STEP_S
    summary.step(state.snapshot(at_s), LIMITS)
    for tick in range(100):  # it goes on to say the last
        late_s = at_s + (tick + 1) * STEP_S
        state.receive("mode", REPORTED[mode], late_s)
        state.receive("speed", Twist(speed_mps=5.0), late_s)
        summary.step(state.snapshot(late_s), LIMITS)
    watch, changes = summary.driving.watch, summary.changes
    real = sum(one != other for one, other in itertools.pairwise(["unknown", *spoken]))
    assert watch.changes_received == real, "each real change is counted"
    assert watch.mode == mode, "what stands is believed in the end"
    for one, other in itertools.pairwise(changes):
        assert other.before == one.mode
        assert other.at_s >= one.at_s - FLICKERS_WITHIN_S
    length_s = at_s + 5.0
    assert len(changes) <= 2 + (FLICKERS + 2) * (1 + length_s / FLICKERS_WITHIN_S)
    assert len(summary.interventions) <= 1 + length_s / 3.0
    assert sum(summary.driving.time_s.values()) == pytest.approx(length_s, abs=0.2)
    assert min(*summary.driving.time_s.values(), *summary.driving.way_m.values()) >= -1e-6


def test_a_mode_that_flickers_is_unknown_and_reported_twice_however_long_it_does() -> None:
    for turns in (10, 100):
        car = Car()
        car.drive(5.0)
        for _ in range(turns):
            car.drive(0.2, mode="manual")
            car.drive(0.2)
        car.drive(SETTLE_S + 1.0)
        assert car.modes == ["autonomous", "unknown", "autonomous"]
        assert car.kinds == []
        assert car.summary.changes[-1].flickers == 2 * turns
        assert CONFIRM_S > 0.2


def test_a_take_over_at_the_end_of_a_flicker_is_found() -> None:
    car = Car()
    car.drive(5.0)
    for _ in range(5):
        car.drive(0.1, mode="manual")
        car.drive(0.1)
    began_s = car.now_s + STEP_S
    car.drive(4.0, mode="manual")
    (one,) = car.summary.interventions
    assert one.at_s == pytest.approx(began_s, abs=0.06)


def test_a_link_that_stalls_confirms_no_mode_of_a_flicker() -> None:
    car = Car()
    car.drive(5.0)
    car.drive(0.1, mode="manual")
    car.drive(0.8, mode=None)
    car.drive(3.0)
    assert car.modes == ["autonomous"]
    assert car.kinds == []


def test_a_snapshot_is_enough_to_begin_with() -> None:
    found: Any = DrivingSummary()
    found.step(Snapshot(now_s=0.0), LIMITS)
    assert found.as_json()["modes"]["unknown"] == {"s": 0.0, "m": 0.0}
