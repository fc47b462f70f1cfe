"""The page of one drive: what was announced and done, from the recording's own log."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from server.analysis.drive.drive_report import write_drive_page
from server.analysis.recorded_log import MOST_ENTRIES, RecordedLog, read_recorded_log
from server.recording.read.read import open_recording
from tests.server.recording.bags import BEGIN_S, Drive, Row, write_ros1
from tests.server.recording.export.ours import TOML, OurFile, Own, as_ours, event

NS = 10**9
TWIST = "geometry_msgs/msg/Twist"
ROWS: list[Row] = [(0.05 * n, "/catvehicle/vel", TWIST, {"linear": {"x": 2.0}}) for n in range(401)]  # 20 s


def logged(at_s: float, change: str, alarm: str | None = "speed_limit", n: int = 1, **more: Any) -> Own:
    at_ms = BEGIN_S * 1000 + round(at_s * 1000)
    return (BEGIN_S * NS + round(at_s * NS), "/catgraph/alarms", event(n, at_ms, change, alarm, **more))


def made(folder: Path, own: list[Own], **metadata: str) -> Path:
    return as_ours(write_ros1(folder / "in.bag", Drive(messages=ROWS)), folder / "ours.mcap", own, **metadata)


def found(path: Path) -> RecordedLog:
    with open_recording([path]) as recording:
        logged = read_recorded_log(recording)
    assert logged is not None
    return logged


def page(path: Path, folder: Path) -> tuple[str, dict[str, Any]]:
    with open_recording([path]) as recording:
        write_drive_page(recording, folder / "out.html", name="My drive")
    text = (folder / "out.html").read_text()
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    assert data
    return text, json.loads(data[1])


STORY = [
    logged(1.0, "connected", None, text="Connected."),
    logged(2.0, "raised", n=2, text="3.4 m/s, limit 3.0 m/s", state="UNACKED", announces=True),
    logged(4.0, "acknowledged", n=3, by="Ann <b>", state="ACKED"),
    logged(5.0, "suppressed", n=4, state="ACKED"),
    logged(6.0, "unsuppressed", n=5, state="ACKED"),
    logged(7.0, "recaused", n=6, text="and worse", state="UNACKED", announces=True),
    logged(9.0, "cleared", n=7, text="2.0 m/s", state="NORMAL"),
    logged(12.0, "raised", "obstacle", n=8, text="4.2 m", priority="odd", state="UNACKED", announces=True),
]


def test_alarms_are_those_that_were_told(tmp_path: Path) -> None:
    logged = found(made(tmp_path, STORY))
    speed, obstacle = logged.episodes
    assert (speed.raised_s, speed.cleared_s, speed.trip_text) == (2.0, 9.0, "3.4 m/s, limit 3.0 m/s")
    assert [(one.at_s, one.change) for one in speed.announcements] == [(2.0, "raised"), (7.0, "recaused")]
    assert speed.suppressed == ((5.0, 6.0),)
    assert (obstacle.cleared_s, obstacle.until_s, str(obstacle.priority)) == (None, 20.0, "critical")
    assert (logged.load.announced, logged.load.most_in_10_min) == (3, 3)
    assert [(e.at_s, e.change, e.by) for e in logged.entries][:3] == [
        (1.0, "connected", ""),
        (2.0, "raised", ""),
        (4.0, "acknowledged", "Ann <b>"),
    ]


def test_the_page_shows_them_with_the_log_and_the_settings(tmp_path: Path) -> None:
    own = [*STORY, (BEGIN_S * NS, "/catgraph/settings", {"version": 1, "toml": TOML, "in_force": {}})]
    text, data = page(made(tmp_path, own), tmp_path)
    assert "<title>My drive · catgraph drive</title>" in text
    assert "Original alarms, as announced during the drive." in text
    assert [(bar["alarm"], bar["from"], bar["to"]) for bar in data["episodes"]] == [
        ("speed_limit", 2.0, 9.0),
        ("obstacle", 12.0, 20.0),
    ]
    assert "Speed above limit: acknowledged" in text
    assert "by Ann &lt;b&gt;" in text
    assert "max_mps = 3.0" in text
    assert "Speed limit <b" in text  # what differs from the defaults is judged by, too
    assert not re.search(r'(src|href)="(?!#)', text)  # nothing from anywhere


def test_a_clip_s_page_says_what_stood_already(tmp_path: Path) -> None:
    stood = [event(1, BEGIN_S * 1000 - 90_000, "raised", text="3.1 m/s", state="UNACKED")]
    path = made(
        tmp_path,
        [logged(4.0, "acknowledged", n=2, state="ACKED")],
        clip_of="car_1",
        clip_at_ms=str(BEGIN_S * 1000 + 10_000),
        standing=json.dumps(stood),
    )
    recorded = found(path)
    (episode,) = recorded.episodes
    assert (episode.raised_s, episode.cleared_s, episode.trip_text) == (0.0, None, "3.1 m/s")
    assert recorded.clip_at_s == 10.0
    text, _ = page(path, tmp_path)
    assert "My drive · catgraph incident" in text
    assert "20.0 s of car_1" in text
    assert "cut around 10.0 s" in text
    assert ">before<" in text


def test_a_recording_of_others_is_judged_as_by_catgraph_check(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "in.bag", Drive(messages=ROWS))
    with open_recording([source]) as recording:
        assert read_recorded_log(recording) is None
    text, _ = page(source, tmp_path)
    assert "catgraph check" in text
    assert "Original alarms" not in text


def test_what_is_no_event_and_too_many_of_them_spoil_nothing(tmp_path: Path) -> None:
    ours = OurFile(tmp_path / "ours.mcap", standing="[{", clip_at_ms="x")
    odd: list[Any] = [
        {},
        {"at_ms": "x", "change": "raised"},
        {"at_ms": 1, "change": 3},
        {"at_ms": 1, "change": "a", "alarm": 4},
    ]
    for n, logged in enumerate(odd + [event(n, BEGIN_S * 1000, "connected", None) for n in range(MOST_ENTRIES + 5)]):
        ours.own(BEGIN_S * NS + n, "/catgraph/alarms", logged)
    recorded = found(ours.close())
    assert (len(recorded.entries), recorded.left_out, recorded.episodes) == (MOST_ENTRIES, 5, ())
    assert recorded.clip_at_s is None


@pytest.mark.parametrize("toml", ["not TOML at all [", "[limits.gone]\nx = 1.0\n", 'profile = "nobody"\n'])
def test_settings_of_another_version_do_not_spoil_the_page(tmp_path: Path, toml: str) -> None:
    own: list[Own] = [(BEGIN_S * NS, "/catgraph/settings", {"version": 1, "toml": toml, "in_force": {}})]
    text, _ = page(made(tmp_path, own), tmp_path)
    assert "Settings in force" in text
