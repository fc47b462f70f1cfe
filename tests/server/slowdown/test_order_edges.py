"""The order and its ramp exactly at their limits, and each field of an order by itself."""

from __future__ import annotations

import math
from typing import Any

import pytest

from monitor.alarm import Refused
from server.slowdown.order import CAP_MPS2, DESERTED_S, Car, Command, Order, Ramp, SlowDown
from tests.server.slowdown.test_order import DRIVES, NO_WAY, WAY, begun


def refusal(act: Any, *arguments: Any, **more: Any) -> str:
    with pytest.raises(Refused) as refused:
        act(*arguments, **more)
    return refused.value.reason


def test_an_order_is_what_was_ordered() -> None:
    life = SlowDown(number=6)
    life.arm(WAY, "Ann")
    how: dict[str, Any] = {"by": "Ben", "why": "speed", "deceleration_mps2": 1.5, "now_s": 10.0, "pressed_s": 9.8}
    assert life.begin(WAY, **how) == Order(
        number=7, by="Ben", why="speed", ordered_s=10.0, pressed_s=9.8, deceleration_mps2=1.5
    )
    assert life.begin(WAY, **how | {"by": "Ann"}) is None
    assert life.order is not None
    assert life.order.by == "Ben"


def test_every_refusal_has_its_reason() -> None:
    life = SlowDown()
    how: dict[str, Any] = {"by": "Ann", "why": "by hand", "deceleration_mps2": 1.5, "now_s": 10.0, "pressed_s": None}
    assert refusal(life.arm, NO_WAY, "Ann") == "Slow-down is not available: No car is connected."
    assert refusal(life.begin, WAY, **how) == "Slow-down is not armed."
    assert refusal(life.release, 0) == "The car is not being slowed."
    life.arm(WAY, "Ann")
    assert refusal(life.begin, NO_WAY, **how) == "Slow-down is not available: No car is connected."
    begun(life)
    assert refusal(life.disarm) == "The car is being slowed: release it first."
    assert refusal(life.release, 2) == "A newer slow-down order was given meanwhile: check again."


def test_disarmed_is_not_armed() -> None:
    life = SlowDown()
    assert not life.disarm()
    life.arm(WAY, "Ann")
    assert life.disarm()
    assert (life.armed_by, life.state(WAY, 0.0)) == (None, "not_armed")


def test_it_holds_once_zero_is_commanded_and_goes_out() -> None:
    life = SlowDown()
    begun(life)
    for now_s, state in [(10.0, "ordered"), (13.9, "ordered"), (14.0, "holding")]:
        command = life.next(DRIVES, now_s)
        assert command is not None
        life.sent(command, now_s)
        assert life.state(WAY, now_s) == state
    life.cut()
    assert life.state(WAY, 14.1) == "ordered"  # zero was commanded, but nothing goes out now


def test_moments_of_sending_are_of_the_first_and_of_the_newest_unbroken_row() -> None:
    life = SlowDown()
    begun(life)
    order = life.order
    assert order is not None
    assert not life.cut()  # nothing went out yet
    seen = []
    for now_s, speed_mps in [(10.0, 6.0), (10.1, 5.9), (None, 0.0), (20.0, 3.0)]:
        if now_s is None:
            assert life.cut()
            assert order.sending_s is None
            continue
        command = life.next(Car(speed_mps=speed_mps, tyre_rad=0.1), now_s)
        assert command is not None
        first = life.sent(command, now_s)
        assert order.last == command
        seen.append((first, order.first_sent_s, order.sending_s, order.from_mps, order.ramp and order.ramp.began_s))
    assert seen == [(True, 10.0, 10.0, 6.0, 10.0), (False, 10.0, 10.0, 6.0, 10.0), (False, 10.0, 20.0, 6.0, 20.0)]


def test_a_ramp_that_never_went_out_begins_anew() -> None:
    life = SlowDown()
    begun(life)
    life.next(DRIVES, 10.0)
    assert not life.cut()
    assert life.next(Car(speed_mps=5.0, tyre_rad=0.2), 12.0) == Command(speed_mps=5.0, tyre_rad=0.2)
    life.end("released", 13.0)
    assert life.next(DRIVES, 13.0) is None
    assert not life.cut()


