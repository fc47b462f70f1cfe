"""The car's messages: the same for the same seed, at the real car's rates, in the shapes of ROS 1 and ROS 2."""

from __future__ import annotations

import math
from collections import Counter
from itertools import islice, takewhile
from typing import Any

import numpy as np
import orjson
import pytest

from server.judge.message import Message, RosVersion
from server.judge.sources.choice import choose
from server.rosbridge.codec import json_bytes
from server.simulator.car import START_S, SimulatedCar
from server.simulator.messages import PUBLISHED
from server.simulator.scenarios import planned

TYPES = {
    "/catvehicle/vel": "geometry_msgs/Twist",
    "/catvehicle/brake": "geometry_msgs/Wrench",
    "/catvehicle/accelerator": "geometry_msgs/Wrench",
    "/catvehicle/steering": "geometry_msgs/Wrench",
    "/catvehicle/cmd_vel": "geometry_msgs/Twist",
    "/DistanceEstimator/dist": "std_msgs/Float32",
    "/DistanceEstimator/angle": "std_msgs/Float32",
    "/gps_fix": "sensor_msgs/NavSatFix",
    "/gps_odom": "nav_msgs/Odometry",
    "/catvehicle/front_laser_points": "sensor_msgs/LaserScan",
    "/diagnostics": "diagnostic_msgs/DiagnosticArray",
    "/catvehicle/control_mode": "std_msgs/String",
}
RATES_HZ = {
    "/catvehicle/vel": 20, "/catvehicle/brake": 20, "/catvehicle/accelerator": 20, "/catvehicle/steering": 20,
    "/catvehicle/cmd_vel": 20, "/DistanceEstimator/dist": 75, "/DistanceEstimator/angle": 75, "/gps_fix": 10,
    "/gps_odom": 10, "/catvehicle/front_laser_points": 75, "/diagnostics": 1,
    "/catvehicle/control_mode": 20,
}  # fmt: skip


def drive(seconds: float, **options: Any) -> list[Message]:
    return list(takewhile(lambda message: message.at_s < START_S + seconds, SimulatedCar(**options).messages()))


def first(topic: str, ros_version: RosVersion = 1) -> Message:
    return next(message for message in SimulatedCar(ros_version=ros_version).messages() if message.topic == topic)


def written(messages: list[Message]) -> bytes:
    return b"\n".join(
        orjson.dumps((message.at_s, message.topic, message.type)) + json_bytes(message.message) for message in messages
    )


@pytest.mark.parametrize("options", [{}, {"ros_version": 2}, {"scan_beams": 300}], ids=str)
def test_the_same_seed_and_plan_give_the_same_bytes(options: dict[str, Any]) -> None:
    plan = (planned("obstacle@2+3"), planned("gps-jump@1+4"), planned("slow-rate@3"))
    one, two = (written(drive(8, seed=7, plan=plan, **options)) for _ in range(2))
    assert one == two
    assert written(drive(8, seed=8, plan=plan, **options)) != one


def test_a_scenario_changes_no_message_before_it_begins() -> None:
    healthy, faulty = drive(8, seed=3), drive(8, seed=3, plan=(planned("blind-laser@5"),))
    early = [message for message in healthy if message.at_s < START_S + 5]
    assert written(faulty[: len(early)]) == written(early)
    assert written(faulty) != written(healthy)


def test_every_signal_comes_at_the_real_cars_rate() -> None:
    messages = drive(60)
    counts = Counter(message.topic for message in messages)
    assert counts == {topic: rate * 60 for topic, rate in RATES_HZ.items()}
    for topic, rate in RATES_HZ.items():
        times = [message.at_s for message in messages if message.topic == topic]
        assert np.diff(times) == pytest.approx(1 / rate, abs=1e-5)


def test_a_dense_scan_leaves_the_other_rates_as_they_are() -> None:
    messages = drive(10, scan_beams=1440)
    counts = Counter(message.topic for message in messages)
    assert counts == {topic: rate * 10 for topic, rate in RATES_HZ.items()} | {"/catvehicle/front_laser_points": 200}
    scan = next(message.message for message in messages if message.topic == "/catvehicle/front_laser_points")
    assert len(scan["ranges"]) == 1440


def test_messages_come_in_the_order_of_time_and_are_stamped_shortly_before() -> None:
    messages = drive(5)
    times = [message.at_s for message in messages]
    assert times == sorted(times)
    for message in messages:
        if "header" in message.message:
            stamp = message.message["header"]["stamp"]
            assert 0 <= message.at_s - (stamp["secs"] + stamp["nsecs"] * 1e-9) < 0.05
            assert 0 <= stamp["nsecs"] < 1_000_000_000


