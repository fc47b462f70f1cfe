"""The phone from its page to the judge: what a page may send, which clock counts, and whole drives with a phone."""

from __future__ import annotations

import math
from typing import Any

import pytest

from monitor.phones import NO_PHONE, PhoneReport
from monitor.state import State
from monitor.values import GpsFix, PhoneFix
from server.app.config import Config
from server.judge.phone_report import phone_report
from server.judge.profiles import load as load_profiles
from server.protocol import commands
from server.rosbridge_server.server import RosBridge
from server.simulator.scenarios import planned
from server.vehicle import phone
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.riding import WALL_MS, Ride, Rider, ride
from tests.server.viewer import Viewer, viewer

FIX: dict[str, Any] = {
    "lat_deg": 32.23, "lon_deg": -110.95, "accuracy_m": 5, "alt_m": None, "speed_mps": None, "heading_deg": None,
    "at_ms": 1_700_000_000_000, "age_s": 0.3, "heard_ms": WALL_MS, "held_s": 0.05,
}  # fmt: skip
HERE: dict[str, Any] = {"kind": "position", "id": "1", "phone": "0a1b2c3d", "handheld": True, "fix": FIX}


def with_fix(**more: Any) -> dict[str, Any]:
    return HERE | {"fix": FIX | more}


# -- what a page may say -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "command",
    [
        HERE,
        with_fix(lat_deg=90, lon_deg=180.0, accuracy_m=0),
        with_fix(lat_deg=-90.0, lon_deg=-180, heading_deg=360.0, speed_mps=0.0, alt_m=-400.5),
        with_fix(at_ms=1_700_000_000_000.25),
        {name: value for name, value in HERE.items() if name != "fix"} | {"why": "denied"},
        HERE | {"fix": None, "why": "off"},
    ],
)
def test_a_position_or_a_reason_is_understood(command: dict[str, Any]) -> None:
    assert isinstance(commands.read(command), commands.Position)


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (with_fix(lat_deg=90.1), "fix.lat_deg: Input should be less than or equal to 90."),
        (with_fix(lat_deg=math.nan), "fix.lat_deg: Input should be"),
        (with_fix(lon_deg=180.1), "fix.lon_deg: Input should be less than or equal to 180."),
        (with_fix(lon_deg=None), "fix.lon_deg: Input should be a valid number."),
        (with_fix(lat_deg="32.23"), "fix.lat_deg: Input should be a valid number."),
        (with_fix(accuracy_m=-1), "fix.accuracy_m: Input should be greater than or equal to 0."),
        (with_fix(accuracy_m=math.inf), "fix.accuracy_m: Input should be"),
        (with_fix(age_s=-0.1), "fix.age_s: Input should be greater than or equal to 0."),
        (with_fix(age_s=1e9), "fix.age_s: Input should be less than or equal to 86400."),
        (with_fix(heading_deg=361), "fix.heading_deg: Input should be less than or equal to 360."),
        (with_fix(held_s=True), "fix.held_s: Input should be a valid number."),
        (HERE | {"fix": [32.23, -110.95]}, "fix: Input should be"),
        (HERE | {"phone": "x"}, "phone: String should match pattern"),
        (HERE | {"phone": "<script>"}, "phone: String should match pattern"),
        (HERE | {"handheld": 1}, "handheld: Input should be a valid boolean."),
        (HERE | {"fix": None}, "the command: it needs either a position or the reason for having none."),
        (HERE | {"why": "denied"}, "the command: it needs either a position or the reason for having none."),
        (HERE | {"fix": None, "why": "silent"}, "why: Input should be 'denied', "),  # only the server can say that
    ],
)
def test_anything_else_is_refused_with_a_sentence(command: dict[str, Any], sentence: str) -> None:
    with pytest.raises(commands.NotUnderstood) as refused:
        commands.read(command)
    assert str(refused.value).startswith(sentence)
    assert str(refused.value).endswith(".")


# -- on whose clock it counts ------------------------------------------------------------------------------------------


def report_of(wall_ms: float, **more: Any) -> PhoneReport:
    command = commands.read(with_fix(**more))
    assert isinstance(command, commands.Position)
    return phone_report(command, now_s=1000.0, wall_ms=wall_ms)


@pytest.mark.parametrize("at_ms", [0, 1_700_000_000_000, 1_790_000_000_000, 9_000_000_000_000])
def test_the_phone_s_own_clock_does_not_count(at_ms: float) -> None:
    report = report_of(WALL_MS + 150, at_ms=at_ms, age_s=0.3, held_s=0.05)
    assert report.measured_s == pytest.approx(1000.0 - 0.3 - 0.05)  # half of the 0.1 s there and back
    assert report.uncertain_s == pytest.approx(0.05)
    assert report.fix is not None
    assert report.fix.at_ms == at_ms


