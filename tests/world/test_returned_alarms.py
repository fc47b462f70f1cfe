"""Every alarm can be acknowledged where it stands, also when it has returned to normal."""

from __future__ import annotations

import pytest

from monitor.alarm import Alarm, AlarmState
from monitor.alarm_life import advance
from monitor.catalog import CHECKS
from monitor.check import OK, fault
from monitor.response import acknowledge
from server.protocol import serialize

KEPT = [check for check in CHECKS if check.alarm.needs_ack and not check.alarm.latches]
FAULT = fault("it happened", causes=("a",))


def returned(check_id: str) -> Alarm:
    """Raised and cleared, and nobody acknowledged it."""
    check = next(one for one in CHECKS if one.id == check_id)
    alarm = Alarm(id=check.id, spec=check.alarm)
    for n in range(400):
        alarm, _ = advance(alarm, FAULT if n < 200 else OK, n * 0.1)
    return alarm


@pytest.mark.world(n=18)
@pytest.mark.parametrize("check_id", [check.id for check in KEPT])
def test_what_has_returned_offers_its_acknowledgement_and_takes_it(check_id: str) -> None:
    alarm = returned(check_id)
    assert alarm.state is AlarmState.RTN_UNACKED
    assert "acknowledge" in serialize.alarm(alarm, 41.0, 0)["actions"]
    after, happened = acknowledge(alarm, alarm.occurrence, "Ann", 41.0)
    assert [one.change for one in happened] == ["acknowledged"]
    assert after.state is AlarmState.NORMAL


@pytest.mark.world(n=18)
@pytest.mark.parametrize("check_id", [check.id for check in CHECKS])
def test_what_is_offered_fits_the_state(check_id: str) -> None:
    check = next(one for one in CHECKS if one.id == check_id)
    alarm = Alarm(id=check.id, spec=check.alarm)
    for n in range(200):
        alarm, _ = advance(alarm, FAULT, n * 0.1)
    assert alarm.state is AlarmState.UNACKED
    assert "acknowledge" in serialize.alarm(alarm, 20.0, 0)["actions"]
    known, _ = acknowledge(alarm, alarm.occurrence, "Ann", 20.0)
    assert "acknowledge" not in serialize.alarm(known, 20.0, 0)["actions"]
