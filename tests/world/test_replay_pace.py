"""A replay at another rate has stamps of another pace, and no clock that jumps."""

from __future__ import annotations

import pytest

from monitor.stamps import StampFollower

pytestmark = pytest.mark.world(n=10)


@pytest.mark.parametrize("rate", [0.25, 0.5, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("hz", [10.0, 20.0, 75.0])
def test_stamps_of_another_pace_are_no_jump(rate: float, hz: float) -> None:
    follower = StampFollower()
    assert not [n for n in range(2000) if follower.receive(1e9 + n / hz, n / hz / rate) is not None]


def test_a_real_jump_is_still_found() -> None:
    follower = StampFollower()
    found = [follower.receive(1e9 + n / 20 + (n > 400) * 3.0, n / 20) for n in range(500)]
    assert [round(by_s, 2) for by_s in found if by_s is not None] == [3.0]
