"""Playback: what a seek shows is what playing shows; alarms as announced then; the pace; hostile moments and files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest

from monitor.alarm import Transition
from server.protocol.alarm_state import CheckAnswer
from server.recording.catalog.survey import survey
from server.recording.read.read import open_recording
from server.replay import timeline
from server.replay.manager import summary
from server.replay.playback import RATES, WARM_UP_S, Playback
from server.replay.timeline import AlarmHistory
from tests.frames import check_shape
from tests.monitor.test_alarm import SPEC
from tests.page import drives
from tests.page.canned import live

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
BAG = DATA / "catvehicle_2016-06-01.bag"
NAMES: dict[str, Any] = {"vehicle": "car", "name": "x", "settings_version": 1}
NEVER = lambda: False  # noqa: E731


def opened(path: Path, *, at_s: float = 0.0, settings: str = "") -> Playback:
    return Playback(open_recording([path]), lambda: open_recording([path]), settings=settings, now_s=100.0, at_s=at_s)


def shown(playback: Playback) -> dict[str, Any]:
    """All a page would get, but for the number of the seek, by which it tells one picture from another."""
    frame = playback.frame(**NAMES)
    frame["session"]["track"].pop("number")
    track = playback.answer({"kind": "track_points", "after": 0})["points"]
    return frame | {"minute": playback.answer({"kind": "trends"}), "points": track, "scan": playback.scan_bytes()}


def opened_check(playback: Playback, at_s: float, name: str = "speed_limit") -> dict[str, Any]:
    """What a page gets of a check at a moment."""
    playback.seek(at_s, 100.0)
    reach(playback)
    return dict(playback.answer({"kind": "check", "check": name}))


def active(frame: dict[str, Any]) -> list[str]:
    return [alarm["id"] for alarm in frame["alarms"] if alarm["active"]]


def reach(playback: Playback) -> None:
    """Lets a seek come to its end, and nothing else happen."""
    while playback.is_seeking:
        playback._work(100.0, NEVER)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two minutes and a half: it drives too fast from 40 s to 60 s, is silent from 100 s to 108 s, has a laser."""

    def speed(t: float) -> Any:
        return None if 100 <= t < 108 else drives.twist(12.5 if 40 <= t < 60 else 8.0 + math.sin(t / 9))

    def scan(t: float) -> Any:
        return None if 100 <= t < 108 else drives.street(t, gap_m=30.0)

    return drives.write(tmp_path_factory.mktemp("street") / "street.bag", {"speed": speed, "scan": scan}, seconds=150.0)


@pytest.fixture
def playback(street: Path) -> Iterator[Playback]:
    playback = opened(street)
    reach(playback)
    yield playback
    playback.close()


@pytest.fixture(scope="module")
def indexed(street: Path) -> Iterator[Playback]:
    """One whose time line is made."""
    playback = opened(street)
    reach(playback)
    playback.index.work(NEVER)
    yield playback
    playback.close()


@pytest.mark.parametrize("at_s", [0.0, 0.05, 9.99, 41.3, 61.0, 99.95, 104.0, 108.02, 149.9])
def test_a_seek_comes_to_what_playing_comes_to(street: Path, indexed: Playback, at_s: float) -> None:
    played = opened(street)
    reach(played)
    played.set_rate(16.0, 100.0)
    played.play(100.0)
    now_s = 100.0
    while played.at_s < at_s:
        now_s = min(now_s + 0.1, 100.0 + at_s / 16.0 + 1e-9)
        played._work(now_s, NEVER)
        played.frame(**NAMES)  # somebody looks, all the while
    sought = indexed
    sought.seek(140.0, 100.0)
    reach(sought)
    sought.seek(played.at_s, 100.0)
    reach(sought)
    assert sought.is_settled
    assert shown(sought) == shown(played)
    played.close()


def test_back_and_forth_many_times_is_the_same_picture(indexed: Playback) -> None:
    playback = indexed
    playback.seek(55.0, 100.0)
    reach(playback)
    first = shown(playback)
    for at_s in (120.0, 3.0, 54.9, 150.0, 0.0):
        playback.seek(at_s, 100.0)
        reach(playback)
        playback.seek(55.0, 100.0)
        reach(playback)
        assert shown(playback) == first


