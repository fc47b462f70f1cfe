"""Whatever the numbers are, no check fails, and nobody reads "nan": decoding keeps most of these out, and the judge
does not rely on it."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from monitor.catalog import CHECKS
from monitor.check import Finding
from monitor.phones import PhoneReport
from monitor.state import LinkFacts, NotFresh, Snapshot, State
from monitor.values import (
    Acceleration,
    Bearing,
    Component,
    Diagnostics,
    Distance,
    Effort,
    GpsFix,
    Heading,
    LaserScan,
    Level,
    MotionCommand,
    Odometry,
    PhoneFix,
    Steering,
    Twist,
    Value,
)

NO_NUMBER = re.compile(r"\b(nan|inf)\b", re.IGNORECASE)

odd = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-310, -1e-310])
number = st.one_of(odd, st.floats(-40, 40))
latitude = st.sampled_from([90.0, -90.0, 89.99999, -89.99999, 0.0, 32.0, 32.00001, 32.01, math.nan])
longitude = st.sampled_from([180.0, -180.0, 179.99999, -179.99999, 0.0, -110.0, -110.00001, math.nan])
range_m = st.one_of(st.floats(0, 90, width=32), st.sampled_from([math.nan, math.inf, -math.inf, -1.0, 3e38]))
angle = st.one_of(st.floats(-7, 7), st.sampled_from([-1.0, 1.0, 0.1, -0.1, 0.0, 1e-310, -1e-310]))


@st.composite
def scans(draw: st.DrawFn) -> LaserScan:
    ranges = draw(st.lists(range_m, max_size=40))
    return LaserScan(
        ranges_m=np.array(ranges, dtype=np.float32),
        angle_min_rad=draw(angle),
        angle_max_rad=draw(angle),
        angle_increment_rad=draw(angle),
        time_increment_s=draw(st.floats(0, 10)),
        scan_time_s=draw(st.floats(0, 10)),
        range_min_m=draw(range_m),
        range_max_m=draw(range_m),
        frame_id="laser",
    )


values: dict[str, st.SearchStrategy[Value]] = {
    "speed": st.builds(Twist, speed_mps=number, yaw_rate_radps=st.one_of(st.none(), number)),
    "acceleration": st.builds(Acceleration, acceleration_mps2=number),
    "brake": st.builds(Effort, percent=number),
    "accelerator": st.builds(Effort, percent=number),
    "steering": st.builds(Steering, percent=number),
    "distance": st.builds(Distance, distance_m=st.one_of(st.none(), number)),
    "bearing": st.builds(Bearing, bearing_rad=st.one_of(st.none(), number)),
    "position": st.builds(
        GpsFix,
        lat_deg=latitude,
        lon_deg=longitude,
        alt_m=st.one_of(st.none(), number),
        status=st.integers(-2, 3),
        covariance_type=st.integers(0, 3),
        sigma_m=st.one_of(st.none(), st.floats(1e-6, 1e6)),
    ),
    "odometry": st.builds(
        Odometry, x_m=number, y_m=number, yaw_rad=number, speed_mps=number, frame_id=st.sampled_from(["map", "odom"])
    ),
    "heading": st.builds(Heading, heading_deg=number),
    "scan": scans(),
    "diagnostics": st.builds(
        Diagnostics,
        components=st.lists(
            st.builds(Component, name=st.sampled_from(["", "gps"]), level=st.integers(-1, 5), message=st.just("")),
            max_size=3,
        ).map(tuple),
    ),
    "command": st.builds(
        MotionCommand, speed_mps=st.one_of(st.none(), number), tyre_angle_rad=st.one_of(st.none(), number)
    ),
    "fuel": st.builds(Level, value=number, unit=st.sampled_from(["%", "l", ""])),
}
phones = st.builds(
    PhoneFix,
    lat_deg=latitude.filter(math.isfinite),
    lon_deg=longitude.filter(math.isfinite),
    accuracy_m=st.floats(0.1, 500),
)
events = st.lists(
    st.tuples(
        st.sampled_from([0.0, 0.02, 0.05, 0.1, 0.1, 0.5, 1.5, -0.2, -5.0]),
        st.sampled_from([*sorted(values), "phone"]).flatmap(
            lambda name: st.tuples(st.just(name), phones if name == "phone" else values[name])
        ),
        st.one_of(st.none(), st.sampled_from([0.0, 1.7e9, 1.7e9 + 0.1, 1e11, -1.0])),
    ),
    min_size=1,
    max_size=30,
)


def findings(snapshot: Snapshot) -> list[tuple[str, Finding]]:
    found = []
    for check in CHECKS:
        for was_active in (False, True):
            try:
                found.append((check.id, check.find(snapshot, check.limits(), was_active)))
            except NotFresh:
                continue
    return found


def look_at(snapshot: Snapshot) -> None:
    for name, finding in findings(snapshot):
        assert not NO_NUMBER.search(f"{finding.text} {finding.brief}"), (name, finding.text)
        for quantity in (finding.measured, finding.limit):
            assert quantity is None or math.isfinite(quantity.value), (name, finding)


@settings(max_examples=200)
@given(happening=events, published=st.booleans())
@example(
    happening=[
        (
            0.1,
            (
                "scan",
                LaserScan(
                    ranges_m=np.full(3, 5.0, dtype=np.float32),
                    angle_min_rad=-1.0,
                    angle_max_rad=1.0,
                    angle_increment_rad=1e-310,
                    time_increment_s=0.0,
                    scan_time_s=0.0,
                    range_min_m=0.1,
                    range_max_m=80.0,
                    frame_id="laser",
                ),
            ),
            None,
        )
    ],
    published=True,
)
def test_no_check_fails_and_nobody_reads_nan(happening: list[Any], published: bool) -> None:
    state = State()
    state.link(
        LinkFacts(
            phase="monitoring",
            connected_s=0.0,
            bridge_answers=True,
            wall_zero_s=1.7e9,
            published=frozenset(values) if published else frozenset(),
        )
    )
    now_s = 10.0
    for later_s, (name, value), stamp_s in happening:
        now_s += later_s
        if name == "phone":
            report = PhoneReport(phone="one", is_handheld=True, fix=value, measured_s=now_s)
            state.receive_phone(report, now_s)
        else:
            state.receive(name, value, now_s, stamp_s)
        look_at(state.snapshot(now_s))
    look_at(state.snapshot(now_s + 3.0))
