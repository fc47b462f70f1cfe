"""The track as pages and programs get it: whole when they come late, only what is new afterwards, per car anew."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.state import Snapshot, TrackPoint
from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle import queries
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.cars import twist
from tests.server.conftest import serving
from tests.server.vehicle.test_phone import gps
from tests.server.viewer import viewer

pytestmark = pytest.mark.virtual_time


def point(number: int, **more: Any) -> TrackPoint:
    return TrackPoint(at_s=10.0 * number, lat_deg=32.0 + number, lon_deg=-110.0, distance_m=1.0, number=number, **more)


SNAPSHOT = Snapshot(
    now_s=100.0,
    track=(point(1), point(2), point(5, is_jump=True), point(6), point(7, is_after_gap=True), point(9), point(10)),
    track_m=7.04,
)


@pytest.mark.parametrize(
    ("after", "numbers"), [(0, [1, 2, 5, 6, 7, 9, 10]), (5, [6, 7, 9, 10]), (8, [9, 10]), (10, [])]
)
def test_only_what_is_new(after: int, numbers: list[int]) -> None:
    found = queries.track_points(SNAPSHOT, number=3, after=after)
    assert found["number"] == 3
    assert [row[0] for row in found["points"]] == numbers


def test_a_point_tells_place_time_and_how_it_joins() -> None:
    rows = queries.track_points(SNAPSHOT, number=1, after=2)["points"]
    assert rows[0] == (5, 37.0, -110.0, 50.0, 2)
    assert [row[4] for row in rows] == [2, 0, 1, 0, 0]


def test_as_geojson_a_line_ends_where_the_way_is_not_known() -> None:
    found = queries.track(SNAPSHOT)
    assert found["geometry"]["type"] == "MultiLineString"
    assert [[lat for _, lat in line] for line in found["geometry"]["coordinates"]] == [
        [33.0, 34.0],
        [37.0, 38.0],
        [39.0, 41.0, 42.0],
    ]
    assert found["properties"] == {"length_m": 7.0}
    assert queries.track(Snapshot(now_s=0.0, track=(point(1),)))["geometry"]["coordinates"] == []


async def test_a_track_grows_is_sent_by_number_and_another_connection_is_another(bridge: RosBridge) -> None:
    bridge.advertise("/gps_fix", "sensor_msgs/NavSatFix")
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    async with serving(config) as base, viewer(base) as one, http_client(base_url=base) as client:
        await one.state(lambda s: s["signals"]["position"]["topic"] == "/gps_fix")
        number = one.states[-1]["session"]["track"]["number"]
        assert one.states[-1]["session"]["track"]["last"] == 0
        for n in range(12):
            bridge.publish("/catvehicle/vel", twist(5.0))
            bridge.publish("/gps_fix", gps(32.23 + n * 5e-5) | {"header": {"stamp": {"secs": 1 + n, "nsecs": 0}}})
            await one.state(lambda s, n=n: s["signals"]["position"]["count"] > n)
        state = await one.state(lambda s: s["session"]["track"]["last"] >= 3)
        whole = (await client.get("/api/track/points")).json()
        last = whole["points"][-1][0]
        assert last >= state["session"]["track"]["last"] >= 3
        assert whole["points"][0][:3] == [1, 32.23, -110.95]
        rest = (await client.get("/api/track/points", params={"after": last - 1})).json()
        assert rest == {"number": number, "points": whole["points"][-1:]}
        assert (await client.get("/api/track/points", params={"after": -1})).status_code == 422
        assert (await client.get("/api/track")).json()["geometry"]["coordinates"][0][0] == [-110.95, 32.23]
        assert state["signals"]["position"]["value"]["covariance_m2"] == [1.0, 1.0, 0.0]
        await one.ask(kind="connect", address=bridge.address)  # type: ignore[attr-defined]
        state = await one.state(lambda s: s["session"]["track"]["number"] > number)
        assert state["session"]["track"]["last"] == 0
        assert (await client.get("/api/track/points")).json()["points"] == []