def test_ahead_of_the_time_line_the_checks_are_warmed_up_and_it_is_put_right(street: Path) -> None:
    playback = opened(street, at_s=120.0)
    reach(playback)
    assert playback.position()["is_settled"] is False
    early = shown(playback)
    assert early["signals"]["speed"]["value"] is not None
    playback.work(100.0, NEVER)  # the time line is made, and the picture with it
    reach(playback)
    assert playback.position()["is_settled"] is True
    played = opened(street)
    for at_s in (0.0, 30.0, 60.0, 90.0, 120.0):  # each so little ahead that it is played to
        played.seek(at_s, 100.0)
        reach(played)
    assert shown(playback) == shown(played)
    # What differs while it is not settled is what 25 s cannot know: counts, extents, the track, what is over and
    # was never acknowledged.
    late = shown(playback)
    assert early["checks"] == late["checks"]
    assert active(early) == active(late)
    assert {k: v["value"] for k, v in early["signals"].items()} == {k: v["value"] for k, v in late["signals"].items()}
    assert 120.0 > WARM_UP_S
    playback.close()
    played.close()


def test_the_time_line_has_the_speed_the_gap_and_the_alarms(playback: Playback) -> None:
    assert playback.timeline()["is_done"] is False
    playback.index.work(NEVER)
    line = playback.timeline()
    assert line["is_done"] is True
    at = lambda s: line["speed_mps"][int(s / line["bucket_s"])]  # noqa: E731
    assert at(50.0) == 12.5
    assert at(104.0) is None
    [gap] = line["gaps"]
    assert gap == pytest.approx([100.0, 108.0], abs=0.1)
    fast = next(mark for mark in line["marks"] if mark["alarm"] == "speed_limit")
    assert fast["at_s"] == pytest.approx(40.3, abs=0.2)
    assert (fast["priority"], fast["title"]) == ("critical", "Speed above limit")
    orjson.dumps(line)


def test_a_sketch_stands_until_the_time_line_is_made(street: Path) -> None:
    recording = open_recording([street])
    sketch = survey(street)["speed_mps"]
    playback = Playback(recording, lambda: open_recording([street]), settings="", now_s=100.0, sketch=sketch)
    first = playback.timeline()
    assert (first["done_s"], first["is_done"]) == (0.0, False)
    assert first["speed_mps"][85:115] == sketch[85:115]
    assert max(speed or 0.0 for speed in first["speed_mps"]) == 12.5
    playback.index.work(NEVER)
    made = playback.timeline()
    assert made["is_done"]
    assert made["speed_mps"][100] == pytest.approx(sketch[100], abs=0.05)
    assert made["speed_mps"] != sketch  # two decimals in place of one
    assert made["speed_mps"][210] is None, "in the gap nothing is invented"
    playback.close()


def test_a_chart_of_a_recording_stands_before_it_is_read(street: Path) -> None:
    sketch = survey(street)["trends"]
    playback = Playback(
        open_recording([street]), lambda: open_recording([street]), settings="", now_s=100.0, trends=sketch
    )
    request = {"kind": "drive_trends", "signals": ["speed", "brake"], "buckets": 100}
    first = playback.answer(request)
    assert (first["is_sketch"], first["known_s"]) == (True, 0.0)
    assert max(high for high in first["signals"]["speed"]["highest"] if high is not None) == 12.5
    assert first["signals"]["speed"]["limits"]
    assert any(a <= 100.1 and b >= 107.9 for a, b in first["blind"])
    playback.index.work(NEVER)
    read = playback.answer(request)
    assert (read["is_sketch"], read["known_s"]) == (False, read["length_s"])
    assert max(high for high in read["signals"]["speed"]["highest"] if high is not None) == 12.5
    assert any(a <= 100.1 and b >= 107.9 for a, b in read["blind"])
    assert [mark["alarm"] for mark in read["marks"]] == [mark["alarm"] for mark in playback.timeline()["marks"]]
    playback.close()


