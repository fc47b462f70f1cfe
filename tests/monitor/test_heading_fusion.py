"""The heading: which source is used."""

from __future__ import annotations

import math

import pytest

from monitor.derived_signals import DOUBTS, HeadingFusion
from monitor.values import Heading, Odometry


def odometry(yaw_rad: float | None, frame_id: str = "map", x_m: float = 0.0, y_m: float = 0.0) -> Odometry:
    return Odometry(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, frame_id=frame_id)


def feed(headings: HeadingFusion, course_deg: float, times: int = 1, speed_mps: float | None = 2.0) -> Heading | None:
    found = None
    for _ in range(times):
        found = headings.on_course(course_deg, speed_mps, yaw_is_fresh=True)
    return found


@pytest.mark.parametrize(
    ("message", "believed"),
    [
        pytest.param(odometry(1.0), True, id="map"),
        pytest.param(odometry(1.0, "/utm"), True, id="utm with a slash"),
        pytest.param(odometry(1.0, "car/MAP"), True, id="namespaced"),
        pytest.param(odometry(1.0, "odom"), False, id="odom begins anywhere"),
        pytest.param(odometry(1.0, "/odom", 505_759.7, 3_564_595.3), True, id="the real car: called odom, but UTM"),
        pytest.param(odometry(1.0, "odom", 505.0, 3_564_595.3), False, id="no easting"),
        pytest.param(odometry(None), False, id="no yaw"),
        pytest.param(odometry(math.nan), False, id="NaN"),
    ],
)
def test_which_odometry_is_a_heading(message: Odometry, believed: bool) -> None:
    headings = HeadingFusion()
    headings.on_odometry(odometry(0.99, message.frame_id, message.x_m, message.y_m))
    found = headings.on_odometry(message)
    assert (found is not None) == believed
    if found is not None:
        assert (found.source, found.heading_deg) == ("odometry", pytest.approx(90.0 - math.degrees(1.0)))


def test_an_orientation_that_never_changes_is_none() -> None:
    """Some drivers send UTM positions with an identity quaternion: always east would be a comfortable lie."""
    headings = HeadingFusion()
    assert [headings.on_odometry(odometry(0.0)) for _ in range(9)] == [None] * 9
    course = feed(headings, 10.0)
    assert course is not None
    assert course.source == "track"


def test_a_yaw_which_the_course_contradicts_is_not_believed() -> None:
    headings = HeadingFusion()
    for n in range(5):
        headings.on_odometry(odometry(0.001 * n))  # east
    assert feed(headings, 0.0, DOUBTS - 1) is None
    course = feed(headings, 0.0)
    assert course is not None
    assert (course.heading_deg, course.source) == (0.0, "track")
    assert headings.on_odometry(odometry(0.1)) is None
    assert feed(headings, 90.0, 2 * DOUBTS) is None  # in agreement again
    assert headings.on_odometry(odometry(0.2)) is not None


def test_a_published_heading_wins() -> None:
    headings = HeadingFusion()
    headings.on_odometry(odometry(0.0))
    headings.is_published = True
    assert headings.on_odometry(odometry(0.1)) is None
    assert feed(headings, 10.0) is None


def test_the_course_is_the_heading_unless_the_car_reverses() -> None:
    forward, backward = feed(HeadingFusion(), 350.0), feed(HeadingFusion(), 350.0, speed_mps=-1.0)
    assert forward is not None
    assert backward is not None
    assert (forward.heading_deg, backward.heading_deg) == (350.0, 170.0)
    unknown = feed(HeadingFusion(), 350.0, speed_mps=None)
    assert unknown is not None
    assert unknown.heading_deg == 350.0


def test_standing_has_no_course() -> None:
    assert HeadingFusion().on_course(None, 0.0, yaw_is_fresh=False) is None


def test_odometry_that_fell_silent_makes_way_for_the_course() -> None:
    headings = HeadingFusion()
    for n in range(5):
        headings.on_odometry(odometry(0.001 * n))
    assert feed(headings, 90.0) is None
    course = headings.on_course(90.0, 2.0, yaw_is_fresh=False)
    assert course is not None
    assert course.source == "track"
