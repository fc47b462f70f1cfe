"""The title of an alarm that has ended: no claim that what it was about still holds."""

from __future__ import annotations

import re

import pytest

from monitor.catalog import CHECKS, AnyCheck

# A title of these, followed by "ended", reads as if it still held, or as its opposite.
PRESENT = re.compile(
    r"\b(no|not|nobody|never|is|are|cannot|disagree|ignores|runs|stopped|lost|silent|unknown|unusable|failed)\b", re.I
)
WAITING = [check for check in CHECKS if check.alarm.needs_ack]


@pytest.mark.parametrize("check", WAITING, ids=[check.id for check in WAITING])
def test_an_ended_alarm_reads_as_ended(check: AnyCheck) -> None:
    title = check.alarm.ended_title
    assert title != check.alarm.title
    assert len(title) <= 40
    if title.endswith(": ended"):
        assert not PRESENT.search(check.alarm.title), "its declaration needs `ended`"
