"""A slow link before a whole server: values are shown with their age, less is requested, and all of it again later."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.recording.read.read import open_recording
from server.rosbridge.link import RosLink
from server.rosbridge.subscription import Subscription
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.server.cars import ZERO, scan
from tests.server.conftest import serving
from tests.server.rosbridge_server.conftest import bridging
from tests.server.slow_proxy import slow_proxy
from tests.server.viewer import Viewer, viewer

pytestmark = [pytest.mark.world(n=6), pytest.mark.slow]

HZ = 20.0
UNDER_S = 0.2
SLOW_BPS = 20_000.0
SOON_S = 60.0  # on two busy cores
BEAMS = 181
SPEED, BRAKE, DISTANCE, SCAN, ODOMETRY, NOISE = (
    "/catvehicle/vel",
    "/catvehicle/brake",
    "/DistanceEstimator/dist",
    "/scan",
    "/gps_odom",
    "/noise",
)
JUDGED = (SPEED, BRAKE, DISTANCE, ODOMETRY)


def header(at_s: float) -> dict[str, Any]:
    return {"seq": 0, "stamp": {"secs": int(at_s), "nsecs": int(at_s % 1 * 1e9)}, "frame_id": "map"}


@contextlib.asynccontextmanager
async def car() -> AsyncIterator[tuple[int, float]]:
    """A car whose values state when they were published: seconds since the time that is yielded with the port."""
    async with bridging(ros_version=1) as (bridge, port):
        for topic, type in (
            (SPEED, "geometry_msgs/Twist"),
            (BRAKE, "geometry_msgs/Wrench"),
            (DISTANCE, "std_msgs/Float32"),
            (SCAN, "sensor_msgs/LaserScan"),
            (ODOMETRY, "nav_msgs/Odometry"),
            (NOISE, "std_msgs/String"),
        ):
            bridge.advertise(topic, type)
        began_s = time.time()
        driving = asyncio.create_task(drive(bridge, began_s))
        try:
            yield port, began_s
        finally:
            driving.cancel()


async def drive(bridge: RosBridge, began_s: float) -> None:
    pose = {"position": dict(ZERO), "orientation": ZERO | {"w": 1.0}}
    turn = {"linear": dict(ZERO), "angular": dict(ZERO)}
    while True:
        now_s = time.time()
        since_s = now_s - began_s
        bridge.publish(SPEED, {"linear": ZERO | {"x": 2.0 + since_s / 20}, "angular": dict(ZERO)})
        bridge.publish(BRAKE, {"force": ZERO | {"x": since_s}, "torque": dict(ZERO)})
        bridge.publish(DISTANCE, {"data": 20.0 + since_s / 10})
        bridge.publish(SCAN, scan([20.0 + since_s / 10] * BEAMS) | {"header": header(now_s)})
        place = {"pose": pose | {"position": ZERO | {"x": since_s}}, "covariance": [0.0] * 36}
        bridge.publish(
            ODOMETRY,
            {
                "header": header(now_s),
                "child_frame_id": "",
                "pose": place,
                "twist": {"twist": turn, "covariance": [0.0] * 36},
            },
        )
        bridge.publish(NOISE, {"data": "x" * 1000})
        await asyncio.sleep(1 / HZ)


SINCE_S = {  # when the value that is shown was published
    "speed": lambda value: (value["speed_mps"] - 2.0) * 20,
    "brake": lambda value: value["percent"],
    "distance": lambda value: (value["distance_m"] - 20.0) * 10,
    "scan": lambda value: (value["nearest_m"] - 20.0) * 10,
    "odometry": lambda value: value["x_m"],
}


def ages(state: dict[str, Any], began_s: float) -> dict[str, tuple[float, float]]:
    """Signal → its age as it is shown, and as it is."""
    found = {}
    for signal, published in SINCE_S.items():
        shown = state["signals"][signal]
        if shown["value"] is not None and shown["age_s"] is not None:
            true_s = state["server"]["time_ms"] / 1000 - began_s - published(shown["value"])
            found[signal] = (shown["age_s"], true_s)
    return found


class Requests:
    """What is requested of the bridge, in order: topic, and the least interval of messages [ms]; None: unsubscribed."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.throttles: dict[str, list[int | None]] = {}
        subscribe, unsubscribe = RosLink.subscribe, RosLink.unsubscribe

        def note_and_subscribe(link: RosLink, subscription: Subscription) -> None:
            self._note(subscription.topic, subscription.throttle_ms)
            subscribe(link, subscription)

        def note_and_unsubscribe(link: RosLink, topic: str) -> None:
            self._note(topic, None)
            unsubscribe(link, topic)

        monkeypatch.setattr(RosLink, "subscribe", note_and_subscribe)
        monkeypatch.setattr(RosLink, "unsubscribe", note_and_unsubscribe)

    def _note(self, topic: str, throttle_ms: int | None) -> None:
        before = self.throttles.setdefault(topic, [])
        if not before or before[-1] != throttle_ms:
            before.append(throttle_ms)

    def now(self, topic: str) -> int | None:
        return self.throttles[topic][-1]


