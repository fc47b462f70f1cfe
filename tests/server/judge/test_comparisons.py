"""Which further topics are compared with those that carry the signals, and how their messages are read."""

from __future__ import annotations

import math
from typing import Any

import pytest

from monitor.shell_facts import LinkFacts
from monitor.state import State
from server.judge import pipeline
from server.judge.comparisons import MOST, comparison_sources, odometry_that_is_not_lost, size_of_twist
from server.judge.frames import Frames
from server.judge.message_fields import NotMeasured, Rejected
from server.judge.profiles import GENERIC
from server.judge.reception_stats import Reception
from server.judge.sources.choice import choose

FIX, ODOMETRY, SCAN = "sensor_msgs/NavSatFix", "nav_msgs/Odometry", "sensor_msgs/LaserScan"
TWIST, STAMPED = "geometry_msgs/Twist", "geometry_msgs/TwistStamped"


def compared(found: dict[str, str], picked: dict[str, str] | None = None) -> set[tuple[str, str]]:
    return {(one.signal, one.topic) for one in comparison_sources(found, choose(found, picked).sources)}


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ({"/vel": TWIST, "/fix": FIX, "/odom": ODOMETRY}, set()),
        ({"/gps/fix": FIX, "/gps/filtered": FIX}, {("position", "/gps/filtered")}),
        ({"/gps/fix": "sensor_msgs/msg/NavSatFix", "/b": "sensor_msgs/msg/NavSatFix"}, {("position", "/b")}),
        ({"/vel": TWIST, "/odom": ODOMETRY, "/lio": ODOMETRY}, {("odometry", "/lio")}),
        ({"/odom": ODOMETRY, "/gps_odom": ODOMETRY}, {("odometry", "/odom")}),
        ({"/vehicle/twist": STAMPED, "/speed": "std_msgs/Float32", "/vel": TWIST}, {("speed", "/vehicle/twist")}),
        ({"/odom": ODOMETRY, "/vel": STAMPED}, set()),  # /vel is the speed
        ({"/catvehicle/vel": TWIST, "/gps/vel": STAMPED, "/gps/fix": FIX}, {("speed", "/gps/vel")}),
        ({"/catvehicle/vel": TWIST, "/gps/vel": STAMPED}, set()),  # beside no receiver it may be a command
        ({"/vel": TWIST, "/cmd_vel": TWIST, "/raw/cmd_vel": STAMPED}, set()),
        ({"/lio": ODOMETRY, "/vel": "std_msgs/String"}, set()),
    ],
)
def test_what_is_compared(found: dict[str, str], expected: set[tuple[str, str]]) -> None:
    assert compared(found) == expected


def test_another_robot_is_not_compared() -> None:
    two = {f"/{name}/{topic}": kind for name in "ab" for topic, kind in (("odom", ODOMETRY), ("scan", SCAN))}
    assert compared({**two, "/vel": TWIST}, {"odometry": "/a/odom", "speed": "/vel"}) == set()
    assert compared(
        {**two, "/vel": TWIST, "/a/lio": ODOMETRY, "/lio": ODOMETRY}, {"odometry": "/a/lio", "speed": "/vel"}
    ) == {
        ("odometry", "/a/odom"),
        ("odometry", "/lio"),
    }
    assert compared({"/vel": TWIST, "/odom": ODOMETRY, "/scan": SCAN, "/b/odom": ODOMETRY, "/b/scan": SCAN}) == set()
    assert compared({"/vel": TWIST, "/odom": ODOMETRY, "/scan": SCAN, "/b/odom": ODOMETRY}) == {("odometry", "/b/odom")}
    receivers = {f"/{name}/{topic}": kind for name in ("left", "right") for topic, kind in (("fix", FIX), ("v", TWIST))}
    assert compared(receivers, {"position": "/left/fix"}) == {("position", "/right/fix")}


def test_at_most_four_of_a_signal_and_those_of_before_first() -> None:
    found = {"/vel": TWIST, **{f"/{n:03}/fix": FIX for n in range(500)}}
    chosen = choose(found, {"position": "/000/fix"}).sources
    topics = [one.topic for one in comparison_sources(found, chosen)]
    assert topics == [f"/{n:03}/fix" for n in range(1, 1 + MOST)]
    kept = comparison_sources(found, chosen, before=["/400/fix"])
    assert [one.topic for one in kept] == ["/400/fix", "/001/fix", "/002/fix", "/003/fix"]
    assert all(not one.carries for one in kept)
    few = comparison_sources(found, chosen, unpublished=["/001/fix"])
    assert few[0].topic == "/002/fix"


def test_the_size_of_a_velocity_is_the_same_in_every_frame() -> None:
    def velocity(x: float, y: float) -> dict[str, Any]:
        return {"linear": {"x": x, "y": y, "z": 0.0}, "angular": {"z": 0.1}}

    for course in range(0, 360, 30):
        x, y = 15.0 * math.cos(math.radians(course)), 15.0 * math.sin(math.radians(course))
        assert size_of_twist({"twist": velocity(x, y)}).speed_mps == pytest.approx(15.0)
        assert size_of_twist(velocity(x, y)).speed_mps == pytest.approx(15.0)
    assert size_of_twist(velocity(3.0, math.nan)).speed_mps == 3.0
    for bad in (velocity(math.nan, 1.0), velocity(1e6, 0.0), {}, {"twist": None}):
        with pytest.raises(Rejected):
            size_of_twist(bad)


