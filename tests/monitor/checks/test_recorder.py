"""The recorder: keeps up or not, has room or not, records or not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.check import Verdict
from monitor.runner import Monitor
from monitor.shell_facts import RecorderFacts
from tests.monitor.checks.known import ask, known

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN


def at(**facts: Any) -> Any:
    return replace(known(now_s=100.0), recorder=RecorderFacts(**{"state": "recording"} | facts))


@pytest.mark.parametrize(
    ("facts", "was_active", "verdict", "text"),
    [
        ({"behind_s": 2.0}, False, OK, ""),
        ({"behind_s": 2.1}, False, FAULT, "wait 2.1 s"),
        ({"behind_s": 1.1}, True, FAULT, "wait 1.1 s"),
        ({"behind_s": 1.0}, True, OK, ""),
        ({"dropped": 1, "dropped_s": 90.1}, False, FAULT, "1 message was not recorded"),
        ({"dropped": 7, "dropped_s": 100.0}, False, FAULT, "7 messages were not recorded"),
        ({"dropped": 7, "dropped_s": 90.0}, True, OK, ""),
        ({"state": "saving", "behind_s": 9.0}, False, FAULT, "wait 9.0 s"),
        ({"state": "off", "behind_s": 9.0}, False, UNKNOWN, ""),
        ({"state": "held", "dropped": 1, "dropped_s": 99.0}, False, UNKNOWN, ""),
        ({"state": "stopped", "behind_s": 9.0}, False, UNKNOWN, ""),
    ],
)
def test_it_keeps_up(facts: dict[str, Any], was_active: bool, verdict: Verdict, text: str) -> None:
    found = ask("recorder_behind", at(**facts), was_active=was_active)
    assert found.verdict is verdict
    assert text in found.text


@pytest.mark.parametrize(
    ("facts", "was_active", "verdict"),
    [
        ({"left_gb": 2.0}, False, OK),
        ({"left_gb": 1.99}, False, FAULT),
        ({"left_gb": 2.19}, True, FAULT),
        ({"left_gb": 2.2}, True, OK),
        ({"left_gb": 0.0, "limit": "0.5 GB must stay free"}, False, FAULT),
        ({"left_gb": 0.0, "state": "held"}, False, FAULT),
        ({"left_gb": 0.0, "state": "off"}, False, UNKNOWN),
        ({"left_gb": None}, False, UNKNOWN),
    ],
)
def test_it_has_room(facts: dict[str, Any], was_active: bool, verdict: Verdict) -> None:
    found = ask("disk_nearly_full", at(**facts), was_active=was_active)
    assert found.verdict is verdict
    if facts.get("limit"):
        assert found.text == "Space for 0.00 GB more, then recording stops: 0.5 GB must stay free"


@pytest.mark.parametrize(
    ("facts", "verdict", "text"),
    [
        ({}, OK, "Recording"),
        ({"state": "saving"}, OK, "Recording"),
        ({"state": "held"}, OK, "What was recorded is saved"),
        ({"state": "off"}, UNKNOWN, "Recording is off"),
        ({"state": "stopped", "trouble": "The disk is full."}, FAULT, "The disk is full."),
        ({"state": "stopped"}, FAULT, "Recording stopped by itself"),
    ],
)
def test_it_records(facts: dict[str, Any], verdict: Verdict, text: str) -> None:
    found = ask("recording_stopped", at(**facts))
    assert (found.verdict, found.text) == (verdict, text)


def test_a_stopped_recorder_is_reported_at_once_and_alone_and_while_paused() -> None:
    monitor = Monitor()
    announced = []
    for tenth in range(100):
        stopped = tenth >= 20
        facts = RecorderFacts(
            state="stopped" if stopped else "recording",
            trouble="Recording stopped: the disk is full." if stopped else None,
            left_gb=0.1 if stopped else 5.0,
        )
        snapshot = replace(known(now_s=tenth / 10), recorder=facts, paused=True, paused_since_s=0.0)
        announced += [
            (t.at_s, t.alarm_id, t.change)
            for t in monitor.step(snapshot)
            if t.announces and t.alarm_id in ("recording_stopped", "recorder_behind", "disk_nearly_full")
        ]
    assert announced == [(2.0, "recording_stopped", "raised")]
