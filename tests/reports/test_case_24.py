"""Two cars on one bridge: all signals are of one of them, which the operator names once."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.analysis.rehearse import Rehearsed, rehearse
from server.judge.active_settings import SettingsOverride
from server.recording.read.read import open_recording
from tests.reports.cases import judged, made


def bag() -> Path:
    return made("case_24_namespaces.py") / "24-namespaces" / "two"


def run(**topics: str) -> Rehearsed:
    with open_recording([bag()]) as recording:
        return rehearse(recording, override=SettingsOverride(topics=topics))


def test_the_question_which_car_it_is_comes_once_and_nothing_is_judged_before() -> None:
    report = judged(bag())
    assert report.run.sources == {}
    (question,) = report.run.questions
    assert question["words"] == "Two cars: /agv1 and /agv2: which is this?"
    assert [one["value"] for one in question["options"]] == ["/agv1/odom", "/agv2/odom"]
    assert report.run.episodes == ()
    assert report.why_nothing == "Nothing could be evaluated: two cars, none chosen."


@pytest.mark.parametrize(
    ("topic", "expected"),
    [
        ("/agv2/odom", {"speed": "/agv2/odom", "odometry": "/agv2/odom", "scan": "/agv2/scan"}),
        ("/agv1/odom", {"speed": "/agv1/odom", "odometry": "/agv1/odom", "position": "/agv1/gps/fix"}),
    ],
)
def test_the_answer_decides_for_all_signals(topic: str, expected: dict[str, str]) -> None:
    found = run(speed=topic)
    assert {signal: source.topic for signal, source in found.sources.items()} == expected
    assert found.questions == ()
    assert ("obstacle" in {one.alarm_id for one in found.episodes}) == (topic == "/agv2/odom")
