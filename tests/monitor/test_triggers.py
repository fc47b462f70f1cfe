"""When the car is slowed without a hand: each rule on its switch, after its time, until it is vetoed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.alarm import Alarm
from monitor.catalog import CHECKS
from monitor.check import fault
from monitor.checks.slow_down import SlowDownLimits
from monitor.triggers import TRIGGERS, Trigger, Triggers, is_any_on

ALARMS = {check.id: Alarm(id=check.id, spec=check.alarm) for check in CHECKS}


def at_fault(*ids: str, **more: Any) -> dict[str, Alarm]:
    return ALARMS | {id: replace(ALARMS[id], condition=True, finding=fault(f"{id} is at fault"), **more) for id in ids}


def on(trigger: Trigger, after_s: float = 2.0) -> SlowDownLimits:
    return SlowDownLimits(**{trigger.switch: 1.0, trigger.after: after_s})


@pytest.mark.parametrize("trigger", TRIGGERS, ids=lambda trigger: trigger.id)
def test_each_rule_names_checks_and_settings_that_are_there(trigger: Trigger) -> None:
    assert set(trigger.checks) <= ALARMS.keys()
    limits = SlowDownLimits()
    assert getattr(limits, trigger.switch) == 0.0  # off until somebody switches it on
    assert getattr(limits, trigger.after) >= 0.0
    assert not is_any_on(limits)
    assert is_any_on(on(trigger))


@pytest.mark.parametrize("trigger", TRIGGERS, ids=lambda trigger: trigger.id)
def test_each_rule_is_due_after_its_time_and_not_while_it_is_off(trigger: Trigger) -> None:
    for check in trigger.checks:
        rules, off = Triggers(), Triggers()
        assert rules.look(at_fault(check), on(trigger), 10.0) is None
        assert rules.look(at_fault(check), on(trigger), 11.9) is None
        due = rules.look(at_fault(check), on(trigger), 12.0)
        assert due is not None
        assert (due.trigger, due.since_s, due.text) == (trigger, 10.0, f"{check} is at fault")
        for now_s in (10.0, 12.0, 100.0):
            assert off.look(at_fault(check), SlowDownLimits(), now_s) is None


def test_a_fault_that_goes_begins_anew() -> None:
    trigger, rules = TRIGGERS[0], Triggers()
    faulty = at_fault(trigger.checks[0])
    rules.look(faulty, on(trigger), 10.0)
    rules.look(ALARMS, on(trigger), 11.0)
    assert rules.look(faulty, on(trigger), 11.5) is None
    assert rules.look(faulty, on(trigger), 13.4) is None
    assert rules.look(faulty, on(trigger), 13.5) is not None


def test_a_fault_that_another_alarm_explains_slows_nothing() -> None:
    trigger, rules = TRIGGERS[0], Triggers()
    hidden = at_fault(trigger.checks[0], suppressed_by=("link_lost",))
    for now_s in (10.0, 20.0):
        assert rules.look(hidden, on(trigger), now_s) is None


def test_a_veto_counts_until_the_fault_has_gone() -> None:
    trigger, rules = TRIGGERS[0], Triggers()
    faulty, limits = at_fault(trigger.checks[0]), on(trigger)
    rules.look(faulty, limits, 10.0)
    assert rules.look(faulty, limits, 12.0) is not None
    rules.veto(trigger.id)
    for now_s in (12.1, 20.0, 300.0):
        assert rules.look(faulty, limits, now_s) is None
    rules.look(ALARMS, limits, 301.0)
    assert rules.look(faulty, limits, 301.5) is None  # gone for half a second is not gone
    assert rules.look(faulty, limits, 310.0) is None
    rules.look(ALARMS, limits, 311.0)
    rules.look(ALARMS, limits, 312.0)
    rules.look(faulty, limits, 313.0)
    assert rules.look(faulty, limits, 315.0) is not None


def test_another_drive_knows_no_veto() -> None:
    trigger, rules = TRIGGERS[0], Triggers()
    faulty, limits = at_fault(trigger.checks[0]), on(trigger, after_s=0.0)
    rules.look(faulty, limits, 1.0)
    rules.veto(trigger.id)
    rules.forget()
    assert rules.look(faulty, limits, 2.0) is not None


def test_of_several_the_first_in_order_is_reported() -> None:
    first, second = TRIGGERS[0], TRIGGERS[1]
    limits = SlowDownLimits(**{first.switch: 1.0, first.after: 0.0, second.switch: 1.0, second.after: 0.0})
    faulty = at_fault(first.checks[0], second.checks[0])
    for counting, expected in [(None, first), (first.id, first), (second.id, second), ("another", first)]:
        due = Triggers().look(faulty, limits, 5.0, counting=counting)
        assert due is not None
        assert due.trigger is expected
    due = Triggers().look(at_fault(first.checks[0]), limits, 5.0, counting=second.id)
    assert due is not None
    assert due.trigger is first
