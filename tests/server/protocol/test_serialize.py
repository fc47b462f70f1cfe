"""What a page gets of an alarm."""

from __future__ import annotations

from dataclasses import replace

from monitor.alarm import Alarm
from monitor.alarm_life import advance
from monitor.check import OK, Quantity, fault, unknown
from server.protocol import serialize
from tests.monitor.test_alarm import SPEC


def test_an_active_alarm_that_is_not_checked_states_it() -> None:
    """A lost link neither clears an alarm nor lets it speak in the present."""
    check = replace(SPEC, on_delay_s=0.0, off_delay_s=1.0)
    one = Alarm(id="speed", spec=check)
    findings = ((1.0, fault("12.6 m/s"), "fault"), (2.0, unknown("No link to the car"), "unknown"), (3.0, OK, "ok"))
    for at_s, finding, verdict in findings:
        one, _ = advance(one, finding, at_s, ())
        sent = serialize.alarm(one, at_s, 0)
        assert (sent["active"], sent["verdict"], sent["text"]) == (True, verdict, finding.text)
        assert sent["trip_text"] == "12.6 m/s"


def test_an_alarm_tells_how_bad_it_was_and_on_which_side_of_its_limit() -> None:
    check = replace(SPEC, on_delay_s=0.0, off_delay_s=1.0)
    for values, limit, worst, side in (((12.0, 12.8, 12.6), 11.0, 12.8, "above"), ((4.6, 3.9, 4.2), 5.0, 3.9, "below")):
        one = Alarm(id="x", spec=check)
        assert serialize.alarm(one, 0.0, 0)["worst"] is None
        for at_s, value in enumerate(values):
            measured, against = (Quantity(label="X", value=number, unit="m") for number in (value, limit))
            one, _ = advance(one, fault("X", measured=measured, limit=against), float(at_s), ())
        one, _ = advance(one, unknown("No link"), 4.0, ())
        assert serialize.alarm(one, 4.0, 0)["worst"] == {"label": "X", "value": worst, "unit": "m", "side": side}
        assert serialize.alarm(one, 4.0, 0)["measured"] is None
    one, _ = advance(Alarm(id="x", spec=check), fault("no numbers"), 0.0, ())
    assert serialize.alarm(one, 0.0, 0)["worst"] is None
