"""Where a car is and how much energy it has, in its summary: nothing that is old or unknown looks as if it held."""

from __future__ import annotations

import math
from typing import Any

import pytest

from monitor.reading import Reading
from monitor.snapshot import Snapshot
from monitor.values import GpsFix, Heading, Level
from server.vehicle.car_summary import energy_percent, place

NOW_S = 100.0


def reading(value: Any, *, age_s: float = 0.1) -> Reading[Any]:
    return Reading(value=value, received_s=NOW_S - age_s, horizon_s=1.0, period_s=0.2)


def snapshot(**readings: Reading[Any]) -> Snapshot:
    return Snapshot(now_s=NOW_S, readings=readings)


def test_a_car_is_at_the_position_and_heading_of_its_gps() -> None:
    found = place(
        snapshot(position=reading(GpsFix(lat_deg=36.2, lon_deg=-115.0)), heading=reading(Heading(heading_deg=180.0))),
        NOW_S,
    )
    assert found == {
        "lat_deg": 36.2,
        "lon_deg": -115.0,
        "heading_rad": pytest.approx(-math.pi / 2, abs=1e-3),
        "freshness": "fresh",
        "age_s": 0.1,
    }


@pytest.mark.parametrize(("heading_deg", "heading_rad"), [(0, math.pi / 2), (90, 0), (270, math.pi), (359, 1.588)])
def test_a_heading_is_counter_clockwise_from_east(heading_deg: float, heading_rad: float) -> None:
    fix = reading(GpsFix(lat_deg=0.0, lon_deg=0.0))
    found = place(snapshot(position=fix, heading=reading(Heading(heading_deg=heading_deg))), NOW_S)
    assert found is not None
    assert found["heading_rad"] is not None
    assert abs(found["heading_rad"]) == pytest.approx(abs(heading_rad), abs=1e-3)


@pytest.mark.parametrize(
    "fix",
    [
        None,
        GpsFix(lat_deg=1.0, lon_deg=1.0, status=-1),
        GpsFix(lat_deg=math.nan, lon_deg=1.0),
        GpsFix(lat_deg=1.0, lon_deg=math.inf),
    ],
)
def test_without_a_fix_it_has_no_place(fix: GpsFix | None) -> None:
    assert place(snapshot() if fix is None else snapshot(position=reading(fix)), NOW_S) is None


def test_an_old_place_is_marked_as_old_and_an_old_heading_is_none() -> None:
    found = place(
        snapshot(
            position=reading(GpsFix(lat_deg=1.0, lon_deg=2.0), age_s=20.0),
            heading=reading(Heading(heading_deg=90.0), age_s=20.0),
        ),
        NOW_S,
    )
    assert found is not None
    assert (found["freshness"], found["age_s"], found["heading_rad"]) == ("stale", 20.0, None)


@pytest.mark.parametrize(
    ("level", "age_s", "percent"),
    [
        (Level(value=42.04, unit="%"), 0.1, 42.0),
        (Level(value=42.0, unit="%"), 5.0, None),
        (Level(value=42.0, unit="l"), 0.1, None),
        (Level(value=math.nan, unit="%"), 0.1, None),
    ],
)
def test_energy_is_a_fresh_percentage_or_unknown(level: Level, age_s: float, percent: float | None) -> None:
    assert energy_percent(snapshot(fuel=reading(level, age_s=age_s)), NOW_S) == percent


def test_a_car_that_does_not_say_its_energy_has_none() -> None:
    assert energy_percent(snapshot(), NOW_S) is None
