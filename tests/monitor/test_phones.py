"""Which phone is compared with the car, when, and what is kept of it."""

from __future__ import annotations

from typing import Any

import pytest

from monitor import phones
from monitor.phones import NO_PHONE, PhoneReport, Phones, Why
from monitor.state import State
from monitor.values import GpsFix, PhoneFix

LAT, LON = 32.23, -110.95
M_NORTH = 1 / 110_890.0


def at(north_m: float = 0.0, accuracy_m: float = 5.0) -> PhoneFix:
    return PhoneFix(lat_deg=LAT + north_m * M_NORTH, lon_deg=LON, accuracy_m=accuracy_m)


class Road:
    """A car that drives north, ten positions a second, and phones that report when the test lets them."""

    def __init__(self, speed_mps: float = 0.0) -> None:
        self.phones = Phones()
        self.now_s = 100.0
        self.speed_mps = speed_mps

    @property
    def view(self) -> phones.PhoneView:
        return self.phones.view

    @property
    def north_m(self) -> float:
        return self.speed_mps * (self.now_s - 100.0)

    def drive(self, seconds: float = 1.0) -> Road:
        until_s = self.now_s + seconds
        while self.now_s < until_s - 1e-6:
            self.now_s = round(self.now_s + 0.1, 3)
            self.phones.car(GpsFix(lat_deg=LAT + self.north_m * M_NORTH, lon_deg=LON, sigma_m=1.0), self.now_s)
        return self

    def wait(self, seconds: float) -> Road:
        """Time passes and the car sends nothing."""
        self.now_s = round(self.now_s + seconds, 3)
        return self

    def report(self, phone: str = "one", aside_m: float = 0.0, *, age_s: float = 0.2, **more: Any) -> Road:
        """`aside_m` north of where the car was at the moment of the fix."""
        north_m = self.speed_mps * (self.now_s - age_s - 100.0) + aside_m
        accuracy_m, handheld = more.pop("accuracy_m", 5.0), more.pop("is_handheld", True)
        report = PhoneReport(
            phone=phone, is_handheld=handheld, fix=at(north_m, accuracy_m), measured_s=self.now_s - age_s, **more
        )
        self.phones.receive(report, self.now_s)
        return self

    def excuse(self, why: Why, phone: str = "one", *, is_handheld: bool = True) -> Road:
        self.phones.receive(PhoneReport(phone=phone, is_handheld=is_handheld, why=why), self.now_s)
        return self


def test_before_any_phone_speaks_there_is_none() -> None:
    assert Road().drive(5.0).view is NO_PHONE
    assert not NO_PHONE.is_there(100.0)


@pytest.mark.parametrize("age_s", [0.0, 0.25, 1.5, 4.9])
def test_the_car_is_looked_up_at_the_phone_s_own_time(age_s: float) -> None:
    """At 10 m/s a comparison with the car's newest position would be wrong by 10 m for each second of age."""
    road = Road(10.0).drive(8.0).report(age_s=age_s)
    (one,) = road.view.comparisons
    assert one.distance_m == pytest.approx(0.0, abs=0.05)
    assert one.at_s == pytest.approx(108.0 - age_s)


@pytest.mark.parametrize(("aside_m", "bearing_deg"), [(40.0, 180.0), (-40.0, 0.0)])
def test_the_bearing_of_the_car_from_the_phone(aside_m: float, bearing_deg: float) -> None:
    (one,) = Road(10.0).drive(3.0).report(aside_m=aside_m).view.comparisons
    assert one.bearing_deg % 360.0 == pytest.approx(bearing_deg, abs=0.1)


def test_a_fix_newer_than_the_car_s_newest_position_waits_for_the_next() -> None:
    road = Road(10.0).drive(3.0).wait(0.05).report(age_s=0.0)
    assert road.view.comparisons == ()
    road.drive(0.05)
    assert [one.distance_m for one in road.view.comparisons] == pytest.approx([0.0], abs=0.05)


