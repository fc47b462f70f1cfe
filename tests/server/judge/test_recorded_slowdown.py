"""The slow-down in a replay: its state in the log of the drive, moment by moment."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.checks.slow_down import SlowDownLimits
from server.judge import recorded_events
from server.judge.recorded_events import RecordedSlowDown

START_S = 1_790_000_000.0
LIMITS = SlowDownLimits()

DRIVE: list[tuple[float, dict[str, Any]]] = [
    (1.0, {"change": "armed", "by": "Ann"}),
    (5.0, {"change": "slow_down", "step": "ordered", "order": 7, "why": "by hand", "by": "Ben", "topic": "/cmd_vel"}),
    (5.1, {"change": "slow_down", "step": "sent", "order": 7, "why": "by hand", "commanded_mps": 6.0}),
    (5.8, {"change": "slow_down", "step": "slows", "order": 7, "why": "by hand", "commanded_mps": 5.0}),
    (6.1, {"change": "slow_down", "step": "cut", "order": 7, "why": "by hand", "commanded_mps": 4.5}),
    (8.1, {"change": "slow_down", "step": "resumed", "order": 7, "why": "by hand", "commanded_mps": 3.0}),
    (12.0, {"change": "slow_down", "step": "refused", "by": "Ben"}),
    (13.0, {"change": "slow_down", "step": "released", "order": 7, "why": "by hand", "by": "Ann"}),
    (14.0, {"change": "disarmed", "by": "Ann"}),
]


def at(now_s: float) -> RecordedSlowDown:
    state = RecordedSlowDown()
    for at_s, event in DRIVE:
        recorded = recorded_events.read_slowdown(event)
        assert recorded is not None
        if at_s <= now_s:
            state = state.after(recorded, at_s)
    return state


@pytest.mark.parametrize(
    ("now_s", "state", "ordered_mps", "confirmed", "sending"),
    [
        (0.5, "not_armed", None, None, None),
        (1.0, "armed", None, None, None),
        (5.05, "ordered", None, None, False),
        (5.1, "ordered", 6.0, None, True),
        (5.5, "ordered", 5.4, None, True),
        (5.8, "ordered", 4.95, True, True),
        (7.0, "ordered", None, True, False),
        (8.1, "ordered", 3.0, True, True),
        (10.2, "holding", 0.0, True, True),
        (12.5, "holding", 0.0, True, True),
        (13.5, "armed", None, None, None),
        (14.5, "not_armed", None, None, None),
    ],
)
def test_each_moment_is_shown_as_it_was(
    now_s: float, state: str, ordered_mps: float | None, confirmed: bool | None, sending: bool | None
) -> None:
    shown = at(now_s).as_json(now_s, START_S, LIMITS)
    assert shown["state"] == state
    order = shown["order"]
    if sending is None:
        assert order is None
        return
    assert (order["number"], order["by"], order["why"]) == (7, "Ben", "by hand")
    assert order["ordered_mps"] == (None if ordered_mps is None else pytest.approx(ordered_mps, abs=0.01))
    assert (order["confirmed"], order["sending"]) == (confirmed, sending)
    assert order["steps"]["server_ms"] == round((START_S + 5.0) * 1000)


def test_what_was_not_confirmed_says_so_until_the_car_slows() -> None:
    state = at(5.1)
    for step, confirmed in (("not_confirmed", False), ("slows", True)):
        recorded = recorded_events.read_slowdown({"change": "slow_down", "step": step, "order": 7, "why": "by hand"})
        assert recorded is not None
        state = state.after(recorded, 6.5)
        assert state.as_json(6.5, START_S, LIMITS)["order"]["confirmed"] is confirmed


def test_a_recording_that_begins_in_the_middle_of_an_order_knows_it_from_the_next_word() -> None:
    recorded = recorded_events.read_slowdown(
        {"change": "slow_down", "step": "slows", "order": 3, "why": "by hand", "ordered_by": "Ann"}
    )
    assert recorded is not None
    shown = RecordedSlowDown().after(recorded, 2.0).as_json(2.5, START_S, LIMITS)
    assert (shown["state"], shown["order"]["by"], shown["order"]["sending"]) == ("ordered", "Ann", False)


def test_a_log_of_before_the_present_name_of_a_phase_is_read() -> None:
    """Rows as they were written when a slow-down that is not armed was called safe."""
    state = RecordedSlowDown()
    for row, shown in [
        ({"change": "armed", "by": "Ann", "state": "armed", "text": "Slow-down armed: /cmd_vel"}, "armed"),
        ({"change": "disarmed", "state": "safe", "text": "Slow-down disarmed."}, "not_armed"),
    ]:
        recorded = recorded_events.read_slowdown(row)
        assert recorded is not None
        state = state.after(recorded, 1.0)
        assert state.as_json(1.0, START_S, LIMITS)["state"] == shown


@pytest.mark.parametrize(
    "event",
    [
        {"change": "paused"},
        {"change": "slow_down"},
        {"change": "slow_down", "step": 7, "order": "x", "by": 5, "topic": {}, "commanded_mps": "fast"},
        {"change": "slow_down", "step": "sent", "order": True},
        {"change": "slow_down", "step": "slows", "order": None},
        {"change": "armed", "by": None},
    ],
)
def test_events_that_make_no_sense_harm_nothing(event: dict[str, Any]) -> None:
    recorded = recorded_events.read_slowdown(event)
    state = RecordedSlowDown() if recorded is None else RecordedSlowDown().after(recorded, 1.0)
    assert state.order is None
    state.facts(2.0, LIMITS)
    state.as_json(2.0, START_S, LIMITS)
