"""The frames that the pictures and the tests of the page are made of are those of the protocol."""

from __future__ import annotations

import json
from typing import Any

import pytest
from pydantic import ValidationError

from server.protocol.alarm_state import StandingAlarm
from server.protocol.state import State
from tests.frames import check_shape
from tests.page import canned

STATES = {
    "live": canned.live(),
    "idle": canned.idle(),
    "connecting": canned.idle("connecting"),
    **{
        f"slow-down {name}": canned.live() | {"decelerate": canned.slow(name)}
        for name in ("not_armed", "armed", "holding")
    },
    "slowed": canned.live() | {"decelerate": canned.slowed()},
    "alarm": canned.live() | {"alarms": [canned.alarm("speed_limit", "Speed above limit")]},
}


@pytest.mark.parametrize("name", STATES)
def test_a_canned_state_is_one_of_the_protocol(name: str) -> None:
    check_shape(json.dumps(STATES[name]), State)


@pytest.mark.parametrize(
    ("name", "change", "wrong"),
    [
        ("missing", lambda alarm: alarm.pop("verdict"), ValidationError),
        ("of another type", lambda alarm: alarm.update(for_s="2.3"), ValidationError),
        ("no such value", lambda alarm: alarm.update(priority="urgent"), ValidationError),
        ("unknown", lambda alarm: alarm.update(colour="red"), AssertionError),
        ("unknown within", lambda alarm: alarm["measured"].update(digits=1), AssertionError),
    ],
)
def test_what_is_not_of_its_type_is_found(name: str, change: Any, wrong: type[Exception]) -> None:
    alarm = canned.alarm("speed_limit", "Speed", measured={"label": "Speed", "value": 12.6, "unit": "m/s"})
    check_shape(json.dumps(alarm), StandingAlarm)
    change(alarm)
    with pytest.raises(wrong):
        check_shape(json.dumps(alarm), StandingAlarm)
