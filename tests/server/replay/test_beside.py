"""A second recording beside the one that a page replays: each at its own moment, closed alone or with the first."""

from __future__ import annotations

import asyncio
import signal
from pathlib import Path
from typing import Any

import pytest

from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import driving
from tests.server.replay.conftest import STREET
from tests.server.replay.test_replay_socket import at, order, replays
from tests.server.viewer import Viewer, viewer

OTHER = "car_20260921T142640Z"


async def beside(one: Viewer, at_s: float) -> dict[str, Any]:
    """The second recording, once it shows this moment."""
    found: dict[str, Any] = await one.until(
        lambda: next(
            (
                m
                for m in reversed(one.other)
                if m["kind"] == "beside" and m["replay"]["at_s"] == at_s and not m["replay"]["is_seeking"]
            ),
            None,
        ),
    )
    return found


@pytest.mark.field
async def test_a_second_recording_is_led_apart_and_closed_while_the_first_stays(bridge: RosBridge, base: str) -> None:
    async with driving(bridge, speed=lambda n: 4.2), viewer(base) as one:
        assert (await order(one, "beside", recording=OTHER))["reason"] == "This page shows no replay."
        await order(one, "open", recording=STREET, at_s=25.0)
        assert (await order(one, "seek", at_s=1.0, beside=True))["reason"] == "No recording is shown beside this one."
        same = await order(one, "beside", recording=STREET)
        assert same["reason"] == "This recording is shown already: choose another one."
        assert (await order(one, "beside", recording=OTHER, at_s=6.0))["ok"]
        second = await beside(one, 6.0)
        first = await at(one, 25.0)
        assert first["signals"]["speed"]["value"]["speed_mps"] == 12.5
        assert second["replay"]["id"] == OTHER
        assert second["replay"]["alarms_from"] == "recording"
        assert second["state"]["signals"]["speed"]["value"]["speed_mps"] < 12.5
        assert first["live"]["phase"] == "monitoring"
        assert "live" not in second["state"]
        await order(one, "seek", at_s=14.0, beside=True)
        await beside(one, 14.0)
        await at(one, 25.0)
        async with http_client() as client:
            tokens = [frame["replay"]["token"] for frame in (first, second)]
            lengths = [
                (await client.get(f"{base}/api/trends/drive", params={"replay": token})).json()["length_s"]
                for token in tokens
            ]
        assert lengths == [first["replay"]["length_s"], second["replay"]["length_s"]]
        assert len(replays()) == 2
        assert (await order(one, "alone"))["ok"]
        await at(one, 25.0)
        assert len(replays()) == 1


@pytest.mark.field
async def test_leaving_the_replay_closes_both(bridge: RosBridge, base: str) -> None:
    async with driving(bridge), viewer(base) as one:
        await order(one, "open", recording=STREET)
        await order(one, "beside", recording=OTHER)
        assert len(replays()) == 2
        assert (await order(one, "leave"))["ok"]
        await one.state(lambda s: "replay" not in s)
        assert replays() == []
    async with asyncio.timeout(5):
        while replays():
            await asyncio.sleep(0.05)


async def test_what_is_no_recording_is_refused_in_words_and_the_first_stays(
    bridge: RosBridge, base: str, data: Path
) -> None:
    (data / "recordings" / "car" / f"{OTHER}.mcap").write_bytes(b"no recording at all")
    async with viewer(base) as one:
        await order(one, "open", recording=STREET, at_s=3.0)
        gone = await order(one, "beside", recording="nobody")
        assert gone["reason"] == "There is no recording named nobody."
        damaged = await order(one, "beside", recording=OTHER)
        assert OTHER in damaged["reason"]
        assert str(data) not in damaged["reason"]
        await at(one, 3.0)
        assert len(replays()) == 1


@pytest.mark.field
async def test_a_process_that_dies_ends_the_second_alone(bridge: RosBridge, base: str) -> None:
    async with viewer(base) as one:
        await order(one, "open", recording=STREET, at_s=3.0)
        before = {process.pid for process in replays()}
        await order(one, "beside", recording=OTHER)
        [second] = [process for process in replays() if process.pid not in before]
        second.send_signal(signal.SIGKILL)
        message = await one.until(lambda: next((m for m in one.other if m["kind"] == "beside_ended"), None))
        assert message["ended"].startswith("The replay failed")
        await at(one, 3.0)
        assert {process.pid for process in replays()} == before
