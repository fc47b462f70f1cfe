"""The tables of the CSV export: which columns a signal has and which of catgraph's own channels have one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from monitor.values import Diagnostics, LaserScan

TIMES = ("time", "since start [s]", "stamp by the car [s since 1970]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """What one signal becomes."""

    what: str  # for the reader of README.txt
    columns: tuple[str, ...]  # with their units
    rows: Callable[[Any], Iterator[tuple[Any, ...]]]  # of one value; mostly one


def _table(what: str, **columns: str) -> Table:
    """Field of the value → its column."""
    get = attrgetter(*columns)

    def rows(value: Any) -> Iterator[tuple[Any, ...]]:
        found = get(value)
        yield found if len(columns) > 1 else (found,)

    return Table(what=what, columns=tuple(columns.values()), rows=rows)


def _scan(scan: LaserScan) -> Iterator[tuple[Any, ...]]:
    nearest = scan.nearest
    yield (
        scan.beams,
        scan.usable,
        None if nearest is None else round(nearest[0], 4),
        None if nearest is None else round(nearest[1], 6),
        scan.angle_min_rad,
        scan.angle_max_rad,
        scan.angle_increment_rad,
        scan.range_min_m,
        scan.range_max_m,
        scan.frame_id,
    )


def _components(diagnostics: Diagnostics) -> Iterator[tuple[Any, ...]]:
    for component in diagnostics.components:
        yield component.name, component.level, component.message


TABLES: Mapping[str, Table] = {
    "speed": _table("Speed of the car, forward positive.", speed_mps="speed [m/s]", yaw_rate_radps="yaw rate [rad/s]"),
    "acceleration": _table("Longitudinal acceleration.", acceleration_mps2="acceleration [m/s^2]"),
    "brake": _table("How far the brake is pressed.", percent="brake [%]"),
    "accelerator": _table("How far the accelerator is pressed.", percent="accelerator [%]"),
    "steering": _table("How far the steering is turned, negative = left.", percent="steering [%]"),
    "distance": _table(
        "Distance to the nearest object ahead, by the car's estimator. Empty: nothing in range, or it did not say.",
        distance_m="distance [m]",
        none_in_range="none in range",
    ),
    "bearing": _table("Where the nearest object is: counter-clockwise, 0 = ahead.", bearing_rad="bearing [rad]"),
    "position": _table(
        "Position on the WGS84 ellipsoid. Status -1 = no fix. Sigma is the horizontal one-sigma error where the "
        "receiver states a trustworthy one.",
        lat_deg="latitude [deg]",
        lon_deg="longitude [deg]",
        alt_m="altitude above the ellipsoid [m]",
        status="status",
        sigma_m="sigma [m]",
        covariance_type="covariance type",
    ),
    "odometry": _table(
        "Pose in the frame named, speed in the body frame.",
        x_m="x [m]",
        y_m="y [m]",
        z_m="z [m]",
        yaw_rad="yaw [rad]",
        speed_mps="speed [m/s]",
        frame_id="frame",
    ),
    "heading": _table("Compass heading, 0 = north, clockwise.", heading_deg="heading [deg]"),
    "scan": Table(
        what="Laser: one row a scan, with its nearest usable return. The ranges are in the MCAP and the bag.",
        columns=(
            "beams",
            "usable beams",
            "nearest [m]",
            "nearest bearing [rad]",
            "angle min [rad]",
            "angle max [rad]",
            "angle increment [rad]",
            "range min [m]",
            "range max [m]",
            "frame",
        ),
        rows=_scan,
    ),
    "diagnostics": Table(
        what="The car's own diagnostics, one row a component. Level 0 OK, 1 WARN, 2 ERROR, 3 STALE.",
        columns=("component", "level", "message"),
        rows=_components,
    ),
    "command": _table("What the car was asked to do.", speed_mps="speed [m/s]", tyre_angle_rad="tyre angle [rad]"),
    "fuel": _table("What is left of fuel or charge.", value="level", unit="unit"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnTable:
    """What one of catgraph's own channels becomes; what has no column stands in `details` as JSON."""

    what: str
    file: str
    columns: Mapping[str, str]  # column → where the value is, dots between the levels


OWN_TABLES: Mapping[str, OwnTable] = {
    "/catgraph/phone": OwnTable(
        what="What operators' phones said of their own position (WGS84), or why they could not.",
        file="phone.csv",
        columns={
            "phone": "phone",
            "by": "by",
            "latitude [deg]": "fix.lat_deg",
            "longitude [deg]": "fix.lon_deg",
            "accuracy [m]": "fix.accuracy_m",
            "altitude above the ellipsoid [m]": "fix.alt_m",
            "speed [m/s]": "fix.speed_mps",
            "heading [deg]": "fix.heading_deg",
            "age [s]": "fix.age_s",
            "why not": "why",
        },
    ),
    "/catgraph/operator": OwnTable(
        what="What operators asked for, and whether it was done.",
        file="operator.csv",
        columns={"kind": "kind", "by": "by", "done": "ok", "reason": "reason"},
    ),
    "/catgraph/commands": OwnTable(
        what="What was sent to the car.",
        file="commands.csv",
        columns={"topic": "topic", "type": "type", "by": "by"},
    ),
    "/catgraph/delay": OwnTable(
        what="How late the link was, whenever that changed. `delays` in the details: of each topic's newest message.",
        file="delay.csv",
        columns={"late [s]": "late_s", "asked for less": "reduced"},
    ),
    "/catgraph/link": OwnTable(
        what="The link to the car whenever it changed.",
        file="link.csv",
        columns={"phase": "phase", "address": "address", "problem": "problem"},
    ),
}
