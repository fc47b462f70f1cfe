"""Where a laser is on the car: by transforms, by settings, assumed; against a geometry of its own."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor import catalog
from monitor.catalog import AllLimits
from monitor.check import Finding
from monitor.obstacle_view import corridor_ahead, look_ahead
from monitor.values import LaserScan, Steering, Twist
from server.judge.frames import Frames, looks_ahead
from server.judge.signals.scan import laser_scan
from server.judge.transforms import FrameTree
from tests.monitor.checks.known import check_of, known
from tests.server.judge.mounted_lasers import Laser, Post, row

LIMITS = AllLimits()
TOPIC = "/scan"


def limits(**values: float) -> AllLimits:
    return catalog.changed(AllLimits(), {name.replace("__", "."): value for name, value in values.items()})


def frames(*rows: dict[str, Any], topic: str = "/tf_static") -> Frames:
    found = Frames()
    for one in rows:
        found.receive(topic, {"transforms": [one]})
    return found


def scanned(
    laser: Laser, posts: list[Post], by: Frames, set_to: AllLimits = LIMITS, *, frame: str = "laser"
) -> LaserScan:
    return by.mounted(TOPIC, laser_scan(laser.scan(posts, frame=frame)), set_to)


def finding_of(
    scan: LaserScan, set_to: AllLimits = LIMITS, *, tyre_rad: float = 0.0, check: str = "obstacle"
) -> Finding:
    steering = Steering(percent=0.0, tyre_rad=tyre_rad)
    one = check_of(check)
    snapshot = known(scan=scan, speed=Twist(speed_mps=0.0), steering=steering)
    return one.find(snapshot, getattr(set_to, one.limits_group), False)


# -- against the truth -----------------------------------------------------------------------------------------------

ROUND = {"beams": 720, "first_rad": -math.pi, "increment_rad": math.tau / 720}
ROUND_FROM_ZERO = {"beams": 720, "first_rad": 0.0, "increment_rad": math.tau / 720}
CLOCKWISE = {"beams": 720, "first_rad": math.pi, "increment_rad": -math.tau / 720}
CLOSED = {"beams": 721, "first_rad": -math.pi, "increment_rad": math.tau / 720}  # its last beam is its first


@given(
    shape=st.sampled_from([ROUND, ROUND_FROM_ZERO, CLOCKWISE, CLOSED]),
    yaw_rad=st.one_of(st.floats(-math.pi, math.pi), st.sampled_from([0.0, math.pi, -math.pi / 2])),
    is_upside_down=st.booleans(),
    x_m=st.floats(-1.0, 3.0),
    y_m=st.floats(-0.8, 0.8),
    bumper_m=st.one_of(st.just(0.0), st.floats(0.5, 4.0)),
    gap_m=st.floats(0.6, 12.0),
    aside_m=st.floats(-2.5, 2.5),
)
def test_a_post_is_as_far_from_the_bumper_as_it_is_however_the_laser_is_mounted(
    shape: dict[str, Any],
    yaw_rad: float,
    is_upside_down: bool,
    x_m: float,
    y_m: float,
    bumper_m: float,
    gap_m: float,
    aside_m: float,
) -> None:
    laser = Laser(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, roll_rad=math.pi if is_upside_down else 0.0, **shape)
    nose_m = max(x_m, bumper_m, 0.0)
    radius = 0.25
    post = (nose_m + gap_m + radius, aside_m, radius)
    set_to = limits(obstacle__bumper_ahead_m=bumper_m)
    scan = scanned(laser, [post], frames(laser.transform()), set_to)
    snapshot = known(scan=scan)
    sight = look_ahead(scan, corridor_ahead(snapshot, set_to.obstacle))
    assert sight.covered == 1.0
    # Its surface as the laser sees it: the nearest of the points that two adjacent beams hit, within the corridor.
    points = laser.directions * laser.ranges([post])[:, None] + [x_m, y_m]
    on_post = np.hypot(points[:, 0] - post[0], points[:, 1] - post[1]) < radius + 1e-6
    inside = on_post & (np.abs(points[:, 1]) <= set_to.obstacle.half_width_m)
    pairs = np.maximum(points[:, 0], np.roll(points[:, 0], -1))[inside & np.roll(inside, -1)]
    if abs(abs(aside_m) - set_to.obstacle.half_width_m) < radius + 0.1:
        return  # the edge of the corridor runs through it
    if abs(aside_m) > set_to.obstacle.half_width_m:
        assert sight.gap_m is None or sight.gap_m > 15.0
        return
    assert sight.gap_m == pytest.approx(pairs.min() - nose_m, abs=0.01)
    to_post = math.atan2(post[1] - y_m, post[0] - x_m)
    assert sight.bearing_rad is not None
    assert abs(sight.bearing_rad) <= math.pi
    assert (
        abs(sight.bearing_rad - to_post) < math.asin(min(1.0, radius / math.hypot(post[0] - x_m, post[1] - y_m))) + 0.02
    )


@given(
    yaw_rad=st.floats(-math.pi, math.pi),
    is_upside_down=st.booleans(),
    x_m=st.floats(-1.0, 3.0),
    y_m=st.floats(-0.8, 0.8),
    bumper_m=st.floats(0.5, 4.0),
    tyre_rad=st.sampled_from([-0.3, -0.1, 0.1, 0.3]),
    way_m=st.floats(1.0, 6.0),
    aside_m=st.sampled_from([-2.2, -0.6, 0.0, 0.6, 2.2]),
)
def test_in_a_bend_the_gap_is_the_way_of_the_nose_round_the_centre(
    yaw_rad: float,
    is_upside_down: bool,
    x_m: float,
    y_m: float,
    bumper_m: float,
    tyre_rad: float,
    way_m: float,
    aside_m: float,
) -> None:
    laser = Laser(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, roll_rad=math.pi if is_upside_down else 0.0)
    set_to = limits(obstacle__bumper_ahead_m=bumper_m)
    nose_m = max(x_m, bumper_m, 0.0)
    centre_m = set_to.obstacle.wheelbase_m / math.tan(round(tyre_rad / 0.005) * 0.005)
    # The nose after it has turned by so much about the centre abeam of the rear axle, and a place beside its path.
    radius_m, turned = math.hypot(nose_m, centre_m), way_m / math.hypot(nose_m, centre_m)
    at = math.atan2(nose_m, abs(centre_m)) + turned
    if at > 1.2:
        return  # beyond a quarter of a turn
    side = math.copysign(1.0, centre_m)
    ring_m = radius_m + aside_m  # farther out is positive
    post = (ring_m * math.sin(at), centre_m - side * ring_m * math.cos(at), 0.1)
    if post[0] - x_m < 0.3:
        return  # beside the laser or behind it, where no beam is counted
    scan = scanned(laser, [post], frames(laser.transform()), set_to)
    snapshot = known(scan=scan, steering=Steering(percent=0.0, tyre_rad=tyre_rad))
    gap_m = look_ahead(scan, corridor_ahead(snapshot, set_to.obstacle)).gap_m
    width = set_to.obstacle.half_width_m
    if abs(centre_m) - width + 0.2 < ring_m < radius_m + width - 0.2:
        assert gap_m == pytest.approx(way_m, abs=0.35)
    elif ring_m > radius_m + width + 0.2:
        assert gap_m is None or gap_m > way_m + 1.0


@pytest.mark.parametrize("shape", [ROUND, ROUND_FROM_ZERO, CLOCKWISE, CLOSED], ids=["−π", "0", "clockwise", "closed"])
@pytest.mark.parametrize("yaw_rad", [0.0, math.pi, math.pi / 2, -2.0])
def test_what_is_thin_and_ahead_is_seen_also_at_the_seam(shape: dict[str, Any], yaw_rad: float) -> None:
    """Two beams wide: only the first and the last beam of a full circle may hit it."""
    laser = Laser(yaw_rad=yaw_rad, **shape)
    for aside_m in np.linspace(-0.06, 0.06, 7):
        post = (6.0, float(aside_m), 0.053)  # of 6 m, a step of half a degree is 5 cm
        finding = finding_of(scanned(laser, [post], frames(laser.transform())), limits(obstacle__standoff_m=7.0))
        assert finding.verdict == "fault", (aside_m, finding.text)


# -- what is not seen ------------------------------------------------------------------------------------------------

WIDE = {"beams": 541, "first_rad": -math.radians(135), "increment_rad": math.radians(0.5)}


@pytest.mark.parametrize(
    ("yaw_deg", "verdict"),
    [(0, "ok"), (45, "ok"), (-45, "ok"), (110, "ok"), (135, "unknown"), (180, "unknown"), (-160, "unknown")],
)
def test_a_laser_that_does_not_look_into_the_whole_corridor_says_nothing_of_it(yaw_deg: float, verdict: str) -> None:
    laser = Laser(yaw_rad=math.radians(yaw_deg), **WIDE)
    finding = finding_of(scanned(laser, [], frames(laser.transform())))
    assert finding.verdict == verdict
    if verdict == "unknown":
        assert "look" in finding.text
        assert finding.applies


def test_what_is_near_in_the_part_that_is_seen_is_an_obstacle_all_the_same() -> None:
    laser = Laser(yaw_rad=math.radians(135), **WIDE)
    assert finding_of(scanned(laser, [(3.0, 0.6, 0.3)], frames(laser.transform()))).verdict == "fault"


@pytest.mark.parametrize("pitch_deg", [0.0, 1.0, 5.0, 9.0, 12.0, -12.0, 40.0, 90.0, 140.0, 180.0])
def test_a_tilted_laser_is_not_checked(pitch_deg: float) -> None:
    laser = Laser(pitch_rad=math.radians(pitch_deg))
    tilt = min(abs(pitch_deg), 180 - abs(pitch_deg))
    scan = scanned(Laser(), [(3.3, 0.0, 0.5)], frames(laser.transform()))
    finding = finding_of(scan)
    if tilt > 10:
        assert (finding.verdict, finding.text) == ("unknown", f"The laser is tilted by {tilt:.0f}°")
        assert finding_of(scan, check="laser_blind").verdict == "unknown"
    elif tilt > 2:
        assert f"(laser tilted by {tilt:.0f}°)" in finding.text
    else:
        assert "tilted" not in finding.text


def test_a_roll_tilts_too() -> None:
    for degrees, verdict in ((40, "unknown"), (140, "unknown"), (3, "fault"), (177, "fault")):
        by = frames(Laser(roll_rad=math.radians(degrees)).transform())
        assert finding_of(scanned(Laser(), [(3.0, 0.0, 0.5)], by)).verdict == verdict


# -- the car itself --------------------------------------------------------------------------------------------------


def test_the_cars_own_body_is_no_obstacle_and_hides_what_is_behind_it() -> None:
    """A laser over the rear axle, 3 m behind the bumper."""
    laser, set_to = Laser(), limits(obstacle__bumper_ahead_m=3.0)
    by = frames(laser.transform())
    mast = [(1.0, 0.3, 0.05)]
    assert finding_of(scanned(laser, mast, by), set_to).verdict == "ok"
    assert finding_of(scanned(laser, [*mast, (5.0, -0.5, 0.4)], by), set_to).verdict == "fault"
    cabin = [(1.5, 0.0, 1.0)]
    assert finding_of(scanned(laser, cabin, by), set_to).verdict == "unknown", "it hides the corridor"


@pytest.mark.parametrize("beyond_m", [0.02, 0.0, -0.1, -0.25])
def test_what_touches_the_bumper_is_an_obstacle_though_the_bumper_is_measured_by_hand(beyond_m: float) -> None:
    laser, set_to = Laser(), limits(obstacle__bumper_ahead_m=3.0)
    finding = finding_of(scanned(laser, [(3.3 + beyond_m, 0.0, 0.3)], frames(laser.transform())), set_to)
    assert finding.verdict == "fault"
    assert finding.measured is not None
    assert finding.measured.value == pytest.approx(max(0.0, beyond_m), abs=0.01)


def test_without_transforms_the_bumper_counts_from_the_laser_as_it_is_set() -> None:
    laser = Laser()
    scan = scanned(laser, [(8.3, 0.0, 0.3)], Frames(), set_to := limits(obstacle__bumper_ahead_m=3.5))
    assert finding_of(scan).measured.value == pytest.approx(8.0, abs=0.01)  # type: ignore[union-attr]
    assert finding_of(scan, set_to).measured.value == pytest.approx(7.0, abs=0.01)  # type: ignore[union-attr]


# -- settings --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("laser", "values"),
    [
        (Laser(yaw_rad=math.pi), {"mounting__yaw_deg": 180.0}),
        (Laser(yaw_rad=-math.pi / 2), {"mounting__yaw_deg": -90.0}),
        (Laser(roll_rad=math.pi), {"mounting__upside_down": 1.0}),
        (Laser(roll_rad=math.pi, yaw_rad=2.0), {"mounting__upside_down": 1.0, "mounting__yaw_deg": math.degrees(2.0)}),
        (Laser(y_m=0.8), {"mounting__left_m": 0.8}),
    ],
)
@pytest.mark.parametrize("post", [(7.5, 0.77, 0.25), (7.5, -1.03, 0.25)])
def test_settings_stand_for_transforms(laser: Laser, values: dict[str, float], post: Post) -> None:
    laser = replace(laser, x_m=2.5)  # where the settings have it
    by_settings, set_to = scanned(laser, [post], Frames(), limits(**values)), limits(**values)
    by_transforms = scanned(laser, [post], frames(laser.transform()))
    assert finding_of(by_settings, set_to).text == finding_of(by_transforms).text
    assert "assumed" not in finding_of(by_settings, set_to).text
    assert by_settings.mounting is not None
    assert (by_settings.mounting.note or "").startswith("mounted by the settings")


def test_the_operators_setting_comes_before_the_transforms() -> None:
    laser = Laser(yaw_rad=math.pi)
    wrong = frames(Laser(x_m=0.4, y_m=0.2).transform())
    scan = scanned(laser, [(3.3, 0.2, 0.3)], wrong, limits(mounting__yaw_deg=180.0))
    assert scan.mounting is not None
    assert (scan.mounting.origin, scan.mounting.x_m, scan.mounting.y_m) == ("settings", 0.4, 0.2)
    assert (scan.mounting.note or "").endswith("not by the car's transforms")
    assert finding_of(scan).verdict == "fault"
    ahead = scanned(Laser(), [(3.3, 0.0, 0.3)], frames(laser.transform()), limits(mounting__by_settings=1.0))
    assert finding_of(ahead).verdict == "fault", "what is at its default counts too"


def test_assumed_is_said_and_a_setting_or_the_catvehicles_topic_ends_it() -> None:
    laser, posts = Laser(), [(3.3, 0.0, 0.3)]
    assumed = scanned(laser, posts, Frames())
    assert "(laser assumed to look ahead); gap from the laser: no bumper set" in finding_of(assumed).text
    measured = scanned(laser, posts, Frames(), limits(obstacle__bumper_ahead_m=3.0))
    assert "(laser assumed to look ahead)" in finding_of(measured).text
    assert (assumed.mounting.note or "").startswith("assumed to look ahead") if assumed.mounting else False
    set_there = scanned(laser, posts, Frames(), limits(mounting__by_settings=1.0))
    assert "assumed" not in finding_of(set_there).text
    of_car = Frames().mounted("/catvehicle/front_laser_points", laser_scan(laser.scan(posts)), LIMITS)
    assert of_car.mounting is not None
    assert (of_car.mounting.note, "assumed" in finding_of(of_car).text) == (None, False)
    moved = scanned(laser, posts, Frames(), limits(obstacle__laser_ahead_m=1.0))
    assert "assumed" in finding_of(moved).text, "its place alone does not give its direction"


COUNTED = "gap from the laser: no bumper set"


@pytest.mark.parametrize(
    ("x_m", "posts", "text"),
    [
        (1.2, [(4.5, 0.0, 0.3)], COUNTED),  # on the roof
        (1.2, [], COUNTED),
        (1.2, [(11.5, 0.0, 0.3)], COUNTED),
        (-0.4, [(4.5, 0.0, 0.3)], "gap from the rear axle: no bumper set"),
    ],
)
@pytest.mark.parametrize("by_settings", [0.0, 1.0])
def test_a_gap_that_is_not_counted_from_the_bumper_says_so(
    x_m: float, posts: list[Post], text: str, by_settings: float
) -> None:
    laser = Laser(x_m=x_m)
    set_to = limits(mounting__by_settings=by_settings)
    scan = scanned(laser, posts, frames(laser.transform()), set_to)
    expected = COUNTED if by_settings else text  # there the laser's place is that of the settings
    assert f"; {expected}" in finding_of(scan, set_to).text
    assert scan.mounting is not None
    assert expected in scan.mounting.notes
    with_bumper = limits(obstacle__bumper_ahead_m=3.5, mounting__by_settings=by_settings)
    scan = scanned(laser, posts, frames(laser.transform()), with_bumper)
    assert "bumper" not in finding_of(scan, with_bumper).text
    assert scan.mounting is not None
    assert (scan.mounting.gap_words, len(scan.mounting.notes)) == (None, 1)


# -- bad transforms --------------------------------------------------------------------------------------------------

TURNED = Laser(yaw_rad=math.pi).transform()
NAN = math.nan


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        ([TURNED, row("rear_link", "laser")], "also below rear_link"),
        ([row("base_link", "laser"), TURNED], "two places"),
        ([row("a", "laser"), row("b", "a"), row("laser", "b")], None),  # a loop without a body
        ([row("base_link", "laser", rotation=(0.0, 0.0, 0.0, 0.0))], "unit quaternion"),
        ([row("base_link", "laser", rotation=(0.0, 0.0, 0.7, 0.0))], "unit quaternion"),
        ([row("base_link", "laser", rotation=(0.0, 0.0, NAN, 1.0))], "not a number"),
        ([row("base_link", "laser", x_m=math.inf)], "not a number"),
        ([row("base_link", "laser", x_m=300.0)], "more than 50 m"),
    ],
)
def test_transforms_that_contradict_each_other_are_not_guessed_at(rows: list[dict[str, Any]], why: str | None) -> None:
    by = frames(*rows)
    finding = finding_of(scanned(Laser(), [(3.3, 0.0, 0.3)], by))
    if why is None:
        assert "assumed" in finding.text or finding.verdict == "unknown"
        return
    assert finding.verdict == "unknown"
    assert why in finding.text
    settled = scanned(Laser(), [(3.3, 0.0, 0.3)], by, limits(mounting__by_settings=1.0))
    assert finding_of(settled).verdict == "fault", "the operator knows"


def test_a_frame_that_is_renamed_in_mid_drive_is_not_guessed_at() -> None:
    laser, posts = Laser(yaw_rad=math.pi), [(3.3, 0.0, 0.3)]
    by = frames(laser.transform())
    assert finding_of(scanned(laser, posts, by)).verdict == "fault"
    renamed = finding_of(scanned(laser, posts, by, frame="laser_2"))
    assert (renamed.verdict, "its frame was laser and is laser_2" in renamed.text) == ("unknown", True)
    by.receive("/tf_static", {"transforms": [laser.transform(child="laser_2")]})
    assert finding_of(scanned(laser, posts, by, frame="laser_2")).verdict == "fault"


def test_after_the_link_was_lost_transforms_are_sent_again_and_may_be_others() -> None:
    posts = [(3.3, 0.0, 0.3)]
    by = frames(Laser(yaw_rad=math.pi).transform())
    assert finding_of(scanned(Laser(yaw_rad=math.pi), posts, by)).verdict == "fault"
    by.forget()
    waiting = finding_of(scanned(Laser(yaw_rad=math.pi), posts, by))
    assert (waiting.verdict, "is not sent any more" in waiting.text) == ("unknown", True), (
        "it is known not to look ahead"
    )
    by.receive("/tf_static", {"transforms": [Laser(yaw_rad=1.0).transform()]})
    assert finding_of(scanned(Laser(yaw_rad=1.0), posts, by)).verdict == "fault"


def test_frames_that_name_no_body_are_no_answer() -> None:
    assert "assumed" in finding_of(scanned(Laser(), [], frames(row("map", "odom"), row("odom", "laser")))).text
    assert "assumed" in finding_of(scanned(Laser(), [], frames(row("base_link", "camera")))).text


@pytest.mark.parametrize(
    "rows",
    [
        [row("/base_link", "/laser", rotation=(0.0, 0.0, 1.0, 0.0))],
        [row("odom", "base_footprint"), row("base_footprint", "base_link"), TURNED],
        [
            row("base_footprint", "base_link", z_m=0.3),
            row("base_link", "tower"),
            Laser(yaw_rad=math.pi).transform("tower"),
        ],
        [row("base_footprint", "base_link"), Laser(yaw_rad=math.pi).transform("base_footprint")],
        [row("base_link", "chassis"), Laser(yaw_rad=math.pi).transform("chassis")],
        [Laser(yaw_rad=math.pi).transform("vehicle")],
        [row("base_link", "turned", rotation=(0.0, 0.0, 1.0, 0.0)), row("turned", "laser")],
    ],
)
def test_the_body_is_found(rows: list[dict[str, Any]]) -> None:
    for order in (rows, rows[::-1]):
        scan = scanned(Laser(yaw_rad=math.pi), [(3.3, 0.0, 0.3)], frames(*order))
        assert finding_of(scan).verdict == "fault"
        assert scan.mounting is not None
        assert scan.mounting.origin == "transforms"


def test_names_of_a_namespace_are_its_own() -> None:
    by = Frames()
    by.receive("/tf_static", {"transforms": [Laser(yaw_rad=math.pi).transform("agv2/base_link", "agv2/laser")]})
    by.receive("/agv1/tf_static", {"transforms": [Laser(yaw_rad=1.0).transform()]})
    scan = laser_scan(Laser().scan([], frame="agv2/laser"))
    assert by.mounted("/agv2/scan", scan, LIMITS).mounting.yaw_rad == pytest.approx(math.pi, abs=1e-4)  # type: ignore[union-attr]
    scan = laser_scan(Laser().scan([], frame="laser"))
    assert by.mounted("/agv1/scan", scan, LIMITS).mounting.yaw_rad == pytest.approx(1.0, abs=1e-4)  # type: ignore[union-attr]
    assert by.mounted("/scan", scan, LIMITS).mounting.origin == "assumed"  # type: ignore[union-attr]


def test_what_moves_counts_as_it_was_sent_last() -> None:
    by = frames(Laser(yaw_rad=1.0).transform(), topic="/tf")
    assert scanned(Laser(), [], by).mounting.yaw_rad == pytest.approx(1.0, abs=1e-4)  # type: ignore[union-attr]
    by.receive("/tf", {"transforms": [row("odom", "base_link", 5.0), Laser(yaw_rad=2.0).transform()]})
    assert scanned(Laser(), [], by).mounting.yaw_rad == pytest.approx(2.0, abs=1e-4)  # type: ignore[union-attr]


def test_what_is_kept_is_bounded() -> None:
    by = Frames()
    for number in range(2_000):
        by.receive("/tf", {"transforms": [row("base_link", f"joint_{number}"), row("x" * 200, "y"), {}, None, 3]})
        by.receive(f"/ns{number}/tf", {"transforms": [row("base_link", "laser")]})
        scanned(Laser(beams=3), [], by, frame=f"frame_{number}")
    assert len(by._trees) <= 8
    assert 400 < len(by._trees[""]._links) <= 500
    assert len(by._kept) <= 64
    assert 0 < len(by.notes) <= 200
    for junk in (None, 3, "tf", {}, {"transforms": None}, {"transforms": 3}):
        by.receive("/tf", junk)


@pytest.mark.parametrize("topic", ["/tf", "/tf_static"])
def test_a_needed_frame_is_never_forgotten_though_names_come_without_end(topic: str) -> None:
    """Only the laser is sent once, before all others; those are named by a counter."""
    by = frames(Laser(yaw_rad=1.0).transform("mast", "laser"), topic="/tf_static")
    by.receive("/tf", {"transforms": [row("base_link", "mast", 0.5)]})
    for number in range(3_000):
        scanned(Laser(beams=3), [], by)
        for part in range(10):
            by.receive(topic, {"transforms": [row("map", f"goal_{number}_{part}")]})
    assert scanned(Laser(), [], by).mounting.yaw_rad == pytest.approx(1.0, abs=1e-4)  # type: ignore[union-attr]
    assert by.notes == ["More than 500 frames are sent: the longest unused are forgotten, goal_0_0 first."]


def test_a_static_frame_that_no_sensor_asked_for_yet_outlives_those_that_move() -> None:
    by = frames(Laser(yaw_rad=1.0).transform(), topic="/tf_static")
    for number in range(2_000):
        by.receive("/tf", {"transforms": [row("map", f"goal_{number}")]})
    assert scanned(Laser(), [], by).mounting.origin == "transforms"  # type: ignore[union-attr]


def test_a_laser_whose_frame_is_named_by_a_counter_is_placed_each_time() -> None:
    by = Frames()
    names: set[bytes] = set()
    for number in range(2_000):
        by.receive("/tf", {"transforms": [Laser(yaw_rad=1.0).transform("base_link", f"laser_{number}")]})
        assert scanned(Laser(beams=3), [], by, frame=f"laser_{number}").mounting.why_not is None  # type: ignore[union-attr]
        by.note_needed(names)
        assert f"laser_{number}".encode() in names
    assert len(by._requested) <= 64
    assert len(by._trees[""]._placed) <= 64


# -- which looks ahead -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("yaw_deg", "shape", "answer"),
    [
        (0, WIDE, True),
        (59, WIDE, True),
        (110, WIDE, True),
        (135, WIDE, False),
        (180, WIDE, False),
        (180, ROUND, True),
        (70, {"beams": 90, "first_rad": -0.2, "increment_rad": 0.4 / 89}, False),
    ],
)
def test_which_laser_looks_ahead(yaw_deg: float, shape: dict[str, Any], answer: bool) -> None:
    laser, tree = Laser(yaw_rad=math.radians(yaw_deg), **shape), FrameTree()
    assert looks_ahead(tree, "laser", laser_scan(laser.scan([]))) is None
    tree.add({"transforms": [laser.transform()]}, is_static=True)
    assert looks_ahead(tree, "laser", laser_scan(laser.scan([]))) is answer
