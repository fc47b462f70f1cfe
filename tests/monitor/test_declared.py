"""Messages that declare a value as not measured, between others that have a value or are wrong."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.catalog import AllLimits, changed
from monitor.runner import Monitor
from monitor.signals import SIGNALS
from monitor.state import State
from monitor.values import Acceleration, Heading, Level, Odometry, Twist, Value
from tests.monitor.drive import REAL_HZ, Drive

NOT_MEASURED = "not measured (present is false)"
LOW = Level(value=3.0, unit="%")


def test_a_second_battery_that_is_absent_does_not_hide_that_the_first_is_low() -> None:
    car = Drive()
    car.link = replace(car.link, published=frozenset({*REAL_HZ, "fuel"}))
    car.open()
    for second in range(1, 12):
        car.send("fuel", LOW)
        car.to(second - 1.0 + 0.002)
        car.state.refuse("fuel", NOT_MEASURED, car.now_s, is_declared=True)
        car.to(second - 0.1)
        assert car.monitor.findings["fuel_low"].verdict == "fault"
        car.to(float(second))
    assert "fuel_low" in car.announced


@pytest.mark.parametrize(
    ("signal", "value"),
    [("heading", Heading(heading_deg=10.0)), ("acceleration", Acceleration(acceleration_mps2=0.2, source="topic"))],
)
def test_two_sensors_on_one_topic_do_not_take_turns_with_what_is_derived(signal: str, value: Value) -> None:
    state = State()
    for number in range(200):
        at_s = number / 20
        state.receive(signal, value, at_s)
        state.refuse(signal, "not measured (covariance[0] is -1)", at_s + 0.002, is_declared=True)
        move(state, at_s + 0.004)
        reading = state.get(signal)
        assert reading is not None
        assert (reading.value, reading.derived_from) == (value, None)
    for number in range(200, 460):  # the one that measures has gone, the other declares that it does not
        state.refuse(signal, "not measured (covariance[0] is -1)", number / 20, is_declared=True)
        move(state, number / 20)
    reading = state.get(signal)
    assert reading is not None
    assert reading.derived_from == {"heading": "odometry", "acceleration": "speed"}[signal]


def move(state: State, at_s: float) -> None:
    state.receive("speed", Twist(speed_mps=1.0 + 0.1 * at_s), at_s)
    state.receive("odometry", Odometry(x_m=at_s, y_m=0.0, yaw_rad=0.01 * at_s, frame_id="map"), at_s)


def test_wrong_messages_between_declared_ones_are_counted_on() -> None:
    car = Drive().open()
    car.silent = {"brake"}
    car.to(5.0)
    for number in range(60):
        car.state.refuse("brake", "data is not a number", car.now_s)
        car.state.refuse("brake", NOT_MEASURED, car.now_s + 0.001, is_declared=True)
        car.to(5.0 + (number + 1) / 20)
    assert "signal_unusable.brake" in car.announced
    assert car.monitor.findings["signal_unusable.brake"].text.startswith("Brake: not a number (data), ")
    for _ in range(60):
        car.state.refuse("brake", NOT_MEASURED, car.now_s, is_declared=True)
        car.to(car.now_s + 0.05)
    assert car.monitor.findings["signal_unusable.brake"].verdict == "ok"  # the wrong ones have ended


@pytest.mark.parametrize(
    ("signal", "hz", "is_declared", "verdict"),
    [
        ("brake", 0.0, True, "fault"),
        ("brake", 0.0, False, "fault"),
        ("heading", 0.0, True, "unknown"),
        ("heading", 5.0, True, "fault"),
        ("fuel", 0.0, True, "unknown"),
    ],
)
def test_what_came_without_a_value_and_then_no_more_is_not_called_never_received(
    signal: str, hz: float, is_declared: bool, verdict: str
) -> None:
    car = Drive(monitor=Monitor(limits=changed(AllLimits(), {f"signals.{signal}_hz": hz})))
    car.link = replace(car.link, published=frozenset({*REAL_HZ, signal}))
    car.silent = {signal, "odometry"}
    car.open()
    for number in range(60):
        car.state.refuse(signal, NOT_MEASURED, number / 20, is_declared=is_declared)
        car.to((number + 1) / 20)
    car.to(23.0)
    finding = car.monitor.findings[f"signal_stale.{signal}"]
    label = SIGNALS[signal].label
    assert (finding.verdict, finding.text) == (verdict, f"{label}: {NOT_MEASURED}, then no message for 20 s")


def test_a_single_wrong_message_between_declared_ones_is_no_fault() -> None:
    car = Drive().open()
    car.silent = {"brake"}
    car.to(5.0)
    for number in range(100):
        car.state.refuse("brake", NOT_MEASURED, car.now_s, is_declared=number % 60 != 30)
        car.to(5.0 + (number + 1) / 20)
    assert not [one for one in car.announced if "brake" in one]