def test_a_mark_tells_how_long_its_alarm_was_active(indexed: Playback) -> None:
    marks = indexed.timeline()["marks"]
    fast = next(mark for mark in marks if mark["alarm"] == "speed_limit")
    assert fast["duration_s"] == pytest.approx(22.0, abs=0.5)  # with the time after which it counts as over


def test_the_keys_lead_to_the_alarms_before_and_after(indexed: Playback) -> None:
    playback = indexed
    playback.seek(0.0, 100.0)
    reach(playback)
    marks = sorted({mark["at_s"] for mark in playback.timeline()["marks"]})
    assert len(marks) >= 2
    gone = []
    while playback.step_alarm(1, 100.0):
        reach(playback)
        gone.append(playback.at_s)
    assert gone == [pytest.approx(at_s, abs=0.001) for at_s in marks if at_s > 0.05]
    assert playback.step_alarm(-1, 100.0)
    assert playback.at_s < gone[-1]


@pytest.mark.parametrize("rate", RATES)
def test_it_keeps_the_pace(playback: Playback, rate: float) -> None:
    playback.set_rate(rate, 100.0)
    playback.play(100.0)
    playback._work(102.0, NEVER)
    assert playback.at_s == pytest.approx(2.0 * rate)
    playback.pause(102.0)
    playback._work(150.0, NEVER)
    assert playback.at_s == pytest.approx(2.0 * rate)


def test_a_change_of_pace_goes_on_from_where_it_is(playback: Playback) -> None:
    playback.play(100.0)
    playback._work(104.0, NEVER)
    playback.set_rate(0.5, 104.0)
    playback._work(106.0, NEVER)
    assert playback.at_s == pytest.approx(5.0)


def test_at_its_end_it_stands_and_begins_anew_when_played(playback: Playback) -> None:
    playback.set_rate(16.0, 100.0)
    playback.play(100.0)
    playback._work(200.0, NEVER)
    assert playback.at_s == playback.length_s
    assert playback.is_playing is False
    playback.play(200.0)
    reach(playback)
    assert playback.at_s == 0.0
    assert playback.is_playing is True


def test_a_pace_that_is_not_reached_is_said(playback: Playback) -> None:
    playback.set_rate(16.0, 100.0)
    playback.play(100.0)
    for now_s in (101.0, 102.0, 103.0):
        looks = iter([False] * 8 + [True] * 10_000)
        playback._work(now_s, lambda looks=looks: next(looks))  # time for some two hundred steps only
    reached = playback.position()["reached_rate"]
    assert reached is not None
    assert 0 < reached < 14
    assert playback.at_s < 48.0


@pytest.mark.parametrize(("asked_s", "at_s"), [(-5.0, 0.0), (1e300, 149.95), (-1e300, 0.0), (149.95, 149.95)])
def test_a_moment_beyond_an_end_is_that_end(playback: Playback, asked_s: float, at_s: float) -> None:
    playback.seek(asked_s, 100.0)
    reach(playback)
    assert playback.at_s == pytest.approx(at_s)


@pytest.mark.parametrize("asked_s", [math.nan, math.inf, -math.inf])
def test_what_is_no_moment_is_refused_and_changes_nothing(playback: Playback, asked_s: float) -> None:
    before = playback.position()
    with pytest.raises(ValueError, match="outside the recording"):
        playback.seek(asked_s, 100.0)
    assert playback.position() == before


@pytest.mark.parametrize("rate", [0.0, -1.0, 3.0, 32.0, math.nan, math.inf])
def test_a_pace_that_there_is_not_is_refused(playback: Playback, rate: float) -> None:
    with pytest.raises(ValueError, match=r"0\.25"):
        playback.set_rate(rate, 100.0)
    assert playback.rate == 1.0