@pytest.mark.parametrize("ros_version", [1, 2])
def test_topics_have_the_real_cars_names_and_types(ros_version: RosVersion) -> None:
    messages = drive(1.5, ros_version=ros_version)
    found = {message.topic: message.type for message in messages}
    assert found == {
        topic: name if ros_version == 1 else name.replace("/", "/msg/", 1) for topic, name in TYPES.items()
    }
    assert found == {published.topic: published.ros_type(ros_version) for published in PUBLISHED}


@pytest.mark.parametrize("ros_version", [1, 2])
def test_every_message_is_understood_as_the_signal_it_is_meant_for(ros_version: RosVersion) -> None:
    messages = drive(3, ros_version=ros_version)
    sources = {
        source.topic: source
        for source in choose({message.topic: message.type for message in messages}).sources.values()
    }
    assert {published.topic: published.signal for published in PUBLISHED} == {
        topic: source.signal for topic, source in sources.items()
    }
    for message in messages:
        decode = sources[message.topic].decode
        assert decode is not None
        for form in (message.message, orjson.loads(json_bytes(message.message))):
            decode(form)  # raises where it is not understood


def test_ros_1_headers() -> None:
    headers = [message.message["header"] for message in drive(1) if message.topic == "/gps_fix"]
    assert [header["seq"] for header in headers] == list(range(10))
    assert headers[0].keys() == {"seq", "stamp", "frame_id"}
    assert headers[0]["stamp"].keys() == {"secs", "nsecs"}


def test_ros_2_headers() -> None:
    header = first("/gps_fix", ros_version=2).message["header"]
    assert header.keys() == {"stamp", "frame_id"}
    assert header["stamp"].keys() == {"sec", "nanosec"}


def test_the_position_is_marked_as_the_real_driver_does() -> None:
    fix = first("/gps_fix").message
    assert fix["position_covariance"] == [0.0] * 9
    assert fix["position_covariance_type"] == 2
    assert fix["status"] == {"status": 0, "service": 1}
    assert fix["latitude"] == pytest.approx(32.23, abs=0.0013)
    assert fix["longitude"] == pytest.approx(-110.95, abs=0.0013)
    assert fix["altitude"] == pytest.approx(748.0, abs=2.0)


def test_the_laser_has_the_frame_and_limits_of_the_real_one() -> None:
    scan = first("/catvehicle/front_laser_points").message
    assert scan["header"]["frame_id"] == "laser"
    assert (scan["range_min"], scan["range_max"]) == (0.0, 81.0)


def test_diagnostics_list_healthy_components_with_integer_levels() -> None:
    rows = first("/diagnostics").message["status"]
    assert len(rows) >= 4
    assert [row["level"] for row in rows] == [0] * len(rows)
    assert all(row["name"] and row["message"] for row in rows)


def test_odometry_and_position_tell_of_the_same_motion() -> None:
    messages = drive(20)
    fixes = [message.message for message in messages if message.topic == "/gps_fix"]
    places = [message.message for message in messages if message.topic == "/gps_odom"]
    speeds = [message.message["linear"]["x"] for message in messages if message.topic == "/catvehicle/vel"]
    begin, end = places[100]["pose"]["pose"]["position"], places[190]["pose"]["pose"]["position"]
    way_m = math.hypot(end["x"] - begin["x"], end["y"] - begin["y"])
    assert way_m == pytest.approx(
        math.hypot(
            (fixes[190]["latitude"] - fixes[100]["latitude"]) * 110_891,
            (fixes[190]["longitude"] - fixes[100]["longitude"]) * 94_256,
        ),
        rel=1e-3,
    )
    assert way_m == pytest.approx(sum(speeds[200:380]) / 20, rel=0.1)  # a wide bend: the chord is a little shorter
    velocity = places[150]["twist"]["twist"]["linear"]
    heading = math.atan2(end["y"] - begin["y"], end["x"] - begin["x"])
    assert math.hypot(velocity["x"], velocity["y"]) == pytest.approx(speeds[300], abs=0.1)
    assert math.cos(math.atan2(velocity["y"], velocity["x"]) - heading) > 0.9
    orientation = places[150]["pose"]["pose"]["orientation"]
    yaw_rad = 2 * math.atan2(orientation["z"], orientation["w"])
    assert math.cos(yaw_rad - math.atan2(velocity["y"], velocity["x"])) == pytest.approx(1.0)


def test_efforts_come_in_the_steps_of_the_real_car() -> None:
    efforts = [
        message.message["force"]["x"]
        for message in drive(60)
        if message.topic in ("/catvehicle/brake", "/catvehicle/accelerator")
    ]
    steps = np.array(efforts) / (100 / 255)
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    assert max(efforts) > 10.0


def test_a_left_bend_is_negative_steering_and_a_positive_commanded_tyre_angle() -> None:
    """The lap's long bend goes to the left with a radius of 100 m: 2.62/100 rad, 4.9 % of steering."""
    messages = drive(12)
    steering = [message.message["torque"]["z"] for message in messages if message.topic == "/catvehicle/steering"]
    angles = [message.message["angular"]["z"] for message in messages if message.topic == "/catvehicle/cmd_vel"]
    assert np.mean(steering[100:]) == pytest.approx(-4.9, abs=0.3)
    assert np.mean(angles[100:]) == pytest.approx(0.0262, abs=0.0015)


