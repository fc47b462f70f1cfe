"""The phone beside the car: each check's three answers, both sides of each limit, and when nothing is reported."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.agreement import Tracks
from monitor.check import Finding
from monitor.phones import NO_PHONE, Comparison, PhoneView, Why
from monitor.state import Snapshot
from monitor.values import GpsFix, PhoneFix, Twist
from tests.monitor.checks.known import LINK, ask, check_of, known

NOW_S = 100.0
CAR = GpsFix(lat_deg=32.23, lon_deg=-110.95, sigma_m=1.0)
CHECKS = ("phone_car", "phone_tracks", "phone_missing")


def apart(*distances_m: float, gate_m: float = 14.0) -> tuple[Comparison, ...]:
    """One comparison a second, the newest half a second ago."""
    n = len(distances_m)
    return tuple(
        Comparison(at_s=NOW_S - 0.5 - (n - 1 - i), distance_m=d, gate_m=gate_m) for i, d in enumerate(distances_m)
    )


def tracks(r: float | None = 0.99, **more: Any) -> Tracks:
    made = Tracks(pairs=60, span_s=59.0, car_spread_m=80.0, phone_spread_m=80.0, phone_sigma_m=3.5, correlation=r)
    return replace(made, **more)


def view(**more: Any) -> PhoneView:
    made = PhoneView(
        phone="one",
        count=1,
        is_handheld=True,
        received_s=NOW_S - 0.5,
        usable_s=NOW_S - 0.5,
        was_usable=True,
        fix=PhoneFix(lat_deg=32.23, lon_deg=-110.95, accuracy_m=5.0),
        measured_s=NOW_S - 0.5,
        comparisons=apart(2.0, 2.0, 2.0, 2.0, 2.0),
        tracks=tracks(),
    )
    return replace(made, **more)


def finding_of(
    check: str, phone: PhoneView, *, position: GpsFix | None = CAR, age_s: float = 0.0, **more: Any
) -> Finding:
    snapshot: Snapshot = replace(known(NOW_S, age_s=age_s, position=position), phone=phone)
    return ask(check, snapshot, **more)


# -- phone and car -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("comparisons", "verdict"),
    [
        (apart(2.0, 2.0, 2.0, 2.0, 2.0), "ok"),
        (apart(14.0, 14.0, 14.0, 14.0, 14.0), "ok"),
        (apart(14.1, 14.1, 14.1, 2.0, 2.0), "fault"),
        (apart(14.1, 2.0, 14.1, 2.0, 14.1), "fault"),
        (apart(14.1, 2.0, 2.0, 2.0, 14.1), "ok"),
        (apart(600.0, 2.0, 2.0, 2.0, 600.0), "ok"),
        (apart(14.1, 14.1, 14.1), "fault"),
        (apart(14.1, 14.1), "unknown"),
        (apart(2.0, 2.0, 2.0), "ok"),
        ((), "unknown"),
        (apart(9.9, 9.9, 9.9, 9.9, 9.9, gate_m=8.0), "ok"),  # beyond what the errors explain, and too little to matter
        (apart(10.0, 10.0, 10.0, 10.0, 10.0, gate_m=8.0), "ok"),
        (apart(10.1, 10.1, 10.1, 10.1, 10.1, gate_m=8.0), "fault"),
        (apart(float("inf"), float("inf"), float("inf")), "fault"),
    ],
)
def test_three_of_five_beyond_the_gate_and_10_m(comparisons: tuple[Comparison, ...], verdict: str) -> None:
    assert finding_of("phone_car", view(comparisons=comparisons)).verdict == verdict


def test_what_the_operator_reads_of_it() -> None:
    finding = finding_of("phone_car", view(comparisons=apart(2.0, 511.6, 511.6, 511.6, 2.0)))
    assert finding.text == "The phone is 512 m from the car; up to 14 m is normal"
    assert finding.brief == "FAULT 512 m"
    assert finding.measured is not None
    assert finding.limit is not None
    assert (finding.measured.value, finding.limit.value) == (511.6, 14.0)
    assert finding_of("phone_car", view(count=3)).text.startswith("The phone (one, of 3 phones) is 2 m")
    assert finding_of("phone_car", view(count=3, label="Anna")).text.startswith("The phone (Anna, of 3 phones) is 2 m")


@pytest.mark.parametrize(("was_active", "verdict"), [(False, "ok"), (True, "fault")])
def test_it_clears_a_fifth_below(was_active: bool, verdict: str) -> None:
    phone = view(comparisons=apart(12.0, 12.0, 12.0, 12.0, 12.0))
    assert finding_of("phone_car", phone, was_active=was_active).verdict == verdict
    assert finding_of("phone_car", view(comparisons=apart(*[11.2] * 5)), was_active=was_active).verdict == "ok"


def test_the_operator_s_distance_counts() -> None:
    phone = view(comparisons=apart(*[60.0] * 5))
    assert finding_of("phone_car", phone, least_m=60.0).verdict == "ok"
    assert finding_of("phone_car", phone, least_m=59.0).verdict == "fault"


def test_old_comparisons_prove_nothing_of_now() -> None:
    old = tuple(replace(one, at_s=one.at_s - 4.6) for one in apart(*[60.0] * 5))
    finding = finding_of("phone_car", view(comparisons=old))
    assert (finding.verdict, finding.brief) == ("unknown", "not checked: stale")


# -- tracks ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("of", "verdict"),
    [
        (tracks(0.99), "ok"),
        (tracks(0.70), "ok"),
        (tracks(0.69), "fault"),
        (tracks(-1.0), "fault"),
        (tracks(None, phone_spread_m=0.0), "fault"),  # 0/0: the car moves and the phone does not
        (tracks(0.2, pairs=20), "fault"),
        (tracks(0.2, pairs=19), "unknown"),
        (tracks(0.2, span_s=30.0), "fault"),
        (tracks(0.2, span_s=29.9), "unknown"),
        (tracks(0.2, car_spread_m=10.51), "fault"),
        (tracks(0.2, car_spread_m=10.5), "unknown"),  # three sigma of the phone
        (tracks(0.2, car_spread_m=0.0, phone_spread_m=40.0), "unknown"),
        (None, "unknown"),
    ],
)
def test_tracks_are_judged_only_where_the_car_moved(of: Tracks | None, verdict: str) -> None:
    assert finding_of("phone_tracks", view(tracks=of)).verdict == verdict


def test_standing_is_reported_and_not_taken_for_good() -> None:
    finding = finding_of("phone_tracks", view(tracks=tracks(0.1, car_spread_m=0.4)))
    assert finding.brief == "not checked: standing"
    assert finding.text == "Standing: the car's track spreads 0.4 m, with this phone 10.5 m is needed"
    assert finding_of("phone_tracks", view(tracks=tracks(pairs=3))).brief == "not checked: waiting"


@pytest.mark.parametrize(
    ("speed_mps", "stands_since_s", "brief"),
    [
        (4.0, None, "not checked: near"),
        (-4.0, None, "not checked: near"),
        (0.3, None, "not checked: standing"),
        (0.0, None, "not checked: standing"),
        (0.0, 60.0, "not checked: standing"),
    ],
)
def test_a_car_that_drives_on_the_spot_of_a_coarse_phone_is_not_called_standing(
    speed_mps: float, stands_since_s: float | None, brief: str
) -> None:
    snapshot = replace(
        known(NOW_S, position=CAR, speed=Twist(speed_mps=speed_mps)),
        phone=view(tracks=tracks(0.1, car_spread_m=40.0, phone_sigma_m=20.0)),
        standing_since_s=stands_since_s,
    )
    finding = ask("phone_tracks", snapshot)
    assert (finding.verdict, finding.brief) == ("unknown", brief)


def test_the_correlation_has_a_deadband_and_a_setting() -> None:
    assert finding_of("phone_tracks", view(tracks=tracks(0.72)), was_active=True).verdict == "fault"
    assert finding_of("phone_tracks", view(tracks=tracks(0.75)), was_active=True).verdict == "ok"
    assert finding_of("phone_tracks", view(tracks=tracks(0.85)), least_correlation=0.9).verdict == "fault"
    assert (
        finding_of("phone_tracks", view(tracks=tracks(0.12))).text
        == "The tracks correlate with 0.12; 0.70 is the least"
    )


# -- missing -----------------------------------------------------------------------------------------------------------

WHYS: dict[Why, tuple[str, str, str]] = {
    "denied": ("Location permission denied on the phone", "not checked: denied", "FAULT: permission"),
    "insecure": (
        "The page on the phone was not opened over HTTPS, which a position needs",
        "not checked: HTTPS",
        "FAULT: needs HTTPS",
    ),
    "unavailable": ("No position found by the phone", "not checked: no fix", "FAULT: no fix"),
    "timeout": ("No GPS fix on the phone for 10 s", "not checked: no fix", "FAULT: no fix"),
    "hidden": (
        "No position while the page is in the background on the phone",
        "not checked: hidden",
        "FAULT: background",
    ),
    "coarse": (
        "Position of the phone is accurate to 800 m only; 50 m is needed",
        "not checked: coarse",
        "FAULT ±800 m",
    ),
    "late": ("Positions of the phone arrive too late over the radio", "not checked: late", "FAULT: comes late"),
}


def without(why: Why, for_s: float, **more: Any) -> PhoneView:
    fix = PhoneFix(lat_deg=32.23, lon_deg=-110.95, accuracy_m=800.0)
    return view(why=why, usable_s=NOW_S - for_s, fix=fix, **more)


@pytest.mark.parametrize(("why", "texts"), WHYS.items(), ids=WHYS.keys())
def test_each_reason_is_reported_after_10_s_and_nothing_is_compared_meanwhile(
    why: Why, texts: tuple[str, str, str]
) -> None:
    sentence, not_checked, brief = texts
    before, after = finding_of("phone_missing", without(why, 9.9)), finding_of("phone_missing", without(why, 10.0))
    assert (before.verdict, before.brief) == ("unknown", not_checked)
    assert (after.verdict, after.brief, after.text) == ("fault", brief, sentence)
    for check in ("phone_car", "phone_tracks"):
        other = finding_of(check, without(why, 20.0, comparisons=apart(*[600.0] * 5), tracks=tracks(0.0)))
        assert (other.verdict, other.brief) == ("unknown", not_checked)


def test_a_fix_that_grew_old_and_a_phone_that_fell_silent() -> None:
    old = view(measured_s=NOW_S - 12.0, usable_s=NOW_S - 12.0)
    assert finding_of("phone_missing", old).text == "The newest fix of the phone is 12 s old"
    silent = view(received_s=NOW_S - 14.0, measured_s=NOW_S - 14.0, usable_s=NOW_S - 14.0)
    assert finding_of("phone_missing", silent).text == "No position from the phone for 14 s"
    assert finding_of("phone_missing", silent).brief == "FAULT: silent"


def test_a_position_is_in_order() -> None:
    finding = finding_of("phone_missing", view())
    assert (finding.verdict, finding.text) == ("ok", "Position of the phone known to 5 m")


def test_once_reported_it_stands_until_there_is_one() -> None:
    assert finding_of("phone_missing", without("timeout", 3.0), was_active=True).verdict == "fault"
    assert finding_of("phone_missing", without("timeout", 3.0), after_s=3.0).verdict == "fault"


def test_every_reason_is_one_cause_so_that_a_change_of_reason_announces_nothing() -> None:
    causes = {why: finding_of("phone_missing", without(why, 20.0)).causes for why in WHYS}
    assert set(causes.values()) == {("phone",)}


@pytest.mark.parametrize("why", [why for why in WHYS if why != "denied"])
def test_a_desktop_computer_raises_no_alarm(why: Why) -> None:
    desktop = without(why, 99.0, is_handheld=False)
    finding = finding_of("phone_missing", desktop)
    assert (finding.verdict, finding.applies, finding.brief) == ("unknown", False, "no phone")
    assert finding_of("phone_missing", desktop, was_active=True).verdict == "ok"


def test_a_refusal_is_reported_even_from_a_desktop_computer() -> None:
    assert finding_of("phone_missing", without("denied", 10.0, is_handheld=False)).brief == "FAULT: permission"


# -- nothing to check --------------------------------------------------------------------------------------------------

GONE = view(received_s=NOW_S - 61.0, measured_s=NOW_S - 61.0)


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("phone", [NO_PHONE, GONE], ids=["never", "gone"])
def test_without_a_phone_nothing_is_checked_and_what_stood_ends(check: str, phone: PhoneView) -> None:
    finding = finding_of(check, phone)
    assert (finding.verdict, finding.applies, finding.brief) == ("unknown", False, "no phone")
    assert finding_of(check, phone, was_active=True).verdict == "ok"


@pytest.mark.parametrize("check", CHECKS)
def test_a_car_without_positions_needs_no_phone(check: str) -> None:
    finding = finding_of(check, view(comparisons=apart(*[99.0] * 5), why="denied", usable_s=0.0), position=None)
    assert (finding.verdict, finding.applies) == ("unknown", False)


@pytest.mark.parametrize("check", ["phone_car", "phone_tracks"])
@pytest.mark.parametrize(
    ("car", "brief"),
    [
        ({"age_s": 3.0}, "not checked: stale"),
        ({"position": replace(CAR, status=-1)}, "not checked: no fix"),
    ],
)
def test_without_a_fresh_fix_of_the_car_it_is_not_checked(check: str, car: dict[str, Any], brief: str) -> None:
    phone = view(comparisons=apart(*[600.0] * 5), tracks=tracks(0.0))
    finding = finding_of(check, phone, **car)
    assert (finding.verdict, finding.brief) == ("unknown", brief)


def test_a_car_whose_position_is_published_and_not_yet_received() -> None:
    link = replace(LINK, published=frozenset({"position"}))
    finding = ask("phone_car", replace(known(NOW_S, link=link), phone=view()))
    assert (finding.verdict, finding.brief) == ("unknown", "not checked: no data")


# -- how they are reported ---------------------------------------------------------------------------------------------


def test_where_and_how_they_are_reported() -> None:
    specs = {check: check_of(check).alarm for check in CHECKS}
    assert {name: (str(spec.priority), str(spec.place)) for name, spec in specs.items()} == {
        "phone_car": ("warning", "dialog"),
        "phone_tracks": ("advisory", "snackbar"),
        "phone_missing": ("warning", "snackbar"),
    }
    assert specs["phone_tracks"].inhibited_by == ("phone_car",)
    assert specs["phone_car"].inhibited_by == ("gps_jump", "gps_drift")
    assert {check_of(check).tile_label for check in CHECKS} == {"Phone–car", "Tracks"}
