"""Each effect on its own, over messages as recordings have them: other types, lists with nulls, missing fields."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from server.judge.message import Message
from server.simulator.effects import (
    BlindLaser,
    BothPedals,
    ComponentReport,
    Effect,
    FrozenSpeed,
    GpsOffset,
    IgnoredCommand,
    ObstacleAhead,
    Silence,
    SlowRate,
    Speeding,
)
from server.simulator.faults import FrozenPosition, FrozenScan, NearObject, NoFix, OtherClock, TruncatedScan
from server.simulator.scenarios import SCENARIOS, inject, planned

EVERY_EFFECT: list[Callable[[], Effect]] = [
    scenario.effect for scenario in SCENARIOS.values() if scenario.effect is not None
]
SIGNALS = (
    "speed",
    "brake",
    "accelerator",
    "position",
    "odometry",
    "scan",
    "distance",
    "bearing",
    "diagnostics",
    "command",
    None,
)

SPEED_SHAPES: list[Callable[[float], dict[str, Any]]] = [
    lambda speed: {"linear": {"x": speed, "y": 0.0, "z": 0.0}, "angular": {"z": 0.3}},
    lambda speed: {"header": {"seq": 1}, "twist": {"linear": {"x": speed}, "angular": {"z": 0.3}}},
    lambda speed: {"pose": {}, "twist": {"twist": {"linear": {"x": speed}}, "covariance": [0.0]}},
    lambda speed: {"data": speed},
]


def message(fields: dict[str, Any], at_s: float = 0.0) -> Message:
    return Message(at_s=at_s, topic="/some/topic", type="some_msgs/Type", message=fields)


def apply(effect: Effect, signal: str | None, fields: dict[str, Any], at_s: float = 0.0) -> dict[str, Any]:
    (made,) = effect.apply(message(fields, at_s), signal)
    assert (made.at_s, made.topic, made.type) == (at_s, "/some/topic", "some_msgs/Type")
    return dict(made.message)


def fix(lat_deg: float, lon_deg: float) -> dict[str, Any]:
    return {"latitude": lat_deg, "longitude": lon_deg, "altitude": 700.0}


def offset_m(fields: dict[str, Any], lat_deg: float, lon_deg: float) -> float:
    east_m = (fields["longitude"] - lon_deg) * 111_320 * math.cos(math.radians(lat_deg))
    return math.hypot(east_m, (fields["latitude"] - lat_deg) * 110_900)


@pytest.mark.parametrize("make", EVERY_EFFECT)
@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"data": None},
        {"data": math.nan},
        {"linear": None},
        {"linear": {"x": "fast"}},
        {"force": {"x": None}},
        {"latitude": None, "longitude": math.nan},
        {"ranges": None, "angle_min": None},
        {"ranges": [], "angle_min": 0.0, "angle_increment": 0.1},
        {"ranges": [None, 1.0, math.inf], "angle_min": None, "angle_increment": 0.1},
        {"status": None},
        {"status": [None, 3]},
        {"pose": {"pose": {"position": {"x": 1.0}}}},
    ],
    ids=str,
)
def test_odd_messages_harm_no_effect(make: Callable[[], Effect], fields: dict[str, Any]) -> None:
    before = repr(fields)
    for signal in SIGNALS:
        effect = make()
        for at_s in (0.0, 1.0, math.nextafter(1.0, 0.0), 5.0):  # once a little backward
            for made in effect.apply(message(fields, at_s), signal):
                assert made.at_s == at_s
        effect.end()
        effect.apply(message(fields, 6.0), signal)
    assert repr(fields) == before


@pytest.mark.parametrize("shape", SPEED_SHAPES)
def test_speeding_climbs_smoothly_above_the_limit_and_back(shape: Callable[[float], dict[str, Any]]) -> None:
    def speed_at(at_s: float) -> float:
        fields: Any = apply(effect, "speed", shape(3.0), at_s)
        for name in ("twist", "twist", "linear", "x", "data"):
            if isinstance(fields, dict) and name in fields:
                fields = fields[name]
        return float(fields)

    effect = Speeding()
    climb = [speed_at(tick / 20) for tick in range(200)]
    assert climb[0] == 3.0
    assert np.diff(climb).max() == pytest.approx(0.1)
    assert climb[-1] == pytest.approx(Speeding.REACHED_MPS)
    effect.end()
    assert not effect.is_over
    descent = [speed_at(10 + tick / 20) for tick in range(200)]
    assert np.diff(descent).min() == pytest.approx(-0.1)
    assert descent[-1] == 3.0
    assert effect.is_over


def test_silence_is_of_the_signals_named_or_of_all() -> None:
    one, all_of_them = Silence("position"), Silence()
    assert list(one.apply(message({}), "position")) == []
    assert len(one.apply(message({}), "odometry")) == 1
    assert len(one.apply(message({}), None)) == 1
    assert list(all_of_them.apply(message({}), "speed")) == []
    assert list(all_of_them.apply(message({}), None)) == []


def test_the_slow_rate_is_half_the_rate_of_its_signal_only() -> None:
    effect = SlowRate("speed")
    assert sum(len(effect.apply(message({}), "speed")) for _ in range(40)) == 20
    assert sum(len(effect.apply(message({}), "brake")) for _ in range(40)) == 40


@pytest.mark.parametrize("shape", SPEED_SHAPES)
def test_a_frozen_speed_repeats_the_first_one_in_motion(shape: Callable[[float], dict[str, Any]]) -> None:
    effect = FrozenSpeed()
    assert apply(effect, "speed", shape(0.0)) == shape(0.0)
    assert apply(effect, "speed", shape(0.4)) == shape(0.4)
    assert apply(effect, "speed", shape(2.0)) == shape(2.0)
    assert apply(effect, "speed", shape(3.0)) == shape(2.0)
    assert apply(effect, "speed", shape(0.0)) == shape(2.0)
    assert apply(effect, "brake", {"data": 4.0}) == {"data": 4.0}


@pytest.mark.parametrize(
    "shape", [lambda percent: {"force": {"x": percent}, "torque": {}}, lambda percent: {"data": percent}]
)
def test_both_pedals_are_down_by_whole_steps(shape: Callable[[float], dict[str, Any]]) -> None:
    effect = BothPedals()
    assert apply(effect, "brake", shape(0.0)) == shape(31 * 100 / 255)
    assert apply(effect, "accelerator", shape(0.0)) == shape(46 * 100 / 255)
    assert apply(effect, "brake", shape(60.0)) == shape(60.0)
    assert apply(effect, "steering", shape(0.0)) == shape(0.0)


def offsets(effect: GpsOffset, speeds: Iterable[float], began_s: float = 0.0) -> list[float]:
    """The offset at 10 Hz for a car with these speeds."""
    found = []
    for tick, speed in enumerate(speeds):
        at_s = began_s + tick / 10
        effect.apply(message({"data": speed}, at_s), "speed")
        found.append(offset_m(apply(effect, "position", fix(32.23, -110.95), at_s), 32.23, -110.95))
    return found


def test_drift_waits_for_standstill_grows_and_goes_back_in_motion() -> None:
    effect = GpsOffset(pace_mps=2.0, most_m=10.0, during="standing", after_s=3.0, back_mps=1.0)
    assert max(offsets(effect, [5.0] * 20)) == 0.0
    standing = offsets(effect, [0.0] * 120, began_s=2.0)
    assert max(standing[:30]) == 0.0
    assert standing[60] == pytest.approx(6.2, abs=0.3)
    assert standing[-1] == pytest.approx(10.0, rel=0.01)
    effect.end()
    assert offsets(effect, [0.0] * 20, began_s=14.0)[-1] == pytest.approx(10.0, rel=0.01)
    assert not effect.is_over
    moving = offsets(effect, [3.0] * 120, began_s=16.0)
    assert moving[49] == pytest.approx(5.0, abs=0.3)
    assert moving[-1] == 0.0
    assert effect.is_over


def test_a_mismatch_grows_only_in_motion() -> None:
    effect = GpsOffset(pace_mps=2.0, most_m=60.0, during="moving", back_mps=2.0)
    assert max(offsets(effect, [0.0] * 50)) == 0.0
    assert offsets(effect, [4.0] * 101, began_s=5.0)[-1] == pytest.approx(20.0, abs=0.5)


def test_a_jump_runs_away_at_once_and_is_over_at_once() -> None:
    effect = GpsOffset(pace_mps=23.0, most_m=1000.0, during="always", back_mps=None)
    away = offsets(effect, [0.0] * 20)
    assert np.diff(away) == pytest.approx(2.3, rel=0.02)
    effect.end()
    assert effect.is_over


def test_the_odometry_moves_with_the_position() -> None:
    effect = GpsOffset(pace_mps=1.0, most_m=100.0, during="always", back_mps=None)
    offsets(effect, [1.0] * 51)
    given = {"pose": {"pose": {"position": {"x": 500.0, "y": 900.0, "z": 7.0}}}, "twist": {"linear": 1}}
    moved = apply(effect, "odometry", given, 5.0)
    position = moved["pose"]["pose"]["position"]
    assert math.hypot(position["x"] - 500.0, position["y"] - 900.0) == pytest.approx(5.0)
    assert position["z"] == 7.0
    assert moved["twist"] == {"linear": 1}
    assert given["pose"]["pose"]["position"]["x"] == 500.0


def test_a_gap_in_the_recording_is_no_leap_of_the_offset() -> None:
    effect = GpsOffset(pace_mps=2.0, most_m=100.0, during="always", back_mps=None)
    offsets(effect, [1.0] * 11)
    assert offsets(effect, [1.0], began_s=3600.0)[-1] <= 4.1


def test_a_blind_laser_sees_nothing_and_the_estimator_says_so() -> None:
    effect = BlindLaser()
    scan = {"ranges": [1.0, None, 3.0], "angle_min": -1.2, "angle_increment": 0.1, "range_max": 30.0}
    blind = apply(effect, "scan", scan)
    assert np.isposinf(blind["ranges"]).all()
    assert len(blind["ranges"]) == 3
    assert blind["angle_min"] == -1.2
    assert apply(effect, "distance", {"data": 4.0}) == {"data": 30.0}
    assert apply(effect, "bearing", {"data": 0.05}) == {"data": -1.2}


@pytest.mark.parametrize("sign", [1, -1], ids=["counter-clockwise", "clockwise"])
def test_an_obstacle_hides_what_is_behind_it_and_nothing_else(sign: int) -> None:
    increment = sign * math.radians(1)
    scan = {
        "ranges": [None] * 80 + [50.0] * 21 + [2.0] * 80,
        "angle_min": -90 * increment,
        "angle_increment": increment,
    }
    ranges = np.asarray(apply(ObstacleAhead(), "scan", scan)["ranges"], dtype=float)
    assert ranges[90] == pytest.approx(4.4)
    assert ranges[80:101] == pytest.approx(4.4 / np.cos(np.radians(np.arange(-10, 11))), rel=1e-6)
    assert ranges[79] == pytest.approx(4.4 / math.cos(math.radians(11)))  # a beam of unknown range ends there too
    assert np.isnan(ranges[:78]).all()
    assert (ranges[101:] == 2.0).all()  # what is nearer stays
    assert apply(ObstacleAhead(), "distance", {"data": 81.0}) == {"data": 4.4}
    assert apply(ObstacleAhead(), "distance", {"data": 1.5}) == {"data": 1.5}
    assert apply(ObstacleAhead(), "bearing", {"data": 0.08}) == {"data": 0.0}


def test_a_component_error_leaves_the_other_components() -> None:
    given = {"status": [{"level": 0, "name": "a", "message": "fine"}, {"level": 1, "name": "b", "message": "so so"}]}
    rows = apply(ComponentReport(2, "No data"), "diagnostics", given)["status"]
    assert [row["level"] for row in rows] == [2, 1]
    assert rows[0]["name"] == "a"
    assert rows[0]["message"] != "fine"
    assert given["status"][0]["level"] == 0


def test_a_component_error_where_there_is_no_component() -> None:
    rows = apply(ComponentReport(2, "No data"), "diagnostics", {"status": []})["status"]
    assert [row["level"] for row in rows] == [2]


def test_faults_are_laid_over_any_messages_for_their_time() -> None:
    stream = [
        Message(at_s=500 + tick / 10, topic=topic, type="t", message={"data": 4.0})
        for tick in range(200)
        for topic in ("/my/speed", "/my/gps", "/unknown")
    ]
    signal_of = {"/my/speed": "speed", "/my/gps": "position"}
    faults = (planned("all-silent@12+2"), planned("slow-rate@5+4"), planned("bridge-killed@1"))
    left = list(inject(stream, faults, lambda message: signal_of.get(message.topic)))

    def count(topic: str, from_s: float, to_s: float) -> int:
        return sum(message.topic == topic and 500 + from_s <= message.at_s < 500 + to_s - 1e-6 for message in left)

    assert count("/my/speed", 0, 5) == 50
    assert count("/my/speed", 5, 9) == 20
    assert count("/my/speed", 9, 12) == 30
    assert count("/unknown", 5, 12) == 70
    assert [count(topic, 12, 14) for topic in ("/my/speed", "/my/gps", "/unknown")] == [0, 0, 0]
    assert count("/unknown", 14, 20) == 60
    assert [message.at_s for message in left] == sorted(message.at_s for message in left)


def test_no_fault_changes_nothing() -> None:
    stream = [message({"data": 1.0}, tick / 10) for tick in range(20)]
    assert list(inject(stream, (), lambda message: "speed")) == stream


def stamped(stamp: dict[str, Any], **fields: Any) -> dict[str, Any]:
    return {"header": {"seq": 7, "stamp": stamp, "frame_id": "/odom"}, **fields}


@pytest.mark.parametrize(
    ("given", "moved"),
    [
        ({"secs": 1000, "nsecs": 250_000_000}, {"secs": 970, "nsecs": 250_000_000}),
        ({"sec": 1000, "nanosec": 0}, {"sec": 970, "nanosec": 0}),
        ({"secs": 0, "nsecs": 0}, {"secs": 0, "nsecs": 0}),
        ({"secs": None, "nsecs": 0}, {"secs": None, "nsecs": 0}),
        ({}, {}),
    ],
    ids=["ROS 1", "ROS 2", "not given", "null", "empty"],
)
def test_a_clock_set_back_moves_the_stamps_that_are_given(given: dict[str, Any], moved: dict[str, Any]) -> None:
    effect = OtherClock(step_s=-30.0)
    made = apply(effect, "position", stamped(given, latitude=1.0))
    assert (made["header"]["stamp"], made["header"]["frame_id"], made["latitude"]) == (moved, "/odom", 1.0)
    effect.end()
    assert effect.is_over


def test_a_slow_clock_falls_behind_to_its_most_and_comes_back_as_slowly() -> None:
    effect = OtherClock(pace=-0.25, most_s=4.0)

    def behind_s(at_s: float) -> float:
        stamp = apply(effect, None, stamped({"secs": 1000, "nsecs": 0}), at_s)["header"]["stamp"]
        return float(1000 - stamp["secs"] - stamp["nsecs"] * 1e-9)

    assert behind_s(0.0) == 0.0
    assert behind_s(8.0) == pytest.approx(2.0)
    assert behind_s(30.0) == pytest.approx(4.0)
    effect.end()
    assert not effect.is_over
    assert behind_s(38.0) == pytest.approx(2.0)
    assert behind_s(50.0) == 0.0
    assert effect.is_over


def test_a_frozen_position_keeps_its_place_and_not_its_stamps() -> None:
    effect = FrozenPosition()
    first = apply(effect, "position", stamped({"secs": 1, "nsecs": 0}, **fix(32.0, -110.0)))
    later = apply(effect, "position", stamped({"secs": 2, "nsecs": 0}, **fix(32.1, -110.1)))
    assert (later["latitude"], later["longitude"]) == (first["latitude"], first["longitude"]) == (32.0, -110.0)
    assert later["header"]["stamp"]["secs"] == 2
    assert apply(effect, "odometry", {"data": 5.0}) == {"data": 5.0}


def test_a_frozen_scan_repeats_all_of_the_first() -> None:
    effect = FrozenScan()
    first = apply(effect, "scan", stamped({"secs": 1, "nsecs": 0}, ranges=[1.0, None]))
    assert apply(effect, "scan", stamped({"secs": 2, "nsecs": 0}, ranges=[2.0, 3.0])) == first


@pytest.mark.parametrize("ranges", [[1.0] * 181, np.ones(181, dtype=np.float32)], ids=["list", "array"])
def test_a_short_scan_lacks_beams_and_keeps_its_angles(ranges: Any) -> None:
    made = apply(TruncatedScan(), "scan", {"angle_min": -1.5, "ranges": ranges})
    assert (len(made["ranges"]), made["angle_min"]) == (171, -1.5)


def test_without_a_fix_the_coordinates_go_on() -> None:
    made = apply(NoFix(), "position", {"status": {"status": 0, "service": 1}, **fix(32.0, -110.0)})
    assert (made["status"]["status"], made["latitude"]) == (-1, 32.0)


def test_an_object_that_only_the_estimator_sees() -> None:
    effect = NearObject()
    assert apply(effect, "distance", {"data": 81.0}) == {"data": NearObject.AHEAD_M}
    assert apply(effect, "bearing", {"data": -1.5}) == {"data": 0.0}
    assert apply(effect, "scan", {"ranges": [5.0]}) == {"ranges": [5.0]}


def test_a_stop_is_ordered_only_in_motion_and_the_rest_of_the_command_stays() -> None:
    effect = IgnoredCommand()
    order = {"linear": {"x": 4.0}, "angular": {"z": None}}
    apply(effect, "speed", {"linear": {"x": 1.0}})
    assert apply(effect, "command", order) == order
    apply(effect, "speed", {"linear": {"x": 5.0}})
    assert apply(effect, "command", order) == {"linear": {"x": 0.0}, "angular": {"z": None}}


def test_every_topic_is_halved_by_itself() -> None:
    effect = SlowRate()
    topics = ["/a", "/b", "/b", "/a", "/b", "/b"]
    sent = [Message(at_s=0.0, topic=topic, type="t", message={}) for topic in topics]
    assert [len(effect.apply(one, None)) for one in sent] == [0, 0, 1, 1, 0, 1]