@pytest.mark.parametrize(
    ("wall_ms", "held_s", "uncertain_s"),
    [
        (WALL_MS + 50, 0.05, 0.0),
        (WALL_MS + 4_050, 0.05, 2.0),  # it hung in the radio
        (WALL_MS - 150, 0.05, 0.0),  # the server's time of day was set back a little
        (WALL_MS - 1_000, 0.05, math.inf),  # or more: nothing is known of the way
        (WALL_MS + 50, 80_000.0, math.inf),
    ],
)
def test_how_long_the_way_may_have_taken(wall_ms: float, held_s: float, uncertain_s: float) -> None:
    report = report_of(wall_ms, held_s=held_s)
    assert report.uncertain_s == pytest.approx(uncertain_s)
    assert math.isfinite(report.measured_s)


def test_a_reason_needs_no_clock() -> None:
    command = commands.read(HERE | {"fix": None, "why": "insecure", "handheld": False})
    assert isinstance(command, commands.Position)
    assert phone_report(command, 5.0, WALL_MS) == PhoneReport(phone="0a1b2c3d", is_handheld=False, why="insecure")


# -- its part of the state ---------------------------------------------------------------------------------------------


def test_the_state_shows_it_without_a_number_that_is_none() -> None:
    assert phone.as_json(NO_PHONE, 100.0) is None
    state = State()
    state.receive_phone(PhoneReport(phone="one-1", is_handheld=True, why="timeout"), 100.0)
    shown = phone.as_json(state.snapshot(101.0).phone, 101.0)
    assert shown is not None
    assert (shown["used"], shown["why"], shown["why_text"]) == (
        False,
        "timeout",
        "No GPS fix on the phone for 1 s",
    )
    assert {shown[name] for name in ("lat_deg", "accuracy_m", "age_s", "apart_m", "correlation")} == {None}
    for i in range(20):
        state.receive("position", GpsFix(lat_deg=32.23, lon_deg=-110.95, sigma_m=1.0), 101.0 + i / 10)
    fix = PhoneFix(lat_deg=32.2301, lon_deg=-110.95, accuracy_m=30.2, at_ms=1_700_000_000_000)
    state.receive_phone(PhoneReport(phone="one-1", is_handheld=True, label="Anna", fix=fix, measured_s=102.5), 102.9)
    shown = phone.as_json(state.snapshot(103.0).phone, 103.0)
    assert shown == {
        "id": "one-1", "label": "Anna", "count": 1, "handheld": True, "lat_deg": 32.2301, "lon_deg": -110.95,
        "accuracy_m": 30.2, "sigma_m": 20.0, "alt_m": None, "speed_mps": None, "heading_deg": None,
        "at_ms": 1_700_000_000_000, "age_s": 0.5, "used": True, "why": None, "why_text": None,
        "apart_m": 11.1, "bearing_deg": 180.0, "compared_age_s": 0.5, "explained_m": 74.6, "correlation": None,
        "chosen": False, "choice": "only",
        "choice_text": "No phone was chosen as the phone in the car. The only phone is used.",
    }  # fmt: skip


# -- over the wire -----------------------------------------------------------------------------------------------------


async def say(one: Viewer, **more: Any) -> dict[str, Any]:
    """As a page does: with the server's time of the newest state, and how long it has been here."""
    import time

    newest, held_s = one.states[-1]["server"]["time_ms"], max(0.0, time.time() - one.got_s[-1])
    return await one.ask(**(HERE | {"fix": FIX | {"heard_ms": newest, "held_s": held_s} | more}))


def gps(lat_deg: float) -> dict[str, Any]:
    return {
        "header": {"seq": 1, "stamp": {"secs": 0, "nsecs": 0}, "frame_id": "gps"},
        "status": {"status": 0, "service": 1}, "latitude": lat_deg, "longitude": -110.95, "altitude": 748.0,
        "position_covariance": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0], "position_covariance_type": 2,
    }  # fmt: skip


@pytest.mark.virtual_time
async def test_a_phone_far_from_the_car_is_shown_on_every_page(bridge: RosBridge) -> None:
    """Page → server → check → alarm on another page, and how the state shows it."""
    bridge.advertise("/gps_fix", "sensor_msgs/NavSatFix")
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    async with serving(config) as server, viewer(server) as operator, viewer(server) as other:
        await other.state(lambda s: s["signals"]["position"]["topic"] == "/gps_fix")
        for i in range(60):
            bridge.publish("/gps_fix", gps(32.23))
            if i % 4 == 0:
                answer = await say(operator, lat_deg=32.24, age_s=0.05)
                assert answer["ok"], answer
            found = await other.state()
            if any(alarm["id"] == "phone_car" for alarm in found["alarms"]):
                break
        assert found["phone"]["used"] is True
        assert found["phone"]["apart_m"] == pytest.approx(1108.8, abs=1.0)
        assert found["phone"]["bearing_deg"] == 180.0  # the phone is north of the car
        assert 0 <= found["phone"]["compared_age_s"] < 2.0
        (alarm,) = [alarm for alarm in found["alarms"] if alarm["id"] == "phone_car"]
        assert alarm["place"] == "dialog"
        assert alarm["text"].startswith("The phone is 1109 m from the car")
        async with http_client() as client:
            assert (await client.get(f"{server}/api/state")).json()["phone"]["id"] == "0a1b2c3d"
            text = (await client.get(f"{server}/metrics")).text
        assert 'catgraph_phones{vehicle="car"} 1' in text