def test_in_a_gap_values_grow_old_and_the_car_is_not_called_silent(indexed: Playback) -> None:
    playback = indexed
    playback.seek(106.0, 100.0)
    reach(playback)
    frame = playback.frame(**NAMES)
    assert frame["signals"]["speed"]["freshness"] == "stale"
    assert frame["signals"]["speed"]["age_s"] == pytest.approx(6.05, abs=0.01)
    assert frame["link"]["cut"] is None
    assert playback.position()["silent_s"] == pytest.approx(6.05, abs=0.01)


def test_other_settings_judge_otherwise(street: Path) -> None:
    playback = opened(street, settings="[limits.speed_limit]\nmax_mps = 14.0\n")
    playback.index.work(NEVER)
    assert not [mark for mark in playback.timeline()["marks"] if mark["alarm"] == "speed_limit"]
    assert playback.position()["settings_from"] == "now"
    playback.close()


def test_settings_that_cannot_be_used_are_said(street: Path) -> None:
    playback = opened(street, settings="not = [toml")
    assert any("settings cannot be used" in note for note in playback.timeline()["notes"])
    playback.close()


def test_the_real_drive(tmp_path: Path) -> None:
    if not BAG.exists():
        pytest.skip("the recorded drives are not here")
    playback = opened(BAG)
    playback.index.work(NEVER)
    marks = {mark["alarm"]: mark["at_s"] for mark in playback.timeline()["marks"]}
    assert marks["obstacle_nearest"] == pytest.approx(52.84, abs=0.05)
    playback.seek(marks["obstacle_nearest"], 100.0)
    reach(playback)
    assert "obstacle_nearest" in {alarm["id"] for alarm in playback.frame(**NAMES)["alarms"]}
    assert playback.position()["alarms_from"] == "judged"
    playback.close()


def test_a_check_has_its_minute_and_its_alarms_up_to_the_moment_shown(street: Path, indexed: Playback) -> None:
    for at_s, highest, changes in ((30.0, 9.0, []), (45.0, 12.5, ["raised"]), (99.0, 12.5, ["raised", "cleared"])):
        found = opened_check(indexed, at_s)
        check_shape(orjson.dumps(found), CheckAnswer)
        values = [value for value in found["minute"]["values"] if value is not None]
        assert len(found["minute"]["values"]) == min(300, round(at_s / 0.2) + 1)  # also right after a seek
        assert max(values) == pytest.approx(highest, abs=0.05)
        assert set(found["minute"]["limits"]) <= {11.0, None}
        assert [event["change"] for event in found["history"]] == changes
    raised, cleared = found["history"]
    begun_ms = indexed.position()["start_ms"]
    assert (raised["at_ms"] - begun_ms) / 1000 == pytest.approx(40.3, abs=0.2)
    assert (cleared["n"], cleared["worst"]["value"], cleared["worst"]["side"]) == (2, 12.5, "above")
    assert opened_check(indexed, 99.0, "laser_blind").get("history", []) == []
    played = opened(street)
    reach(played)
    assert opened_check(played, 99.0)["history"] is None  # its own alarms are found by reading as far
    played._work(100.0, NEVER)
    played.index.work(NEVER)
    played._put_right(100.0)
    reach(played)
    assert played.answer({"kind": "check", "check": "speed_limit"}) == opened_check(indexed, 99.0)
    played.close()
    assert opened_check(indexed, 1.0, "nothing")["ok"] is False


def test_a_history_that_is_too_long_is_not_shown_as_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timeline, "MOST_TRANSITIONS", 2)
    history = AlarmHistory()
    for at_s in (1.0, 2.0, 3.0):
        history.add(Transition(alarm_id="a", spec=SPEC, occurrence=1, change="raised", at_s=at_s, text=""), at_s)
    assert [one.at_s for one in history.until("a", 2.9) or ()] == [1.0, 2.0]
    assert (history.until("a", 3.0), history.until("b", 2.0)) == (None, [])


def test_a_page_that_replays_can_sign_orders_to_the_live_car() -> None:
    state: Any = live()
    assert "challenge" not in summary(state)
    state["server"]["challenge"] = "of the agent"
    assert summary(state)["challenge"] == "of the agent"
