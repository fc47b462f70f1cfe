"""A change is applied and then logged: a log, a recording or a state that fails undoes and hides nothing."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app.app import create_app
from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.server.cars import driving
from tests.server.conftest import serving_app
from tests.server.viewer import viewer

pytestmark = [pytest.mark.virtual_time, pytest.mark.world(n=16)]


def fails(*_: Any, **__: Any) -> Any:
    raise RuntimeError("broken on purpose")


async def test_a_limit_counts_although_the_log_fails_and_its_event_comes_later(
    bridge: RosBridge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    app = create_app(config, now=time.monotonic)
    bus = app.state.services.bus
    async with serving_app(app, config) as base, driving(bridge, speed=lambda _: 4.2), viewer(base) as page:
        await page.state(lambda state: state["signals"]["speed"]["freshness"] == "fresh")
        with monkeypatch.context() as patch:
            patch.setattr(bus, "append", fails)
            async with httpx.AsyncClient(base_url=base, timeout=20) as client:
                answer = await client.patch("/api/settings", json={"values": {"speed_limit.max_mps": 2.0}})
            assert answer.status_code == 200, answer.text
            await page.state(
                lambda state: (
                    any(alarm["id"] == "speed_limit" for alarm in state["alarms"])
                    and "The event log fails: RuntimeError: broken on purpose." in str(state)
                )
            )
        async with asyncio.timeout(10):
            while not bus.past_events("car", change="raised", alarm="speed_limit"):
                await asyncio.sleep(0.05)
        changes = [event["changes"] for event in bus.past_events("car", change="settings")]
        assert [change["speed_limit.max_mps"][1] for change in changes if "speed_limit.max_mps" in change] == [2.0]
        raised = bus.past_events("car", change="raised", alarm="speed_limit")
        assert len(raised) == 1  # delivered once, and late


@pytest.mark.parametrize("broken", ["frame", "_record_command"])
async def test_an_order_that_was_obeyed_is_answered_so(
    bridge: RosBridge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    app = create_app(config, now=time.monotonic)
    session: Session = app.state.services.sessions["car"]
    async with serving_app(app, config) as base, driving(bridge, speed=lambda _: 4.2), viewer(base) as page:
        await page.state(lambda state: state["signals"]["speed"]["freshness"] == "fresh")
        if broken == "frame":
            monkeypatch.setattr(session, "frame", fails)
        else:
            monkeypatch.setattr(session._parts.recording, "note_command", fails)
        async with httpx.AsyncClient(base_url=base, timeout=20) as client:
            answer = await client.post("/api/pause")
            assert answer.status_code == 200, answer.text
            assert session._parts.pause.since_s is not None
            answer = await client.post("/api/resume")
            assert answer.status_code == 200, answer.text
            assert session._parts.pause.since_s is None


async def test_a_limit_counts_before_it_is_logged(
    bridge: RosBridge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    app = create_app(config, now=time.monotonic)
    session: Session = app.state.services.sessions["car"]
    judged_by: list[float] = []
    monkeypatch.setattr(
        session._parts.event_log,
        "settings",
        lambda *_, **__: judged_by.append(session._parts.judgement.monitor.limits.speed_limit.max_mps),
    )
    async with serving_app(app, config) as base, driving(bridge, speed=lambda _: 4.2), viewer(base) as page:
        await page.state(lambda state: state["signals"]["speed"]["freshness"] == "fresh")
        judged_by.clear()
        async with httpx.AsyncClient(base_url=base, timeout=20) as client:
            await client.patch("/api/settings", json={"values": {"speed_limit.max_mps": 2.0}})
    assert judged_by == [2.0]
