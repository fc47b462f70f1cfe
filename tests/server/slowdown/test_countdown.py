"""The count-down before a rule slows the car: when it begins, when it is over, and who stops it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.alarm import Alarm, Refused
from monitor.catalog import CHECKS
from monitor.check import fault
from monitor.checks.slow_down import SlowDownLimits
from monitor.triggers import COUNTDOWN_S
from server.slowdown.countdown import Countdown

QUIET = {check.id: Alarm(id=check.id, spec=check.alarm) for check in CHECKS}
ON = SlowDownLimits(on_speed=1.0, on_speed_after_s=2.0, on_reach=1.0, on_reach_after_s=2.0)


def at_fault(*names: str) -> dict[str, Alarm]:
    faulty = {name: replace(QUIET[name], condition=True, finding=fault(f"{name} is bad")) for name in names}
    return QUIET | faulty


class Car:
    """A count-down with its log; `look` returns the rule that slows the car now."""

    def __init__(self) -> None:
        self.log: list[dict[str, Any]] = []
        self.countdown = Countdown(self._note)

    def _note(self, change: str, text: str, *, by: str | None = None, **more: Any) -> None:
        self.log.append({"change": change, "text": text, "by": by} | more)

    def look(self, now_s: float, *names: str, can_begin: bool = True) -> str | None:
        due = self.countdown.look(at_fault(*names), ON, now_s, can_begin=can_begin)
        return None if due is None else due.trigger.id


def counting() -> Car:
    """The speed is too high since 10 s, so it counts down since 12 s."""
    car = Car()
    assert [car.look(now_s, "speed_limit") for now_s in (10.0, 12.0)] == [None, None]
    return car


def test_it_announces_what_will_happen_and_slows_the_car_when_it_is_over() -> None:
    car = counting()
    assert car.log == [
        {
            "change": "slow_down",
            "text": "The car is slowed in 2 s unless somebody vetoes: Speed above limit. speed_limit is bad",
            "by": None,
            "step": "countdown",
            "trigger": "speed",
        }
    ]
    shown = {"trigger": "speed", "title": "Speed above limit", "text": "speed_limit is bad"}
    assert car.countdown.frame(12.26) == shown | {"left_s": 1.7}
    assert car.countdown.frame(15.0) == shown | {"left_s": 0.0}
    assert car.look(12.0 + COUNTDOWN_S - 0.01, "speed_limit") is None
    assert car.look(12.0 + COUNTDOWN_S, "speed_limit") == "speed"
    assert len(car.log) == 1


def test_it_ends_with_the_fault_and_begins_anew_with_another() -> None:
    car = counting()
    assert car.look(12.5) is None
    assert car.log[1:] == [
        {
            "change": "slow_down",
            "text": "Countdown ended: Speed above limit is over.",
            "by": None,
            "step": "over",
        }
    ]
    assert car.countdown.frame(12.5) is None
    car = counting()
    assert [car.look(now_s, "reach") for now_s in (12.1, 14.1)] == [None, None]  # the speed's is over, its own begins
    assert [event["step"] for event in car.log] == ["countdown", "over", "countdown"]
    assert car.look(14.1 + COUNTDOWN_S, "reach") == "reach"


def test_a_rule_that_comes_before_it_takes_nothing_from_its_time() -> None:
    car = Car()
    assert [car.look(now_s, "reach") for now_s in (10.0, 12.0)] == [None, None]
    assert [car.look(now_s, "reach", "speed_limit") for now_s in (12.0, 13.9, 14.0)] == [None, None, "reach"]
    assert [event["step"] for event in car.log] == ["countdown"]


def test_where_no_order_can_begin_nothing_counts_down() -> None:
    car = counting()
    assert car.look(13.0, "speed_limit", can_begin=False) is None
    assert car.countdown.frame(13.0) is None
    assert car.look(13.5, "speed_limit") is None  # it begins anew, and counts from now
    assert car.look(13.5 + COUNTDOWN_S - 0.01, "speed_limit") is None
    assert car.look(13.5 + COUNTDOWN_S, "speed_limit") == "speed"


def test_a_veto_holds_until_the_fault_has_gone() -> None:
    car = counting()
    for wrong in ("reach", ""):
        with pytest.raises(Refused) as refused:
            car.countdown.veto(wrong, by="Ann")
        assert refused.value.reason == "This countdown is no longer running."
    car.countdown.veto("speed", by="Ann")
    assert car.log[1:] == [
        {
            "change": "slow_down",
            "text": "Vetoed: Speed above limit.",
            "by": "Ann",
            "step": "vetoed",
            "trigger": "speed",
        }
    ]
    assert [car.look(now_s, "speed_limit") for now_s in (13.0, 20.0)] == [None, None]
    assert car.countdown.frame(20.0) is None
    with pytest.raises(Refused):
        car.countdown.veto("speed", by="Ann")


def test_stopped_it_counts_anew_and_forgotten_its_rules_do() -> None:
    car = counting()
    car.countdown.stop()
    assert car.countdown.frame(12.1) is None
    assert car.look(12.2, "speed_limit") is None
    assert car.countdown.frame(12.2) is not None
    car.countdown.forget()
    assert car.countdown.frame(12.3) is None
    assert car.look(12.4, "speed_limit") is None
    assert car.countdown.frame(12.4) is None  # the fault has to stand for its time again
