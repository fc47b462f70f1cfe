"""The topics of the driving mode: each type, each value, and values without a mode."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.state import State
from monitor.values import DriveMode, Mode
from server.judge import pipeline, profiles
from server.judge.message_fields import Rejected
from server.judge.reception_stats import Reception
from server.judge.sources.choice import choose
from server.judge.topics import BY_SIGNAL

REPORT = "autoware_vehicle_msgs/ControlModeReport"


@pytest.mark.parametrize(
    ("type", "message", "mode"),
    [
        ("std_msgs/Bool", {"data": True}, "autonomous"),
        ("std_msgs/Bool", {"data": False}, "manual"),
        ("std_msgs/Bool", {"data": 1}, None),
        ("std_msgs/UInt8", {"data": 1}, "unknown"),  # what it means is a setting
        ("std_msgs/UInt8", {"data": 256}, None),
        ("std_msgs/UInt8", {"data": True}, None),
        ("std_msgs/String", {"data": " AUTONOMOUS "}, "autonomous"),
        ("std_msgs/String", {"data": "manual"}, "manual"),
        ("std_msgs/String", {"data": "not autonomous"}, "unknown"),
        ("std_msgs/String", {"data": "<b>" * 100}, "unknown"),
        ("std_msgs/String", {"data": ""}, "unknown"),  # else the previous mode would remain
        ("std_msgs/String", {"data": "\u200b"}, "unknown"),
        ("std_msgs/String", {"data": True}, "autonomous"),  # where the type is not known
        ("std_msgs/String", {"data": 0}, "unknown"),
        ("std_msgs/String", {"data": 256}, None),
        ("std_msgs/String", {"mode": 4}, "manual"),
        ("std_msgs/String", {"mode": "x"}, None),
        ("std_msgs/String", {}, None),
        *((REPORT, {"mode": number}, mode) for number, mode in enumerate(
            ["unknown", "autonomous", "unknown", "unknown", "manual", "manual", "unknown", "unknown"]
        )),
        ("autoware_auto_vehicle_msgs/ControlModeReport", {"mode": 1}, "autonomous"),
        (REPORT, {"mode": -1}, None),
        (REPORT, {"mode": None}, None),
    ],
)  # fmt: skip
def test_a_message_becomes_a_mode_or_is_rejected(type: str, message: Any, mode: Mode | None) -> None:
    decode = BY_SIGNAL["mode"].types[type]
    if mode is None:
        with pytest.raises(Rejected):
            decode(message)
        return
    found = decode(message)
    assert found.mode == mode
    assert 0 < len(found.text) <= 40


def test_a_report_is_found_by_its_type_and_other_topics_only_by_name_or_choice() -> None:
    found = {"/state": "std_msgs/Bool", "/report": "autoware_vehicle_msgs/msg/ControlModeReport"}
    assert choose(found).sources["mode"].topic == "/report"
    assert "mode" not in choose({"/state": "std_msgs/Bool"}).sources
    assert choose({"/state": "std_msgs/Bool"}, {"mode": "/state"}).sources["mode"].decode is not None


def test_a_kind_of_car_has_words_and_numbers_of_its_own() -> None:
    own = profiles._read("own", {"title": "Own", "mode": {"autonomous": ["Cruise", "3"], "manual": ["PARK"]}})
    state, reception = State(), Reception()
    for at, (type, data) in enumerate(
        [("std_msgs/String", "cruise"), ("std_msgs/String", "park"), ("std_msgs/UInt8", 3)]
    ):
        sources = pipeline.by_topic(choose({"/m": type}, {"mode": "/m"}).sources.values())["/m"]
        message = {"data": data}
        pipeline.receive(
            sources, message, float(at), None, reception=reception, state=state, profile=own, tyre_rad_per_unit=0.0
        )
    assert [one.value.mode for one in state.snapshot(3.0).modes_received] == ["autonomous", "manual", "autonomous"]
    reading = state.get("mode")
    assert reading is not None
    assert reading.value == DriveMode(mode="autonomous", text="3")