def test_a_fix_for_which_the_car_s_position_never_comes_is_not_compared() -> None:
    road = Road(10.0).drive(3.0).report(age_s=0.0).drive(0.1)
    assert len(road.view.comparisons) == 1
    road.wait(0.5).report(age_s=0.0).wait(2.5).drive(1.0)  # a gap of 3 s: nobody knows how the car drove in it
    assert len(road.view.comparisons) == 1


def test_one_fix_reported_twice_is_compared_once() -> None:
    road = Road().drive(2.0).report(age_s=0.2)
    road.report(age_s=0.2).drive(0.5).report(age_s=0.7).report(age_s=0.9)
    assert len(road.view.comparisons) == 1


def test_five_comparisons_and_a_minute_of_track_are_kept() -> None:
    road = Road(5.0)
    for _ in range(90):
        road.drive(1.0).report(aside_m=3.0)
    assert len(road.view.comparisons) == 5
    assert all(one.distance_m == pytest.approx(3.0, abs=0.1) for one in road.view.comparisons)
    assert road.view.tracks is not None
    assert road.view.tracks.pairs == 61
    assert road.view.tracks.span_s == pytest.approx(60.0)
    assert road.view.tracks.correlation == pytest.approx(1.0, abs=1e-6)


def test_places_that_the_gate_does_not_explain_are_no_part_of_the_track() -> None:
    """Else a receiver that ran away for five seconds would spoil the correlation of the next minute."""
    road = Road(5.0)
    for second in range(60):
        road.drive(1.0).report(aside_m=200.0 if 40 <= second < 45 else 3.0)
    assert road.view.tracks is not None
    assert road.view.tracks.pairs == 55
    assert road.view.tracks.correlation == pytest.approx(1.0, abs=1e-6)
    for _ in range(70):
        road.drive(1.0).report(aside_m=200.0)
    assert road.view.tracks.pairs == 0


def test_however_fast_a_phone_speaks_what_is_kept_is_bounded() -> None:
    road = Road(5.0)
    for _ in range(600):
        road.drive(0.1).report(age_s=0.05)
    assert road.view.tracks is not None
    assert road.view.tracks.pairs <= phones.TRACK_S / phones.STEP_S + 1
    assert road.view.tracks.span_s > 59.0


def test_old_comparisons_do_not_count() -> None:
    road = Road().drive(1.0).report().drive(1.0).report().drive(phones.COMPARED_WITHIN_S).report()
    assert len(road.view.comparisons) == 2  # the first is 16 s older


def test_what_is_uncertain_of_the_moment_widens_the_gate() -> None:
    sure, unsure = (Road(10.0).drive(3.0).report(uncertain_s=s).view.comparisons[0].gate_m for s in (0.0, 0.9))
    # The phone stands where the car was: no direction, so the gate is that across the way and does not grow.
    assert sure == pytest.approx(unsure)
    sure, unsure = (
        Road(10.0).drive(3.0).report(aside_m=30.0, uncertain_s=s).view.comparisons[0].gate_m for s in (0.0, 0.9)
    )
    assert unsure > sure + 20.0


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"accuracy_m": 50.0}, None),
        ({"accuracy_m": 50.1}, "coarse"),
        ({"age_s": 5.0}, None),
        ({"age_s": 5.1}, "old"),
        ({"uncertain_s": 1.0}, None),
        ({"uncertain_s": 1.01}, "late"),
        ({"uncertain_s": float("inf")}, "late"),
    ],
)
def test_which_fixes_are_used(more: dict[str, Any], why: Why | None) -> None:
    road = Road().drive(8.0).report(**more)
    assert road.view.why == why
    assert len(road.view.comparisons) == (why is None)
    assert road.view.fix is not None  # shown all the same


@pytest.mark.parametrize("why", ["denied", "unavailable", "timeout", "insecure", "hidden"])
def test_a_reason_is_kept_with_the_time_since_the_last_fix(why: Why) -> None:
    road = Road().drive(2.0).report(age_s=0.0)
    road.drive(3.0).excuse(why)
    assert road.view.why_not(road.now_s) == why
    assert road.view.missing_s(road.now_s) == pytest.approx(3.0)
    road.drive(1.0).report(age_s=0.0)
    assert road.view.why_not(road.now_s) is None
    assert road.view.missing_s(road.now_s) == 0.0


