"""What a check's quick look passes over is never a fault, and a monitor that passes over it raises the same alarms."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor.catalog import CHECKS, AllLimits, AnyCheck
from monitor.check import OK, Finding, Limits, Verdict
from monitor.runner import ASKED_EVERY, IMPAIRED, Monitor
from monitor.state import LinkFacts, NotFresh, Snapshot, State
from monitor.values import (
    Bearing,
    Component,
    Diagnostics,
    Distance,
    Effort,
    GpsFix,
    Level,
    MotionCommand,
    Odometry,
    Steering,
    Twist,
    Value,
)
from tests.monitor.drive import REAL_HZ, VALUES, Drive, sweep
from tests.monitor.test_runner import Script, at, check

QUICK = [check for check in CHECKS if check.is_harmless is not None]
NEEDS_A_SNAPSHOT = frozenset({"no_response"})  # looks at more than what the message changed

numbers = st.one_of(st.floats(-30, 30), st.sampled_from([math.nan, math.inf, -math.inf, 0.0, 5.0, 11.0]))
ranges = st.lists(st.one_of(st.floats(0, 90, width=32), st.sampled_from([math.nan, math.inf])), max_size=9)
values: dict[str, st.SearchStrategy[Value]] = {
    "speed": st.builds(Twist, speed_mps=numbers),
    "brake": st.builds(Effort, percent=numbers),
    "accelerator": st.builds(Effort, percent=numbers),
    "steering": st.builds(Steering, percent=numbers),
    "distance": st.builds(Distance, distance_m=st.one_of(st.none(), st.floats(0, 60))),
    "bearing": st.builds(Bearing, bearing_rad=st.floats(-3, 3)),
    "position": st.builds(
        GpsFix,
        lat_deg=st.sampled_from([32.0, 32.00001, 32.0001, 89.9999, math.nan]),
        lon_deg=st.sampled_from([-110.0, -110.0001, 180.0, -180.0]),
        status=st.sampled_from([-1, 0, 2]),
        covariance_type=st.integers(0, 3),
        sigma_m=st.one_of(st.none(), st.floats(0.1, 60)),
    ),
    "odometry": st.builds(Odometry, x_m=numbers, y_m=numbers, speed_mps=numbers),
    "scan": st.builds(sweep, ranges),
    "diagnostics": st.builds(
        Diagnostics,
        components=st.lists(
            st.builds(Component, name=st.just("gps"), level=st.integers(0, 3), message=st.just(""))
        ).map(tuple),
    ),
    "command": st.builds(MotionCommand, speed_mps=st.one_of(st.none(), numbers), tyre_angle_rad=st.none()),
    "fuel": st.builds(Level, value=numbers, unit=st.sampled_from(["%", "l"])),
}
events = st.lists(
    st.tuples(
        st.sampled_from([0.0, 0.05, 0.05, 0.1, 0.1, 0.7, 3.0, -0.2, -5.0]),
        st.sampled_from(sorted(values)).flatmap(lambda name: st.tuples(st.just(name), values[name])),
    ),
    max_size=60,
)
limits_of_any_kind = st.builds(
    AllLimits,
    gps_fix=st.builds(AllLimits.model_fields["gps_fix"].annotation, strict=st.sampled_from([0.0, 1.0])),  # type: ignore[arg-type]
)


def snapshots(happening: list[Any], phase: str, published: frozenset[str]) -> list[Snapshot]:
    state = State()
    state.link(LinkFacts(phase=phase, connected_s=0.0, published=published))  # type: ignore[arg-type]
    now_s, seen = 10.0, [state.snapshot(10.0)]
    for later_s, (name, value) in happening:
        now_s += later_s
        state.receive(name, value, now_s)
        seen.append(state.snapshot(now_s))
    seen.append(state.snapshot(now_s + 2.5))
    return seen


@settings(max_examples=150)
@given(
    happening=events,
    phase=st.sampled_from(["monitoring", "monitoring", "monitoring", "connecting", "failed", "lost", "idle"]),
    published=st.sampled_from([frozenset(), frozenset(values)]),
    limits=limits_of_any_kind,
)
def test_what_is_passed_over_is_no_fault(
    happening: list[Any], phase: str, published: frozenset[str], limits: Any
) -> None:
    for snapshot in snapshots(happening, phase, published):
        for one in QUICK:
            own = getattr(limits, one.limits_group, None) or one.limits()
            assert one.is_harmless is not None
            if not one.is_harmless(snapshot, own):
                continue
            try:
                verdict = one.find(snapshot, own, False).verdict
            except NotFresh:
                continue
            assert verdict is not Verdict.FAULT, one.id


@pytest.mark.parametrize("one", QUICK, ids=lambda one: one.id)
def test_the_quick_look_spares_the_work_on_a_healthy_car(one: AnyCheck) -> None:
    drive = Drive().open().to(12.0)
    assert one.is_harmless is not None
    own = getattr(drive.monitor.limits, one.limits_group, None) or one.limits()
    assert one.is_harmless(drive.state.snapshot(12.0), own)


@settings(max_examples=30)
@given(happening=events, published=st.sampled_from([frozenset(REAL_HZ), frozenset(values)]))
def test_a_monitor_that_asks_everything_raises_the_same(happening: list[Any], published: frozenset[str]) -> None:
    def run(monitor: Monitor) -> list[Any]:
        drive = Drive(hz={name: REAL_HZ[name] for name in ("speed", "brake", "position", "distance")}, monitor=monitor)
        drive.phase("monitoring", published=published)
        for later_s, (name, value) in happening:
            drive.to(drive.now_s + abs(later_s))
            drive.say(name, value)
            if name in VALUES:
                drive.values[name] = value
        drive.to(drive.now_s + 4.0)
        return drive.happened

    assert run(Monitor()) == run(Monitor([replace(one, is_harmless=None) for one in CHECKS]))


def test_findings_are_made_when_they_are_read() -> None:
    script = Script()
    monitor = Monitor([check("a", script, is_harmless=lambda snapshot, limits: True)])
    monitor.step(at(0.0))
    assert script.asked == 0
    assert monitor.findings["a"] is OK
    assert [tile.verdict for tile in monitor.tiles()] == [Verdict.OK]
    assert script.asked == 1  # and once is enough


def test_a_message_that_cannot_matter_asks_nobody() -> None:
    script = Script()
    monitor = Monitor([check("a", script, needs=frozenset({"speed"}), is_harmless=lambda snapshot, limits: True)])
    monitor.step(at(0.0), ("speed",))
    assert script.asked == 0


def test_an_alarm_that_stirs_is_always_asked() -> None:
    harmless: list[bool] = [False]
    script = Script(Finding(verdict=Verdict.FAULT, text="bad", brief="FAULT"))
    monitor = Monitor([check("a", script, is_harmless=lambda snapshot, limits: harmless[0])])
    monitor.step(at(0.0))
    harmless[0], script.finding = True, OK
    (cleared,) = monitor.step(at(0.1)) + monitor.step(at(0.2))
    assert (cleared.change, script.asked) == ("cleared", 3)
    monitor.step(at(0.3))
    assert script.asked == 4  # gone, but nobody has seen it yet
    monitor.acknowledge("a", 1, "Ann", 0.4)
    monitor.step(at(0.5))
    assert script.asked == 4


def test_a_check_that_fails_is_found_out_within_a_second() -> None:
    monitor = Monitor([check("a", Script(ZeroDivisionError()), is_harmless=lambda snapshot, limits: True)])
    for tick in range(ASKED_EVERY):
        monitor.step(at(tick / 10))
    assert monitor.alarms[IMPAIRED].active


def test_a_quick_look_that_fails_leaves_it_to_the_check() -> None:
    def fails(snapshot: Snapshot, limits: Limits) -> bool:
        raise ZeroDivisionError

    script = Script(Finding(verdict=Verdict.FAULT, text="bad", brief="FAULT"))
    monitor = Monitor([check("a", script, is_harmless=fails)])
    assert [t.change for t in monitor.step(at(0.0))] == ["raised"]


def test_nothing_is_passed_over_without_a_link_or_while_paused() -> None:
    monitor = Monitor([check("a", Script(), is_harmless=lambda snapshot, limits: True)])
    briefs = []
    for snapshot in (at(0.0, "lost"), at(0.1, paused=True), at(0.2)):
        monitor.step(snapshot)
        briefs.append(monitor.findings["a"].brief)
    assert briefs == ["not checked: no link", "not checked: paused", "OK"]
    assert all(first != second for first, second in pairwise(briefs))


@settings(max_examples=60)
@given(happening=events)
def test_the_state_itself_can_be_looked_at(happening: list[Any]) -> None:
    """What comes of a message is first looked at without a snapshot, and must look the same."""
    state = State()
    state.link(LinkFacts(phase="monitoring", connected_s=0.0))
    now_s = 10.0
    for later_s, (name, value) in happening:
        now_s += max(0.0, later_s)
        state.receive(name, value, now_s)
        snapshot = state.snapshot(now_s)
        for one in QUICK:
            if one.needs and one.id not in NEEDS_A_SNAPSHOT:
                assert one.is_harmless is not None
                limits = one.limits()
                assert one.is_harmless(state, limits) == one.is_harmless(snapshot, limits), one.id
