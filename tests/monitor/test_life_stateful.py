"""Any history of a monitor with three alarms that explain each other: judged, answered, paused, restarted, ended, on a
clock that also goes back. What the log reports is what stands; nothing unseen vanishes; UNKNOWN decides nothing."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from monitor.alarm import Alarm, Refused, Transition
from monitor.alarm_spec import Priority
from monitor.check import OK, Finding, Verdict, fault, unknown
from monitor.restoring import restore
from monitor.runner import Monitor
from tests.monitor.test_alarm import SPEC
from tests.monitor.test_runner import Script, at, check

NAMES = ("link", "stale", "slow")
SPECS = {
    "link": replace(SPEC, on_delay_s=0.0, off_delay_s=1.0, needs_ack=True, priority=Priority.CRITICAL, grace_s=3.0),
    "stale": replace(SPEC, on_delay_s=0.0, off_delay_s=2.0, needs_ack=True, inhibited_by=("link",), grace_s=3.0),
    "slow": replace(SPEC, on_delay_s=0.5, off_delay_s=1.0, needs_ack=False, inhibited_by=("stale",)),
}
FINDINGS = st.sampled_from(
    [
        OK,
        unknown("cannot tell"),
        fault("bad"),
        fault("a", causes=("a",)),
        fault("a, b", causes=("a", "b")),
        fault("worse", level=2),
    ]
)


class Life(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.scripts = {name: Script() for name in NAMES}
        self.monitor = self.born()
        self.now_s = 100.0
        self.paused = False
        self.transitions: list[Transition] = []
        self.before: dict[str, Alarm] = {}
        self.seen: set[str] = set()  # alarms acknowledged, or ended, by the newest step
        self.announced: dict[str, list[int]] = {name: [] for name in NAMES}

    def born(self) -> Monitor:
        return Monitor([check(name, self.scripts[name], alarm=SPECS[name]) for name in NAMES])

    def hear(self, happened: tuple[Transition, ...]) -> None:
        for transition in happened:
            self.transitions.append(transition)
            if transition.change in ("raised", "recaused"):
                self.announced[transition.alarm_id].append(transition.occurrence)

    def remember(self) -> None:
        self.before = dict(self.monitor.alarms)
        self.seen = set()

    @rule(
        wait_s=st.sampled_from([0.0, 0.1, 0.6, 1.1, 4.0, 70.0]),
        findings=st.fixed_dictionaries(dict.fromkeys(NAMES, FINDINGS)),
    )
    def judge(self, wait_s: float, findings: dict[str, Finding]) -> None:
        self.remember()
        self.now_s += wait_s
        for name, finding in findings.items():
            self.scripts[name].finding = finding
        happened = self.monitor.step(at(self.now_s, paused=self.paused))
        self.hear(happened)
        for name, finding in findings.items():
            was, is_ = self.before[name], self.monitor.alarms[name]
            if finding.verdict is Verdict.UNKNOWN or self.paused:
                assert is_.active == was.active, "raised or cleared by what was not judged"
            gone = [t.change for t in happened if t.alarm_id == name]
            if was.active and not is_.active:
                assert finding.verdict is Verdict.OK
                assert "cleared" in gone
            if not was.acknowledged and is_.acknowledged:
                assert not SPECS[name].needs_ack
                assert "cleared" in gone

    @rule(name=st.sampled_from(NAMES), off_by=st.sampled_from([0, 0, -1, 1]))
    def acknowledge(self, name: str, off_by: int) -> None:
        self.remember()
        alarm = self.monitor.alarms[name]
        try:
            self.hear(self.monitor.acknowledge(name, alarm.occurrence + off_by, "Ann", self.now_s))
        except Refused:
            assert self.monitor.alarms[name] is alarm
            return
        assert off_by == 0, "it covered what was not shown"
        self.seen.add(name)

    @rule(name=st.sampled_from(NAMES), minutes=st.sampled_from([1.0, 15.0]))
    def shelve(self, name: str, minutes: float) -> None:
        self.remember()
        try:
            occurrence = self.monitor.alarms[name].occurrence
            self.hear(self.monitor.shelve(name, occurrence, minutes, "Ann", self.now_s))
        except Refused:
            return
        assert name == "slow", "an inhibitor was hidden"

    @rule(name=st.sampled_from(NAMES))
    def unshelve(self, name: str) -> None:
        self.remember()
        try:
            self.hear(self.monitor.unshelve(name, "Ann", self.now_s))
        except Refused:
            return

    @rule(paused=st.booleans())
    def pause(self, paused: bool) -> None:
        self.remember()
        self.paused = paused

    @rule(back_s=st.sampled_from([0.1, 5.0, 3600.0]))
    def set_clock_back(self, back_s: float) -> None:
        """Noticed, and made up for, at the next judgement; what is reported after it is on the new clock."""
        self.remember()
        self.now_s -= back_s
        self.transitions = [
            replace(t, at_s=t.at_s - back_s, shelved_until_s=self.moved(t, back_s)) for t in self.transitions
        ]
        for script in self.scripts.values():
            script.finding = unknown("cannot tell")
        self.hear(self.monitor.step(at(self.now_s, paused=self.paused)))
        for name in NAMES:
            assert self.monitor.alarms[name].active == self.before[name].active
            assert self.monitor.alarms[name].acknowledged <= self.before[name].acknowledged

    def moved(self, transition: Transition, back_s: float) -> float | None:
        """The monitor takes half a second back for a message that waited."""
        until_s = transition.shelved_until_s
        return until_s if until_s is None or back_s <= 0.5 else until_s - back_s

    @rule(down_s=st.sampled_from([0.0, 30.0, 1e5]))
    def restart(self, down_s: float) -> None:
        """The process is killed; another one goes on from the log, on a clock of its own."""
        self.remember()
        self.transitions = [
            replace(
                t,
                at_s=t.at_s - self.now_s - down_s,
                shelved_until_s=None if t.shelved_until_s is None else t.shelved_until_s - self.now_s - down_s,
            )
            for t in self.transitions
        ]
        self.now_s = 0.0
        for script in self.scripts.values():
            script.finding = unknown("nothing came yet")
        self.monitor = self.born()
        self.monitor.restore(self.transitions)
        for name in NAMES:
            was, is_ = self.before[name], self.monitor.alarms[name]
            assert (is_.active, is_.acknowledged, is_.occurrence) == (was.active, was.acknowledged, was.occurrence)
            assert (is_.shelved_until_s is None) == (was.shelved_until_s is None)
            assert not was.is_standing or bool(is_.suppressed_by) == bool(was.suppressed_by)

    @rule()
    def end(self) -> None:
        """At the operator's request: it is in the log, and nothing stands."""
        self.remember()
        self.hear(self.monitor.end(self.now_s))
        self.seen.update(NAMES)
        assert self.monitor.standing() == []

    @invariant()
    def the_log_says_what_stands(self) -> None:
        fresh = {name: Alarm(id=name, spec=SPECS[name]) for name in NAMES}
        again = restore(fresh, self.transitions)
        for name in NAMES:
            live, read = self.monitor.alarms[name], again[name]
            assert (read.active, read.acknowledged, read.occurrence) == (
                live.active,
                live.acknowledged,
                live.occurrence,
            )
            assert (read.shelved_until_s is None) == (live.shelved_until_s is None)
            assert read.acknowledged_by == live.acknowledged_by or not (live.active and live.acknowledged)

    @invariant()
    def nothing_unseen_vanishes(self) -> None:
        for name, was in self.before.items():
            is_ = self.monitor.alarms[name]
            if not was.acknowledged and SPECS[name].needs_ack and name not in self.seen:
                assert not is_.acknowledged
                assert is_.is_standing

    @invariant()
    def no_number_is_given_twice(self) -> None:
        for numbers in self.announced.values():
            assert numbers == sorted(set(numbers))


TestLife = Life.TestCase
TestLife.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