def odometry(covariance: Any, x: float = 1.0) -> dict[str, Any]:
    orientation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    pose = {"position": {"x": x, "y": 0.0, "z": 0.0}, "orientation": orientation}
    twist = {"linear": {"x": 1.0, "y": 0.0}, "angular": {"z": 0.0}}
    return {"pose": {"pose": pose, "covariance": covariance}, "twist": {"twist": twist}}


@pytest.mark.parametrize(("covariance", "is_lost"), [([9999.0], True), ([0.1], False), ([], False), (None, False)])
def test_an_odometry_that_declares_itself_lost_is_not_compared(covariance: Any, is_lost: bool) -> None:
    if is_lost:
        with pytest.raises(NotMeasured):
            odometry_that_is_not_lost(odometry(covariance))
    else:
        assert odometry_that_is_not_lost(odometry(covariance)).x_m == 1.0


def test_what_is_compared_changes_no_signal_and_is_counted_for_none() -> None:
    found = {"/vel": TWIST, "/odom": ODOMETRY, "/lio": ODOMETRY}
    sources = choose(found).sources
    watched = (*sources.values(), *comparison_sources(found, sources))
    state, reception = State(), Reception()
    state.link(LinkFacts(phase="monitoring"))

    def receive(message: Any) -> tuple[str, ...]:
        return pipeline.receive(
            pipeline.by_topic(watched)["/lio"],
            message,
            5.0,
            None,
            reception=reception,
            state=state,
            profile=GENERIC,
            tyre_rad_per_unit=0.0,
        )

    assert receive(odometry([0.1], x=4.0)) == ()
    assert receive({"pose": 3}) == ()
    (other,) = state.snapshot(5.0).compared.of("odometry")
    assert (other.topic, other.reading.value.x_m, other.reading.count) == ("/lio", 4.0, 1)
    assert state.get("odometry") is None
    assert (reception.by_signal, reception.received, reception.rejected) == ({}, 2, 0)
    assert pipeline.published(watched) == {"speed", "odometry"}
    assert pipeline.carriers(watched) == {"speed": "/vel", "odometry": "/odom"}


def test_the_unit_that_the_operator_chose_is_that_of_the_topic_which_carries_the_speed() -> None:
    found = {"/vehicle/speed": "std_msgs/Float32", "/gps/vel": STAMPED, "/gps/fix": FIX}
    chosen = choose(found, {"speed": "/vehicle/speed"}).sources
    by_topic = pipeline.by_topic((*chosen.values(), *comparison_sources(found, chosen)))
    state, reception = State(), Reception()
    velocity = {"linear": {"x": 0.0, "y": 10.0, "z": 0.0}, "angular": {"z": 0.0}}
    for topic, message in (("/vehicle/speed", {"data": 36.0}), ("/gps/vel", {"twist": velocity})):
        pipeline.receive(
            by_topic[topic],
            message,
            5.0,
            None,
            reception=reception,
            state=state,
            profile=GENERIC,
            tyre_rad_per_unit=0.0,
            units={"speed": "kmh"},
        )
    speed = state.get("speed")
    assert speed is not None
    assert speed.value.speed_mps == pytest.approx(10.0)
    (other,) = state.snapshot(5.0).compared.of("speed")
    assert other.reading.value.speed_mps == pytest.approx(10.0)


def test_axes_that_are_not_known_keep_a_topic_from_being_compared_and_refuse_no_signal() -> None:
    found = {"/vel": TWIST, "/odom": ODOMETRY, "/lio": ODOMETRY}
    sources = choose(found).sources
    by_topic = pipeline.by_topic((*sources.values(), *comparison_sources(found, sources)))
    frames = Frames()
    for yaw_rad in (0.0, math.pi / 2):  # they contradict each other
        frames.receive("/tf_static", {"transforms": [transform("base_link", "lidar", yaw_rad)]})
    state, reception = State(), Reception()
    pipeline.receive(
        by_topic["/lio"],
        {**odometry([0.1]), "child_frame_id": "lidar"},
        5.0,
        None,
        reception=reception,
        state=state,
        profile=GENERIC,
        tyre_rad_per_unit=0.0,
        frames=frames,
    )
    assert (frames.axes("/lio", "lidar").why_unknown or "").startswith("its axes are not known: ")
    snapshot = state.snapshot(5.0)
    assert snapshot.compared.of("odometry") == ()
    assert (dict(snapshot.unusable), reception.by_signal) == ({}, {})


def transform(parent: str, child: str, yaw_rad: float) -> dict[str, Any]:
    rotation = {"x": 0.0, "y": 0.0, "z": math.sin(yaw_rad / 2), "w": math.cos(yaw_rad / 2)}
    found = {"translation": {"x": 0.0, "y": 0.0, "z": 0.0}, "rotation": rotation}
    header = {"seq": 0, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": parent}
    return {"header": header, "child_frame_id": child, "transform": found}


@pytest.mark.parametrize("cars", [("/agv1", "/agv2"), ("/fleet/a7", "/fleet/b2")])
def test_another_car_of_the_bridge_is_not_compared(cars: tuple[str, str]) -> None:
    one, other = cars
    found = {f"{one}/odom": ODOMETRY, f"{other}/odom": ODOMETRY, f"{other}/scan": SCAN}
    assert compared(found, {"speed": f"{one}/odom", "odometry": f"{one}/odom"}) == set()
