"""Which topic carries each signal: by evidence, with a reason; what evidence does not decide becomes a question."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from server.judge.frame_names import is_earth_fixed
from server.judge.sources.candidates import to_compare
from server.judge.sources.choice import Choice, choose
from server.judge.sources.evidence import Evidence

TWIST, STAMPED, ODOM = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry"
SCAN, FIX = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/NavSatFix"
LASERS = {"/front/scan": SCAN, "/rear/scan": SCAN}


def chosen(choice: Choice) -> dict[str, str]:
    return {signal: source.topic for signal, source in choice.sources.items()}


def header(frame: str, at_s: float) -> dict[str, Any]:
    return {"frame_id": frame, "stamp": {"sec": int(at_s), "nanosec": round(at_s % 1 * 1e9)}}


def twist(x: float, y: float = 0.0) -> dict[str, Any]:
    return {"linear": {"x": x, "y": y, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}


def stamped(x: float, y: float = 0.0, frame: str = "", at_s: float = 1.0) -> dict[str, Any]:
    return {"header": header(frame, at_s), "twist": twist(x, y)}


def odometry(way_m: float, mps: float) -> dict[str, Any]:
    pose = {"position": {"x": way_m, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    return {"header": header("odom", 1.0), "pose": {"pose": pose}, "twist": {"twist": twist(mps)}}


def scan(frame: str, at_s: float = 1.0, ranges: Any = (1.0, 2.0)) -> dict[str, Any]:
    beams = list(ranges)
    return {
        "header": header(frame, at_s), "ranges": beams, "angle_min": -1.0, "angle_max": 1.0,
        "angle_increment": 2.0 / (len(beams) - 1), "range_min": 0.1, "range_max": 30.0,
        "time_increment": 0.0, "scan_time": 0.1,
    }  # fmt: skip


def shown(topics: Mapping[str, str], *messages: tuple[str, Any, float]) -> Evidence:
    evidence = Evidence()
    evidence.follow(topics)
    for topic, message, at_s in messages:
        evidence.receive(topic, message, at_s)
    return evidence


def frames(ahead: Mapping[str, bool | None] = {}, **by_topic: str) -> Evidence:
    """`ahead`: frame → whether a laser there looks ahead."""
    evidence = Evidence(lambda _, seen: ahead.get(seen.frame_id))
    evidence.follow(LASERS)
    for name, frame in by_topic.items():
        evidence.receive(f"/{name}/scan", scan(frame), 1.0)
    return evidence


# -- lasers ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("evidence", [Evidence(), frames(front="a", rear="b"), frames(front="laser", rear="laser")])
def test_two_lasers_are_asked_for_whatever_their_names_say(evidence: Evidence) -> None:
    choice = choose(LASERS, evidence=evidence)
    assert "scan" not in choice.sources
    assert choice.undecided["scan"] == "two lasers, none chosen"
    (question,) = choice.questions
    assert question["words"] == "Two lasers: which one faces forward?"
    assert [one["value"] for one in question["options"]] == ["/front/scan", "/rear/scan"]
    assert "its name suggests forward" in question["options"][0]["why"]
    assert [one.topic for one in choice.watched["scan"]] == ["/front/scan", "/rear/scan"]
    assert not any(one.carries for one in choice.watched["scan"])


def test_tf_decides_which_laser_looks_ahead() -> None:
    evidence = frames({"one": False, "two": True}, front="one", rear="two")
    source = choose(LASERS, evidence=evidence).sources["scan"]
    assert (source.topic, source.why) == ("/rear/scan", "faces forward by TF")


@pytest.mark.parametrize("ahead", [{}, {"one": None}, {"one": False, "two": False}, {"one": True, "two": True}])
def test_tf_that_names_none_or_both_does_not_decide(ahead: dict[str, bool | None]) -> None:
    evidence = frames(ahead, front="one", rear="two")
    assert "scan" not in choose(LASERS, evidence=evidence).sources


def copies(*, noise: float, frame: str = "laser", late_s: float = 0.0) -> Evidence:
    topics, rng = {"/scan_filtered": SCAN, "/scan": SCAN}, np.random.default_rng(3)
    evidence = shown(topics)
    for n in range(60):
        at_s = 10.0 + n / 10
        ranges = 5.0 + rng.normal(0, 0.05, 181)
        other = np.where(np.arange(181) < 30, np.nan, ranges + rng.normal(0, noise, 181) if noise else ranges)
        evidence.receive("/scan", scan("laser", at_s, ranges.tolist()), at_s)
        beams = [None if math.isnan(one) else one for one in other.tolist()]
        evidence.receive("/scan_filtered", scan(frame, at_s + late_s, beams), at_s + 0.002)
    return evidence


def test_a_laser_and_its_filter_are_one_laser() -> None:
    evidence = copies(noise=0.0)
    choice = choose({"/scan_filtered": SCAN, "/scan": SCAN}, evidence=evidence)
    assert chosen(choice)["scan"] == "/scan"
    assert choice.questions == ()


@pytest.mark.parametrize("other", [{"noise": 0.01}, {"noise": 0.0, "frame": "rear"}, {"noise": 0.0, "late_s": 0.01}])
def test_lasers_that_differ_in_values_frame_or_time_are_two(other: dict[str, Any]) -> None:
    choice = choose({"/scan_filtered": SCAN, "/scan": SCAN}, evidence=copies(**other))
    assert "scan" not in choice.sources
    assert [one["value"] for one in choice.questions[0]["options"]] == ["/scan", "/scan_filtered"]


def test_the_catvehicles_laser_says_what_it_is() -> None:
    topics = {"/catvehicle/front_laser_points": SCAN, "/catvehicle/back_laser_points": SCAN}
    assert chosen(choose(topics))["scan"] == "/catvehicle/front_laser_points"
    assert to_compare(topics, {}) == {}


# -- speed -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame", ["gps", "gnss_antenna", "navsat_link", "map", "/world", "gps0", "ENU", "utm"])
@pytest.mark.parametrize("course", range(0, 360, 30))
def test_a_velocity_in_a_frame_of_the_earth_never_beats_the_wheels(frame: str, course: int) -> None:
    topics = {"/vel": STAMPED, "/odom": ODOM}
    x, y = 9.0 * math.sin(math.radians(course)), 9.0 * math.cos(math.radians(course))
    source = choose(topics, evidence=shown(topics, ("/vel", stamped(x, y, frame), 1.0))).sources["speed"]
    assert (source.topic, source.why) == ("/odom", "the only speed along the car")
    alone = choose({"/vel": STAMPED}, evidence=shown(topics, ("/vel", stamped(x, y, frame), 1.0))).sources["speed"]
    assert alone.decode is not None
    assert alone.decode(stamped(x, y, frame)).speed_mps == pytest.approx(9.0)


@pytest.mark.parametrize("frame", ["base_link", "", "chassis", "mapper", "engpsy", "worldwide_base"])
def test_a_frame_is_of_the_earth_by_whole_words_only(frame: str) -> None:
    topics = {"/vel": STAMPED, "/odom": ODOM}
    assert not is_earth_fixed(frame)
    assert chosen(choose(topics, evidence=shown(topics, ("/vel", stamped(3.0, 0.1, frame), 1.0))))["speed"] == "/vel"


def beside_the_wheels(kind: str, course: int, *, reverses: bool = False) -> Evidence:
    """/vel without a useful frame, in east and north, beside /odom; the car may drive backwards on that course."""
    topics = {"/vel": kind, "/odom": ODOM}
    evidence = shown(topics)
    for n in range(20):
        at_s, mps = n / 10, 6.0 + 0.1 * n
        evidence.receive("/odom", odometry(mps * at_s, -mps if reverses else mps), at_s)
        x, y = mps * math.sin(math.radians(course)), mps * math.cos(math.radians(course))
        evidence.receive("/vel", twist(x, y) if kind == TWIST else stamped(x, y, "vehicle"), at_s + 0.01)
    return evidence


@pytest.mark.parametrize("kind", [TWIST, STAMPED])
@pytest.mark.parametrize("course", [0, 30, 150, 180, 200, 260, 270, 280, 330])
def test_values_show_that_a_velocity_is_in_east_and_north(kind: str, course: int) -> None:
    choice = choose({"/vel": kind, "/odom": ODOM}, evidence=beside_the_wheels(kind, course))
    assert chosen(choice)["speed"] == "/odom"


@pytest.mark.parametrize("kind", [TWIST, STAMPED])
def test_values_along_the_car_keep_the_usual_name_forwards_and_backwards(kind: str) -> None:
    topics = {"/vel": kind, "/odom": ODOM}
    for evidence in (beside_the_wheels(kind, 90), beside_the_wheels(kind, 270, reverses=True)):
        assert chosen(choose(topics, evidence=evidence))["speed"] == "/vel"


@pytest.mark.parametrize("course", [0, 60, 180, 240, 270, 300])
def test_a_velocity_that_follows_the_course_over_ground_is_read_without_a_sign(course: int) -> None:
    topics = {"/vel": STAMPED, "/fix": FIX}
    evidence, mps, angle = shown(topics), 8.0, math.radians(course)
    for n in range(30):
        at_s = n / 5
        north, east = mps * at_s * math.cos(angle), mps * at_s * math.sin(angle)
        place = {"latitude": 48 + north / 111_200, "longitude": 11 + east / 111_200 / math.cos(math.radians(48))}
        evidence.receive("/fix", {"status": {"status": 0}, **place}, at_s)
        evidence.receive("/vel", stamped(mps * math.sin(angle), mps * math.cos(angle), "sensor"), at_s + 0.01)
    source = choose(topics, evidence=evidence).sources["speed"]
    assert source.note == "its velocity is east and north: the way made, without a sign"
    assert source.decode is not None
    assert source.decode(stamped(-8.0, 0.0, "sensor")).speed_mps == 8.0


def test_an_odometry_whose_twist_is_never_filled_gives_no_speed() -> None:
    rows = [("/a/pose", odometry(n * 0.4, 0.0), n / 10) for n in range(60)]
    alone = choose({"/a/pose": ODOM}, evidence=shown({"/a/pose": ODOM}, *rows))
    assert alone.undecided == {"speed": "/a/pose has no speed: its twist is zero while its pose moves"}
    assert alone.refused == {"speed"}
    assert alone.questions == ()
    assert chosen(alone) == {"odometry": "/a/pose"}
    picked = choose({"/a/pose": ODOM}, {"speed": "/a/pose"}, evidence=shown({"/a/pose": ODOM}, *rows))
    assert "speed" in picked.undecided
    two = {"/a/pose": ODOM, "/b/wheels": ODOM}
    assert chosen(choose(two, evidence=shown(two, *rows)))["speed"] == "/b/wheels"


@pytest.mark.parametrize(
    ("ways", "speeds"),
    [
        ([0.0] * 20, [0.0] * 20),  # stands
        ([0.3] * 10 + [3.3] * 10, [0.0] * 20),  # one jump of an estimate is no motion
        ([n * 0.4 for n in range(60)], [0.0] * 59 + [0.1]),  # filled at last
        ([n * 0.4 for n in range(60)], [math.nan] * 60),  # states itself that it is not known
    ],
)
def test_what_may_yet_be_filled_is_accepted(ways: list[float], speeds: list[float]) -> None:
    pairs = enumerate(zip(ways, speeds, strict=True))
    rows = [("/odom", odometry(way, mps), n / 10) for n, (way, mps) in pairs]
    assert chosen(choose({"/odom": ODOM}, evidence=shown({"/odom": ODOM}, *rows)))["speed"] == "/odom"


def test_odometries_without_a_usual_name_are_asked_for_unless_their_values_agree() -> None:
    topics = {"/left/wheel_odom": ODOM, "/visual_odom": ODOM}
    choice = choose(topics)
    assert not {"speed", "odometry"} & set(choice.sources)
    assert [one["words"] for one in choice.questions] == ["Two odometries: which is the car's speed?"]
    rows = [
        (topic, odometry(n * 0.3, mps), n / 10)
        for n in range(40)
        for topic, mps in zip(topics, (3.0, 3.1), strict=True)
    ]
    assert set(chosen(choose(topics, evidence=shown(topics, *rows)))) == {"speed", "odometry"}
    answered = choose(topics, {"speed": "/visual_odom"})
    assert chosen(answered) == {"speed": "/visual_odom", "odometry": "/visual_odom"}
    assert answered.questions == ()


def test_what_is_in_use_stays_when_another_comes_and_is_asked_for() -> None:
    topics = {"/left/wheel_odom": ODOM, "/visual_odom": ODOM}
    choice = choose(topics, in_use={"speed": "/visual_odom", "odometry": "/visual_odom"})
    assert chosen(choice) == {"speed": "/visual_odom", "odometry": "/visual_odom"}


# -- types, publishers and namespaces ----------------------------------------------------------------------------------


def test_a_readable_source_beats_an_unreadable_one_of_a_better_name() -> None:
    other = "geometry_msgs/msg/TwistWithCovarianceStamped"
    assert chosen(choose({"/vehicle/twist": other, "/odom": ODOM}))["speed"] == "/odom"
    alone = choose({"/vehicle/twist": other}).sources["speed"]
    assert (alone.topic, alone.decode) == ("/vehicle/twist", None)


CARS = {"/agv1/odom": ODOM, "/agv2/odom": ODOM, "/agv1/gps/fix": FIX, "/agv2/scan": SCAN}


@pytest.mark.parametrize(
    ("topics", "text"),
    [
        (CARS, "Two cars: /agv1 and /agv2: which is this?"),
        ({f"/robot_{n}/odom": ODOM for n in range(3)}, "Three cars: /robot_0, /robot_1 and /robot_2: which is this?"),
        (
            {"/fleet/a7/base/odom": ODOM, "/fleet/b2/base/odom": ODOM},
            "Two cars: /fleet/a7 and /fleet/b2: which is this?",
        ),
    ],
)
def test_several_cars_on_one_bridge_are_asked_for_once(topics: dict[str, str], text: str) -> None:
    choice = choose(topics)
    assert choice.sources == {}
    assert [one["words"] for one in choice.questions] == [text]


@pytest.mark.parametrize(
    "topics",
    [
        {"/front_2d_lidar/scan": SCAN, "/chassis/odom": ODOM, "/gps/fix": FIX},
        {"/wheel/odom": ODOM, "/visual/odom": ODOM},
        {"/lidar1/scan": SCAN, "/lidar2/scan": SCAN},
        {"/gps_front/fix": FIX, "/gps_rear/fix": FIX},
        {"/catvehicle/vel": TWIST, "/catvehicle/odom": ODOM, "/vehicle/odom": ODOM},
        {"/agv/odom": ODOM, "/agv/lidar/scan": SCAN, "/odom": ODOM},
    ],
)
def test_sensors_and_parts_of_one_car_are_no_cars(topics: dict[str, str]) -> None:
    assert not any("cars" in one["words"] for one in choose(topics).questions)


@pytest.mark.parametrize("car", ["/agv1", "/agv2"])
def test_random_topics_of_several_cars_never_mix(car: str) -> None:
    rng = random.Random(car)
    for _ in range(100):
        tails = {"odom": ODOM, "scan": SCAN, "gps/fix": FIX, "imu/data": "sensor_msgs/msg/Imu", "base/odom": ODOM}
        topics = {f"{one}/odom": ODOM for one in ("/agv1", "/agv2")}
        topics |= {f"/agv{rng.randint(1, 2)}/{tail}": kind for tail, kind in rng.sample(sorted(tails.items()), 3)}
        found = chosen(choose(topics, {"speed": f"{car}/odom"}))
        assert {topic.split("/")[1] for topic in found.values()} == {car[1:]}
        assert set(choose(topics).sources) == set()


def test_another_car_that_comes_does_not_end_what_is_in_use() -> None:
    in_use = {"speed": "/agv1/odom", "odometry": "/agv1/odom", "position": "/agv1/gps/fix"}
    choice = choose(CARS, in_use=in_use)
    assert chosen(choice) == in_use
    assert [one["words"] for one in choice.questions] == ["Two cars: /agv1 and /agv2: which is this?"]


# -- bad input ---------------------------------------------------------------------------------------------------------


def test_500_candidates_are_bounded_and_named_with_their_count() -> None:
    topics = {f"/unit/l{n}_laser": SCAN for n in range(500)} | {f"/o{n}_odometry": ODOM for n in range(500)}
    choice = choose(topics)
    assert [len(one["options"]) for one in choice.questions] == [12, 12]
    assert [one["options_count"] for one in choice.questions] == [500, 500]
    assert choice.questions[0]["words"] == "500 lasers: which one faces forward?"
    assert max(map(len, choice.watched.values())) <= 4
    assert len(to_compare(topics, {})) <= 64


def test_a_pick_that_is_not_there_is_said() -> None:
    choice = choose({"/odom": ODOM}, {"speed": "/gone"})
    assert choice.undecided == {"speed": "/gone, chosen by the operator, is not there"}


@pytest.mark.parametrize("name", ["", "/", "//", "/ü\n/scan", "/" + "a/" * 200 + "odom", "\x00", "/agv1//odom"])
def test_strange_names_do_not_break_the_choice(name: str) -> None:
    for kind in (SCAN, ODOM, FIX, TWIST, "", "/", "nonsense"):
        choose({name: kind, "/odom": ODOM, "/agv2/odom": ODOM, "/scan": SCAN})


def test_messages_that_are_not_proper_show_nothing() -> None:
    topics = {"/vel": STAMPED, "/odom": ODOM, "/fix": FIX, "/scan": SCAN}
    bad: list[Any] = [None, 3, [], {}, {"twist": 1}, {"twist": {"twist": {}}, "pose": {"pose": {}}}, {"header": 4}]
    evidence = shown(topics, *((topic, message, 1.0) for topic in topics for message in bad))
    assert chosen(choose(topics, evidence=evidence))["speed"] == "/vel"


@pytest.mark.parametrize("seed", range(20))
def test_the_choice_depends_on_no_order_and_every_source_has_a_reason(seed: int) -> None:
    rng = random.Random(seed)
    names = ["/odom", "/vel", "/scan", "/front/scan", "/fix", "/gps/fix", "/a/b", "/wheel/odom", "/imu", "/agv1/odom"]
    topics = {rng.choice(names) + rng.choice(["", "_2", "/x"]): rng.choice([ODOM, SCAN, FIX, TWIST]) for _ in range(8)}
    rows = list(topics.items())
    first = choose(topics)
    rng.shuffle(rows)
    again = choose(dict(rows))
    assert (chosen(again), again.questions, again.undecided) == (chosen(first), first.questions, first.undecided)
    assert all(source.why for source in first.sources.values())
    assert not set(first.sources) & set(first.undecided)


def test_a_twist_that_only_turns_is_not_filled() -> None:
    turning = [odometry(float(n), 0.0) for n in range(40)]
    for message in turning:
        message["twist"]["twist"]["angular"]["z"] = 0.1
    evidence = shown({"/odom": ODOM}, *[("/odom", one, n * 0.1) for n, one in enumerate(turning)])
    assert "speed" not in chosen(choose({"/odom": ODOM}, evidence=evidence))


def test_a_way_that_was_driven_unseen_shows_nothing_of_the_twist() -> None:
    """A recording is looked at in windows: the car stands in each of them, and drove between them."""
    windows = [(0.0, 0.0), (20.0, 90.0), (60.0, 300.0)]
    standing = [("/odom", odometry(way_m, 0.0), at_s + n * 0.1) for at_s, way_m in windows for n in range(10)]
    choice = choose({"/odom": ODOM}, evidence=shown({"/odom": ODOM}, *standing))
    assert chosen(choice)["speed"] == "/odom"


def test_the_laser_in_use_stays_while_the_transforms_come_anew() -> None:
    evidence = frames(front="a", rear="b")
    choice = choose(LASERS, evidence=evidence, in_use={"scan": "/rear/scan"})
    assert (chosen(choice)["scan"], choice.questions) == ("/rear/scan", ())
    contradicted = frames({"a": True, "b": False}, front="a", rear="b")
    assert chosen(choose(LASERS, evidence=contradicted, in_use={"scan": "/rear/scan"}))["scan"] == "/front/scan"
