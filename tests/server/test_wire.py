"""What a page is told of an alarm."""

from __future__ import annotations

from dataclasses import replace

from monitor.alarm import Alarm, advance
from monitor.check import OK, fault, unknown
from server import wire
from tests.monitor.test_alarm import SPEC


def test_an_alarm_that_stands_and_is_not_checked_says_so() -> None:
    """A lost link neither clears an alarm nor lets it speak in the present."""
    check = replace(SPEC, on_delay_s=0.0, off_delay_s=1.0)
    one = Alarm(id="speed", spec=check)
    told_so = ((1.0, fault("12.6 m/s"), "fault"), (2.0, unknown("No link to the car"), "unknown"), (3.0, OK, "ok"))
    for at_s, finding, verdict in told_so:
        one, _ = advance(one, finding, at_s, ())
        told = wire.alarm(one, at_s, 0)
        assert (told["active"], told["verdict"], told["text"]) == (True, verdict, finding.text)
        assert told["trip_text"] == "12.6 m/s"
