"""What the catalog has of a file that was read once: how far, how fast, which alarms; of an unreadable one, why."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import pytest

from server.recording.catalog.sketch import from_json
from server.recording.catalog.survey import survey
from tests.server.recording.made import BEGAN_MS, record
from tests.tree import RECORDINGS

DATA = RECORDINGS


def test_a_drive(tmp_path: Path) -> None:
    path = record(
        tmp_path / "car" / "car_1.mcap", seconds=30.0, alarms=[(5.0, "warning"), (9.0, "critical"), (9.5, "advisory")]
    )
    found = survey(path)
    assert found["vehicle"] == "car"
    assert (found["session"], found["part"], found["ended"]) == ("5e55", 1, "closed")
    assert found["started_ms"] == BEGAN_MS
    assert found["length_s"] == pytest.approx(30.0, abs=0.01)
    assert found["distance_m"] == pytest.approx(150.0, rel=0.03)
    assert found["top_speed_mps"] == 5.0
    assert found["speed_mps"] == [5.0] * 61  # two a second
    assert found["alarms"] == {"critical": 1, "warning": 1, "advisory": 1}
    assert [(one["at_ms"] - BEGAN_MS, one["priority"]) for one in found["raised"]] == [
        (5000, "warning"), (9000, "critical"), (9500, "advisory"),
    ]  # fmt: skip
    assert found["raised"][1]["title"] == "A critical alarm"
    assert found["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert not found["is_clip"]
    assert found["damage"] == []
    drawn = from_json(found["sketch"])
    assert drawn is not None
    assert [mark[2] for mark in drawn.marks] == ["warning", "critical"]  # the critical one lies on top


@pytest.mark.parametrize("place", [(0.0, 179.9999), (89.5, 20.0), (-89.9, -179.9), (32.2, -110.9)], ids=str)
def test_anywhere_on_earth(tmp_path: Path, place: tuple[float, float]) -> None:
    found = survey(record(tmp_path / "car" / "car_1.mcap", seconds=20.0, at=place, bend_deg=0.0))
    assert found["distance_m"] == pytest.approx(100.0, rel=0.05)
    drawn = from_json(found["sketch"])
    assert drawn is not None
    (line,) = drawn.lines
    assert line[0][1] == pytest.approx(55.0, abs=0.2)  # from the bottom edge …
    assert line[-1][1] == pytest.approx(9.0, abs=0.2)  # … to the top


def test_without_a_position_nothing_is_drawn_and_nothing_is_driven(tmp_path: Path) -> None:
    found = survey(record(tmp_path / "car" / "car_1.mcap", at=None, speed_mps=-3.0))
    assert (found["distance_m"], found["sketch"]) == (None, None)
    assert found["top_speed_mps"] == 3.0  # backwards is fast too


def test_a_clip_is_marked_as_one(tmp_path: Path) -> None:
    found = survey(record(tmp_path / "car" / "car_1_clip.mcap", clip_of="car_1", started_ms=str(BEGAN_MS - 9000)))
    assert found["is_clip"]
    assert found["clip_of"] == "car_1"
    assert found["started_ms"] == BEGAN_MS, "what it holds begins there, whatever was requested"


def test_the_topics_of_the_drives_own_settings_count(tmp_path: Path) -> None:
    path = record(
        tmp_path / "car" / "car_1.mcap", left_out="/camera\n/points", settings='[topics]\nspeed = "/not/there"\n'
    )
    found = survey(path)
    assert found["top_speed_mps"] is None
    assert found["speed_mps"] == []
    assert (found["left_out"], found["left_out_count"]) == (["/camera", "/points"], 2)
    many = "\n".join(f"/camera_{n}" for n in range(500))
    found = survey(record(tmp_path / "car" / "car_3.mcap", left_out=many, left_out_count="700"))
    assert (len(found["left_out"]), found["left_out_count"], found["not_received_count"]) == (10, 700, 0)
    old = survey(record(tmp_path / "car" / "car_4.mcap", left_out=many))
    assert old["left_out_count"] == 500
    assert survey(record(tmp_path / "car" / "car_2.mcap", settings="[[["))["top_speed_mps"] == 5.0


def test_one_that_was_never_closed_is_read_to_its_end_and_reported(tmp_path: Path) -> None:
    record(tmp_path / "car" / "car_1.mcap", is_closed=False)
    path = (tmp_path / "car" / "car_1.mcap.writing").rename(tmp_path / "car" / "car_1.mcap")
    found = survey(path)
    assert found["length_s"] > 19.0
    assert found["ended"] is None
    assert "never closed" in found["damage"][0]
    assert str(tmp_path) not in found["damage"][0]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is empty"),
        (b"\x89MCAP0\r\n", "ends too early"),
        (b"\x89MCAP0\r\n" + b"\xff" * 3000, "ends too early"),
        (b"hello, I am a text", "a text file"),
        (b"#ROSBAG V2.0\n" + b"\x00" * 40, "damaged or not complete"),
        (b"\x89PNG\r\n\x1a\n", "a PNG picture"),
    ],
)
def test_what_cannot_be_read_has_its_reason_in_one_sentence(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "odd\u202e name.mcap"
    path.write_bytes(content)
    found = survey(path)
    assert list(found) == ["problem"]
    assert reason in found["problem"]
    assert found["problem"].startswith("odd name.mcap")
    assert found["problem"].endswith(".")
    assert str(tmp_path) not in found["problem"]


@pytest.mark.parametrize("inside", [("catvehicle_2016-06-01.bag",), ("catvehicle_2016-06-01_mcap", "*.mcap")])
def test_the_real_drive(inside: tuple[str, ...]) -> None:
    if not DATA.is_dir():
        pytest.skip("the recorded drives are not here")
    path = next(DATA.glob("/".join(inside)))
    found = survey(path)
    assert found["alarms"] is None, "its recorder recorded no alarms: not the same as none"
    assert found["length_s"] == pytest.approx(55.9, abs=0.1)
    assert found["distance_m"] == pytest.approx(75.7, abs=1.5)
    assert found["top_speed_mps"] == pytest.approx(4.23, abs=0.01)
    assert len(found["sketch"]["lines"]) == 1


def test_a_scan_without_a_car(tmp_path: Path) -> None:
    path = DATA / "lidar" / "scan_tools_hokuyo_demo.bag"
    if not path.is_file():
        pytest.skip("the recorded drives are not here")
    found: dict[str, Any] = survey(path)
    assert (found["distance_m"], found["top_speed_mps"], found["sketch"]) == (None, None, None)
    assert found["length_s"] == pytest.approx(35.8, abs=0.1)
