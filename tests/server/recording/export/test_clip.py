"""The minute around an alarm as a recording of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson
import pytest

from server.recording.export.clip import Window, first_raised_ns, write_clip
from server.recording.export.export_format import ExportRefused, Outcome
from server.recording.export.formats.bag import write_bag
from server.recording.folder import writing_path
from server.recording.read.read import open_recording
from tests.server.recording.bags import BEGIN_S, Drive, Row, write_ros1, write_ros2
from tests.server.recording.export.ours import TOML, OurFile, Own, as_ours, event

NS = 10**9
BEGIN = BEGIN_S * NS
TEXT, INT = "std_msgs/msg/String", "std_msgs/msg/Int32"


def cut(source: Path, out: Path, at_s: float, before_s: float = 2.0, after_s: float = 3.0) -> Outcome:
    with open_recording([source]) as recording:
        window = Window(at_ns=BEGIN + round(at_s * NS), before_s=before_s, after_s=after_s)
        return write_clip(recording, out, window, clip_of="car_1")


def logged(at_s: float, n: int, change: str, alarm: str | None = "speed_limit", **more: Any) -> Own:
    at_ms = BEGIN_S * 1000 + round(at_s * 1000)
    return (BEGIN + round(at_s * NS), "/catgraph/alarms", event(n, at_ms, change, alarm, **more))


def in_force(at_s: float, toml: str) -> Own:
    return (BEGIN + round(at_s * NS), "/catgraph/settings", {"version": 1, "toml": toml, "in_force": {}})


STRICTER = TOML.replace("3.0", "2.0")
ROWS: list[Row] = [
    (0.0, "/map", TEXT, {"data": "the map"}),
    *((0.1 * n, "/n", INT, {"data": n}) for n in range(200)),
]
ENTRIES: list[Own] = [
    in_force(0.0, TOML),
    logged(1.0, 1, "raised", state="UNACKED"),
    logged(2.0, 2, "raised", "gps_fix", state="UNACKED"),
    logged(3.0, 3, "cleared", "gps_fix", state="NORMAL"),
    logged(4.0, 4, "raised", "old_style"),  # as without a state: it stands until it is cleared
    logged(4.5, 5, "acknowledged", state="ACKED"),
    logged(5.0, 6, "connected", None),
    in_force(6.0, STRICTER),
    logged(11.0, 7, "raised", "obstacle", state="UNACKED"),
    in_force(11.5, TOML),
    logged(19.0, 8, "raised", "late", state="UNACKED"),
]


@pytest.fixture(scope="module", params=[1, 2])
def drive(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    write = write_ros1 if request.param == 1 else write_ros2
    source = write(folder / ("in.bag" if request.param == 1 else "in"), Drive(messages=ROWS, latched={"/map"}))
    return as_ours(source, folder / "ours.mcap", ENTRIES, address="ws://car:9090")


def test_it_holds_what_came_then_as_it_was(drive: Path, tmp_path: Path) -> None:
    assert cut(drive, tmp_path / "clip.mcap", 11.0).notes == []
    with open_recording([drive]) as whole, open_recording([tmp_path / "clip.mcap"]) as clip:
        assert clip.ros_version == whole.ros_version
        assert clip.topics["/n"].definition == whole.topics["/n"].definition
        assert clip.topics["/n"].type == whole.topics["/n"].type
        inside = [
            (m.at_s, m.message)
            for m in whole.messages()
            if m.topic == "/n" and 9.0 <= round(m.at_s - BEGIN_S, 6) <= 14.0
        ]
        assert [(m.at_s, m.message) for m in clip.messages() if m.topic == "/n"] == inside
        assert len(inside) == 51
        assert [e["alarm"] for _, e in clip.own("/catgraph/alarms")] == ["obstacle"]


def test_at_its_beginning_stands_what_was_already_so(drive: Path, tmp_path: Path) -> None:
    cut(drive, tmp_path / "clip.mcap", 11.0)
    with open_recording([tmp_path / "clip.mcap"]) as clip:
        settings = [(round(at_s - BEGIN_S, 3), s["toml"]) for at_s, s in clip.own("/catgraph/settings")]
        assert settings == [(9.0, STRICTER), (11.5, TOML)]
        assert clip.metadata["settings"] == STRICTER
        standing = orjson.loads(clip.metadata["standing"])
        assert [(e["alarm"], e["change"]) for e in standing] == [
            ("speed_limit", "acknowledged"),
            ("old_style", "raised"),
        ]
        latched = [(round(m.at_s - BEGIN_S, 3), m.message["data"]) for m in clip.messages() if m.topic == "/map"]
        assert latched == [(9.0, "the map")]
        assert clip.topics["/map"].is_latched


def test_it_names_where_it_was_cut_from(drive: Path, tmp_path: Path) -> None:
    cut(drive, tmp_path / "clip.mcap", 11.0)
    with open_recording([tmp_path / "clip.mcap"]) as clip:
        begin_ms = BEGIN_S * 1000
        assert {name: clip.metadata[name] for name in ("vehicle", "address", "session", "ended", "clip_of")} == {
            "vehicle": "car",
            "address": "ws://car:9090",
            "session": "s1",
            "ended": "closed",
            "clip_of": "car_1",
        }
        assert [int(clip.metadata[f"clip_{name}_ms"]) - begin_ms for name in ("at", "from", "to")] == [
            11000,
            9000,
            14000,
        ]
        assert int(clip.metadata["started_ms"]) == begin_ms + 9000


@pytest.mark.parametrize(
    ("at_s", "count", "notes"),
    [
        (1.0, 41, ["The recording begins 1.0 s after the clip should."][:0]),
        (0.5, 36, ["The recording begins 1.5 s after the clip should."]),
        (18.0, 40, ["The recording ends 1.1 s before the clip should."]),
        (-3.0, 1, ["The recording begins 5.0 s after the clip should."]),
        (21.9, 1, ["The recording ends 5.0 s before the clip should."]),
    ],
)
def test_what_of_it_was_not_recorded_is_reported(
    drive: Path, tmp_path: Path, at_s: float, count: int, notes: list[str]
) -> None:
    outcome = cut(drive, tmp_path / "clip.mcap", at_s)
    with open_recording([tmp_path / "clip.mcap"]) as clip:
        assert clip.topics["/n"].count == count
    assert (outcome.notes, outcome.notices) == ([], notes)


@pytest.mark.parametrize("at_s", [-3.1, 22.0, 1e6])
def test_a_window_without_anything_is_refused(drive: Path, tmp_path: Path, at_s: float) -> None:
    with pytest.raises(ExportRefused, match=r"Nothing was recorded from 20\d\d-\d\d-\d\d \d\d:\d\d:\d\d to .* UTC"):
        cut(drive, tmp_path / "clip.mcap", at_s)
    assert list(tmp_path.iterdir()) == []


def test_a_gap_in_the_middle_is_no_clip(tmp_path: Path) -> None:
    rows: list[Row] = [(0.0, "/n", INT, {"data": 1}), (100.0, "/n", INT, {"data": 2})]
    source = as_ours(write_ros1(tmp_path / "in.bag", Drive(messages=rows)), tmp_path / "ours.mcap")
    with pytest.raises(ExportRefused, match="Nothing was recorded"):
        cut(source, tmp_path / "clip.mcap", 50.0)
    assert not list(tmp_path.glob("clip*"))


def test_a_clip_of_a_file_that_has_no_end_yet(tmp_path: Path) -> None:
    writing = OurFile(tmp_path / "car_1.mcap")
    for n in range(50):
        writing.write(BEGIN + n * NS // 10, "/n", "std_msgs/Int32", "int32 data", "ros1", n.to_bytes(4, "little"))
    writing.flush()
    outcome = cut(writing_path(tmp_path / "car_1.mcap"), tmp_path / "clip.mcap", 2.0)
    assert outcome.notes == []
    with open_recording([tmp_path / "clip.mcap"]) as clip:
        assert [m.message["data"] for m in clip.messages()] == list(range(50))
        assert clip.metadata["vehicle"] == "car"
    writing.close()


def test_a_clip_becomes_a_bag(drive: Path, tmp_path: Path) -> None:
    cut(drive, tmp_path / "clip.mcap", 11.0)
    with open_recording([tmp_path / "clip.mcap"]) as clip:
        assert write_bag(clip, tmp_path / "clip.bag").notes == []
    with open_recording([tmp_path / "clip.bag"]) as bag:
        assert bag.topics["/n"].count == 51


def test_a_clip_of_a_recording_of_others(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "in.bag", Drive(messages=ROWS))
    cut(source, tmp_path / "clip.mcap", 11.0)
    with open_recording([tmp_path / "clip.mcap"]) as clip:
        assert clip.topics["/n"].count == 51
        assert clip.metadata["clip_of"] == "car_1"


@pytest.mark.parametrize(("alarm", "at_s"), [("obstacle", 11.0), ("speed_limit", 1.0), ("nothing", None)])
def test_when_an_alarm_was_first_raised(drive: Path, alarm: str, at_s: float | None) -> None:
    with open_recording([drive]) as recording:
        assert first_raised_ns(recording, alarm) == (None if at_s is None else BEGIN + round(at_s * NS))
