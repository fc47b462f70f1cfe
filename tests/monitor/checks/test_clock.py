"""The car's clock: jumps that are reported for a while; offsets of a running clock; old stamps without a fault."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.car_clock import ClockJump
from monitor.check import Finding, Verdict
from monitor.freeze_detection import Repeats
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts
from monitor.state import Reading, Snapshot, State
from monitor.values import GpsFix
from tests.monitor.checks.known import LINK, ask

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN
NOW_S = 100.0
WALL_ZERO_S = 1_790_000_000.0
YEAR_S = 365.25 * 86_400
HERE = GpsFix(lat_deg=32.0, lon_deg=-110.0)


def stamped(offset_s: float = 0.0, change_s: float | None = 0.0, *, age_s: float = 0.0, **more: Any) -> Reading[GpsFix]:
    """A message whose stamp differs so much from the time of day at its arrival, and so much from what is usual."""
    received_s = NOW_S - age_s
    stamp_s = None if change_s is None else WALL_ZERO_S + received_s + offset_s
    return Reading(
        value=HERE, received_s=received_s, horizon_s=1.0, count=9, stamp_s=stamp_s, stamp_change_s=change_s, **more
    )


def at(*readings: Reading[GpsFix], wall: bool = True, jump: ClockJump | None = None) -> Snapshot:
    link = replace(LINK, wall_zero_s=WALL_ZERO_S) if wall else LINK
    named = dict(zip(("position", "scan", "odometry"), readings, strict=False))
    return Snapshot(now_s=NOW_S, readings=named, link=link, clock_jump=jump)


def jumped(by_s: float, ago_s: float, **limits: float) -> Finding:
    jump = ClockJump(at_s=NOW_S - ago_s, by_s=by_s, signals=("scan", "position"))
    return ask("clock_jump", at(stamped(), jump=jump), **limits)


@pytest.mark.parametrize(
    ("by_s", "ago_s", "verdict"),
    [
        pytest.param(-30.0, 0.0, FAULT, id="back, now"),
        pytest.param(30.0, 0.0, FAULT, id="ahead, now"),
        pytest.param(-30.0, 10.0, FAULT, id="ten seconds ago"),
        pytest.param(-30.0, 10.1, OK, id="over"),
        pytest.param(-1.0, 0.0, OK, id="at the limit"),
        pytest.param(-1.01, 0.0, FAULT, id="just above"),
        pytest.param(1e9, 0.0, FAULT, id="years ahead"),
        pytest.param(-30.0, -5.0, FAULT, id="our own clock went back meanwhile"),
    ],
)
def test_a_jump_is_reported_for_ten_seconds(by_s: float, ago_s: float, verdict: Verdict) -> None:
    assert jumped(by_s, ago_s).verdict is verdict


def test_how_far_is_a_setting() -> None:
    assert jumped(-5.0, 0.0, jump_s=6.0).verdict is OK
    assert jumped(-5.0, 0.0, jump_s=4.0).verdict is FAULT


def test_what_the_operator_reads_of_a_jump() -> None:
    assert jumped(-30.0, 0.0).text == "The car's clock jumped back by 30.0 s (Laser, Position)"
    assert jumped(7200.0, 0.0).text == "The car's clock jumped ahead by 2 h (Laser, Position)"
    assert jumped(-30.0, 0.0).causes == jumped(7200.0, 0.0).causes, "a second jump within the time is the same alarm"


def test_without_a_jump_and_without_stamps() -> None:
    assert ask("clock_jump", at(stamped())).verdict is OK
    found = ask("clock_jump", at(stamped(change_s=None)))
    assert (found.verdict, found.applies) == (UNKNOWN, False)


@pytest.mark.parametrize(
    ("readings", "was_active", "verdict"),
    [
        pytest.param([stamped(0.02)], False, OK, id="in time"),
        pytest.param([stamped(5.0)], False, OK, id="at the limit"),
        pytest.param([stamped(5.1)], False, FAULT, id="ahead"),
        pytest.param([stamped(-5.1)], False, FAULT, id="behind"),
        pytest.param([stamped(-4.5)], True, FAULT, id="not yet cleared"),
        pytest.param([stamped(-3.9)], True, OK, id="cleared"),
        pytest.param([stamped(-86_400.0)], False, FAULT, id="a day"),
        pytest.param([stamped(-86_401.0)], False, UNKNOWN, id="more than a day"),
        pytest.param([stamped(-10 * YEAR_S)], False, UNKNOWN, id="a recording, ten years old"),
        pytest.param([stamped(-WALL_ZERO_S)], False, UNKNOWN, id="time of a simulation, or never set"),
        pytest.param([stamped(30 * YEAR_S)], False, UNKNOWN, id="a clock set to nonsense"),
        pytest.param([stamped(-60.0), stamped(0.1)], False, OK, id="one driver's own odd stamps"),
        pytest.param([stamped(0.0, -2.0)], False, OK, id="late, at the limit"),
        pytest.param([stamped(0.0, -2.1)], False, FAULT, id="late"),
        pytest.param([stamped(0.0, 2.1)], False, FAULT, id="running ahead"),
        pytest.param([stamped(0.0, -1.7)], True, FAULT, id="late, not yet cleared"),
        pytest.param([stamped(0.0, -1.5)], True, OK, id="late no more"),
        pytest.param([stamped(0.0, -9.0), stamped(0.0, -0.1)], False, OK, id="one slow sensor"),
        pytest.param([stamped(0.0, -9.0), stamped(0.0, -3.0)], False, FAULT, id="both late"),
        pytest.param([stamped(-10 * YEAR_S, -9.0)], False, UNKNOWN, id="a recording at another pace"),
        pytest.param([stamped(0.0, -9.0, age_s=2.0)], False, UNKNOWN, id="stale"),
        pytest.param([stamped(0.0, -9.0, age_s=2.0), stamped()], False, OK, id="one stale, one fresh"),
        pytest.param([stamped(0.0, -9.0, repeats=Repeats(stamp_n=3, stamp_s=9.0))], False, UNKNOWN, id="stuck stamp"),
        pytest.param([stamped(change_s=None)], False, UNKNOWN, id="no stamp"),
        pytest.param([], False, UNKNOWN, id="nothing received"),
    ],
)
def test_offset(readings: list[Reading[GpsFix]], was_active: bool, verdict: Verdict) -> None:
    assert ask("clock_offset", at(*readings), was_active=was_active).verdict is verdict


@pytest.mark.parametrize(("change_s", "verdict"), [(0.0, OK), (-2.1, FAULT)])
def test_without_the_time_of_day_only_changes_are_judged(change_s: float, verdict: Verdict) -> None:
    found = ask("clock_offset", at(stamped(-60.0, change_s), wall=False))
    assert found.verdict is verdict
    if verdict is OK:
        assert "time of day is unknown" in found.text


def test_what_the_operator_reads_of_an_offset() -> None:
    assert ask("clock_offset", at(stamped(-40.0))).text == "Car's clock 40.0 s behind this server"
    assert ask("clock_offset", at(stamped(600.0))).text == "Car's clock 10 min ahead of this server"
    assert ask("clock_offset", at(stamped(0.0, -3.2))).text == "Messages come 3.2 s late, or the car's clock runs slow"
    old = ask("clock_offset", at(stamped(-10.4 * YEAR_S)))
    assert old.text.startswith("The stamps are 10 years behind this server: a recording")
    assert old.brief == "not checked: another"


def announced(offset_s: Any, seconds: int = 60) -> list[tuple[float, str]]:
    """A receiver at 10 Hz whose clock differs by a function of time, before the whole judge."""
    monitor, state, announced = Monitor(), State(), []
    link = LinkFacts(phase="monitoring", connected_s=0.0, wall_zero_s=WALL_ZERO_S, published=frozenset({"position"}))
    for n in range(10 * seconds):
        now_s = n / 10
        state.link(link)
        fix = GpsFix(lat_deg=32.0 + 1e-7 * (n % 3), lon_deg=-110.0)
        state.receive("position", fix, now_s, WALL_ZERO_S + now_s + offset_s(now_s))
        announced += [(t.at_s, t.alarm_id) for t in monitor.step(state.snapshot(now_s)) if t.announces]
    return announced


def test_stories() -> None:
    assert announced(lambda _: 0.0) == []
    assert announced(lambda _: -5 * YEAR_S) == []
    assert announced(lambda _: -WALL_ZERO_S) == []
    assert announced(lambda s: -5 * YEAR_S - (30.0 if s >= 30 else 0.0)) == [(30.2, "clock_jump")]
    # set back for good: the jump, and once it has been reported for its time, that the clock is wrong
    assert announced(lambda s: -30.0 if s >= 20 else 0.0) == [
        (20.2, "clock_jump"),
        (pytest.approx(32.2, abs=0.15), "clock_offset"),
    ]
    assert announced(lambda s: -30.0 if 20 <= s < 25 else 0.0) == [(20.2, "clock_jump")]
    assert announced(lambda _: -37.0) == [(pytest.approx(2.0, abs=0.15), "clock_offset")]
    assert announced(lambda s: -0.1 * s) == [(pytest.approx(22.2, abs=0.3), "clock_offset")]
