"""After a restart, change by change: what each transition in the log makes of the alarm."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.alarm import Alarm, AlarmState, Cause, Change, Transition
from monitor.check import fault
from monitor.restoring import numbered_on, restore
from tests.monitor.test_alarm import NO_ACK, SPEC

FIRST, SECOND = fault("first"), fault("second")


def transition(change: Change, at_s: float, state: AlarmState = AlarmState.UNACKED, **more: Any) -> Transition:
    fields = {"occurrence": 1, "text": ""} | more
    return Transition(alarm_id="hot", spec=SPEC, change=change, at_s=at_s, state=state, **fields)


RAISED = transition("raised", 1.0, finding=FIRST, causes=("a",))
ACKED = transition("acknowledged", 2.0, AlarmState.ACKED, by="Ann", finding=SECOND, causes=("a",))
SHELVED = transition("shelved", 3.0, AlarmState.SHELVED, by="Ben", causes=("a",), shelved_until_s=60.0)
STANDING: dict[str, Any] = {
    "occurrence": 1,
    "active": True,
    "acknowledged": False,
    "raised_s": 1.0,
    "announced_s": 1.0,
    "worst": FIRST,
    "trip": FIRST,
    "causes": (Cause(name="a"),),
}
SEEN = STANDING | {"acknowledged": True, "acknowledged_by": "Ann"}


@pytest.mark.parametrize(
    ("log", "fields"),
    [
        ([RAISED], STANDING),
        (
            [transition("raised", 1.0, AlarmState.ACKED, finding=FIRST)],
            {"active": True, "raised_s": 1.0, "worst": FIRST, "occurrence": 1},
        ),
        ([RAISED, ACKED], SEEN),
        (
            [RAISED, ACKED, transition("recaused", 5.0, occurrence=2, finding=SECOND, causes=("a", "b"))],
            STANDING
            | {"occurrence": 2, "announced_s": 5.0, "trip": SECOND, "causes": (Cause(name="a"), Cause(name="b"))},
        ),
        (
            [RAISED, transition("cleared", 4.0, AlarmState.RTN_UNACKED)],
            STANDING | {"active": False, "cleared_s": 4.0, "causes": ()},
        ),
        ([RAISED, SHELVED], STANDING | {"shelved_by": "Ben", "shelved_until_s": 60.0}),
        (
            [RAISED, ACKED, SHELVED, transition("unshelved", 60.0, occurrence=2, causes=("a",))],
            STANDING | {"occurrence": 2, "announced_s": 60.0},
        ),
        (
            [
                RAISED,
                transition("cleared", 4.0, AlarmState.SHELVED, shelved_until_s=60.0),
                transition("unshelved", 60.0, AlarmState.RTN_UNACKED),
            ],
            STANDING | {"active": False, "cleared_s": 4.0, "causes": ()},
        ),
        (
            [RAISED, transition("suppressed", 4.0, AlarmState.SUPPRESSED, suppressed_by=("link_lost",), causes=("a",))],
            STANDING | {"suppressed_by": ("link_lost",)},
        ),
        ([RAISED, ACKED, transition("cleared", 9.0, AlarmState.NORMAL)], {"occurrence": 1}),
        (
            [transition("recaused", 5.0, occurrence=7), transition("suppressed", 6.0, AlarmState.NORMAL, occurrence=3)],
            {"occurrence": 7},
        ),
    ],
)
def test_each_change_of_the_log(log: list[Transition], fields: dict[str, Any]) -> None:
    assert restore({"hot": Alarm(id="hot", spec=SPEC)}, log)["hot"] == Alarm(id="hot", spec=SPEC, **fields)
    assert numbered_on({"hot": Alarm(id="hot", spec=SPEC, active=True)}, log)["hot"] == Alarm(
        id="hot", spec=SPEC, active=True, occurrence=fields["occurrence"]
    )


def test_what_needs_no_acknowledgement_is_acknowledged_when_it_clears_on_the_shelf() -> None:
    log = [RAISED, SHELVED, transition("cleared", 4.0, AlarmState.SHELVED, shelved_until_s=60.0)]
    for spec, acknowledged in [(NO_ACK, True), (SPEC, False)]:
        alarm = restore({"hot": Alarm(id="hot", spec=spec)}, log)["hot"]
        assert (alarm.active, alarm.acknowledged, alarm.shelved_by) == (False, acknowledged, "Ben")


def test_out_of_service_stays_and_other_alarms_are_not_touched() -> None:
    alarms = {"hot": Alarm(id="hot", spec=SPEC, out_of_service=True), "cold": Alarm(id="cold", spec=SPEC)}
    after = restore(alarms, [RAISED, transition("cleared", 2.0, AlarmState.NORMAL)])
    assert after == {"hot": Alarm(id="hot", spec=SPEC, out_of_service=True, occurrence=1), "cold": alarms["cold"]}
    assert alarms["hot"].occurrence == 0
