"""Imu and Odometry of sensors mounted anyhow, against rotation matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.state import State
from server.judge import pipeline
from server.judge.body_axes import in_body_axes
from server.judge.frames import Frames
from server.judge.profiles import GENERIC
from server.judge.reception_stats import Reception
from server.judge.signals.acceleration import acceleration_of_imu
from server.judge.signals.heading import heading_of_imu
from server.judge.signals.odometry import odometry
from server.judge.signals.speed import twist_of_odometry
from server.judge.sources.choice import choose
from tests.server.judge.mounted_lasers import Laser, quaternion, row

ANGLE = st.floats(-math.pi, math.pi)


def vector(of: NDArray[np.float64]) -> dict[str, float]:
    return dict(zip("xyz", map(float, of), strict=True))


def turned(matrix: NDArray[np.float64]) -> dict[str, float]:
    return dict(zip("xyzw", quaternion(matrix), strict=True))


def imu(mounting: Laser, course_rad: float, acceleration: list[float], frame: str = "imu") -> dict[str, Any]:
    """What an IMU so mounted sends in a car on this course (0 east) with this acceleration in the body frame."""
    own, body = mounting.matrix, Laser(yaw_rad=course_rad).matrix
    return {
        "header": {"frame_id": frame},
        "orientation": turned(body @ own),
        "orientation_covariance": [0.01] * 9,
        "angular_velocity": vector(own.T @ np.array([0.0, 0.0, 0.1])),
        "linear_acceleration": vector(own.T @ np.array(acceleration)),
        "linear_acceleration_covariance": [0.01] * 9,
    }


def moving(mounting: Laser, course_rad: float, speed_mps: float, child: str = "imu") -> dict[str, Any]:
    own, body = mounting.matrix, Laser(yaw_rad=course_rad).matrix
    twist = {"linear": vector(own.T @ [speed_mps, 0, 0]), "angular": vector(own.T @ [0, 0, 0.2])}
    pose = {"position": vector(np.zeros(3)), "orientation": turned(body @ own)}
    return {"header": {"frame_id": "odom"}, "child_frame_id": child, "pose": {"pose": pose}, "twist": {"twist": twist}}


def frames(mounting: Laser) -> Frames:
    found = Frames()
    found.receive("/tf_static", {"transforms": [mounting.transform(child="imu")]})
    return found


@given(yaw_rad=ANGLE, roll_rad=ANGLE, pitch_rad=st.floats(-1.5, 1.5), course_rad=ANGLE, ahead=st.floats(-5, 5))
def test_acceleration_heading_and_speed_are_the_cars_however_the_sensor_is_mounted(
    yaw_rad: float, roll_rad: float, pitch_rad: float, course_rad: float, ahead: float
) -> None:
    mounting = Laser(yaw_rad=yaw_rad, roll_rad=roll_rad, pitch_rad=pitch_rad, x_m=0.7)
    by = frames(mounting)
    message, why = in_body_axes(by, "/imu/data", "sensor_msgs/Imu", imu(mounting, course_rad, [ahead, 0.3, 9.81]))
    assert why is None
    assert acceleration_of_imu(message).acceleration_mps2 == pytest.approx(ahead, abs=0.05)
    heading = heading_of_imu(message).heading_deg - (90 - math.degrees(course_rad))
    assert math.remainder(heading, 360) == pytest.approx(0.0, abs=0.3)
    message, why = in_body_axes(by, "/odom", "nav_msgs/msg/Odometry", moving(mounting, course_rad, ahead))
    assert twist_of_odometry(message).speed_mps == pytest.approx(ahead, abs=0.02)
    assert twist_of_odometry(message).yaw_rate_radps == pytest.approx(0.2, abs=0.01)
    assert math.remainder((odometry(message).yaw_rad or 0.0) - course_rad, math.tau) == pytest.approx(0.0, abs=0.01)


def test_without_a_transform_or_turned_by_nothing_the_message_is_as_it_came() -> None:
    backwards = Laser(yaw_rad=math.pi)
    sent = imu(backwards, 0.0, [1.0, 0.0, 9.81])
    assert in_body_axes(Frames(), "/imu", "sensor_msgs/Imu", sent)[0] is sent
    assert in_body_axes(frames(Laser(x_m=2.0)), "/imu", "sensor_msgs/Imu", sent)[0] is sent
    assert in_body_axes(frames(backwards), "/imu", "sensor_msgs/Imu", {**sent, "header": {}})[0]["header"] == {}
    assert in_body_axes(frames(backwards), "/scan", "sensor_msgs/LaserScan", sent)[0] is sent


def test_an_axis_that_plays_no_part_may_be_unknown_and_one_that_does_may_not() -> None:
    by, sent = frames(Laser(yaw_rad=math.pi)), imu(Laser(yaw_rad=math.pi), 0.0, [1.0, 0.0, 9.81])
    sent["linear_acceleration"]["z"] = math.nan
    assert acceleration_of_imu(in_body_axes(by, "/imu", "sensor_msgs/Imu", sent)[0]).acceleration_mps2 == pytest.approx(
        1.0
    )
    sent["linear_acceleration"]["x"] = None
    message = in_body_axes(by, "/imu", "sensor_msgs/Imu", sent)[0]
    with pytest.raises(ValueError, match="not a number"):
        acceleration_of_imu(message)


def test_axes_that_cannot_be_known_are_no_value() -> None:
    by = frames(Laser(yaw_rad=math.pi))
    by.receive("/tf_static", {"transforms": [row("mast", "imu")]})
    state, reception = State(), Reception()
    sources = pipeline.by_topic(choose({"/imu/data": "sensor_msgs/Imu"}).sources.values())["/imu/data"]
    changed = pipeline.receive(
        sources,
        imu(Laser(), 0.0, [1.0, 0.0, 9.81]),
        1.0,
        None,
        reception=reception,
        state=state,
        profile=GENERIC,
        tyre_rad_per_unit=0.0,
        frames=by,
    )
    assert changed == ()
    assert "also below mast" in state.snapshot(1.0).unusable["acceleration"].text
    assert reception.rejected == 1


# -- a twist in a frame that is fixed to the ground ------------------------------------------------------------------


def driving(course_rad: float, speed_mps: float, *, child: str = "odom", header: str = "odom") -> dict[str, Any]:
    """An odometry whose twist has the axes of the frame in which its pose is."""
    course = {"x": speed_mps * math.cos(course_rad), "y": speed_mps * math.sin(course_rad), "z": 0.0}
    twist = {"linear": course, "angular": vector(np.array([0.0, 0.0, 0.2]))}
    pose = {"position": vector(np.array([80.0, 70.0, 0.0])), "orientation": turned(Laser(yaw_rad=course_rad).matrix)}
    return {"header": {"frame_id": header}, "child_frame_id": child, "pose": {"pose": pose}, "twist": {"twist": twist}}


def driven(*courses_rad: float, parent: str = "odom", topic: str = "/tf") -> Frames:
    """Transforms of a car that turned to each of these courses, 100 m from where it began, and of its imu."""
    found = Frames()
    found.receive("/tf_static", {"transforms": [Laser(yaw_rad=math.pi).transform(child="imu")]})
    for number, course_rad in enumerate(courses_rad):
        at = Laser(x_m=100.0 * number, yaw_rad=course_rad)
        found.receive(topic, {"transforms": [at.transform(parent, "base_link")]})
    return found


@given(course_rad=ANGLE, speed_mps=st.floats(-20, 20), child=st.sampled_from(["odom", "map", "/robot1/odom", "world"]))
@pytest.mark.parametrize("has_transforms", [False, True])
def test_a_twist_in_the_axes_of_the_ground_is_turned_by_its_own_orientation(
    has_transforms: bool, course_rad: float, speed_mps: float, child: str
) -> None:
    by = driven(0.0, course_rad, parent=child) if has_transforms else Frames()
    sent = driving(course_rad, speed_mps, child=child, header=child)
    message, why = in_body_axes(by, "/odom", "nav_msgs/Odometry", sent)
    assert why is None
    assert twist_of_odometry(message).speed_mps == pytest.approx(speed_mps, abs=0.01)
    assert twist_of_odometry(message).yaw_rate_radps == pytest.approx(0.2, abs=0.001)
    assert math.remainder((odometry(message).yaw_rad or 0.0) - course_rad, math.tau) == pytest.approx(0.0, abs=0.001)
    assert odometry(message).x_m == 80.0


@given(course_rad=ANGLE, speed_mps=st.floats(-20, 20))
def test_a_twist_that_is_along_the_car_alone_has_its_axes_whatever_its_frame(
    course_rad: float, speed_mps: float
) -> None:
    """A driver that names one frame twice: no car slides so."""
    sent = driving(course_rad, 0.0)
    sent["twist"]["twist"]["linear"] = vector(np.array([speed_mps, 0.0, 0.0]))
    message, why = in_body_axes(Frames(), "/odom", "nav_msgs/Odometry", sent)
    is_along_one_axis = abs(math.sin(course_rad)) > 1e-5
    assert why is None or (math.cos(course_rad) < 0.0 and not is_along_one_axis)
    if is_along_one_axis:
        assert twist_of_odometry(message).speed_mps == speed_mps


@pytest.mark.parametrize("speed_mps", [7.0, -0.5])
@pytest.mark.parametrize("course_deg", [0, 90, 180, -180, 270])
def test_along_the_car_and_along_the_ground_at_once_it_is_a_speed_only_if_both_have_one_sign(
    course_deg: int, speed_mps: float
) -> None:
    """Driving west, the rounding of the orientation leaves nothing that tells the axes apart."""
    sent = driving(math.radians(course_deg), 0.0)
    sent["twist"]["twist"]["linear"] = vector(np.array([speed_mps, 0.0, 0.0]))
    message, why = in_body_axes(Frames(), "/odom", "nav_msgs/Odometry", sent)
    if abs(course_deg) == 180:
        reason = "its twist is in odom or in the axes of the car, which point the other way"
        assert why == f"its axes are not known: {reason}"
    else:
        assert why is None
        assert twist_of_odometry(message).speed_mps == pytest.approx(speed_mps)


def test_a_twist_of_the_ground_that_moves_west_and_not_exactly_is_known() -> None:
    message, why = in_body_axes(Frames(), "/odom", "nav_msgs/Odometry", driving(math.pi, 7.0))
    assert why is None
    assert twist_of_odometry(message).speed_mps == pytest.approx(7.0)


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        (driving(1.0, 5.0, header="map"), "its twist is in odom, and its pose in map"),
        (driving(1.0, 5.0, header=""), "its twist is in odom, and its pose in no frame"),
        (
            {**driving(1.0, 5.0), "pose": {"pose": {"orientation": dict.fromkeys("xyzw", 0.0)}}},
            "its twist is in odom, and its orientation is none",
        ),
        (
            {**driving(1.0, 5.0), "pose": driving(2.5, 5.0)["pose"]},
            "its twist is in odom, and moves sideways by its orientation",
        ),
    ],
)
@pytest.mark.parametrize("by", [Frames(), driven(0.0, 1.0)], ids=["alone", "transforms"])
def test_where_its_axes_cannot_be_known_it_is_no_speed_and_says_why(by: Frames, sent: dict[str, Any], why: str) -> None:
    assert in_body_axes(by, "/odom", "nav_msgs/Odometry", sent)[1] == f"its axes are not known: {why}"


@pytest.mark.parametrize("parent", ["odom", "t265_start"])
def test_a_frame_in_which_the_car_moves_is_no_sensor_whatever_its_name(parent: str) -> None:
    by = driven(0.0, 2.0, parent=parent)
    message, why = in_body_axes(by, "/odom", "nav_msgs/Odometry", driving(2.0, 5.0, child=parent, header=parent))
    assert why is None
    assert twist_of_odometry(message).speed_mps == pytest.approx(5.0)
    _, why = in_body_axes(by, "/imu", "sensor_msgs/Imu", imu(Laser(), 2.0, [1.0, 0.0, 9.8], frame=parent))
    assert why == f"its axes are not known: {parent} is no frame of the car"


def test_the_ground_may_be_sent_below_the_car() -> None:
    """Where another filter already sends what is above it."""
    by = Frames()
    for yaw_rad in (0.0, -2.0):
        by.receive("/tf", {"transforms": [Laser(x_m=60.0, yaw_rad=yaw_rad).transform("base_link", "odom_lidar")]})
    sent = driving(2.0, 5.0, child="odom_lidar", header="odom_lidar")
    message, why = in_body_axes(by, "/odom", "nav_msgs/Odometry", sent)
    assert why is None
    assert twist_of_odometry(message).speed_mps == pytest.approx(5.0)


@pytest.mark.parametrize("child", ["base_footprint", "base_stabilized", "robot1/base_footprint"])
def test_a_body_frame_above_base_link_is_no_ground_though_the_body_moves_in_it(child: str) -> None:
    by = Frames()
    for at, roll_rad in enumerate((0.0, 0.03)):
        rows = [Laser(x_m=100.0 * at, yaw_rad=at).transform("odom", child)]
        rows.append(Laser(roll_rad=roll_rad).transform(child, child.replace(child.rpartition("/")[2], "base_link")))
        by.receive("/tf", {"transforms": rows})
    message, why = in_body_axes(by, "/odom", "nav_msgs/Odometry", moving(Laser(), 1.0, 5.0, child=child))
    assert why is None
    assert twist_of_odometry(message).speed_mps == pytest.approx(5.0, abs=0.01)
    assert odometry(message).yaw_rad == pytest.approx(1.0, abs=0.01)


def test_a_sensor_with_a_word_of_the_ground_that_is_bolted_to_the_car_is_a_sensor() -> None:
    by, mounting = Frames(), Laser(yaw_rad=math.pi)
    by.receive("/tf_static", {"transforms": [mounting.transform(child="odom_sensor")]})
    message, why = in_body_axes(by, "/odom", "nav_msgs/Odometry", moving(mounting, 1.0, 5.0, child="odom_sensor"))
    assert why is None
    assert twist_of_odometry(message).speed_mps == pytest.approx(5.0)
    assert odometry(message).yaw_rad == pytest.approx(1.0, abs=0.001)
