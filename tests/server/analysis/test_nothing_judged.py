"""`catgraph check` of a recording without data of the car: code 2 and the reason, in each output."""

from __future__ import annotations

import re
from pathlib import Path

import orjson
import pytest
from mcap.writer import Writer

from tests.server.analysis.conftest import Checking
from tests.server.recording.bags import Drive, write_ros2

pytestmark = pytest.mark.world(n=10)

STRING = "std_msgs/msg/String"
TWIST = "geometry_msgs/msg/Twist"
ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}


def rows(topic: str, type: str, message: dict[str, object]) -> list[tuple[float, str, str, dict[str, object]]]:
    return [(n / 10, topic, type, message) for n in range(50)]


RECORDINGS = {
    "one topic that nobody knows": (rows("/chatter", STRING, {"data": "x"}), "its topic is not one that"),
    "two of them": (
        rows("/chatter", STRING, {"data": "x"}) + rows("/noise", STRING, {"data": "y"}),
        "none of its 2 topics is one that",
    ),
    "messages of one moment": (
        [(0.0, "/catvehicle/vel", TWIST, {"linear": ZERO, "angular": ZERO})] * 50,
        "covers 0.00 s, too short for any check",
    ),
    "a known topic of a type that cannot be read": (
        rows("/catvehicle/vel", STRING, {"data": "x"}),
        r"/catvehicle/vel has another type, std_msgs/String, which is not read as Speed\.$",
    ),
}


@pytest.mark.parametrize("name", RECORDINGS)
def test_nothing_judged_is_exit_2_and_said(check: Checking, tmp_path: Path, name: str) -> None:
    messages, why = RECORDINGS[name]
    recording = write_ros2(tmp_path / "drive", Drive(messages=messages))
    ending = check(recording, "--json", tmp_path / "out.json", "--html", tmp_path / "out.html")
    assert ending.code == 2
    assert ending.err.startswith("catgraph check: Nothing could be evaluated: ")
    found = orjson.loads((tmp_path / "out.json").read_bytes())
    assert found["judged"]["nothing_why"] == ending.err.removeprefix("catgraph check: ").strip()
    page = (tmp_path / "out.html").read_text()
    assert "Nothing judged" in page
    assert "No alarms</b>" not in page
    assert re.search(why, ending.err)


def test_known_topics_without_messages_beside_one_of_another_type(check: Checking, tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        text = writer.register_schema(STRING, "ros2msg", b"string data")
        written = writer.register_channel("/catvehicle/vel", "cdr", text)
        number = writer.register_schema("sensor_msgs/msg/LaserScan", "ros2msg", b"")
        writer.register_channel("/catvehicle/front_laser_points", "cdr", number)
        for n in range(50):
            writer.add_message(written, n * 10**8, b"\0\1\0\0\2\0\0\0x\0", n * 10**8)
        writer.finish()  # type: ignore[no-untyped-call]
    ending = check(path, "--json", "-")
    assert ending.code == 2
    assert "which is not read as Speed; the others have no message here." in ending.err


def test_one_signal_is_enough_to_judge(check: Checking, tmp_path: Path) -> None:
    messages = rows("/catvehicle/vel", TWIST, {"linear": ZERO, "angular": ZERO})
    recording = write_ros2(tmp_path / "drive", Drive(messages=messages))
    ending = check(recording, "--json", "-")
    assert ending.code in (0, 1)
    assert ending.json["judged"]["nothing_why"] is None
