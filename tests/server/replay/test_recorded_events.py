"""Recorded events of our own recordings: original alarms, pauses, settings and phones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import orjson
import pytest

from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.read.read import open_recording
from server.recording.read.schemas import TypeBook
from server.replay.playback import Playback

BEGAN_MS = 1_790_000_000_000
NAMES: dict[str, Any] = {"vehicle": "car", "name": "x", "settings_version": 1}


def event(at_s: float, change: str, **more: Any) -> dict[str, Any]:
    return {
        "at_ms": BEGAN_MS + round(at_s * 1000), "alarm": "speed_limit", "occurrence": 3, "change": change,
        "title": "Speed above limit", "priority": "critical", "place": "dialog", "sound": "high",
        "text": "12.6 m/s, limit 11.0 m/s", "by": None, "announces": change == "raised", "state": "UNACKED",
        "causes": [], "suppressed_by": [], "shelved_until_ms": None, "settings_version": 1, "measured": None,
        "limit": None, **more,
    }  # fmt: skip


def toml(limit: float) -> str:
    return f'version = 1\nprofile = "auto"\n[topics]\n[limits.speed_limit]\nmax_mps = {limit}\n'


def record(path: Path, own: list[tuple[float, Any, dict[str, Any]]], **metadata: str) -> Path:
    """Twenty seconds at 9 m/s, and what catgraph itself wrote."""
    metadata = {"vehicle": "car", "session": "5e55", "settings": toml(11.0)} | metadata
    file = PartFile(path, profile="ros1", metadata=metadata)
    vel = TypeBook(1).schema("geometry_msgs/Twist")
    assert vel is not None
    assert vel.encode is not None
    waiting = sorted(own, key=lambda row: row[0])
    for n in range(401):
        at_ns = BEGAN_MS * 1_000_000 + n * 50_000_000
        while waiting and waiting[0][0] <= n / 20:
            at_s, channel, fields = waiting.pop(0)
            body = orjson.dumps({"time_ms": BEGAN_MS + at_s * 1000} | fields)
            file.add(file.channel(f"/catgraph/{channel}", own_schema(channel)), at_ns, body)
        zero = {"x": 0.0, "y": 0.0, "z": 0.0}
        file.add(
            file.channel("/catvehicle/vel", vel), at_ns, vel.encode({"linear": zero | {"x": 9.0}, "angular": zero})
        )
        file.flush()
    return file.close(ended="closed")


def at(playback: Playback, at_s: float) -> dict[str, Any]:
    playback.seek(at_s, 0.0)
    while playback.is_seeking:
        playback.work(0.0, lambda: False)
    return playback.frame(**NAMES)


def opened(path: Path) -> Playback:
    return Playback(open_recording([path]), lambda: open_recording([path]), settings=toml(5.0), now_s=0.0)


def states(frame: dict[str, Any]) -> dict[str, str]:
    return {alarm["id"]: alarm["state"] for alarm in frame["alarms"]}


STORY = [
    (5.0, "alarms", event(5.0, "raised")),
    (8.0, "alarms", event(8.0, "acknowledged", by="Anna", state="ACKED")),
    (12.0, "alarms", event(12.0, "cleared", state="NORMAL")),
]


@pytest.mark.parametrize("is_indexed", [False, True])
@pytest.mark.parametrize(
    ("at_s", "expected"),
    [(4.9, {}), (5.0, {"speed_limit": "UNACKED"}), (8.5, {"speed_limit": "ACKED"}), (12.1, {}), (19.0, {})],
)
def test_alarms_are_shown_as_they_were_told(
    tmp_path: Path, at_s: float, expected: dict[str, str], is_indexed: bool
) -> None:
    """At 9 m/s nothing would be judged so anew: the recording knows better what the operator saw."""
    playback = opened(record(tmp_path / "a.mcap", STORY))
    if is_indexed:
        at(playback, 19.5)
    frame = at(playback, at_s)
    assert states(frame) == expected
    assert playback.position()["alarms_from"] == "recording"
    for alarm in frame["alarms"]:
        assert alarm["raised_ms"] == BEGAN_MS + 5000
        assert alarm["acknowledged_by"] == ("Anna" if at_s > 8 else None)
    playback.close()


def test_the_time_line_is_marked_by_what_was_told(tmp_path: Path) -> None:
    playback = opened(record(tmp_path / "a.mcap", STORY))
    at(playback, 1.0)
    marks = playback.timeline()["marks"]
    assert [(mark["alarm"], mark["at_s"]) for mark in marks] == [("speed_limit", 5.0)]
    playback.close()


def test_what_stood_when_a_clip_began_stands(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mcap", [], clip_of="b", standing=json.dumps([event(-4.0, "raised")]))
    playback = opened(path)
    frame = at(playback, 2.0)
    assert states(frame) == {"speed_limit": "UNACKED"}
    assert frame["alarms"][0]["for_s"] == 6.0
    playback.close()


def test_settings_are_those_in_force_then_and_change_when_they_changed(tmp_path: Path) -> None:
    path = record(
        tmp_path / "a.mcap",
        [(0.0, "settings", {"version": 1, "toml": toml(11.0)}), (10.0, "settings", {"version": 2, "toml": toml(8.0)})],
    )
    playback = opened(path)
    assert at(playback, 9.0)["limits"]["speed_limit.max_mps"] == 11.0
    late = at(playback, 11.0)
    assert late["limits"]["speed_limit.max_mps"] == 8.0
    assert next(tile for tile in late["checks"] if "speed_limit" in tile["checks"])["verdict"] == "fault"
    assert at(playback, 9.0)["limits"]["speed_limit.max_mps"] == 11.0
    assert playback.position()["settings_from"] == "recording"
    playback.close()


def test_a_pause_then_is_a_pause_there(tmp_path: Path) -> None:
    rows = [
        (6.0, "alarms", event(6.0, "paused", alarm=None, by="Anna")),
        (9.0, "alarms", event(9.0, "resumed", alarm=None)),
    ]
    playback = opened(record(tmp_path / "a.mcap", rows))
    assert at(playback, 7.0)["session"]["paused"] is True
    assert at(playback, 10.0)["session"]["paused"] is False
    assert at(playback, 7.0)["session"]["paused_by"] == "Anna"
    playback.close()


@pytest.mark.parametrize(
    ("change", "more"),
    [
        ("acknowledged", {"state": "ACKED", "by": "Ann"}),
        ("handed_over", {"state": "ACKED", "by": "Ann"}),
        ("cleared", {"state": "RTN_UNACKED"}),
        ("silenced", {"state": "UNACKED", "by": "Ann"}),
        ("unacknowledged", {"state": "UNACKED", "by": "Ann"}),
    ],
)
def test_an_alarm_that_stood_before_the_part_stands_in_it_as_its_newest_event_says(
    change: str, more: dict[str, Any], tmp_path: Path
) -> None:
    before = event(-4.0, change, alarm="gps_drift", title="GPS drift", priority="warning", **more)
    playback = opened(record(tmp_path / "a.mcap", [], standing=json.dumps([before])))
    (found,) = (one for one in at(playback, 1.0)["alarms"] if one["id"] == "gps_drift")
    assert found["state"] == more["state"]
    assert found["acknowledged_by"] == ("Ann" if more["state"] == "ACKED" else None)
    playback.close()


def test_a_planned_stop_then_is_one_there(tmp_path: Path) -> None:
    rows = [
        (5.0, "alarms", event(5.0, "raised", alarm="gps_drift", title="GPS drift", priority="warning", sound="low")),
        (6.0, "alarms", event(6.0, "planned_stop", alarm=None, by="Anna", reason="workshop")),
        (9.0, "alarms", event(9.0, "planned_stop_ended", alarm=None, reason="workshop")),
    ]
    playback = opened(record(tmp_path / "a.mcap", rows))
    stop = at(playback, 7.0)["session"]["planned_stop"]
    assert (stop["reason"], stop["by"], stop["since_ms"]) == ("workshop", "Anna", BEGAN_MS + 6000)
    drift = next(one for one in at(playback, 7.0)["alarms"] if one["id"] == "gps_drift")
    assert (drift["planned_stop"], drift["sound"]) == (True, "none")
    after = at(playback, 10.0)
    assert after["session"]["planned_stop"] is None
    assert [(one["planned_stop"], one["sound"]) for one in after["alarms"] if one["id"] == "gps_drift"] == [
        (False, "low")
    ]
    playback.close()


def test_a_planned_stop_that_began_before_the_part_is_in_force_in_it(tmp_path: Path) -> None:
    began = event(-30.0, "planned_stop", alarm=None, by="Anna", reason="parked")
    playback = opened(record(tmp_path / "a.mcap", [], standing=json.dumps([began])))
    assert at(playback, 1.0)["session"]["planned_stop"]["since_ms"] == BEGAN_MS - 30_000
    playback.close()


def test_who_acknowledged_is_off_duty_at_the_moments_at_which_the_live_page_said_so(tmp_path: Path) -> None:
    owner = "A. K. (Pixel 7)"

    def owned(at_s: float, off_s: float | None) -> tuple[float, str, dict[str, Any]]:
        off_ms = None if off_s is None else BEGAN_MS + round(off_s * 1000)
        return at_s, "alarms", event(at_s, "owner", alarm=None, owner=owner, off_duty_ms=off_ms)

    acknowledged = event(-9.0, "acknowledged", alarm="gps_drift", state="ACKED", by=owner)
    began = owned(-3.0, -4.0)[2]
    rows = [owned(5.0, None), owned(9.0, 8.5), (12.0, "alarms", event(12.0, "owner", alarm=None, owner=7))]
    playback = opened(record(tmp_path / "a.mcap", rows, standing=json.dumps([acknowledged, began])))

    def off_ms(at_s: float) -> Any:
        return next(one["off_duty_ms"] for one in at(playback, at_s)["alarms"] if one["id"] == "gps_drift")

    assert [off_ms(at_s) for at_s in (1.0, 6.0, 10.0, 13.0, 2.0)] == [
        BEGAN_MS - 4000, None, BEGAN_MS + 8500, BEGAN_MS + 8500, BEGAN_MS - 4000,
    ]  # fmt: skip
    playback.close()


def test_the_phone_is_where_it_was(tmp_path: Path) -> None:
    fix = {
        "lat_deg": 32.23, "lon_deg": -110.95, "accuracy_m": 5.0, "at_ms": 1.0, "age_s": 0.2,
        "heard_ms": BEGAN_MS + 3000.0, "held_s": 0.1,
    }  # fmt: skip
    rows = [
        (3.1, "phone", {"phone": "9c0f2b7d", "handheld": True, "by": "Anna's phone", "why": None, "fix": fix}),
        (3.2, "phone", {"phone": 7, "fix": "nonsense"}),
    ]
    playback = opened(record(tmp_path / "a.mcap", rows))
    assert at(playback, 3.0)["phone"] is None
    shown = at(playback, 4.0)["phone"]
    assert (shown["lat_deg"], shown["label"]) == (32.23, "Anna's phone")
    assert any("1 invalid entries" in note for note in playback.timeline()["notes"])
    playback.close()


@pytest.mark.parametrize("odd", [None, 5, "x", {}, {"change": "raised"}, {"alarm": "speed_limit", "change": []}])
def test_nonsense_in_the_alarm_channel_is_left_out(tmp_path: Path, odd: Any) -> None:
    rows = [(2.0, "alarms", odd if isinstance(odd, dict) else {"alarm": odd, "change": "raised", "at_ms": odd})]
    playback = opened(record(tmp_path / "a.mcap", rows))
    assert states(at(playback, 4.0)) == {}
    playback.close()
