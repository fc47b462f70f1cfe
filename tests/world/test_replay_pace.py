"""A replay at another rate has stamps of another pace, and no clock that jumps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import takewhile
from typing import Any

import pytest

from monitor.alarm import Transition
from monitor.car_clock import StampFollower
from server.cli.replay import Rounds
from server.judge.drive import Drive
from server.judge.message import Message
from server.judge.offline import Observer, OfflineRun
from server.judge.recorded_events import RecordedEvents
from server.recording.read.read import TopicInfo
from server.rosbridge_server.player import moved
from server.simulator.car import SimulatedCar

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


ROUND_S = 40.0
FRESH_S, OLD_S = 600.0, 5 * 365 * 86_400.0  # how long ago it was recorded
HORIZON_S = 20.0  # of watching it again and again


@cache
def drive_of(began_s: float) -> tuple[Message, ...]:
    car = SimulatedCar(seed=3, start_s=began_s)
    return tuple(takewhile(lambda _: car.elapsed_s < ROUND_S, car.messages()))


class Watched:
    """What a session receives of a replay, as a recording of its own: judged in virtual time."""

    ros_version = 1
    duration_s = 0.0
    damage: tuple[str, ...] = ()

    def __init__(self, recorded: Sequence[Message], *, rate: float, start_s: float, rounds: int, now_s: float) -> None:
        self.start_s = now_s
        self.topics = {one.topic: TopicInfo(type=one.type, count=1, definition=None) for one in recorded}
        self.notes: list[str] = []
        self.rejected: dict[str, int] = {}
        self.why_rejected: dict[str, str] = {}
        self.metadata: dict[str, str] = {}
        self._recorded = [one for one in recorded if one.at_s >= recorded[0].at_s + start_s]
        self._rate, self._rounds = rate, rounds

    def own(self, topic: str) -> Iterator[Any]:
        return iter(())

    def rows(self, start_s: float, topics: Any) -> Iterator[Any]:
        rounds, began_s = Rounds(self._rate), 0.0
        for _ in range(self._rounds):
            at_s = 0.0
            for one in rounds.next(iter(self._recorded), began_s):
                at_s = began_s + (one.at_s - self._recorded[0].at_s) / self._rate
                yield self.start_s + at_s, one.topic, one.type, one.message
            began_s = at_s + 0.05


@pytest.mark.field
@pytest.mark.parametrize("is_fresh", [True, False])
@pytest.mark.parametrize(("rate", "start_s"), [(1.0, 0.0), (1.0, 25.0), (0.5, 20.0), (4.0, 0.0), (4.0, 30.0)])
def test_a_replay_again_and_again_has_no_clock_that_jumps_and_no_negative_age(
    rate: float, start_s: float, is_fresh: bool
) -> None:
    now_s = 1.8e9
    recorded = drive_of(now_s - (FRESH_S if is_fresh else OLD_S))
    rounds = max(3, round(HORIZON_S / ((ROUND_S - start_s) / rate)))
    watched: Any = Watched(recorded, rate=rate, start_s=start_s, rounds=rounds, now_s=now_s)
    ages: list[float] = []
    raised: set[str] = set()

    class Ages(Observer):
        def judged(self, transitions: Sequence[Transition], now_s: float) -> None:
            raised.update(one.alarm_id for one in transitions if one.change == "raised")

        def ticked(self, run: OfflineRun, now_s: float) -> None:
            ages.extend(reading.age_s(now_s) for reading in run.run_state.state.snapshot(now_s).readings.values())

    run = OfflineRun(watched, Drive(watched, RecordedEvents()), opens_with_message=True, observer=Ages())
    run.advance(math.inf, to_last_message=True)
    assert min(ages) >= 0.0
    assert len(ages) > 1000
    assert "clock_jump" not in raised, raised
    if not is_fresh:  # else the car's clock is reported as 10 min behind, which is true
        assert not [alarm for alarm in raised if "clock" in alarm], raised


def test_all_stamps_of_a_message_move_and_nothing_else() -> None:
    header = {"seq": 5, "stamp": {"secs": 100, "nsecs": 900_000_000}, "frame_id": "map"}
    numbers = [1.0, 2.0]
    message = {
        "transforms": [{"header": header, "x": 1.0}, {"header": header | {"stamp": {"secs": 0, "nsecs": 0}}, "x": 2.0}],
        "duration": {"secs": 5, "nsecs": 0},
        "numbers": numbers,
    }
    later = moved(message, 0.25)
    assert later["transforms"][0]["header"] == header | {"stamp": {"secs": 101, "nsecs": 150_000_000}}
    assert later["transforms"][1] == message["transforms"][1], "no stamp at all"
    assert (later["duration"], later["numbers"]) == (message["duration"], numbers)
    assert header["stamp"] == {"secs": 100, "nsecs": 900_000_000}, "the recorded message is as it was"
    assert moved({"stamp": {"sec": 7, "nanosec": 5}}, 60.0) == {"stamp": {"sec": 67, "nanosec": 5}}
    for same in (
        {"numbers": numbers},
        {"stamp": "text"},
        {"stamp": {"sec": 2**31 - 1, "nanosec": 0}},
        {"stamp": {"sec": True, "other": 1}},
        {"list": [1, {"stamp": {"sec": 1, "nanosec": 1}}]},
    ):
        assert moved(same, 5.0) is same
    assert moved(message, 0.0) is message
