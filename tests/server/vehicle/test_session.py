"""The session on a real bridge: phases, silence and its place, bad messages, reconnection."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import numpy as np
import orjson
import psutil
import pytest

from server.app.app import create_app
from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from server.web.fair_wakeup import FairWakeup
from tests.http import http_client
from tests.server import scan_frames
from tests.server.cars import driving, scan, twist
from tests.server.conftest import serving, serving_app
from tests.server.viewer import viewer


def is_live(state: dict[str, Any]) -> bool:
    return state["link"]["cut"] is None and state["signals"]["speed"]["freshness"] == "fresh"


@pytest.mark.virtual_time
async def test_speed_reaches_the_page(bridge: RosBridge, server: str) -> None:
    async with driving(bridge, speed=lambda n: 4.23), viewer(server) as one:
        state = await one.state(is_live)
        speed = state["signals"]["speed"]
        assert speed["value"]["speed_mps"] == 4.23
        assert speed["topic"] == "/catvehicle/vel"
        assert state["session"]["phase"] == "monitoring"
        assert state["session"]["ros_version"] == 1
        assert state["signals"]["fuel"]["freshness"] == "not_published"
        assert state["signals"]["scan"]["freshness"] == "never"


@pytest.mark.virtual_time
async def test_events_reach_a_page_before_a_state_is_made(bridge: RosBridge) -> None:
    """To make a state takes milliseconds: an alarm does not wait for it."""
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    app, speeds = create_app(config, now=time.monotonic), {"now": 4.2}
    turns, due = FairWakeup(), asyncio.Event()  # a page as the hub wakes it
    noticed, shown = [False], [False]  # whether the alarm is raised: by the events of a page, and by the states
    was_noticed_first: list[bool] = []

    async with serving_app(app, config), driving(bridge, speed=lambda _: speeds["now"]):
        bus = app.state.services.bus

        def watch(kind: str) -> None:
            if kind == "events":
                turns.queue(due, is_urgent=True)
            elif kind == "state":
                alarms = orjson.loads(bus.newest("car", "state").payload)["alarms"]
                if (
                    is_raised := any(one["id"] == "speed_limit" and one["state"] == "UNACKED" for one in alarms)
                ) != shown[-1]:
                    shown.append(is_raised)
                    was_noticed_first.append(noticed[-1] == is_raised)

        async def page() -> None:
            while True:
                await due.wait()
                due.clear()
                changes = [event["change"] for event in bus.recent_events("car", 0) if event["alarm"] == "speed_limit"]
                noticed.append(changes[-1:] == ["raised"])

        writer = asyncio.create_task(page())
        bus.watch("car", watch)
        async with asyncio.timeout(30):
            for count, speed in enumerate((12.6, 4.2, 12.6, 4.2), 1):
                speeds["now"] = speed
                while len(was_noticed_first) < count:
                    await asyncio.sleep(0.02)
        writer.cancel()
    assert any(was_noticed_first)  # the machine may stand still between; with a state made at once none is


@pytest.mark.virtual_time
async def test_a_killed_bridge_is_reported_at_once_and_data_flow_again(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one:
        await one.state(is_live)
        await bridge.kill()
        state = await one.state(lambda s: s["link"]["cut"] == "server-bridge", within_s=2.0)
        assert state["session"]["phase"] == "lost"
        await asyncio.sleep(1.0)
        await bridge.revive()
        await one.state(is_live, within_s=4.0)


@pytest.mark.virtual_time
async def test_a_frozen_bridge_is_reported_within_2_s_and_data_flow_again(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one:
        await one.state(is_live)
        bridge.freeze()
        state = await one.state(lambda s: s["link"]["cut"] == "server-bridge", within_s=2.0)
        assert state["link"]["problem"]["code"] == "bridge_silent"
        await asyncio.sleep(4.0)  # long enough for the link to have been dropped and dialled in vain
        assert one.states[-1]["link"]["problem"]["code"] == "bridge_silent"
        bridge.thaw()
        await one.state(is_live, within_s=4.0)


@pytest.mark.virtual_time
async def test_a_silent_car_is_distinguished_from_a_silent_bridge(bridge: RosBridge, server: str) -> None:
    async with viewer(server) as one:
        async with driving(bridge):
            await one.state(is_live)
        state = await one.state(lambda s: s["link"]["cut"] == "bridge-car", within_s=2.0)
        assert state["link"]["problem"]["code"] == "car_silent"
        assert state["link"]["bridge_age_s"] < 1.5
        async with driving(bridge):
            await one.state(is_live, within_s=1.0)


@pytest.mark.virtual_time
async def test_nothing_after_connecting_is_reported_after_5_s(server: str) -> None:
    start_s = time.monotonic()
    async with viewer(server) as one:
        state = await one.state(lambda s: s["link"]["cut"] == "bridge-car", within_s=7.0)
        assert state["link"]["problem"]["code"] == "no_message"
        assert time.monotonic() - start_s == pytest.approx(5.0, abs=0.1)


@pytest.mark.virtual_time
async def test_connecting_to_nothing_names_the_reason_and_goes_on_trying(bridge: RosBridge) -> None:
    async with serving(Config()) as server, viewer(server) as one:
        assert (await one.state())["session"]["phase"] == "idle"
        await bridge.kill()
        assert (await one.ask(kind="connect", address=bridge.address))["ok"]  # type: ignore[attr-defined]
        state = await one.state(lambda s: s["session"]["phase"] == "failed", within_s=2.0)
        assert state["link"]["problem"]["code"] == "refused"
        await bridge.revive()
        await one.state(lambda s: s["session"]["phase"] == "monitoring", within_s=4.0)
        assert (await one.ask(kind="disconnect"))["ok"]
        await one.state(lambda s: s["session"]["phase"] == "idle")


@pytest.mark.virtual_time
@pytest.mark.parametrize(
    ("address", "code"),
    [("http://127.0.0.1:11311", "ros_master"), ("https://car", "scheme"), ("car:abc", "address"), ("", "address")],
)
async def test_a_wrong_address_is_refused_with_its_own_sentence(address: str, code: str) -> None:
    async with serving(Config()) as server, viewer(server) as one:
        answer = await one.ask(kind="connect", address=address)
        assert answer["ok"] is False
        assert answer["problem"]["code"] == code
        assert one.states[-1]["session"]["phase"] in ("idle", "failed")


@pytest.mark.virtual_time
async def test_a_wrong_address_does_not_end_a_running_watch(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one:
        await one.state(is_live)
        assert (await one.ask(kind="connect", address="http://x:11311"))["ok"] is False
        await one.state(is_live)


@pytest.mark.virtual_time
async def test_only_listed_hosts_are_dialled(bridge: RosBridge) -> None:
    async with serving(Config(allowed_hosts=("192.168.4.1",))) as server, viewer(server) as one:
        answer = await one.ask(kind="connect", address=bridge.address)  # type: ignore[attr-defined]
        assert answer["ok"] is False
        assert answer["problem"]["code"] == "not_allowed"


@pytest.mark.virtual_time
async def test_bad_messages_are_counted_with_their_reason(bridge: RosBridge, server: str) -> None:
    async with viewer(server) as one, driving(bridge):
        await one.state(is_live)
        before = one.states[-1]["signals"]["speed"]["rejected"]
        for bad in ({}, {"linear": None}, {"linear": {"x": "fast"}}, twist(float("nan")), twist(1e9), {"linear": [1]}):
            bridge.publish("/catvehicle/vel", bad)
            await asyncio.sleep(0.02)  # the bridge keeps five in a burst
        state = await one.state(lambda s: s["signals"]["speed"]["rejected"] == before + 6)
        assert state["signals"]["speed"]["rejected_why"]
        assert is_live(state)
        async with http_client() as client:
            body = (await client.get(f"{server}/api/signals")).json()
        assert sum(body["rejected"]["Speed"].values()) == 6


@pytest.mark.virtual_time
async def test_messages_without_a_value_are_not_called_no_message(bridge: RosBridge, server: str) -> None:
    bridge.advertise("/battery_state", "sensor_msgs/BatteryState")
    async with viewer(server) as one, driving(bridge):
        await one.state(lambda s: is_live(s) and s["signals"]["fuel"]["freshness"] == "never")
        bridge.publish("/battery_state", {"present": False, "percentage": float("nan")})
        bridge.publish("/scan", {"ranges": "none"})
        state = await one.state(lambda s: s["signals"]["scan"]["unusable"] and s["signals"]["fuel"]["unusable"])
        fuel, laser = state["signals"]["fuel"], state["signals"]["scan"]
        assert (fuel["freshness"], fuel["unusable"]) == ("not_measured", "not measured (present is false)")
        assert (laser["freshness"], laser["value"]) == ("no_value", None)
        bridge.publish("/battery_state", {"present": False, "percentage": 0.5})
        state = await one.state(lambda s: s["signals"]["fuel"]["freshness"] == "fresh")
        assert state["signals"]["fuel"]["value"]["value"] == 50.0


@pytest.mark.virtual_time
async def test_beams_below_range_min_are_no_returns(bridge: RosBridge, server: str) -> None:
    ranges = np.array([0.02, 5.0, np.nan, np.inf, 90.0, 10.0, -np.inf], dtype=np.float32)
    async with viewer(server) as one, driving(bridge):
        await one.send({"kind": "watch", "scan": True})
        await one.state(lambda s: s["signals"]["scan"]["freshness"] == "never")
        for _ in range(20):
            bridge.publish("/scan", scan(ranges, range_min=0.1))
            await asyncio.sleep(0.02)
        await one.until(lambda: one.scans)
        frame = scan_frames.read(one.scans[-1])
        codes, scale = frame.codes, frame.scale_m
        assert list(codes[[0, 2, 3, 4, 6]]) == [65535, 65533, 65534, 65534, 65535]
        assert np.allclose(codes[[1, 5]] * scale, [5.0, 10.0], atol=2e-3)
        state = await one.state(lambda s: s["signals"]["scan"]["value"])
        assert state["signals"]["scan"]["value"]["usable"] == 2


@pytest.mark.virtual_time
async def test_pause_and_stop(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one:
        await one.state(is_live)
        await one.ask(kind="pause")
        state = await one.state(lambda s: s["session"]["paused"])
        assert is_live(state)
        await one.ask(kind="resume")
        await one.state(lambda s: not s["session"]["paused"])
        await one.ask(kind="disconnect")
        state = await one.state(lambda s: s["session"]["phase"] == "idle")
        assert state["signals"]["speed"]["value"] is None


@pytest.mark.virtual_time
async def test_two_vehicles_in_one_process_do_not_mix(bridge: RosBridge) -> None:
    other = RosBridge(ros_version=2)
    port = await other.start()
    other.advertise("/catvehicle/vel", "geometry_msgs/msg/Twist")
    config = Config(
        vehicles=(
            Vehicle(name="red", address=bridge.address),  # type: ignore[attr-defined]
            Vehicle(name="blue", address=f"ws://127.0.0.1:{port}"),
        )
    )
    async with (
        serving(config) as server,
        driving(bridge, speed=lambda n: 1.0),
        driving(other, speed=lambda n: 2.0),
        viewer(server, vehicle="red") as red,
        viewer(server, vehicle="blue") as blue,
    ):
        state = await red.state(is_live)
        assert (state["vehicle"], state["signals"]["speed"]["value"]["speed_mps"]) == ("red", 1.0)
        state = await blue.state(is_live)
        assert (state["vehicle"], state["signals"]["speed"]["value"]["speed_mps"]) == ("blue", 2.0)
        assert state["session"]["ros_version"] == 2
    await other.stop()


@pytest.mark.field
@pytest.mark.parametrize("flaps", [8, pytest.param(200, marks=[pytest.mark.soak, pytest.mark.timeout(1800)])])
async def test_flaps_leak_nothing_and_keep_the_subscriptions_whole(bridge: RosBridge, server: str, flaps: int) -> None:
    """Killed and frozen in turn: then as many tasks, threads and descriptors as before, one subscription a topic."""
    process = psutil.Process()
    async with driving(bridge), viewer(server) as one:
        await one.state(is_live)
        await asyncio.sleep(1.5)
        before = (process.num_threads(), process.num_fds(), len(asyncio.all_tasks()))
        for flap in range(flaps):
            if flap % 2:
                await bridge.kill()
                await one.state(lambda s: s["link"]["cut"] == "server-bridge", within_s=2.2)
                await bridge.revive()
            else:
                bridge.freeze()
                await one.state(lambda s: s["link"]["cut"] == "server-bridge", within_s=2.2)
                bridge.thaw()
            await one.state(is_live, within_s=4.0)
        await asyncio.sleep(6.0)  # time-outs of what was abandoned have run
        after = (process.num_threads(), process.num_fds(), len(asyncio.all_tasks()))
        assert after[0] <= before[0]
        assert after[1] <= before[1]
        assert after[2] <= before[2] + 1  # a conversation may just be between two
        assert bridge.clients == 2  # the link, and the connection for questions
        state = await one.state(is_live)
        assert state["link"]["topics_subscribed"] == 2
        count = state["signals"]["speed"]["count"]
        await asyncio.sleep(2.0)
        state = await one.state(is_live)
        assert 30 <= state["signals"]["speed"]["count"] - count <= 46  # 20 Hz once, not twice