def test_it_is_confirmed_once() -> None:
    life = SlowDown()
    assert not life.confirm(9.0)
    begun(life)
    assert life.confirm(11.0)
    assert not life.confirm(12.0)
    assert life.order is not None
    assert life.order.slows_s == 11.0


def test_no_order_is_too_long_and_only_another_car_disarms() -> None:
    life = SlowDown()
    assert not life.is_too_long(0.0, 1e9)
    assert life.end("longest", 5.0) is None
    assert life.ended_at_longest_s == 5.0
    begun(life, 20.0)
    order = life.order
    assert life.end("released", 30.0) is order
    assert (life.armed_by, life.ended_at_longest_s) == ("Ann", None)
    life.end("longest", 31.0)
    life.end("disconnected", 32.0)
    assert (life.armed_by, life.ended_at_longest_s) == (None, None)


@pytest.mark.parametrize(
    ("contacts_s", "now_s", "keeps", "is_deserted"),
    [
        ([100.0], 100.0 + DESERTED_S - 0.01, False, False),
        ([100.0], 100.0 + DESERTED_S, False, True),
        ([100.0], 200.0, True, False),
        ([100.0, 50.0], 100.0 + DESERTED_S - 0.01, False, False),  # the newest counts
        ([50.0, 100.0], 100.0 + DESERTED_S - 0.01, False, False),
        ([None], 1000.0, False, False),  # armed by a program, with no page about
    ],
)
def test_armed_with_nobody_about(contacts_s: list[float | None], now_s: float, keeps: bool, is_deserted: bool) -> None:
    life = SlowDown()
    life.arm(WAY, "Ann")
    for heard_s in contacts_s:
        assert not life.is_deserted(heard_s, heard_s or 0.0, keeps=keeps)
    assert life.is_deserted(None, now_s, keeps=keeps) is is_deserted


def test_an_order_is_never_deserted_and_arming_anew_forgets_who_was_here() -> None:
    life = SlowDown()
    begun(life)
    life.is_deserted(100.0, 100.0, keeps=False)
    assert not life.is_deserted(None, 1000.0, keeps=False)
    life.end("released", 1000.0)
    assert life.is_deserted(None, 1000.0, keeps=False)
    life.disarm()
    assert not life.is_deserted(None, 1001.0, keeps=False)
    life.arm(WAY, "Ann")
    assert not life.is_deserted(None, 2000.0, keeps=False)


@pytest.mark.parametrize(
    ("from_mps", "after_s", "speed_mps"),
    [
        (6.0, -1.0, 6.0),
        (6.0, 0.0, 6.0),
        (6.0, 1.0, 4.5),
        (-6.0, 1.0, -4.5),
        (6.0, 4.0, 0.0),
        (6.0, 99.0, 0.0),
        (0.0, 0.0, 0.0),
    ],
)
def test_a_ramp_at_a_moment(from_mps: float, after_s: float, speed_mps: float) -> None:
    ramp = Ramp(from_mps=from_mps, tyre_rad=0.1, deceleration_mps2=1.5, began_s=100.0)
    assert ramp.speed_mps(100.0 + after_s) == speed_mps
    assert math.copysign(1.0, ramp.speed_mps(1000.0)) == 1.0  # not a negative zero


def test_a_ramp_brakes_as_hard_as_the_car_and_no_harder() -> None:
    good: dict[str, float] = {"from_mps": 1.0, "tyre_rad": 0.0, "began_s": 0.0}
    Ramp(**good, deceleration_mps2=CAP_MPS2)
    for deceleration_mps2 in (0.0, -1.0, math.nextafter(CAP_MPS2, 9.0)):
        with pytest.raises(ValueError, match=r"^A deceleration is above 0 and at most 4\.6 m/s²\.$"):
            Ramp(**good, deceleration_mps2=deceleration_mps2)
    with pytest.raises(ValueError, match=r"^A ramp needs a start speed and a tyre angle\.$"):
        Ramp(**good | {"tyre_rad": math.inf}, deceleration_mps2=1.0)
