"""The last minute over HTTP and in each state: what a page missed, it gets; what was not received is in no answer."""

from __future__ import annotations

import pytest

from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import driving
from tests.server.viewer import viewer


async def test_a_page_that_comes_late_gets_what_it_missed(bridge: RosBridge, server: str) -> None:
    async with viewer(server) as one, driving(bridge, speed=lambda n: 4.0 + 0.1 * (n % 5)), http_client() as http:
        state = await one.state(lambda s: sum(x is not None for x in s["trends"]["lowest"]["speed"]) == 4, 15)
        whole = (await http.get(f"{server}/api/trends")).json()
    carried = state["trends"]
    assert set(carried["lowest"]) == {"speed", "acceleration", "distance", "steering", "brake", "accelerator"}
    assert len(carried["lowest"]["speed"]) == 4
    assert carried["now"] - carried["first"] == pytest.approx(4, abs=1)
    at = carried["first"] - whole["first"]
    assert whole["lowest"]["speed"][at : at + 4] == carried["lowest"]["speed"]
    assert whole["highest"]["speed"][at : at + 4] == carried["highest"]["speed"]
    assert all(low >= 3.999 and high <= 4.401 for low, high in zip(*map(known, ends(whole)), strict=True))
    assert whole["first"] == whole["since"]
    assert known(whole["lowest"]["brake"]) == []  # not published: nothing is sent


async def test_only_what_came_after(server: str) -> None:
    async with http_client() as http:
        now = int((await http.get(f"{server}/api/trends")).json()["now"])
        later = (await http.get(f"{server}/api/trends", params={"after": now + 5})).json()
        assert later["lowest"]["speed"] == []
        for wrong in ("-1", "x", str(2**60), "1.5"):
            assert (await http.get(f"{server}/api/trends", params={"after": wrong})).status_code == 422
        assert (await http.get(f"{server}/api/trends", params={"vehicle": "none"})).status_code == 404


def ends(trends: dict[str, dict[str, list[float | None]]]) -> tuple[list[float | None], list[float | None]]:
    return trends["lowest"]["speed"], trends["highest"]["speed"]


def known(row: list[float | None]) -> list[float]:
    return [number for number in row if number is not None]
