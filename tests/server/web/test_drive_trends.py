"""The whole drive over HTTP: of the live car and of its recording the same, bounded and refused in sentences."""

from __future__ import annotations

import pytest

from server.protocol.answers import DriveTrendsAnswer
from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import driving
from tests.server.viewer import viewer

pytestmark = pytest.mark.virtual_time


async def test_a_drive_is_told_in_buckets(bridge: RosBridge, server: str) -> None:
    async with viewer(server) as one, driving(bridge, speed=lambda n: 4.0 + 0.1 * (n % 5)), http_client() as http:
        await one.state(lambda s: sum(x is not None for x in s["trends"]["lowest"]["speed"]) == 4, 15)
        answer = await http.get(f"{server}/api/trends/drive", params={"signals": "speed,brake", "buckets": 100})
        state = (await http.get(f"{server}/api/state")).json()
    drive: DriveTrendsAnswer = answer.json()
    assert list(drive["signals"]) == ["speed", "brake"]
    speed = drive["signals"]["speed"]
    known = [low for low in speed["lowest"] if low is not None]
    assert known
    assert all(3.999 <= low <= 4.401 for low in known)
    assert len(speed["lowest"]) == len(speed["highest"]) <= 102
    assert speed["limits"] == [[0.0, state["limits"]["speed_limit.max_mps"]]]
    brake = drive["signals"]["brake"]
    assert set(brake["lowest"]) == {None}
    assert len(brake["gaps"]) == 1  # nothing ever came
    assert drive["offered"]["speed"] == {"label": "Speed", "unit": "m/s", "has_data": True}
    assert drive["offered"]["position"]["label"] == "Altitude"
    assert not drive["offered"]["brake"]["has_data"]
    assert drive["known_s"] == drive["length_s"]
    assert drive["start_ms"] + drive["length_s"] * 1000 == pytest.approx(state["server"]["time_ms"], abs=3000)
    assert {mark["alarm"] for mark in drive["marks"]} <= {alarm["id"] for alarm in state["checks"]} | {"link"}


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"signals": "nothing"}, "No signal is named 'nothing'"),
        ({"signals": "speed,brake,steering,distance,bearing"}, "At most 4 signals"),
        ({"signals": ""}, "No signal is named ''"),
        ({"from_s": 5, "to_s": 4}, "ends before it begins"),
        ({"from_s": -1}, "from_s"),
        ({"from_s": "nan"}, "from_s"),
        ({"to_s": "inf"}, "to_s"),
        ({"buckets": 9}, "buckets"),
        ({"buckets": 601}, "buckets"),
    ],
)
async def test_what_cannot_be_answered_is_refused_in_a_sentence(
    server: str, wrong: dict[str, str], sentence: str
) -> None:
    async with http_client() as http:
        answer = await http.get(f"{server}/api/trends/drive", params=wrong)
    assert answer.status_code == 422
    assert sentence in answer.json()["detail"]


async def test_no_such_vehicle_and_no_such_replay(server: str) -> None:
    async with http_client() as http:
        for missing in ({"vehicle": "none"}, {"replay": "0000"}):
            assert (await http.get(f"{server}/api/trends/drive", params=missing)).status_code == 404