def test_a_phone_that_never_had_a_fix_is_missing_since_it_first_spoke() -> None:
    road = Road().drive(2.0).excuse("timeout").drive(4.0).excuse("denied")
    assert road.view.missing_s(road.now_s) == pytest.approx(4.0)


def test_silence_is_noticed_by_time_alone() -> None:
    road = Road().drive(2.0).report(age_s=0.0)
    assert road.view.why_not(road.now_s + 5.0) is None
    assert road.view.why_not(road.now_s + 5.1) == "silent"
    assert road.view.is_there(road.now_s + 60.0)
    assert not road.view.is_there(road.now_s + 60.1)


def test_a_page_that_speaks_without_a_newer_fix_has_an_old_one() -> None:
    road = Road().drive(6.0).report(age_s=4.0).wait(2.0)
    assert road.view.why_not(road.now_s) == "old"


def test_a_phone_that_leaves_is_no_phone_any_more() -> None:
    road = Road().drive(2.0).report().excuse("off")
    assert road.view is NO_PHONE


# -- several phones --------------------------------------------------------------------------------------------------


def test_the_first_with_a_fix_is_compared_and_stays_so() -> None:
    road = Road().drive(2.0).excuse("timeout", "early").report("one").report("two", aside_m=300.0)
    for _ in range(5):
        road.drive(1.0).report("two", aside_m=300.0).report("one")
    assert (road.view.phone, road.view.count) == ("one", 3)
    assert max(one.distance_m for one in road.view.comparisons) < 1.0


def test_the_next_takes_over_when_the_first_has_none_for_10_s_and_nothing_of_the_first_counts_for_it() -> None:
    road = Road().drive(2.0).report("one")
    for second in range(1, 14):
        road.drive(1.0).excuse("timeout", "one").report("two", aside_m=300.0)
        assert road.view.phone == ("one" if second <= 9 else "two"), second
    assert [round(one.distance_m) for one in road.view.comparisons] == [300] * 4
    assert road.view.tracks is not None
    assert road.view.tracks.pairs == 0  # what lies beyond the gate is no track
    road.drive(1.0).report("one").report("two")
    assert road.view.phone == "two"  # who comes back is the next again, and does not push in


def test_the_next_takes_over_at_once_from_one_that_leaves() -> None:
    road = Road().drive(2.0).report("one").report("two").excuse("off", "one")
    assert (road.view.phone, road.view.count) == ("two", 1)


def test_without_any_fix_the_handheld_phone_is_reported_and_not_the_desktop() -> None:
    road = Road().drive(2.0).excuse("unavailable", "desktop", is_handheld=False)
    assert road.view.phone == "desktop"
    road.excuse("denied", "hand")
    assert (road.view.phone, road.view.why) == ("hand", "denied")
    road.excuse("timeout", "other").excuse("unavailable", "desktop", is_handheld=False)
    assert road.view.phone == "hand"


def test_those_silent_for_a_minute_are_forgotten_and_their_number_is_bounded() -> None:
    road = Road()
    for i in range(phones.MOST + 10):
        road.excuse("denied", f"phone {i}")
    assert road.view.count == phones.MOST
    road.wait(61.0).report("late one")
    assert (road.view.phone, road.view.count) == ("late one", 1)


# -- in the state ----------------------------------------------------------------------------------------------------


def test_a_snapshot_holds_what_was_known_then() -> None:
    state = State()
    for i in range(20):
        state.receive("position", GpsFix(lat_deg=LAT, lon_deg=LON), 100.0 + i / 10)
    before = state.snapshot(101.9)
    state.receive_phone(PhoneReport(phone="one", is_handheld=True, fix=at(40.0), measured_s=101.5), 101.95)
    assert before.phone is NO_PHONE
    assert state.snapshot(102.0).phone.comparisons[0].distance_m == pytest.approx(40.0, abs=0.05)


