"""Running the checks: which when, what a broken one does, what the operator may do, what is shown first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor import catalog
from monitor.alarm import AlarmState, Refused
from monitor.alarm_spec import Priority
from monitor.catalog import AllLimits
from monitor.check import OK, Check, Finding, Limits, NotFresh, Scope, Verdict, fault, unknown
from monitor.runner import IMPAIRED, Monitor
from monitor.state import LinkFacts, Snapshot
from tests.monitor.test_alarm import SPEC

AT_ONCE = replace(SPEC, on_delay_s=0.0, off_delay_s=0.0)


class Script:
    """A check that returns a given finding, and counts its calls."""

    def __init__(self, finding: Finding | Exception = OK) -> None:
        self.finding = finding
        self.calls = 0

    def __call__(self, snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
        self.calls += 1
        if isinstance(self.finding, Exception):
            raise self.finding
        return self.finding


def check(name: str, script: Script, **fields: object) -> Check[Limits]:
    alarm = fields.pop("alarm", AT_ONCE)
    return Check(id=name, label=name.upper(), alarm=alarm, limits=Limits, find=script, **fields)  # type: ignore[arg-type]


def at(now_s: float, phase: str = "monitoring", paused: bool = False) -> Snapshot:
    return Snapshot(now_s=now_s, link=LinkFacts(phase=phase), paused=paused)  # type: ignore[arg-type]


BAD = fault("it is bad")


def test_a_tick_judges_all_and_a_message_the_immediate_checks_that_need_it() -> None:
    a, b, c = Script(), Script(), Script()
    monitor = Monitor(
        [
            check("a", a, needs=frozenset({"speed", "brake"}), immediate=True),
            check("b", b, immediate=True),
            check("c", c, needs=frozenset({"speed"})),
        ]
    )
    monitor.step(at(0.0))
    assert (a.calls, b.calls, c.calls) == (1, 1, 1)
    monitor.step(at(0.1), ("speed",))
    assert (a.calls, b.calls, c.calls) == (2, 1, 1)
    monitor.step(at(0.2), ("speed", "acceleration", "brake"))
    assert (a.calls, b.calls, c.calls) == (3, 1, 1)
    monitor.step(at(0.3), ("scan",))
    monitor.step(at(0.3), ())
    assert (a.calls, b.calls, c.calls) == (3, 1, 1)
    assert monitor.has_immediate(("speed",))
    assert not monitor.has_immediate(("scan",))


def test_what_hurts_within_a_moment_is_judged_with_each_message() -> None:
    immediate = {check.id for check in catalog.CHECKS if check.immediate and check.needs}
    assert immediate == {"speed_limit", "obstacle", "obstacle_nearest", "pedals", "no_response"}


def test_an_event_raises_in_the_same_pass() -> None:
    script = Script()
    monitor = Monitor([check("a", script, needs=frozenset({"speed"}), immediate=True)])
    script.finding = BAD
    (raised,) = monitor.step(at(0.05), ("speed",))
    assert (raised.alarm_id, raised.change, raised.at_s, raised.announces) == ("a", "raised", 0.05, True)
    assert monitor.findings["a"] is BAD


def test_a_missing_value_is_unknown_with_its_reason() -> None:
    script = Script(NotFresh("Speed is 3.4 s old", "stale"))
    monitor = Monitor([check("a", script)])
    monitor.step(at(0.0))
    assert monitor.findings["a"] == unknown("Speed is 3.4 s old", short="stale")
    assert monitor.crashes == {}


def test_a_broken_check_silences_none_of_the_others() -> None:
    broken, sound = Script(ZeroDivisionError("division by zero")), Script(BAD)
    monitor = Monitor([check("a", broken), check("b", sound)])
    happened = monitor.step(at(0.0))
    assert [(t.alarm_id, t.change) for t in happened] == [("b", "raised"), (IMPAIRED, "raised")]
    assert monitor.findings["a"].verdict is Verdict.UNKNOWN
    assert monitor.findings["a"].brief == "not checked: failed"
    assert happened[1].text == "Not watched: A"
    crash = monitor.crashes["a"]
    assert (crash.error, crash.count) == ("ZeroDivisionError: division by zero", 1)
    assert "in __call__" in crash.where


def test_a_broken_check_does_not_clear_its_alarm() -> None:
    script = Script(BAD)
    monitor = Monitor([check("a", script)])
    monitor.step(at(0.0))
    script.finding = RuntimeError("boom")
    for n in range(100):
        monitor.step(at(1.0 + n))
    assert monitor.alarms["a"].state is AlarmState.UNACKED


def test_a_check_that_answers_nonsense_is_broken_too() -> None:
    monitor = Monitor([check("a", Script(None))])  # type: ignore[arg-type]
    monitor.step(at(0.0))
    assert monitor.crashes["a"].error.startswith("TypeError")


def test_one_more_broken_check_is_announced_and_a_repaired_one_clears() -> None:
    a, b = Script(RuntimeError("a")), Script()
    monitor = Monitor([check("a", a), check("b", b)])
    monitor.step(at(0.0))
    monitor.acknowledge(IMPAIRED, 1, "Ann", 0.1)
    b.finding = RuntimeError("b")
    (again,) = monitor.step(at(1.0))
    assert (again.change, again.occurrence, again.text) == ("recaused", 2, "Not watched: A, B")
    assert monitor.crashes["a"].count == 2
    a.finding = b.finding = OK
    monitor.acknowledge(IMPAIRED, 2, "Ann", 1.1)
    happened = [t for n in range(12) for t in monitor.step(at(2.0 + n))]
    assert [(t.alarm_id, t.change, t.at_s) for t in happened] == [(IMPAIRED, "cleared", 12.0)]


def test_a_check_that_breaks_on_an_event_is_reported_at_once() -> None:
    monitor = Monitor([check("a", Script(RuntimeError("a")), needs=frozenset({"speed"}), immediate=True)])
    assert [t.alarm_id for t in monitor.step(at(0.0), ("speed",))] == [IMPAIRED]


@pytest.mark.parametrize("phase", ["connecting", "failed", "lost"])
def test_without_a_link_nothing_of_the_car_is_checked(phase: str) -> None:
    car, link, server = Script(BAD), Script(BAD), Script(BAD)
    monitor = Monitor([check("a", car), check("b", link, scope=Scope.LINK), check("c", server, scope=Scope.SERVER)])
    happened = monitor.step(at(0.0, phase))
    assert [t.alarm_id for t in happened] == ["b", "c"]
    assert (car.calls, monitor.findings["a"].brief) == (0, "not checked: no link")


def test_a_pause_suppresses_all_but_the_link_and_brings_back_what_stood() -> None:
    car, link = Script(BAD), Script()
    monitor = Monitor([check("a", car), check("b", link, scope=Scope.LINK)])
    monitor.step(at(0.0))
    assert [(t.alarm_id, t.change) for t in monitor.step(at(1.0, paused=True))] == [("a", "suppressed")]
    assert monitor.findings["a"].brief == "not checked: paused"
    assert monitor.standing() == []
    link.finding = BAD
    assert [(t.alarm_id, t.change) for t in monitor.step(at(2.0, paused=True))] == [("b", "raised")]
    assert [(t.alarm_id, t.change, t.occurrence) for t in monitor.step(at(3.0))] == [("a", "unsuppressed", 1)]
    assert [alarm.id for alarm in monitor.standing()] == ["b", "a"]


def test_idle_ends_everything() -> None:
    monitor = Monitor([check("a", Script(BAD)), check("b", Script(), scope=Scope.LINK)])
    monitor.step(at(0.0))
    (ended,) = monitor.step(at(1.0, "idle"))
    assert (ended.change, ended.text) == ("cleared", "Monitoring ended")
    assert monitor.step(at(1.1, "idle")) == ()
    assert (monitor.standing(), monitor.findings) == ([], {})
    (raised,) = monitor.step(at(2.0))
    assert raised.occurrence == 2  # a late tap for the first still finds nothing of its own


def test_what_is_explained_away_is_shown_as_not_judged() -> None:
    cause, consequence = Script(BAD), Script(BAD)
    inhibited = replace(AT_ONCE, inhibited_by=("cause",))
    monitor = Monitor([check("consequence", consequence, alarm=inhibited), check("cause", cause)])
    assert [t.alarm_id for t in monitor.step(at(0.0))] == ["cause"]  # judged first, though declared last
    assert monitor.findings["consequence"].brief == "not checked: waiting"
    assert monitor.alarms["consequence"].suppressed_by == ("cause",)


def test_what_is_shown_first() -> None:
    critical = replace(AT_ONCE, priority=Priority.CRITICAL)
    scripts = {name: Script() for name in ("w1", "w2", "c1", "c2", "fine")}
    monitor = Monitor(
        [check(name, script, alarm=critical if "c" in name else AT_ONCE) for name, script in scripts.items()]
    )
    for n, name in enumerate(["c1", "w1", "c2", "w2"]):
        scripts[name].finding = BAD
        monitor.step(at(float(n)))
    assert [alarm.id for alarm in monitor.standing()] == ["c2", "c1", "w2", "w1"]
    monitor.shelve("w2", 1, 5.0, "Ann", 5.0)
    assert [alarm.id for alarm in monitor.standing()] == ["c2", "c1", "w1", "w2"]


def test_what_the_operator_does() -> None:
    monitor = Monitor([check("a", Script(BAD))])
    monitor.step(at(0.0))
    (seen,) = monitor.acknowledge("a", 1, "Ann", 0.5)
    assert (seen.change, seen.by, seen.at_s) == ("acknowledged", "Ann", 0.5)
    (shelved,) = monitor.shelve("a", 1, 10.0, "Ann", 0.6)
    assert (shelved.change, monitor.alarms["a"].state) == ("shelved", AlarmState.SHELVED)
    (back,) = monitor.unshelve("a", "Ann", 0.7)
    assert (back.change, back.occurrence, back.announces) == ("unshelved", 2, True)
    with pytest.raises(Refused, match="no such alarm"):
        monitor.acknowledge("b", 1, "Ann", 0.8)


def test_a_refused_request_changes_nothing() -> None:
    monitor = Monitor([check("a", Script(BAD))])
    monitor.step(at(0.0))
    before = monitor.alarms["a"]
    with pytest.raises(Refused):
        monitor.acknowledge("a", 7, "Ann", 0.5)
    assert monitor.alarms["a"] is before


def test_an_alarm_that_explains_others_is_not_shelved() -> None:
    monitor = Monitor()
    monitor.step(at(0.0))
    monitor.alarms["signal_stale.brake"] = replace(
        monitor.alarms["signal_stale.brake"], active=True, acknowledged=False, occurrence=1
    )
    with pytest.raises(Refused, match="explains other alarms"):
        monitor.shelve("signal_stale.brake", 1, 5.0, "Ann", 0.0)


def test_thresholds_may_change_while_running() -> None:
    seen: list[float] = []

    def find(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
        seen.append(limits.max_mps)  # type: ignore[attr-defined]
        return OK

    speed = next(check for check in catalog.CHECKS if check.id == "speed_limit")
    monitor = Monitor([replace(speed, find=find)])
    monitor.step(at(0.0))
    monitor.limits = catalog.changed(AllLimits(), {"speed_limit.max_mps": 5.0})
    monitor.step(at(0.1))
    assert seen == [11.0, 5.0]


def test_two_checks_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match="two checks have one id"):
        Monitor([check("a", Script()), check("a", Script())])
