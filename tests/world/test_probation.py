"""A topic that is only recorded and keeps a bridge from answering does not cost what is judged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.rosbridge.link import RosLink
from server.vehicle import wanted_topics
from server.vehicle.connection import Connection
from server.vehicle.delivery import Delivery
from server.vehicle.subscription_table import SubscriptionTable
from server.vehicle.subscriptions import Subscriptions
from server.vehicle.type_definitions import TypeDefinitions
from server.vehicle.vehicle import Vehicle
from server.vehicle.wanted_topics import LEFT_AFTER, STEADY_S, Probation
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.link_listener import until
from tests.server.rosbridge_server.conftest import bridging
from tests.server.viewer import viewer

pytestmark = pytest.mark.world(n=10)
SOON_S = 30.0


def drive(one: Probation, *, bad: str, suspects: list[str], seconds: float = 60.0) -> tuple[int, list[str]]:
    """The link falls silent a second after `bad` is subscribed to. How often it did, and what was left."""
    losses, left, asked_s = 0, [], 0.0
    one.opened(0.0)
    for tick in range(int(seconds * 10)):
        now_s = tick / 10
        before = bad in one.held
        one.look(now_s)
        if before and bad not in one.held:
            asked_s = now_s
        if bad not in one.held and now_s - asked_s >= 1.0:
            losses += 1
            left += one.silent([topic for topic in suspects if topic not in one.held])
            one.opened(now_s + 1.0)
            asked_s = now_s + 1.0
    return losses, left


def test_the_one_that_silences_the_bridge_is_found_and_left_and_all_others_come_back() -> None:
    one, suspects = Probation(), ["/a", "/cloud", "/z"]
    losses, left = drive(one, bad="/cloud", suspects=suspects)
    assert left == ["/cloud"]
    assert losses == 1 + LEFT_AFTER, "once with all of them, and then alone"
    assert one.held == {"/cloud"}


def test_a_lost_radio_holds_them_back_for_a_while_and_leaves_none() -> None:
    one = Probation()
    one.opened(0.0)
    assert one.silent(["/a", "/b"]) == []
    one.opened(10.0)
    assert one.held == {"/a", "/b"}
    assert not one.look(10.0 + STEADY_S - 0.1)
    assert one.look(10.0 + STEADY_S)
    assert one.held == {"/b"}
    one.received("/b")  # it is not the cause
    assert one.look(10.0 + 2 * STEADY_S) is False
    assert one.held == set()


def test_while_the_link_is_down_none_is_tried() -> None:
    one = Probation()
    one.opened(0.0)
    one.silent(["/a"])
    assert not one.look(1e6)
    assert one.held == {"/a"}


def test_one_that_makes_all_others_late_is_found_and_left_and_the_others_are_recorded_again() -> None:
    """A ROS 2 bridge that encodes 40 MB each second sends everything else a second late, and answers each ping."""
    clock = [0.0]
    definitions, delivery = TypeDefinitions(lambda _: None, lambda: None), Delivery()
    definitions.requested = definitions.may_be_large = {"std_msgs/msg/UInt8MultiArray"}
    table = SubscriptionTable(None, definitions, delivery, now=lambda: clock[0])
    table.also = "all"
    offered = {f"/{name}": "std_msgs/msg/UInt8MultiArray" for name in ("a", "cloud", "z")}

    def subscribe() -> None:
        table.subscribe({}, offered, needs_client_count=False)
        delivery.follow([], [*table.recorded.topics], clock[0])

    left, recorded_s = [], 0.0
    table.opened()
    subscribe()
    for tick in range(1800):
        clock[0] = tick / 10
        if "/a" in table.recorded.topics:
            recorded_s += 0.1
            delivery.received("/a", clock[0])
            delivery.received("/z", clock[0])
        changed, now_left = table.look_at_load(1.1 if "/cloud" in table.recorded.topics else 0.05, 0.0)
        left += now_left
        if changed or table.tries_another():
            subscribe()
    assert left == ["/cloud"]
    assert (set(table.recorded.topics), table.recorded.left_out) == ({"/a", "/z"}, ("/cloud",))
    assert recorded_s > 90.0


@pytest.mark.virtual_time
async def test_after_a_silence_of_the_bridge_the_large_ones_that_never_came_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wanted_topics, "STEADY_S", 3.0)
    links: list[RosLink] = []
    silent = Subscriptions.fell_silent

    def fell_silent(subscriptions: Subscriptions) -> None:
        assert subscriptions._link is not None
        links.append(subscriptions._link)
        silent(subscriptions)

    monkeypatch.setattr(Subscriptions, "fell_silent", fell_silent)
    opened: list[Any] = []
    link_opened = Connection.link_opened

    def keep(connection: Connection) -> None:
        opened.append(connection.link)
        link_opened(connection)

    monkeypatch.setattr(Connection, "link_opened", keep)
    async with bridging(ros_version=2) as (bridge, port):
        bridge.advertise("/catvehicle/vel", "geometry_msgs/msg/Twist")
        bridge.advertise("/cloud", "std_msgs/msg/UInt8MultiArray")
        bridge.advertise("/text", "std_msgs/msg/String")

        def is_requested(topic: str) -> bool:
            found = bridge.graph.find(topic)
            return bool(found and found.subscribers)

        config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),), data=tmp_path)
        async with driving(bridge), serving(config) as base, viewer(base) as one:
            await until(lambda: is_requested("/cloud") and is_requested("/text"), within_s=SOON_S)
            socket = opened[0]._socket
            socket.was_silent = True
            socket.dropConnection(abort=True)
            await until(lambda: links and not is_requested("/text"), within_s=SOON_S)
            await until(lambda: is_requested("/text"), within_s=SOON_S)
            assert not is_requested("/cloud")
            await one.state(lambda s: s["recording"]["left_out"] == ["/cloud"], SOON_S)
            await until(lambda: is_requested("/cloud"), within_s=SOON_S)
            await one.state(lambda s: s["recording"]["left_out"] == [], SOON_S)