def test_a_clock_that_goes_back_forgets_the_phones_which_speak_again() -> None:
    state = State()
    state.receive("position", GpsFix(lat_deg=LAT, lon_deg=LON), 100.0)
    state.receive_phone(PhoneReport(phone="one", is_handheld=True, fix=at(), measured_s=100.0), 100.0)
    assert state.snapshot(50.0).phone is NO_PHONE
    for i in range(5):
        state.receive("position", GpsFix(lat_deg=LAT, lon_deg=LON), 50.0 + i / 10)
    state.receive_phone(PhoneReport(phone="one", is_handheld=True, fix=at(), measured_s=50.2), 50.5)
    assert len(state.snapshot(50.5).phone.comparisons) == 1


def test_another_connection_begins_without_phones() -> None:
    state = State()
    state.receive_phone(PhoneReport(phone="one", is_handheld=True, why="denied"), 100.0)
    state.reset()
    assert state.snapshot(100.1).phone is NO_PHONE


# -- the phone that is in the car --------------------------------------------------------------------------------------


def test_the_chosen_phone_is_compared_though_another_came_first() -> None:
    road = Road().drive(2.0).report("one").report("two", aside_m=9.0)
    assert (road.view.phone, road.view.is_chosen) == ("one", False)
    road.phones.ride("two", road.now_s)
    assert (road.view.phone, road.view.is_chosen, road.view.comparisons) == ("two", True, ())
    road.drive(1.0).report("one").report("two", aside_m=9.0)
    assert [one.distance_m for one in road.view.comparisons] == pytest.approx([9.0], abs=0.05)


@pytest.mark.parametrize("why", ["denied", "hidden", "timeout", "off"])
def test_no_other_takes_its_place_whatever_becomes_of_it(why: Why) -> None:
    road = Road().drive(2.0).report("one").report("two")
    road.phones.ride("two", road.now_s)
    road.excuse(why, "two")
    for _ in range(70):  # longer than any other phone is remembered
        road.drive(1.0).report("one")
    assert road.view.phone == "two"
    assert road.view.fix is not None
    assert road.view.why_not(road.now_s) == ("off" if why == "off" else "silent")
    assert road.view.is_there(road.now_s + 1000.0)  # it is missed for ever


def test_a_phone_that_has_not_reported_yet_is_waited_for() -> None:
    road = Road().drive(2.0).report("one")
    road.phones.ride("two", road.now_s)
    assert road.view.phone == "two"
    assert road.view.why_not(road.now_s + 6.0) == "silent"
    assert road.view.missing_s(road.now_s + 6.0) == pytest.approx(6.0)
    road.drive(1.0).report("two")
    assert road.view.why_not(road.now_s) is None
    assert len(road.view.comparisons) == 1


def test_when_the_choice_is_taken_back_one_is_found_as_before() -> None:
    road = Road().drive(2.0).report("one")
    road.phones.ride("two", road.now_s)
    road.phones.ride(None, road.now_s)
    assert (road.view.phone, road.view.is_chosen, road.view.count) == ("one", False, 1)  # the one waited for is gone


def test_every_phone_is_seen_each_with_its_own_reason() -> None:
    road = Road().drive(2.0).report("one").report("two", accuracy_m=80.0).excuse("denied", "three")
    assert [(view.phone, view.why_not(road.now_s)) for view in road.phones.views] == [
        ("one", None), ("two", "coarse"), ("three", "denied"),
    ]  # fmt: skip
    road.excuse("off", "two")
    assert [view.phone for view in road.phones.views] == ["one", "three"]


def test_a_clock_that_goes_back_forgets_the_phones_and_not_the_choice() -> None:
    state = State()
    state.ride("two", 100.0)
    state.receive_phone(PhoneReport(phone="two", is_handheld=True, fix=at(), measured_s=100.0), 100.0)
    snapshot = state.snapshot(50.0)
    assert (snapshot.phone.phone, snapshot.phone.is_chosen, snapshot.phone.fix) == ("two", True, None)
