"""What is made quickly is as good as what is made in the ordinary way."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, replace

import pytest

from monitor.quick import changer, maker
from monitor.state import Reading, Snapshot
from monitor.values import Twist


def test_a_value_made_quickly_equals_one_made_slowly() -> None:
    made = maker(Reading)(value=Twist(speed_mps=1.0), received_s=2.0, horizon_s=3.0, count=4)
    usual = Reading(value=Twist(speed_mps=1.0), received_s=2.0, horizon_s=3.0, count=4)
    assert type(made) is Reading
    assert made == usual
    assert hash(made) == hash(usual)
    assert repr(made) == repr(usual)
    assert copy.copy(made) == pickle.loads(pickle.dumps(made)) == usual
    assert replace(made, count=5) == replace(usual, count=5)
    assert made.is_fresh(4.0)


@pytest.mark.parametrize("name", ["speed_mps", "something_else"])
def test_it_is_frozen_all_the_same(name: str) -> None:
    made = maker(Twist)(speed_mps=1.0)
    with pytest.raises((FrozenInstanceError, AttributeError, TypeError)):
        setattr(made, name, 2.0)
    with pytest.raises(FrozenInstanceError):
        del made.speed_mps
    assert made == Twist(speed_mps=1.0)


def test_what_has_no_default_must_be_given() -> None:
    with pytest.raises(TypeError, match="horizon_s"):
        maker(Reading)(value=1, received_s=2.0)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="nonsense"):
        maker(Twist)(speed_mps=1.0, nonsense=2)  # type: ignore[call-arg]


def test_each_call_makes_a_value_of_its_own() -> None:
    @dataclass(frozen=True, slots=True, kw_only=True)
    class Pair:
        left: int
        right: list[int] = field(default_factory=list)

    make = maker(Pair)
    one, other = make(left=1), make(left=2)
    one.right.append(1)
    assert (one.left, one.right, other.left, other.right) == (1, [1], 2, [])
    assert maker(Snapshot)(now_s=1.0) == Snapshot(now_s=1.0)


def test_what_is_changed_quickly_equals_what_is_replaced() -> None:
    reading = Reading(value=Twist(speed_mps=1.0), received_s=2.0, horizon_s=3.0, count=4)
    change = changer(Reading)
    assert change(reading) == reading
    assert change(reading, count=5, stamp_s=None) == replace(reading, count=5, stamp_s=None)
    assert type(change(reading)) is Reading
    assert reading.count == 4
    with pytest.raises(TypeError, match="nonsense"):
        change(reading, nonsense=1)
    with pytest.raises(FrozenInstanceError):
        change(reading).count = 6  # type: ignore[misc]
