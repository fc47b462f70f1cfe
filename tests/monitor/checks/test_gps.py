"""GPS: fix, quality, drift at standstill and jump; made-up walks, real drives and a real fault."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from monitor.catalog import CHECKS
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts
from monitor.state import State
from monitor.values import GpsFix, Twist
from tests.monitor.checks.known import LINK, ask, check_of, known
from tests.monitor.recorded import drive_fixes, drive_speeds, rows

HERE = (32.2319, -110.9501)
DATELINE = (10.0, 179.99999)
POLAR = (84.0, 20.0)
POLES = {"close by the north pole": (89.999, 179.9), "close by the south pole": (-89.999, -60.0)}  # 111 m from it
GPS = ("gps_fix", "gps_quality", "gps_drift", "gps_jump")


def moved(place: tuple[float, float], east_m: float, north_m: float, sigma_m: float | None = None) -> GpsFix:
    lat = place[0] + math.degrees(north_m / 6_371_000)
    lon = place[1] + math.degrees(east_m / 6_371_000 / math.cos(math.radians(place[0])))
    return GpsFix(lat_deg=lat, lon_deg=math.remainder(lon, 360.0), covariance_type=2, sigma_m=sigma_m)


class Walk:
    """A car at 20 Hz and its receiver at 10 Hz."""

    def __init__(self, place: tuple[float, float] = HERE, sigma_m: float | None = None) -> None:
        self.state, self.now_s, self.east_m = State(), 0.0, 0.0
        self.place, self.sigma_m = place, sigma_m
        self.state.link(LinkFacts(phase="monitoring", connected_s=0.0))

    def go(
        self, seconds: float, *, speed_mps: float = 0.0, gps_mps: float | None = None, bunched: bool = False
    ) -> Walk:
        """The wheels at one speed, the position at the same or at another."""
        for step in range(round(seconds * 20)):
            self.now_s += 0.05
            self.state.receive("speed", Twist(speed_mps=speed_mps, yaw_rate_radps=None), self.now_s)
            self.east_m += 0.05 * (speed_mps if gps_mps is None else gps_mps)
            if step % 2:
                arrival_s = math.ceil(self.now_s) if bunched else self.now_s
                fix = moved(self.place, self.east_m, 0.0, self.sigma_m)
                self.state.receive("position", fix, arrival_s if bunched else self.now_s, 1e9 + self.now_s)
        return self

    def ask(self, id: str, *, was_active: bool = False) -> str:
        return str(ask(id, self.state.snapshot(self.now_s), was_active=was_active).verdict)


@pytest.mark.parametrize(
    "place", [HERE, DATELINE, POLAR, *POLES.values()], ids=["Tucson", "180° meridian", "far north", *POLES]
)
def test_drift_and_jump_anywhere_on_earth(place: tuple[float, float]) -> None:
    walk = Walk(place).go(6.0)
    assert (walk.ask("gps_drift"), walk.ask("gps_jump")) == ("ok", "ok")
    walk.go(5.0, gps_mps=2.3)
    assert (walk.ask("gps_drift"), walk.ask("gps_jump")) == ("fault", "ok")
    walk.go(0.5, gps_mps=23.0)
    assert walk.ask("gps_jump") == "fault"


@pytest.mark.parametrize("lat_deg", [90.0, -90.0])
def test_at_the_pole_itself_a_longitude_is_no_way_made(lat_deg: float) -> None:
    """Every longitude is the same place there."""
    walk = Walk((lat_deg, 0.0), sigma_m=0.2).go(6.0)
    for n in range(20):
        walk.now_s += 0.1
        walk.state.receive("speed", Twist(speed_mps=0.0), walk.now_s)
        fix = GpsFix(lat_deg=lat_deg, lon_deg=math.remainder(17.0 * n, 360.0), covariance_type=2, sigma_m=0.2)
        walk.state.receive("position", fix, walk.now_s, 1e9 + walk.now_s)
    assert (walk.ask("gps_drift"), walk.ask("gps_jump")) == ("ok", "ok")


@pytest.mark.parametrize(
    ("sigma_m", "drift_m", "verdict"),
    [
        (None, 10.0, "ok"),
        (None, 11.5, "fault"),
        (0.2, 1.8, "ok"),
        (0.2, 2.6, "fault"),
        (2.0, 8.0, "ok"),
        (2.0, 9.5, "fault"),
    ],
)
def test_the_drift_that_is_allowed_follows_from_the_receivers_error(
    sigma_m: float | None, drift_m: float, verdict: str
) -> None:
    walk = Walk(sigma_m=sigma_m).go(6.0)
    walk.go(drift_m, gps_mps=1.0).go(1.0)
    assert walk.ask("gps_drift") == verdict


def test_drift_is_not_checked_while_moving_and_the_anchor_is_taken_anew() -> None:
    walk = Walk(sigma_m=0.2).go(6.0).go(10.0, speed_mps=3.0)
    assert walk.ask("gps_drift") == "unknown"
    assert walk.ask("gps_drift", was_active=True) == "ok"
    assert walk.ask("gps_jump") == "ok"
    walk.go(3.0)
    assert walk.ask("gps_drift") == "unknown"
    walk.go(4.0)
    assert walk.ask("gps_drift") == "ok"


def test_a_car_that_has_only_just_stopped_is_not_reported_as_moving() -> None:
    walk = Walk(sigma_m=0.2).go(5.0, speed_mps=3.0).go(1.0)
    assert ask("gps_drift", walk.state.snapshot(walk.now_s)).text == "The car has just stopped"
    walk.go(1.0, speed_mps=3.0)
    assert ask("gps_drift", walk.state.snapshot(walk.now_s)).text == "The car moves"


@pytest.mark.parametrize(("gps_mps", "verdict"), [(2.9, "ok"), (3.1, "fault"), (23.0, "fault")])
def test_jump_margin_at_rest(gps_mps: float, verdict: str) -> None:
    assert Walk().go(6.0).go(1.0, gps_mps=gps_mps).ask("gps_jump") == verdict


def test_fixes_that_arrive_in_bunches_do_not_jump() -> None:
    assert Walk().go(6.0, speed_mps=10.0, bunched=True).ask("gps_jump") == "ok"


def test_one_stray_fix_is_no_fault() -> None:
    walk = Walk(sigma_m=0.2).go(6.0)
    walk.state.receive("position", moved(HERE, walk.east_m + 40, 0.0, 0.2), walk.now_s + 0.1, 1e9 + walk.now_s + 0.1)
    walk.now_s += 0.1
    assert (walk.ask("gps_drift"), walk.ask("gps_jump")) == ("ok", "ok")
    assert walk.go(1.0).ask("gps_drift") == "ok"


@pytest.mark.parametrize("id", GPS)
def test_not_published_and_silent(id: str) -> None:
    assert not ask(id, known()).applies
    assert ask(id, known(link=replace(LINK, published=frozenset({"position"})))).applies
    assert ask(id, known(age_s=2.0, position=moved(HERE, 0, 0, 1.0))).verdict == "unknown"


@pytest.mark.parametrize(("status", "brief"), [(-1, "FAULT: no fix"), (-2, "FAULT: fix unset"), (-3, "FAULT: no fix")])
def test_without_a_fix_nothing_else_is_judged(status: int, brief: str) -> None:
    """−2 is "status is not yet set" of ROS 2's NavSatStatus: it does not mean that there is no fix."""
    fix = GpsFix(lat_deg=math.nan, lon_deg=math.nan, status=status)
    snapshot = known(position=fix, speed=Twist(speed_mps=0.0, yaw_rate_radps=None))
    found = ask("gps_fix", snapshot)
    assert (found.verdict, found.brief) == ("fault", brief)
    assert ask("gps_drift", snapshot).verdict == "unknown"
    assert ask("gps_jump", snapshot).verdict == "unknown"


