"""The tyre angle belongs to the kind of car; where it is not known, nothing is commanded that would turn the tyres."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.alarm import Refused
from monitor.catalog import CHECKS, AllLimits
from monitor.obstacle_view import corridor_ahead
from monitor.state import State
from monitor.values import Steering, Twist
from server.judge import pipeline, profiles
from server.judge.active_settings import ActiveSettings
from server.judge.profiles import GENERIC, Profile
from server.judge.reception_stats import Reception
from server.judge.settings import Settings, SettingsFile, from_toml
from server.judge.sources.choice import choose
from server.slowdown.controller import NO_STEERING, STEERING_NOT_KNOWN
from tests.monitor.checks.known import known
from tests.monitor.test_corridor import sweep
from tests.server.slowdown.rig import Rig

pytestmark = pytest.mark.world(n=12)
TURNED = Steering(percent=-20.0, tyre_rad=0.1072)
FILE_BEFORE = 'version = 7\nprofile = "catvehicle"\n[topics]\n[limits.speed_limit]\nmax_mps = 9.0\n'


def ratio(profile: Profile, settings: Settings | None = None) -> float:
    found: float = (settings or Settings()).limits(profile).steering.tyre_rad_per_unit
    return found


def received(number: float, profile: Profile, tyre_rad_per_unit: float, chosen: str | None = None) -> Steering:
    """What becomes of a message of the steering topic. `chosen`: its unit, by the operator."""
    found = value_of(number, profile, tyre_rad_per_unit, chosen)
    assert found is not None
    return found


def value_of(number: float, profile: Profile, tyre_rad_per_unit: float, chosen: str | None = None) -> Steering | None:
    """The same; None: its unit is not known."""
    state = State()
    sources = pipeline.by_topic(choose({"/catvehicle/steering": "geometry_msgs/Wrench"}, {}).sources.values())
    pipeline.receive(
        sources["/catvehicle/steering"],
        {"force": {"x": 0.0, "y": 0.0, "z": 0.0}, "torque": {"x": 0.0, "y": 0.0, "z": number}},
        1.0,
        None,
        reception=Reception(),
        state=state,
        profile=profile,
        tyre_rad_per_unit=tyre_rad_per_unit,
        units={} if chosen is None else {"steering": chosen},
    )
    reading = state.get("steering")
    return None if reading is None else reading.value


@pytest.mark.parametrize(
    ("name", "kind", "per_unit"),
    [
        ("catvehicle", "percent", -0.00536),
        ("catvehicle-sim", "tyre_angle", 1.0),
        ("ros2-generic", "unknown", 0.0),
        ("generic", "unknown", 0.0),
    ],
)
def test_each_kind_of_car_has_its_own_steering(name: str, kind: str, per_unit: float) -> None:
    profile = profiles.load()[name]
    assert (profile.steering, ratio(profile)) == (kind, per_unit)


def test_the_angle_follows_from_kind_and_ratio_and_a_team_may_set_it() -> None:
    cars = profiles.load()
    assert received(-20.0, cars["catvehicle"], -0.00536).tyre_rad == pytest.approx(0.1072)
    turned = received(0.1072, cars["catvehicle-sim"], 1.0)
    assert (turned.tyre_rad, turned.percent) == (pytest.approx(0.1072), pytest.approx(-20.0))
    assert value_of(-20.0, GENERIC, 0.0) is None  # percent or degrees: nothing states which
    assert received(-20.0, GENERIC, 0.0, "percent") == Steering(percent=-20.0)
    own = from_toml("[limits.steering]\ntyre_rad_per_unit = 0.0625\n")  # a steering wheel of 16:1, positive = left
    assert received(1.6, GENERIC, ratio(GENERIC, own)).tyre_rad == pytest.approx(0.1)


def test_settings_of_before_are_read_and_the_kind_of_car_decides_the_rest() -> None:
    read = from_toml(FILE_BEFORE, known_profiles=profiles.load())
    assert (read.version, read.values) == (7, {"speed_limit.max_mps": 9.0})
    assert ratio(profiles.load()[read.profile], read) == -0.00536


def test_where_the_steering_is_not_known_it_cannot_be_armed_and_names_why() -> None:
    rig = Rig(steering=Steering(percent=3.0))
    rig.slowing.car.is_steering_known = False
    rig.pass_time(0.1)
    frame = rig.slowing.frame()
    assert (frame["state"], frame["why"]) == ("not_available", STEERING_NOT_KNOWN)
    with pytest.raises(Refused, match="steering of this kind of car is not known"):
        rig.execute("arm")
    with pytest.raises(Refused):
        rig.execute("slow_down")
    rig.pass_time(1.0)
    assert rig.link.angles == []


def test_before_any_steering_has_come_it_cannot_be_armed() -> None:
    rig = Rig(steering=None)
    assert rig.slowing.frame()["why"] == NO_STEERING
    rig.steering = TURNED
    rig.pass_time(0.1)
    rig.execute("arm")
    rig.execute("slow_down")
    rig.pass_time(0.5)
    assert set(rig.link.angles) == {0.1072}


def test_steering_that_falls_silent_before_or_in_an_order_is_held_as_it_was_last_known() -> None:
    rig = Rig(steering=TURNED)
    rig.execute("arm")
    rig.steering = None
    rig.pass_time(8.0)  # far beyond its freshness
    assert rig.slowing.frame()["state"] == "armed"
    rig.execute("slow_down")
    rig.pass_time(0.5)
    assert set(rig.link.angles) == {0.1072}
    assert any("no longer measured: the last known angle is held" in note for note in rig.notes)
    rig.slowing.link_closed()
    rig.pass_time(0.2)
    rig.slowing.link_opened(rig.link)  # type: ignore[arg-type]
    rig.pass_time(2.0)
    assert set(rig.link.angles) == {0.1072}
    assert len(rig.link.angles) > 20


@pytest.mark.parametrize("kept", [{}, {"tyre_rad": 0.05}])
def test_an_order_that_stood_over_a_restart_commands_nothing_before_an_angle_is_known(kept: dict[str, Any]) -> None:
    rig = Rig(steering=None)
    rig.slowing.resume({"by": "Ann", "why": "by hand", **kept})
    rig.pass_time(2.0)
    assert set(rig.link.angles) == set(kept.values())
    rig.steering = TURNED
    rig.pass_time(1.0)
    assert set(rig.link.angles) == (set(kept.values()) or {0.1072})


def test_the_corridor_is_straight_and_marked_where_the_steering_is_not_known() -> None:
    speed = Twist(speed_mps=4.5, yaw_rate_radps=None)
    limits = AllLimits()
    scan = sweep([(60.0, 0.0, 50.0)])
    blind = known(scan=scan, speed=speed, steering=Steering(percent=-20.0))
    bent = known(scan=scan, speed=speed, steering=TURNED)
    assert corridor_ahead(blind, limits.obstacle).tyre_angle_rad == 0.0
    assert corridor_ahead(bent, limits.obstacle).tyre_angle_rad == pytest.approx(0.105)
    check = next(check for check in CHECKS if check.id == "obstacle")
    assert "steering unknown" in check.find(blind, limits.obstacle, False).text
    assert "steering unknown" not in check.find(bent, limits.obstacle, False).text


def test_choosing_the_kind_of_car_makes_its_steering_known() -> None:
    tuning = ActiveSettings(SettingsFile(None))
    assert tuning.limits.steering.tyre_rad_per_unit == 0.0
    tuning.change(values={}, topics={}, profile="catvehicle", version=None)
    assert tuning.limits.steering.tyre_rad_per_unit == -0.00536
    tuning.change(values={"steering.tyre_rad_per_unit": 0.0625}, topics={}, profile=None, version=None)
    assert tuning.limits.steering.tyre_rad_per_unit == 0.0625
