"""`catgraph check` of a recording without data of the car: code 2 and the reason, in each output."""

from __future__ import annotations

import re
from pathlib import Path

import orjson
import pytest

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
        "/catvehicle/vel has another type, std_msgs/String, which is not read as Speed",
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


def test_one_signal_is_enough_to_judge(check: Checking, tmp_path: Path) -> None:
    messages = rows("/catvehicle/vel", TWIST, {"linear": ZERO, "angular": ZERO})
    recording = write_ros2(tmp_path / "drive", Drive(messages=messages))
    ending = check(recording, "--json", "-")
    assert ending.code in (0, 1)
    assert ending.json["judged"]["nothing_why"] is None