def test_wheels_at_rest_are_as_noisy_as_the_real_ones() -> None:
    car = SimulatedCar()
    measured = []
    for step in car.steps():
        if car.elapsed_s > 80:
            break
        if car.motion.speed_mps == 0.0:
            measured += [m.message["linear"]["x"] for m in step.messages if m.topic == "/catvehicle/vel"]
    assert len(measured) > 90  # about five seconds at the stop line
    assert min(measured) == 0.0
    assert 0 < max(measured) <= 0.084


def test_messages_are_never_changed_afterwards() -> None:
    """The bridge encodes a message when somebody wants it: later than the next is made."""
    messages = SimulatedCar(plan=(planned("obstacle@0.5+2"), planned("gps-jump@0.5+2"))).messages()
    some = list(islice(messages, 800))
    before = written(some)
    list(islice(messages, 800))
    assert written(some) == before


def test_a_command_from_the_bridge_is_followed_within_limits() -> None:
    car = SimulatedCar()
    steps = car.steps()
    while car.elapsed_s < 12.0:
        next(steps)
    begun_mps = car.motion.speed_mps
    assert begun_mps > 6.0
    commands = 0
    while car.elapsed_s < 15.0:
        car.follow({"linear": {"x": 2.0}, "angular": {"z": -0.1}})
        commands += sum(message.topic == "/catvehicle/cmd_vel" for message in next(steps).messages)
        assert car.motion.acceleration_mps2 >= -4.6
    assert car.motion.speed_mps == pytest.approx(2.0, abs=0.1)
    assert car.motion.tyre_rad == pytest.approx(-0.1)
    assert commands == 0  # the lap's own driver leaves the wheel


def test_when_no_more_commands_come_the_driver_returns_to_the_lap() -> None:
    car = SimulatedCar()
    steps = car.steps()
    while car.elapsed_s < 10.0:
        next(steps)
    while car.elapsed_s < 13.0:
        car.follow({"linear": {"x": 4.0, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0.1}})
        next(steps)
    while car.elapsed_s < 40.0:
        next(steps)
    place = car.state()["truth"]
    assert place["speed_mps"] > 3.0
    assert math.hypot(car.motion.x_m, car.motion.y_m) == pytest.approx(100.0, abs=20.0)


@pytest.mark.parametrize(
    "message",
    [
        {},
        {"linear": None},
        {"linear": {"x": None}},
        {"linear": {"x": math.nan}, "angular": {"z": 0.0}},
        {"linear": {"x": "5"}},
        {"linear": {"x": True}},
        {"linear": [1, 2, 3]},
        {"linear": {"x": 10**400}},
    ],
    ids=str,
)
def test_a_command_without_a_speed_is_ignored(message: dict[str, Any]) -> None:
    car, untouched = SimulatedCar(), SimulatedCar()
    steps, others = car.steps(), untouched.steps()
    while car.elapsed_s < 3.0:
        car.follow(message)
        next(steps)
        next(others)
    assert car.motion == untouched.motion


@pytest.mark.parametrize("angle", [None, math.nan, math.inf, "left"], ids=str)
def test_a_command_without_an_angle_keeps_the_tyres(angle: object) -> None:
    car = SimulatedCar()
    steps = car.steps()
    while car.elapsed_s < 3.0:
        next(steps)
    tyre_rad = car.motion.tyre_rad
    while car.elapsed_s < 4.0:
        car.follow({"linear": {"x": 1.0}, "angular": {"z": angle}})
        next(steps)
    assert car.motion.tyre_rad == pytest.approx(tyre_rad, abs=0.002)


def test_monstrous_commands_stay_within_what_a_car_can_do() -> None:
    car = SimulatedCar()
    steps = car.steps()
    while car.elapsed_s < 4.0:
        car.follow({"linear": {"x": 1e300}, "angular": {"z": -1e300}})
        next(steps)
        assert 0 <= car.motion.speed_mps <= 1.5 * car.elapsed_s + 0.1
        assert abs(car.motion.tyre_rad) <= 0.53
    while car.elapsed_s < 8.0:
        car.follow({"linear": {"x": -1e300}, "angular": {"z": 1e300}})
        next(steps)
    assert car.motion.speed_mps == 0.0


def test_the_clock_can_be_set_ahead_without_the_car_moving() -> None:
    car = SimulatedCar()
    steps = car.steps()
    before = next(steps)
    motion = car.motion
    car.skip_clock(100.0)
    assert car.motion == motion
    assert next(steps).at_s - before.at_s == pytest.approx(100.0, abs=0.02)