def steps(one: Viewer) -> list[int]:
    return [event["step"] for event in one.events if event["change"] == "reduced"]


@pytest.mark.field
async def test_old_values_look_old_less_is_requested_and_all_of_it_once_the_link_is_fast_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    requests = Requests(monkeypatch)
    async with car() as (port, began_s), slow_proxy(port, None) as proxy:
        config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{proxy.port}"),), data=tmp_path)
        async with serving(config) as base, viewer(base, name="Ann") as one:
            state = await one.state(
                lambda s: s["recording"]["messages"] > 200 and len(ages(s, began_s)) == len(SINCE_S), SOON_S
            )
            assert requests.now(NOISE) == 0
            name = state["recording"]["name"]

            proxy.rate_Bps = SLOW_BPS
            late = await one.until(lambda: next((e for e in one.events if e.get("alarm")), None), SOON_S)
            assert "the link is too slow" in late["text"]
            await one.until(lambda: max(throttle or 0 for throttle in requests.throttles[SCAN]) > 0, SOON_S)
            await one.state(lambda s: steps(one) and s["link"]["late_s"] < 1.0, SOON_S)
            during = steps(one)
            assert during == sorted(during)
            assert during[0] == 1, "first of all what is only recorded"
            assert requests.now(NOISE) is None
            for topic in JUDGED:
                assert None not in requests.throttles[topic]
            assert all(
                (requests.throttles[topic][-1] or 0) <= (requests.throttles[SCAN][-1] or 0) for topic in (SPEED, BRAKE)
            )

            proxy.rate_Bps = None
            await one.state(lambda s: s["link"]["reduced"] is None, SOON_S)
            await one.until(lambda: steps(one)[-1] == 0, SOON_S)  # the event is stored first, and comes after the state
            await one.until(lambda: requests.now(NOISE) == 0, SOON_S)
            assert all(requests.now(topic) == 0 for topic in (*JUDGED, SCAN))
            state = await one.state(lambda s: all(shown < true + 0.3 for shown, true in ages(s, began_s).values()))

            seen = [(signal, *both) for each in one.states for signal, both in ages(each, began_s).items()]
            assert max(true_s for _, _, true_s in seen) > 1.0, "the link was slow"
            too_young = [row for row in seen if row[1] < row[2] - UNDER_S]
            assert not too_young, too_young[:5]
            raised = {event["alarm"] for event in one.events if event.get("alarm")} - {"reach"}
            assert raised <= {"link_late", "link_late_moving"}, raised
            assert (await one.ask(kind="disconnect"))["ok"]
            await one.state(lambda s: s["recording"]["state"] == "off", SOON_S)
    with open_recording(sorted(tmp_path.rglob(f"{name}*.mcap"))) as recording:
        assert NOISE in recording.metadata["left_out"].split() or recording.topics[NOISE].count > 0
