"""Transforms of a recording: wherever they are in it, they hold for the whole drive, and where it is continued."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from monitor.scan import Mounting
from server.analysis.rehearse import rehearse
from server.judge.drive import Drive as JudgedDrive
from server.judge.frames import Frames
from server.judge.offline import OfflineRun
from server.judge.signals.scan import laser_scan
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import Recording, open_recording
from server.replay import timeline
from tests.server.judge.mounted_lasers import Laser, row
from tests.server.recording.bags import Drive, Row, write_ros1, write_ros2

TF = "tf2_msgs/msg/TFMessage"
TF_TEXT = {TF: "geometry_msgs/TransformStamped[] transforms\n"}
BACKWARDS = Laser(x_m=0.5, yaw_rad=math.pi, beams=360, increment_rad=math.tau / 360)
POST = [(3.8, 0.0, 0.3)]


def scans(from_s: float, to_s: float, frame: str = "laser") -> list[Row]:
    fields = BACKWARDS.scan(POST, frame=frame)
    count = round((to_s - from_s) * 10)
    return [(from_s + 0.1 * n + 0.01, "/scan", "sensor_msgs/msg/LaserScan", fields) for n in range(count)]


def sent(at_s: float, *rows: dict[str, Any], topic: str = "/tf_static") -> Row:
    return (at_s, topic, TF, {"transforms": [*rows]})


def written(path: Path, version: int, rows: list[Row]) -> Path:
    rows = sorted(rows, key=lambda one: one[0])
    if version == 1:
        return write_ros1(path.with_suffix(".bag"), Drive(messages=rows, definitions=TF_TEXT, latched={"/tf_static"}))
    return write_ros2(path, Drive(messages=rows, latched={"/tf_static"}))


def judged_drive(recording: Recording) -> JudgedDrive:
    return JudgedDrive(recording, read_recorded_events(recording))


def mounting(run: OfflineRun) -> Mounting:
    found = run.run_state.state.snapshot(run.at_s).need("scan").mounting
    assert found is not None
    return found


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("at_s", [0.0, 5.0, 9.9])
@pytest.mark.parametrize("topic", ["/tf_static", "/tf"])
def test_transforms_hold_for_the_whole_drive_wherever_they_are_in_it(
    tmp_path: Path, version: int, at_s: float, topic: str
) -> None:
    path = written(tmp_path / "drive", version, [*scans(0.0, 10.0), sent(at_s, BACKWARDS.transform(), topic=topic)])
    with open_recording([path]) as recording:
        drive = judged_drive(recording)
        for from_s in (0.0, 7.0):  # a replay that starts in the middle too
            run = OfflineRun(recording, drive, from_s=from_s)
            run.advance(from_s + 1.0)
            assert mounting(run).yaw_rad == pytest.approx(math.pi, abs=1e-4)
            (tile,) = (tile for tile in run.run_state.monitor.tiles() if "obstacle" in tile.checks)
            assert tile.verdict == "fault"


def test_the_second_part_of_a_split_drive_has_those_of_the_first(tmp_path: Path) -> None:
    first = written(tmp_path / "one", 1, [*scans(0.0, 5.0), sent(0.0, BACKWARDS.transform())])
    second = written(tmp_path / "two", 1, scans(5.0, 10.0))
    with open_recording([second, first]) as recording:
        run = OfflineRun(recording, judged_drive(recording), from_s=7.0)
        run.advance(8.0)
        assert mounting(run).origin == "transforms"


def test_a_laser_on_a_tower_that_turns_is_where_it_was_sent_last_also_after_a_checkpoint(tmp_path: Path) -> None:
    turning = [sent(0.5 * n, Laser(yaw_rad=0.2 * n).transform(), topic="/tf") for n in range(20)]
    path = written(tmp_path / "drive", 2, [*scans(0.0, 10.0), *turning])
    with open_recording([path]) as recording:
        run = OfflineRun(recording, drive := judged_drive(recording))
        run.advance(3.2)
        assert mounting(run).yaw_rad == pytest.approx(1.2, abs=1e-4)
        saved = timeline.save_checkpoint(run.run_state)
        run.advance(9.9)
        assert math.remainder(mounting(run).yaw_rad - 3.8, math.tau) == pytest.approx(0.0, abs=1e-4)
        again = OfflineRun(recording, drive, run_state=timeline.restore_checkpoint(saved))
        again.advance(4.2)
        assert mounting(again).yaw_rad == pytest.approx(1.6, abs=1e-4)


def test_what_moves_is_not_decoded_where_static_transforms_place_the_laser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    moving = [sent(0.1 * n, row("odom", "base_link", 0.1 * n), topic="/tf") for n in range(100)]
    path = written(tmp_path / "drive", 2, [*scans(0.0, 10.0), *moving, sent(0.0, BACKWARDS.transform())])
    with open_recording([path]) as recording:
        run = OfflineRun(recording, judged_drive(recording))
        received: list[Any] = []
        monkeypatch.setattr(Frames, "receive", lambda *what: received.append(what))
        run.advance(9.9)
        assert mounting(run).origin == "transforms"
        assert received == []


def test_a_frame_that_is_renamed_in_mid_drive_ends_the_check(tmp_path: Path) -> None:
    rows = [*scans(0.0, 5.0), *scans(5.0, 10.0, frame="laser_2"), sent(0.0, BACKWARDS.transform())]
    with open_recording([written(tmp_path / "drive", 2, rows)]) as recording:
        run = OfflineRun(recording, judged_drive(recording))
        run.advance(4.0)
        assert mounting(run).why_not is None
        run.advance(6.0)
        assert "its frame was laser and is laser_2" in (mounting(run).why_not or "")
        (tile,) = (tile for tile in run.run_state.monitor.tiles() if "obstacle" in tile.checks)
        assert tile.verdict == "unknown"


@pytest.mark.parametrize("topic", ["/tf_static", "/tf"])
def test_a_replay_that_begins_after_a_frame_was_renamed_knows_that_it_was(tmp_path: Path, topic: str) -> None:
    rows = [*scans(0.0, 5.0), *scans(5.0, 10.0, frame="laser_2"), sent(0.0, BACKWARDS.transform(), topic=topic)]
    with open_recording([written(tmp_path / "drive", 2, rows)]) as recording:
        run = OfflineRun(recording, judged_drive(recording), from_s=7.0)
        run.advance(8.0)
        assert "its frame was laser and is laser_2" in (mounting(run).why_not or "")


LATE = {  # what is sent in the middle of a drive: topic, transforms
    "another parent": ("/tf", [Laser().transform("mast", "laser")]),
    "another parent, as static": ("/tf_static", [Laser().transform("mast", "laser")]),
    "another place, as static": ("/tf_static", [Laser(x_m=2.0).transform()]),
    "nothing": ("/tf", [row("odom", "base_link", 3.0)]),
}


@pytest.mark.parametrize("placed_by", ["/tf_static", "/tf"])
@pytest.mark.parametrize("late", LATE)
def test_a_contradiction_that_comes_late_is_said_in_the_same_words_as_live(
    tmp_path: Path, late: str, placed_by: str
) -> None:
    topic, transforms = LATE[late]
    moving = [sent(0.02 * n, row("odom", "base_link", 0.1 * n), topic="/tf") for n in range(500)]
    first = sent(0.0, BACKWARDS.transform(), topic=placed_by)
    rows = [*scans(0.0, 10.0), *moving, first, *(sent(6.0 + 0.2 * n, *transforms, topic=topic) for n in range(3))]
    with open_recording([written(tmp_path / "drive", 2, rows)]) as recording:
        run = OfflineRun(recording, drive := judged_drive(recording))
        run.advance(5.0)
        before = mounting(run).why_not
        run.advance(8.0)
        recorded = mounting(run)
        report = rehearse(recording)
        limits = drive.epochs[0].tuning.limits
    live = Frames()
    for _, name, kind, message in sorted(rows, key=lambda one: one[0]):
        if kind == TF:
            live.receive(name, message)
    scan = laser_scan(BACKWARDS.scan(POST))
    expected = live.mounted("/scan", scan, limits).mounting
    assert expected is not None
    if topic == "/tf":  # else another one of the two came first
        assert recorded == expected
    if late == "nothing":
        assert (before, recorded.why_not) == (None, None)
        return
    assert recorded.why_not is not None
    assert expected.why_not is not None
    assert topic == "/tf_static" or before is None, "only what is static is known beforehand"
    notes = {frozenset(note.removesuffix(".").split()) for note in report.notes}
    assert {frozenset(note.removesuffix(".").split()) for note in live.notes} & notes


def test_what_is_wrong_with_transforms_is_a_note_of_the_drive(tmp_path: Path) -> None:
    rows = [*scans(0.0, 2.0), sent(0.0, BACKWARDS.transform()), sent(1.0, row("rear_link", "laser"))]
    with open_recording([written(tmp_path / "drive", 2, rows)]) as recording:
        drive = judged_drive(recording)
        assert "The frame laser is below base_link and also below rear_link." in drive.notes
        assert recording.rejected == {}


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("turn_deg", range(0, 360, 45))
@pytest.mark.parametrize("topic", ["/tf_static", "/tf"])
def test_of_two_lasers_the_one_that_looks_ahead_is_taken(
    tmp_path: Path, version: int, turn_deg: int, topic: str
) -> None:
    """The lasers look in opposite directions; where neither looks ahead, there is a question."""
    rows: list[Row] = []
    for number, name in enumerate(("one", "two")):
        yaw_rad = math.radians(turn_deg + 180 * number)
        laser = Laser(yaw_rad=yaw_rad, first_rad=-math.pi / 2, beams=181, increment_rad=math.pi / 180)
        rows += [
            (0.1 * n, f"/{name}/scan", "sensor_msgs/msg/LaserScan", laser.scan(POST, frame=name)) for n in range(100)
        ]
        rows.append(sent(3.0 + number, laser.transform(child=name), topic=topic))
    with open_recording([written(tmp_path / "drive", version, rows)]) as recording:
        choice = judged_drive(recording).epochs[0].choice
    expected = {0: "/one/scan", 45: "/one/scan", 315: "/one/scan", 180: "/two/scan", 135: "/two/scan", 225: "/two/scan"}
    source = choice.sources.get("scan")
    assert (source and source.topic) == expected.get(turn_deg)
    assert len(choice.questions) == (turn_deg not in expected)


# -- Imu and Odometry ------------------------------------------------------------------------------------------------

OPPOSITE = Laser(yaw_rad=math.pi)  # of a sensor that is mounted backwards
STRAIGHT = Laser()
PLACES = {  # static transforms, and those that move, of a sensor that looks back
    "static": ([OPPOSITE.transform(child="imu")], []),
    "moving": ([], [OPPOSITE.transform(child="imu")]),
    "moving, among others": ([row("base_link", "mast")], [OPPOSITE.transform(child="imu")]),
    "on a mast that is sent as moving": ([OPPOSITE.transform("mast", "imu")], [STRAIGHT.transform(child="mast")]),
    "on a turned mast that is sent as moving": (
        [STRAIGHT.transform("mast", "imu")],
        [OPPOSITE.transform(child="mast")],
    ),
    "a body below base_link": ([STRAIGHT.transform("chassis", "imu")], [OPPOSITE.transform(child="chassis")]),
    "a body above base_link": (
        [STRAIGHT.transform("base_footprint", "imu")],
        [OPPOSITE.transform("base_footprint", "base_link")],
    ),
    "a robot's body below base_link": ([STRAIGHT.transform("robot", "imu")], [OPPOSITE.transform(child="robot")]),
}


def measuring(seconds: float, *, frame: str = "imu") -> list[Row]:
    """A car that speeds up northwards at 1 m/s², by a sensor that is mounted backwards."""
    rows: list[Row] = []
    for n in range(round(seconds * 10)):
        imu = {
            "header": {"frame_id": frame},
            "orientation": {"z": -math.sqrt(0.5), "w": math.sqrt(0.5)},
            "orientation_covariance": [0.01] * 9,
            "linear_acceleration": {"x": -1.0, "z": 9.81},
            "linear_acceleration_covariance": [0.01] * 9,
        }
        pose = {"position": {"y": 0.05 * (0.1 * n) ** 2}, "orientation": imu["orientation"]}
        odometry = {
            "header": {"frame_id": "odom"},
            "child_frame_id": frame,
            "pose": {"pose": pose},
            "twist": {"twist": {"linear": {"x": -5.0 - 0.1 * n}}},
        }
        rows.append((0.1 * n + 0.01, "/imu/data", "sensor_msgs/msg/Imu", imu))
        rows.append((0.1 * n + 0.02, "/odom", "nav_msgs/msg/Odometry", odometry))
    return rows


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("place", PLACES)
def test_what_is_measured_has_the_cars_axes_whichever_transforms_place_the_sensor(
    tmp_path: Path, version: int, place: str
) -> None:
    static, moving = PLACES[place]
    rows = [*measuring(3.0), sent(0.0, *static), *(sent(0.1 * n, *moving, topic="/tf") for n in range(30) if moving)]
    with open_recording([written(tmp_path / "drive", version, rows)]) as recording:
        drive = judged_drive(recording)
        run = OfflineRun(recording, drive)
        run.advance(1.05)
        snapshot = run.run_state.state.snapshot(run.at_s)
    assert snapshot.need("speed").speed_mps == pytest.approx(6.0)
    assert snapshot.need("acceleration").acceleration_mps2 == pytest.approx(1.0)
    assert snapshot.need("odometry").yaw_rad == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("place", PLACES)
def test_a_recording_and_the_live_car_have_the_same_axes(tmp_path: Path, place: str) -> None:
    static, moving = PLACES[place]
    live = Frames()
    for topic, transforms in (("/tf_static", static), ("/tf", moving)):
        live.receive(topic, {"transforms": transforms})
    rows = [*measuring(1.0), sent(0.0, *static), sent(0.0, *moving, topic="/tf")]
    with open_recording([written(tmp_path / "drive", 2, rows)]) as recording:
        assert judged_drive(recording).frames.axes("/odom", "imu") == live.axes("/odom", "imu")
    turn = live.axes("/odom", "imu").turn
    assert turn is not None
    assert abs(turn[2]) == pytest.approx(1.0)


def test_the_second_laser_of_a_sweep_is_placed_too(tmp_path: Path) -> None:
    """Scans of one topic come from two frames in turn; one is placed by what moves."""
    both = [*scans(0.0, 3.0, frame="left"), *((t + 0.05, *rest) for t, *rest in scans(0.0, 3.0, frame="right"))]
    rows = [*both, sent(0.0, BACKWARDS.transform(child="left"))]
    rows += [sent(0.1 * n, BACKWARDS.transform(child="right"), topic="/tf") for n in range(30)]
    with open_recording([written(tmp_path / "drive", 2, rows)]) as recording:  # type: ignore[arg-type]
        run = OfflineRun(recording, judged_drive(recording))
        run.advance(1.07)
        assert run.run_state.state.snapshot(run.at_s).need("scan").frame_id == "right"
        assert (mounting(run).why_not, mounting(run).yaw_rad) == (None, pytest.approx(math.pi, abs=1e-4))


def test_what_moves_and_contradicts_a_static_transform_is_noticed(tmp_path: Path) -> None:
    """As it is live."""
    rows = [*measuring(2.0), sent(0.0, OPPOSITE.transform(child="imu"))]
    rows += [sent(0.1 * n, STRAIGHT.transform("mast", "imu"), topic="/tf") for n in range(20)]
    with open_recording([written(tmp_path / "drive", 2, rows)]) as recording:
        run = OfflineRun(recording, judged_drive(recording))
        run.advance(1.0)
        assert "also below mast" in run.run_state.state.snapshot(run.at_s).unusable["acceleration"].text


def test_what_is_not_measured_on_the_car_needs_no_transforms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [
        *measuring(1.0, frame="base_link"),
        *(sent(0.1 * n, row("odom", "base_link"), topic="/tf") for n in range(9)),
    ]
    with open_recording([written(tmp_path / "drive", 2, rows)]) as recording:
        run = OfflineRun(recording, judged_drive(recording))
        received: list[Any] = []
        monkeypatch.setattr(Frames, "receive", lambda *what: received.append(what))
        run.advance(0.9)
        assert received == []


def wheels(seconds: float) -> list[Row]:
    turned = (0.0, math.sin(0.3), 0.0, math.cos(0.3))
    names = [f"wheel_{n}" for n in range(4)]
    return [
        sent(0.02 * n, *(row("base_link", name, 0.02 * n, rotation=turned) for name in names), topic="/tf")
        for n in range(round(seconds * 50))
    ]


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("chain", [["imu"], ["mast", "imu"], ["robot1/top plate", "mast", "imu"], ["chassis", "imu"]])
def test_of_what_moves_only_what_places_a_sensor_is_decoded_also_if_it_comes_late(
    tmp_path: Path, version: int, chain: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Long after the first messages, and each link for itself."""
    rows, parents = [*measuring(12.0), *wheels(12.0)], ["base_link", *chain]
    for number, child in enumerate(chain):
        laser = OPPOSITE if number == 0 else STRAIGHT
        rows += [
            sent(9.0 + 0.2 * n + 0.01 * number, laser.transform(parents[number], child), topic="/tf") for n in range(10)
        ]
    received: list[Any] = []
    whole = Frames.receive
    monkeypatch.setattr(
        Frames, "receive", lambda self, topic, message: received.append(message) or whole(self, topic, message)
    )
    with open_recording([written(tmp_path / "drive", version, rows)]) as recording:
        run = OfflineRun(recording, drive := judged_drive(recording))
        assert drive.moving_transforms == {"/tf"}
        received.clear()
        run.advance(8.0)
        assert received == []
        assert run.run_state.state.snapshot(8.0).need("speed").speed_mps < 0.0, "as without transforms"
        run.advance(11.0)
        assert run.run_state.state.snapshot(11.0).need("speed").speed_mps > 0.0
        assert len(received) < (600 if " " in chain[0] else 120)  # a name with a space may be spelled in another way