@pytest.mark.parametrize("kind", [0, 1, 2, 3])
def test_quality_of_every_covariance_type(kind: int) -> None:
    """Unknown quality is not checked, is reported, and is a fault in the strict mode."""
    without_quality = known(position=replace(moved(HERE, 0, 0), covariance_type=kind))
    assert ask("gps_fix", without_quality).verdict == "ok"
    assert ask("gps_quality", without_quality).verdict == "unknown"
    assert ask("gps_quality", without_quality, strict=1.0).verdict == "fault"
    with_quality = known(position=replace(moved(HERE, 0, 0, 1.5), covariance_type=kind))
    assert ask("gps_quality", with_quality, strict=1.0).verdict == "ok"


@pytest.mark.parametrize(
    ("sigma_m", "was_active", "verdict"), [(10.0, False, "ok"), (10.1, False, "fault"), (9.5, True, "fault")]
)
def test_a_poor_fix(sigma_m: float, was_active: bool, verdict: str) -> None:
    assert ask("gps_fix", known(position=moved(HERE, 0, 0, sigma_m)), was_active=was_active).verdict == verdict


def test_the_real_fault_of_2016_07_28_is_a_jump_within_half_a_second(recordings: Path) -> None:
    """GPS runs at 23 m/s while the wheels stand; status 0 and covariance zeros, as the real driver sent them."""
    table = rows(recordings / "catvehicle_2016-07-28_excerpt" / "gps_fix.head_tail.csv")
    monitor = Monitor([check for check in CHECKS if check.id in GPS])
    state = State()
    state.link(LinkFacts(phase="monitoring", connected_s=0.0))
    start_s, raised_s = None, None
    for row in table[: len(table) // 2]:
        stamp_s = int(row["header.stamp.secs"]) + int(row["header.stamp.nsecs"]) * 1e-9
        start_s = start_s if start_s is not None else stamp_s
        at_s = stamp_s - start_s + 1.0
        state.receive("speed", Twist(speed_mps=0.0, yaw_rate_radps=None), at_s - 0.01)
        fix = GpsFix(lat_deg=float(row["latitude"]), lon_deg=float(row["longitude"]), covariance_type=2)
        state.receive("position", fix, at_s, stamp_s)
        for transition in monitor.step(state.snapshot(at_s)):
            if transition.alarm_id == "gps_jump" and transition.change == "raised":
                raised_s = at_s - 1.0
    assert raised_s is not None
    assert raised_s <= 0.5


def test_the_healthy_drive_raises_no_gps_alarm(recordings: Path) -> None:
    monitor = Monitor([check for check in CHECKS if check.id in GPS])
    state = State()
    received = [(at_s, "speed", Twist(speed_mps=v, yaw_rate_radps=None)) for at_s, v in drive_speeds(recordings)]
    received += [(at_s, "position", fix) for at_s, fix in drive_fixes(recordings)]
    received.sort(key=lambda row: row[0])
    start_s = received[0][0]
    state.link(LinkFacts(phase="monitoring", connected_s=0.0))
    for at_s, signal, value in received:
        now_s = at_s - start_s + 1.0
        state.receive(signal, value, now_s, at_s)
        assert monitor.step(state.snapshot(now_s), {signal}) == ()


def test_the_reports_cases_15_and_16_get_their_dialog() -> None:
    for id in ("gps_drift", "gps_jump"):
        assert check_of(id).alarm.place == "dialog"
