"""An event of an older or a newer version is read as it declares itself; an unknown one is the most urgent."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.alarm import AlarmState, Transition
from monitor.alarm_spec import Place, Priority, Sound
from monitor.catalog import CHECKS
from server.judge.logged_transition import spec_of, transition_of

KNOWN = next(check.alarm for check in CHECKS if check.id == "not_moving")
WORST = (Priority.CRITICAL, Place.DIALOG, Sound.HIGH)
LEAST = {"priority": "advisory", "place": "list", "sound": "low"}


def read(**event: Any) -> Transition | None:
    return transition_of({"at_ms": 5000, "alarm": "of_another_version", **event}, lambda ms: ms / 1000, lambda ms: ms)


@pytest.mark.parametrize(
    ("event", "title", "shown"),
    [
        ({"alarm": "x"}, "x", WORST),
        ({"alarm": "x", "title": "Wheel lost", **LEAST}, "Wheel lost", (Priority.ADVISORY, Place.LIST, Sound.LOW)),
        ({"alarm": "x", "priority": "warning"}, "x", (Priority.WARNING, Place.SNACKBAR, Sound.MEDIUM)),
        ({"alarm": "x", **LEAST, "place": "ceiling", "sound": []}, "x", (Priority.ADVISORY, Place.LIST, Sound.LOW)),
        ({"alarm": "x", **LEAST, "priority": "extreme"}, "x", WORST),
        ({"alarm": "x", **LEAST, "priority": []}, "x", WORST),
        ({"alarm": "not_moving"}, KNOWN.title, (KNOWN.priority, KNOWN.place, KNOWN.sound)),
        ({"alarm": "not_moving", "title": "Stuck", "priority": "critical"}, "Stuck", WORST),
        ({"alarm": "not_moving", **LEAST, "priority": "extreme"}, KNOWN.title, WORST),
        ({"alarm": "x", "title": "y" * 1000}, "y" * 120, WORST),
    ],
)
def test_an_alarm_is_what_its_event_declares(
    event: dict[str, Any], title: str, shown: tuple[Priority, Place, Sound]
) -> None:
    spec = spec_of(event)
    assert (spec.title, (spec.priority, spec.place, spec.sound)) == (title, shown)


@pytest.mark.parametrize(
    ("event", "change", "state", "announces"),
    [
        ({"change": "raised"}, "raised", AlarmState.UNACKED, True),  # older than the state
        ({"change": "cleared"}, "cleared", AlarmState.NORMAL, False),
        ({"change": "acknowledged"}, "acknowledged", AlarmState.ACKED, False),
        ({"change": "raised", "state": "NO SUCH"}, "raised", AlarmState.UNACKED, True),
        ({"change": "raised", "state": "ACKED", "announces": False}, "raised", AlarmState.ACKED, False),
        ({"change": "escalated", "state": "UNACKED", "announces": True}, "recaused", AlarmState.UNACKED, True),
        ({"change": "escalated", "state": "RTN_UNACKED"}, "cleared", AlarmState.RTN_UNACKED, False),
        ({"change": "escalated"}, "recaused", AlarmState.UNACKED, False),
        ({"change": "raised", "state": [], "occurrence": "x", "causes": 7}, "raised", AlarmState.UNACKED, True),
    ],
)
def test_a_change_or_a_state_that_is_not_known_leaves_no_alarm_out(
    event: dict[str, Any], change: str, state: AlarmState, announces: bool
) -> None:
    found = read(**event)
    assert found is not None
    assert (found.change, found.state, found.announces) == (change, state, announces)


@pytest.mark.parametrize("event", [{}, {"change": 7}, {"change": "raised", "at_ms": "now"}])
def test_without_a_moment_or_a_change_it_is_none(event: dict[str, Any]) -> None:
    assert read(**event) is None