@pytest.mark.virtual_time
async def test_what_does_not_fit_or_is_not_wanted_is_refused(bridge: RosBridge) -> None:
    async with serving(Config()) as server, viewer(server) as one:
        assert (await one.state())["phone"] is None
        answer = await say(one)
        assert answer == answer | {"ok": False, "reason": "No car is monitored: no position is needed."}
        answer = await say(one, lat_deg=91)
        assert answer["reason"] == "fix.lat_deg: Input should be less than or equal to 90."
        assert (await one.state())["phone"] is None


# -- whole drives, in virtual time -------------------------------------------------------------------------------------


def raised(found: Ride) -> list[tuple[str, float]]:
    return [(one.alarm, one.at_s) for one in found.events if one.change == "raised"]


@pytest.mark.parametrize(
    ("accuracy_m", "seed", "seconds"),
    [
        (5.0, 1, 100.0),
        pytest.param(3.0, 2, 300.0, marks=(pytest.mark.field, pytest.mark.slow)),
        pytest.param(10.0, 3, 300.0, marks=(pytest.mark.field, pytest.mark.slow)),
        pytest.param(20.0, 4, 300.0, marks=pytest.mark.slow),
    ],
)
def test_a_healthy_phone_in_the_car_raises_nothing_and_is_really_checked(
    accuracy_m: float, seed: int, seconds: float
) -> None:
    """Driving, braking and standing at the stop line; the phone's clock is seven hours off."""
    found = ride(Rider(seed=seed, accuracy_m=accuracy_m), seconds, seed=seed)
    assert found.events == []
    assert all("OK" in found.briefs[check] for check in ("phone_car", "phone_tracks", "phone_missing"))


@pytest.mark.parametrize("profile", ["generic", "catvehicle"])
def test_a_phone_left_behind_raises_the_gate_alone(profile: str) -> None:
    found = raised(ride(Rider(left_at_s=40.0), 75.0, profile=load_profiles()[profile]))
    assert [alarm for alarm, _ in found] == ["phone_car"]
    assert 42.0 < found[0][1] < 56.0  # the car is 25 m away some 5 s later


def test_a_phone_500_m_away_is_beyond_the_gate_although_its_track_correlates_perfectly() -> None:
    found = ride(Rider(offset=lambda _: (500.0, 0.0)), 30.0)
    assert [alarm for alarm, _ in raised(found)] == ["phone_car"]
    assert raised(found)[0][1] < 8.0


@pytest.mark.slow
def test_a_phone_that_is_away_for_a_while_is_reported_once_and_its_return_is_not() -> None:
    found = ride(Rider(offset=lambda t: (500.0, 0.0) if 40.0 < t < 60.0 else (0.0, 0.0)), 120.0)
    assert [(one.alarm, one.change) for one in found.events] == [("phone_car", "raised"), ("phone_car", "cleared")]


def test_case_07_a_permission_that_is_taken_away_is_reported_with_its_name() -> None:
    found = ride(Rider(why=lambda t: "denied" if 20.0 < t < 45.0 else None), 60.0)
    assert [(one.alarm, one.change) for one in found.events] == [
        ("phone_missing", "raised"),
        ("phone_missing", "cleared"),
    ]
    assert found.events[0].text == "Location permission denied on the phone"
    assert 28.0 < found.events[0].at_s < 31.0
    assert "FAULT: permission" in found.briefs["phone_missing"]


def test_without_a_phone_nothing_is_reported_of_one() -> None:
    found = ride(None, 30.0)
    assert found.events == []
    assert {frozenset(found.briefs[check]) for check in ("phone_car", "phone_tracks", "phone_missing")} == {
        frozenset({"no phone"})
    }


@pytest.mark.field
@pytest.mark.parametrize(
    ("scenario", "alarms"),
    [
        ("phone-mismatch@15+20", ["phone_car"]),
        ("gps-jump@20", ["gps_jump"]),  # one cause is one announcement
        pytest.param("gps-drift@20", ["gps_drift"], marks=pytest.mark.slow),
    ],
)
def test_faults_of_the_car_s_receiver_beside_a_healthy_phone(scenario: str, alarms: list[str]) -> None:
    assert ride(Rider(), 60.0, plan=[planned(scenario)]).raised == alarms
