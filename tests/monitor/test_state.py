"""What is known of a vehicle: readings and their age, what is derived, and the snapshot that nothing changes."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from monitor.signals import SIGNALS
from monitor.state import LinkFacts, NotFresh, Reading, Snapshot, State
from monitor.values import (
    Acceleration,
    Distance,
    Effort,
    GpsFix,
    Heading,
    MotionCommand,
    Odometry,
    Twist,
    Value,
)
from tests.monitor.drive import VALUES, sweep
from tests.monitor.recorded import drive_fixes, drive_speeds


def reading(received_s: float, period_s: float | None = 0.05, horizon_s: float = 1.0) -> Reading[Twist]:
    return Reading(value=Twist(speed_mps=1.0), received_s=received_s, horizon_s=horizon_s, period_s=period_s)


@pytest.mark.parametrize(
    ("age_s", "period_s", "freshness"),
    [
        pytest.param(0.0, 0.05, "fresh", id="new"),
        pytest.param(0.39, 0.05, "fresh", id="three periods of a fast signal are one hiccup"),
        pytest.param(0.41, 0.05, "ageing", id="ageing"),
        pytest.param(0.59, 0.2, "fresh", id="three periods"),
        pytest.param(0.61, 0.2, "ageing", id="more than three periods"),
        pytest.param(1.0, 0.05, "ageing", id="at the horizon"),
        pytest.param(1.01, 0.05, "stale", id="beyond the horizon"),
        pytest.param(0.9, None, "fresh", id="no period known"),
        pytest.param(-0.3, 0.05, "fresh", id="from a moment ahead"),
        pytest.param(-1.01, 0.05, "stale", id="from far ahead: the clock went back"),
        pytest.param(math.nan, 0.05, "stale", id="no time at all"),
    ],
)
def test_freshness(age_s: float, period_s: float | None, freshness: str) -> None:
    assert reading(100.0, period_s).freshness(100.0 + age_s) == freshness


def test_age_is_never_negative() -> None:
    assert reading(100.0).age_s(99.0) == 0.0


def test_what_was_received_is_known() -> None:
    state = State()
    assert state.receive("brake", Effort(percent=3.0), 10.0, stamp_s=1.4e9) == ("brake",)
    state.receive("brake", Effort(percent=4.0), 10.05)
    snapshot = state.snapshot(10.06)
    assert snapshot.need("brake").percent == 4.0
    known = snapshot.get("brake")
    assert known is not None
    assert (known.count, known.received_s, known.stamp_s) == (2, 10.05, None)
    assert snapshot.heard_s == 10.05


def test_need_reports_why_there_is_nothing() -> None:
    state = State()
    with pytest.raises(NotFresh, match="Speed is not published") as missing:
        state.snapshot(0.0).need("speed")
    assert missing.value.short == "no data"
    state.link(LinkFacts(phase="monitoring", published=frozenset({"speed"})))
    with pytest.raises(NotFresh, match="Speed: nothing received yet"):
        state.snapshot(0.0).need("speed")
    state.receive("speed", Twist(speed_mps=1.0), 1.0)
    assert state.snapshot(3.0).need("speed").speed_mps == 1.0
    with pytest.raises(NotFresh, match=r"Speed is 2\.1 s old") as old:
        state.snapshot(3.1).need("speed")
    assert old.value.short == "stale"


def test_a_snapshot_never_changes() -> None:
    state = State()
    state.receive("speed", Twist(speed_mps=1.0), 1.0)
    before = state.snapshot(1.0)
    state.receive("speed", Twist(speed_mps=9.0), 1.1)
    state.receive("brake", Effort(percent=1.0), 1.1)
    state.set_paused(True)
    assert before.need("speed").speed_mps == 1.0
    assert set(before.readings) == {"speed"}
    assert before.extents["speed"].highest == 1.0
    assert not before.paused
    with pytest.raises(TypeError):
        before.readings["speed"] = reading(0.0)  # type: ignore[index]


@pytest.mark.parametrize("signal", [name for name in SIGNALS if name in VALUES])
def test_every_signal_can_be_received_and_read_back(signal: str) -> None:
    state = State()
    assert signal in state.receive(signal, VALUES[signal], 1.0)
    found = state.snapshot(1.0).need(signal)
    assert found is VALUES[signal] or found == VALUES[signal]  # diagnostics are merged anew


@pytest.mark.parametrize(
    ("signal", "values", "lowest", "highest"),
    [
        ("speed", [Twist(speed_mps=v) for v in (2.0, -1.0, 4.23)], -1.0, 4.23),
        ("distance", [Distance(distance_m=v) for v in (9.0, None, 4.1)], 4.1, 9.0),
        ("scan", [sweep((5.0, 2.0)), sweep((7.0, 8.0))], 2.0, 7.0),
        ("diagnostics", [VALUES["diagnostics"]], 0, 0),
        ("speed", [Twist(speed_mps=v) for v in (1.0, math.nan, math.inf)], 1.0, 1.0),
    ],
)
def test_lowest_and_highest(signal: str, values: list[Value], lowest: float, highest: float) -> None:
    state = State()
    for n, value in enumerate(values):
        state.receive(signal, value, 0.05 * n)
    extent = state.snapshot(1.0).extents[signal]
    assert (extent.lowest, extent.highest) == (pytest.approx(lowest), pytest.approx(highest))


def test_no_extent_where_nothing_was_ever_measured() -> None:
    state = State()
    state.receive("command", MotionCommand(speed_mps=None, tyre_angle_rad=None), 0.0)
    state.receive("position", GpsFix(lat_deg=0.0, lon_deg=0.0), 0.0)
    assert dict(state.snapshot(0.0).extents) == {}


def test_acceleration_follows_from_speed() -> None:
    state = State()
    for n in range(40):
        changed = state.receive("speed", Twist(speed_mps=2.0 * 0.05 * n), 0.05 * n)
    assert changed == ("speed", "acceleration")
    known = state.snapshot(2.0).get("acceleration")
    assert known is not None
    assert (known.value.acceleration_mps2, known.value.source) == (pytest.approx(2.0), "speed")
    assert (known.derived_from, known.count) == ("speed", 0)
    assert known.horizon_s == state.snapshot(2.0).readings["speed"].horizon_s


def test_stamps_of_the_car_are_better_than_the_times_of_arrival() -> None:
    state = State()
    for n in range(40):
        state.receive("speed", Twist(speed_mps=2.0 * 0.05 * n), n // 8 * 0.4, stamp_s=1.4e9 + 0.05 * n)
    assert state.snapshot(2.0).need("acceleration").acceleration_mps2 == pytest.approx(2.0, rel=1e-3)


def test_a_published_acceleration_wins() -> None:
    state = State()
    state.receive("acceleration", Acceleration(acceleration_mps2=0.7), 0.0)
    for n in range(40):
        assert state.receive("speed", Twist(speed_mps=0.1 * n), 0.05 * n) == ("speed",)
    assert state.snapshot(2.0).need("acceleration").source == "topic"


def north(seconds: float, speed_mps: float) -> GpsFix:
    return GpsFix(lat_deg=32.0 + speed_mps * seconds / 110_900, lon_deg=-110.0)


def test_heading_is_the_course_while_moving_and_ages_at_standstill() -> None:
    state = State()
    for n in range(100):
        state.receive("speed", Twist(speed_mps=3.0), 0.1 * n)
        changed = state.receive("position", north(0.1 * n, 3.0), 0.1 * n)
    assert changed == ("position", "heading")
    for n in range(100, 200):
        state.receive("speed", Twist(speed_mps=0.0), 0.1 * n)
        changed = state.receive("position", north(9.9, 3.0), 0.1 * n)
    assert changed == ("position",)
    known = state.snapshot(19.9).get("heading")
    assert known is not None
    assert (known.value.source, known.derived_from) == ("track", "position")
    assert abs(math.remainder(known.value.heading_deg, 360.0)) < 0.5
    assert known.age_s(19.9) == pytest.approx(8.0, abs=1.0)
    assert known.freshness(19.9) == "stale"


def test_a_published_heading_wins_over_the_course() -> None:
    state = State()
    state.receive("heading", Heading(heading_deg=200.0), 0.0)
    for n in range(100):
        assert state.receive("position", north(0.1 * n, 3.0), 0.1 * n) == ("position",)


def test_heading_from_odometry_that_is_fixed_to_the_earth() -> None:
    state = State()
    for n in range(3):
        pose = Odometry(x_m=505_759.0, y_m=3_564_595.0, yaw_rad=-0.01 * n, frame_id="/odom")
        changed = state.receive("odometry", pose, 0.1 * n)
    assert changed == ("odometry", "heading")
    heading = state.snapshot(0.2).need("heading")
    assert (heading.source, heading.heading_deg) == ("odometry", pytest.approx(90.0 + math.degrees(0.02)))


def test_the_real_drive(recordings: Path) -> None:
    """What the customer sees of it: 76 m, up to 4.23 m/s, eastward, after standing for half a minute."""
    events: list[tuple[float, str, Value]] = [
        *((at_s, "speed", Twist(speed_mps=speed_mps)) for at_s, speed_mps in drive_speeds(recordings)),
        *((at_s, "position", fix) for at_s, fix in drive_fixes(recordings)),
    ]
    events.sort(key=lambda event: event[0])
    start_s, state = events[0][0], State()
    standing, headings = [], []
    for at_s, signal, value in events:
        state.receive(signal, value, at_s - start_s)
        snapshot = state.snapshot(at_s - start_s)
        standing.append(snapshot.standing_since_s is not None)
        if snapshot.now_s > 38.0 and "heading" in snapshot.readings:
            headings.append(snapshot.readings["heading"].value.heading_deg)
    assert state.snapshot(56.0).track_m == pytest.approx(76.0, abs=1.0)
    assert state.snapshot(56.0).extents["speed"].highest == pytest.approx(4.228, abs=0.001)
    turns = [still for n, still in enumerate(standing) if not n or still != standing[n - 1]]
    assert turns == [False, True, False]  # it stood, then drove; at the end it had not stood for 2 s
    assert max(headings) - min(headings) < 10.0
    assert sum(headings) / len(headings) == pytest.approx(91.3, abs=1.5)
    acceleration = state.snapshot(56.0).extents["acceleration"]
    assert (acceleration.lowest, acceleration.highest) == (pytest.approx(-1.2, abs=0.3), pytest.approx(1.8, abs=0.3))


def test_rates_of_every_signal() -> None:
    state = State({"speed": 5.0})
    assert set(state.snapshot(0.0).rates) == set(SIGNALS)
    assert state.snapshot(0.0).rates["speed"].expected_hz == 5.0
    state.expect({"brake": 50.0})
    rates = state.snapshot(1.0).rates
    assert (rates["speed"].expected_hz, rates["brake"].expected_hz) == (20.0, 50.0)
    assert (rates["brake"].settled, rates["speed"].settled) == (True, False)


def test_a_link_that_opens_again_measures_anew_and_remembers_the_rate() -> None:
    state = State()
    state.link(LinkFacts(phase="monitoring", since_s=0.0, connected_s=0.0))
    for n in range(200):
        state.receive("speed", Twist(speed_mps=1.0), 0.1 * n)
    before = state.snapshot(20.0).rates["speed"]
    state.link(LinkFacts(phase="lost", since_s=20.0, connected_s=0.0))
    state.link(LinkFacts(phase="monitoring", since_s=20.5, connected_s=0.0))
    after = state.snapshot(20.6).rates["speed"]
    assert before.measured_hz == pytest.approx(10.0, rel=0.02)
    assert (after.measured_hz, after.expected_hz) == (None, before.expected_hz)


def test_reset_forgets_all_but_the_operators_rates() -> None:
    state = State({"speed": 5.0})
    state.link(LinkFacts(phase="monitoring"))
    state.set_paused(True)
    for n in range(200):
        state.receive("speed", Twist(speed_mps=3.0), 0.05 * n)
        state.receive("position", north(0.05 * n, 3.0), 0.05 * n)
    state.reset()
    empty = state.snapshot(0.0)
    assert empty == Snapshot(now_s=0.0, rates=empty.rates)
    assert empty.rates["speed"].expected_hz == 5.0


@pytest.mark.parametrize("back_s", [1.0, 3600.0, 1e9])
def test_when_the_clock_goes_back_what_is_known_keeps_its_age(back_s: float) -> None:
    state = State()
    state.receive("brake", Effort(percent=1.0), 1000.0)
    state.receive("speed", Twist(speed_mps=1.0), 1001.5)
    state.receive("speed", Twist(speed_mps=1.0), 1001.5 - back_s)
    snapshot = state.snapshot(1001.5 - back_s)
    assert snapshot.readings["brake"].age_s(snapshot.now_s) == pytest.approx(1.5)
    later = state.snapshot(1001.5 - back_s + 1.0)
    assert not later.readings["brake"].is_fresh(later.now_s)
    assert later.heard_s == pytest.approx(1001.5 - back_s)


def test_a_message_that_waited_a_moment_moves_nothing() -> None:
    state = State()
    state.receive("brake", Effort(percent=1.0), 10.0)
    state.snapshot(10.2)
    state.receive("speed", Twist(speed_mps=1.0), 10.1)
    assert state.snapshot(10.2).readings["brake"].received_s == 10.0


def test_a_clock_that_goes_back_is_seen_by_the_next_snapshot() -> None:
    state = State()
    state.receive("speed", Twist(speed_mps=1.0), 100.0)
    state.snapshot(100.4)
    after = state.snapshot(50.0).get("speed")
    assert after is not None
    assert after.age_s(50.0) == pytest.approx(0.4)
