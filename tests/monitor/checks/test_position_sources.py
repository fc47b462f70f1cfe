"""Sources of the position: a receiver that loses its fix behind a filter, and positions that are apart."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor.catalog import CHECKS
from monitor.check import Finding
from monitor.compared import Compared, Other
from monitor.reading import Reading
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts
from monitor.snapshot import Snapshot
from monitor.state import State
from monitor.values import GpsFix, Twist
from tests.monitor.checks.known import LINK, Row, ask, known
from tests.monitor.checks.test_gps import HERE, moved

RECEIVER, APART = "position_receiver", "position_sources"
CARRIERS = {"position": "/gps/filtered", "speed": "/vel"}
LOST = GpsFix(lat_deg=math.nan, lon_deg=math.nan, status=-1)


def facts(**carriers: str) -> LinkFacts:
    return replace(LINK, carriers=CARRIERS | carriers)


def beside(
    *fixes: tuple[str, GpsFix], age_s: float = 0.0, count: int = 9, speed_mps: float = 0.0, **carriers: str
) -> Snapshot:
    """A car at HERE, by a receiver of 0.3 m; and what else gives a position."""
    snapshot = known(position=moved(HERE, 0.0, 0.0, 0.3), speed=Twist(speed_mps=speed_mps), link=facts(**carriers))
    others = tuple(
        Other(
            topic=topic,
            reading=Reading(value=fix, received_s=snapshot.now_s - age_s, horizon_s=1.0, period_s=0.2, count=count),
        )
        for topic, fix in fixes
    )
    return replace(snapshot, compared=Compared(others={"position": others}))


FIX = ("/gps/fix", moved(HERE, 1.0, 0.0, 0.3))
ANSWERS = {
    RECEIVER: Row(
        ok=beside(FIX), fault=beside(("/gps/fix", LOST)), unknown=beside(("/gps/fix", replace(LOST, status=-2)))
    ),
    APART: Row(
        ok=beside(FIX), fault=beside(("/gps/fix", moved(HERE, 30.0, 0.0, 0.3))), unknown=beside(("/gps/fix", LOST))
    ),
}


def test_the_sentences() -> None:
    lost = ask(RECEIVER, beside(("/gps/fix", LOST)))
    assert lost.text == "No fix at /gps/fix; the position of /gps/filtered continues without it"
    silent = ask(RECEIVER, beside(FIX, age_s=12.0))
    assert silent.text == "Nothing from /gps/fix for 12 s; the position of /gps/filtered continues without it"
    both = ask(RECEIVER, beside(("/a/fix", LOST), ("/b/fix", LOST)))
    assert both.text == "No fix at /a/fix; No fix at /b/fix; the position of /gps/filtered continues without it"
    assert both.causes == ("/a/fix", "/b/fix")
    apart = ask(APART, beside(("/gps/fix", moved(HERE, 30.0, 0.0, 0.3))))
    assert apart.text == "The position is 30.1 m from that of /gps/fix; up to 5.5 m is normal"
    assert apart.brief == "FAULT 30 m"


@pytest.mark.parametrize(
    ("snapshot", "verdict"),
    [
        (beside(FIX, age_s=4.0), "ok"),  # not silent for long
        (beside(FIX, age_s=12.0, count=2), "ok"),  # it never was a source
        (beside(FIX, age_s=12.0, position="/gps/fix_2"), "fault"),
        (beside(("/gps/filtered", FIX[1]), age_s=12.0, position="/gps/fix"), "ok"),  # a filter that died
        (beside(("/gps/filtered", LOST), position="/gps/fix"), "ok"),
        (beside(("/gps/fix", replace(LOST, is_unset=True))), "fault"),
    ],
)
def test_receiver(snapshot: Snapshot, verdict: str) -> None:
    assert ask(RECEIVER, snapshot).verdict == verdict


@pytest.mark.parametrize(
    ("east_m", "sigma_m", "speed_mps", "verdict"),
    [
        (5.4, 0.3, 0.0, "ok"),  # gate_m of 0.3 and 0.3 m with 2 m between the antennas
        (5.6, 0.3, 0.0, "fault"),
        (30.0, 8.0, 0.0, "ok"),
        (31.0, 8.0, 0.0, "fault"),
        (10.0, None, 0.0, "ok"),
        (12.0, None, 0.0, "fault"),
        (15.0, 0.3, 20.0, "ok"),  # one may be half a second later
        (16.0, 0.3, 20.0, "fault"),
        (15.0, 0.3, -20.0, "ok"),
    ],
)
def test_apart(east_m: float, sigma_m: float | None, speed_mps: float, verdict: str) -> None:
    snapshot = beside(("/gps/fix", moved(HERE, east_m, 0.0, sigma_m)), speed_mps=speed_mps)
    assert ask(APART, snapshot).verdict == verdict


def test_limit_and_deadband() -> None:
    near = beside(("/gps/fix", moved(HERE, 5.0, 0.0, 0.3)))
    assert ask(APART, near).verdict == "ok"
    assert ask(APART, near, was_active=True).verdict == "fault"
    assert ask(APART, beside(("/gps/fix", moved(HERE, 30.0, 0.0, 0.3))), least_m=40.0).verdict == "ok"


@pytest.mark.parametrize("id", [RECEIVER, APART])
def test_not_checked(id: str) -> None:
    assert ask(id, known()).text == "Position is not published"
    alone: Finding = ask(id, beside())
    assert (alone.brief, alone.applies) == ("one source", False)
    assert ask(id, beside(), was_active=True).verdict == "unknown"  # as after a lost link: the alarm stands
    itself = beside(("/gps/filtered", LOST))  # the carrier, as it was while another carried the position
    assert ask(id, itself).brief == "one source"
    none = beside(FIX)
    none = replace(none, readings={"position": replace(none.readings["position"], value=LOST)})
    assert ask(id, none).brief == "not checked: no fix"
    assert ask(id, replace(beside(FIX), now_s=200.0)).brief == "not checked: stale"


def test_without_a_speed_the_place_is_not_compared() -> None:
    snapshot = beside(FIX)
    unknown = replace(snapshot, readings={"position": snapshot.readings["position"]})
    assert ask(APART, unknown).brief == "not checked: no speed"


# -- drives -----------------------------------------------------------------------------------------------------------

JUDGED = {RECEIVER, APART, "gps_jump", "gps_drift", "gps_fix", "speed_sources"}


class Car:
    """Drives at 8 m/s: a filter at 10 Hz, which goes on whatever happens, and its receiver at 5 Hz."""

    def __init__(self) -> None:
        # Those that inhibit these, and what inhibits them.
        needed = JUDGED | {c for check in CHECKS if check.id in JUDGED for c in check.alarm.inhibited_by}
        names = needed | {c for check in CHECKS if check.id in needed for c in check.alarm.inhibited_by}
        names |= {c for check in CHECKS if check.id in names for c in check.alarm.inhibited_by}
        names |= {c for check in CHECKS if check.id in names for c in check.alarm.inhibited_by}
        self.monitor = Monitor([check for check in CHECKS if check.id in names])
        self.state, self.step, self.east_m = State(), 0, 0.0
        self.raised: list[tuple[str, str]] = []
        self.ended: list[str] = []

    def go(self, seconds: float, *, receiver: GpsFix | str | None = "fix", apart_m: float = 0.5) -> Car:
        for _ in range(round(seconds * 10)):
            self.step += 1
            now_s = 100.0 + self.step / 10
            self.east_m += 0.8
            self.state.link(replace(facts(), published=frozenset({"position", "speed"})))
            self.state.receive("speed", Twist(speed_mps=8.0 + 0.01 * math.sin(self.step)), now_s)
            self.state.receive("position", moved(HERE, self.east_m, 0.0, 0.3), now_s, 1e9 + now_s)
            if self.step % 2 and receiver is not None:
                fix = receiver if isinstance(receiver, GpsFix) else moved(HERE, self.east_m, apart_m, 0.3)
                self.state.receive_other("position", "/gps/fix", fix, now_s, 1e9 + now_s)
            for one in self.monitor.step(self.state.snapshot(now_s)):
                if one.announces:
                    self.raised.append((one.alarm_id, one.text))
                if one.change == "cleared":
                    self.ended.append(one.alarm_id)
        return self


def test_both_fine() -> None:
    car = Car().go(20.0)
    assert car.raised == []
    assert [str(car.monitor.findings[id].verdict) for id in (RECEIVER, APART)] == ["ok", "ok"]


def test_a_fix_lost_at_the_receiver_is_noticed_though_the_filter_goes_on() -> None:
    car = Car().go(10.0).go(2.5, receiver=LOST)
    assert car.raised == []
    car.go(1.5, receiver=LOST)
    assert car.raised == [(RECEIVER, "No fix at /gps/fix; the position of /gps/filtered continues without it")]
    car.go(6.0)
    assert car.ended == [RECEIVER]
    assert len(car.raised) == 1


def test_a_receiver_that_falls_silent_is_noticed() -> None:
    car = Car().go(10.0).go(14.0, receiver=None)
    assert [id for id, _ in car.raised] == [RECEIVER]
    assert "Nothing from /gps/fix for " in car.raised[0][1]


def test_a_receiver_without_a_fix_from_the_start_is_noticed() -> None:
    assert [id for id, _ in Car().go(5.0, receiver=LOST).raised] == [RECEIVER]


def test_positions_that_part_are_noticed() -> None:
    car = Car().go(10.0).go(8.0, apart_m=40.0)
    assert [id for id, _ in car.raised] == [APART]


@settings(max_examples=200, deadline=None)
@given(
    sigmas_m=st.tuples(st.floats(0.05, 10.0), st.floats(0.05, 10.0)),
    speed_mps=st.floats(-30.0, 30.0),
    late_s=st.floats(0.0, 0.5),
    seed=st.integers(0, 10_000),
)
def test_positions_that_agree_within_three_sigmas_are_no_fault(
    sigmas_m: tuple[float, float], speed_mps: float, late_s: float, seed: int
) -> None:
    noise = random.Random(seed)
    error_m = min(3.0, abs(noise.gauss(0.0, 1.0))) * math.hypot(*sigmas_m)
    angle = noise.uniform(0.0, 2.0 * math.pi)
    east_m, north_m = error_m * math.cos(angle) - speed_mps * late_s, error_m * math.sin(angle)
    snapshot = beside(("/gps/fix", moved(HERE, east_m, north_m, sigmas_m[1])), speed_mps=speed_mps)
    own = replace(snapshot.readings["position"], value=moved(HERE, 0.0, 0.0, sigmas_m[0]))
    assert ask(APART, replace(snapshot, readings={**snapshot.readings, "position": own})).verdict == "ok"


@settings(max_examples=200, deadline=None)
@given(
    sigma_m=st.floats(0.05, 10.0), speed_mps=st.floats(0.0, 30.0), beyond_m=st.floats(0.1, 1e4), angle=st.floats(0, 7)
)
def test_positions_beyond_the_limits_always_are(
    sigma_m: float, speed_mps: float, beyond_m: float, angle: float
) -> None:
    allowed_m = max(5.0, 3.7148 * math.sqrt(sigma_m**2 + 0.3**2 + 2.0)) + 0.5 * speed_mps
    distance_m = 1.01 * allowed_m + beyond_m  # `moved` is on a sphere
    fix = moved(HERE, distance_m * math.cos(angle), distance_m * math.sin(angle), sigma_m)
    assert ask(APART, beside(("/gps/fix", fix), speed_mps=speed_mps)).verdict == "fault"


def awaiting(*topics: str, seconds: float, fixes: tuple[tuple[str, GpsFix], ...] = (), **carriers: str) -> Snapshot:
    snapshot = beside(*fixes, **carriers)
    awaited = {"position": dict.fromkeys(topics, snapshot.now_s - seconds)}
    return replace(snapshot, compared=replace(snapshot.compared, awaited=awaited))


@pytest.mark.parametrize(
    ("snapshot", "verdict", "text"),
    [
        (
            awaiting("/gps/fix", seconds=11.0),
            "fault",
            "Nothing from /gps/fix for 11 s, nor before; the position of /gps/filtered continues without it",
        ),
        (
            awaiting("/b/fix", seconds=60.0, position="/a/fix"),
            "fault",
            "Nothing from /b/fix for 60 s, nor before; the position of /a/fix continues without it",
        ),
        (
            awaiting("/b/fix", seconds=60.0, fixes=(FIX,), position="/a/fix"),
            "fault",
            "Nothing from /b/fix for 60 s, nor before; the position of /a/fix continues without it",
        ),
        (awaiting("/gps/fix", seconds=9.0), "unknown", "No message from /gps/fix yet"),
        (awaiting("/gps/filtered", seconds=60.0, position="/gps/fix"), "unknown", "No message from /gps/filtered yet"),
        (awaiting("/gps/filtered", seconds=60.0), "unknown", "Only one source gives a position"),  # it carries it
    ],
)
def test_a_receiver_of_which_nothing_ever_came_is_noticed(snapshot: Snapshot, verdict: str, text: str) -> None:
    found = ask(RECEIVER, snapshot)
    assert str(found.verdict) == verdict
    assert found.text.startswith(text)
    assert str(ask(APART, snapshot).verdict) in ("unknown", "absent", "ok")
