"""What a client can ask of the bridge, over a real socket."""

from __future__ import annotations

import asyncio
import json
import time
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

from server.judge.message import Json
from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import Probe, decoded, probing, until

pytestmark = pytest.mark.virtual_time

TWIST = {"linear": {"x": 1.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.5}}


@pytest.fixture
def vel(bridge: RosBridge) -> RosBridge:
    """The bridge with a topic on it."""
    bridge.advertise("/vel", "geometry_msgs/Twist")
    return bridge


async def test_a_subscriber_gets_what_is_published(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel", type="geometry_msgs/Twist", id="s", queue_length=1, throttle_rate=0)
    vel.publish("/vel", TWIST)
    assert await probe.hear() == {"op": "publish", "topic": "/vel", "msg": TWIST}
    assert (vel.sent, vel.dropped, vel.clients) == (1, 0, 1)
    assert vel.bytes_sent > 100


async def test_a_subscriber_hears_the_topic_as_it_spelled_it(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("vel")
    vel.publish("/vel", TWIST)
    assert (await probe.hear())["topic"] == "vel"


async def test_cbor_comes_binary_with_its_typed_arrays(vel: RosBridge, probe: Probe) -> None:
    vel.advertise("/scan", "sensor_msgs/LaserScan")
    await probe.subscribe("/scan", compression="cbor")
    ranges = np.array([1.0, np.nan, np.inf, -np.inf], dtype=np.float32)
    vel.publish("/scan", {"ranges": ranges, "range_min": np.inf})
    raw = await probe.hear_raw()
    assert isinstance(raw, bytes)
    message = decoded(raw)["msg"]
    assert message["ranges"].tag == 85
    assert np.array_equal(np.frombuffer(message["ranges"].value, "<f4"), ranges, equal_nan=True)
    assert message["range_min"] == np.inf


async def test_json_and_cbor_clients_share_a_topic(vel: RosBridge, port: int, probe: Probe) -> None:
    async with probing(port) as other:
        await probe.subscribe("/vel")
        await other.subscribe("/vel", compression="cbor")
        vel.publish("/vel", TWIST)
        assert isinstance(await probe.hear_raw(), str)
        assert isinstance(await other.hear_raw(), bytes)


async def test_a_client_that_asks_twice_gets_each_message_once(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel", id="a", compression="none")
    await probe.subscribe("/vel", id="b", compression="cbor")
    vel.publish("/vel", TWIST)
    assert isinstance(await probe.hear_raw(), bytes)  # CBOR if any subscription requested it
    assert await probe.hears_nothing()
    await probe.send(op="unsubscribe", topic="/vel", id="b")
    await probe.settle()
    vel.publish("/vel", TWIST)
    assert isinstance(await probe.hear_raw(), str)
    await probe.send(op="unsubscribe", topic="/vel")
    await probe.settle()
    vel.publish("/vel", TWIST)
    assert await probe.hears_nothing()


async def test_a_topic_may_be_subscribed_before_it_exists(bridge: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/typed", type="geometry_msgs/Twist")
    await probe.subscribe("/untyped")
    bridge.advertise("/typed", "geometry_msgs/Twist")
    bridge.advertise("/untyped", "geometry_msgs/Twist")
    for topic in ("/typed", "/untyped"):
        bridge.publish(topic, TWIST)
        assert (await probe.hear())["topic"] == topic


async def test_a_subscription_outlives_its_source(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel")
    vel.unadvertise("/vel")
    with pytest.raises(LookupError, match="/vel was not advertised"):
        vel.publish("/vel", TWIST)
    vel.advertise("/vel", "geometry_msgs/Twist")
    vel.publish("/vel", TWIST)
    assert (await probe.hear())["msg"] == TWIST


async def test_the_wrong_type_gets_an_error_and_no_data(vel: RosBridge, probe: Probe) -> None:
    await probe.send(op="subscribe", topic="/vel", type="std_msgs/Float64", id="s1")
    assert await probe.hear() == {
        "op": "status",
        "level": "error",
        "msg": "subscribe: /vel has the type geometry_msgs/Twist, not std_msgs/Float64",
        "id": "s1",
    }
    vel.publish("/vel", TWIST)
    assert await probe.hears_nothing()


async def test_the_wrong_type_for_a_topic_that_comes_later(bridge: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel", type="std_msgs/Float64", id="s1")
    bridge.advertise("/vel", "geometry_msgs/Twist")
    status = await probe.hear()
    assert (status["op"], status["level"], status["id"]) == ("status", "error", "s1")
    bridge.publish("/vel", TWIST)
    assert await probe.hears_nothing()
    await probe.subscribe("/vel", type="geometry_msgs/Twist", id="s2")  # and then rightly
    bridge.publish("/vel", TWIST)
    assert (await probe.hear())["msg"] == TWIST


async def test_ros_1_refuses_the_ros_2_spelling(vel: RosBridge, probe: Probe) -> None:
    await probe.send(op="subscribe", topic="/vel", type="geometry_msgs/msg/Twist", id="s")
    assert "not a valid type string in ROS 1" in (await probe.hear_op("status"))["msg"]


@pytest.mark.parametrize("type", ["geometry_msgs/Twist", "geometry_msgs/msg/Twist"])
async def test_ros_2_takes_both_spellings(type: str) -> None:
    async with bridging(ros_version=2) as (bridge, port), probing(port) as probe:
        bridge.advertise("/vel", "geometry_msgs/Twist")
        await probe.subscribe("/vel", type=type)
        bridge.publish("/vel", TWIST)
        assert (await probe.hear())["msg"] == TWIST
        assert (await probe.call("/rosapi/topic_type", {"topic": "/vel"}))["values"] == {
            "type": "geometry_msgs/msg/Twist"
        }


async def test_a_latched_topic_gives_newcomers_its_last_message(bridge: RosBridge, probe: Probe) -> None:
    bridge.advertise("/map", "std_msgs/String", latch=True)
    bridge.publish("/map", {"data": "old"})
    bridge.publish("/map", {"data": "new"})
    await probe.send(op="subscribe", topic="/map")
    assert (await probe.hear())["msg"] == {"data": "new"}


async def test_a_second_subscription_gives_it_again(bridge: RosBridge, probe: Probe) -> None:
    """As a real bridge does, so that a probe of what its publisher keeps is answered."""
    bridge.advertise("/map", "std_msgs/String", latch=True)
    bridge.publish("/map", {"data": "kept"})
    for _ in range(2):
        await probe.send(op="subscribe", id="one", topic="/map")
        assert (await probe.hear())["msg"] == {"data": "kept"}


async def test_throttling_leaves_out_and_counts_no_loss(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel", throttle_rate=60)
    ends = time.monotonic() + 0.29
    published = 0
    while time.monotonic() < ends:
        vel.publish("/vel", TWIST)
        published += 1
        await asyncio.sleep(0.005)
    received = 0
    while not await probe.hears_nothing(0.1):
        received += 1
    assert vel.sent == 5
    assert (vel.dropped, vel.counters.throttled) == (0, published - vel.sent)


async def test_throttling_with_a_queue_ends_with_the_newest(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel", throttle_rate=50, queue_length=1)
    began = time.monotonic()
    for number in range(10):
        vel.publish("/vel", {**TWIST, "number": number})
    assert [(await probe.hear())["msg"]["number"], (await probe.hear())["msg"]["number"]] == [0, 9]
    assert time.monotonic() - began == pytest.approx(0.05, abs=0.001)
    assert vel.dropped == 0


async def test_the_fastest_wish_of_a_client_wins(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel", id="slow", throttle_rate=10_000)
    await probe.subscribe("/vel", id="fast", throttle_rate=0)
    for _ in range(3):
        vel.publish("/vel", TWIST)
    for _ in range(3):
        await probe.hear()


async def test_clients_publish_to_each_other_and_to_us(bridge: RosBridge, port: int, probe: Probe) -> None:
    received: list[tuple[str, str, Json]] = []
    bridge.on_publish.append(lambda *what: received.append(what))
    async with probing(port) as other:
        await other.subscribe("/cmd_vel")
        await probe.send(op="advertise", topic="/cmd_vel", type="geometry_msgs/Twist", id="ad")
        await probe.send(op="publish", topic="/cmd_vel", msg={"linear": {"x": 2}}, id="p")
        message = (await other.hear_op("publish"))["msg"]
    assert message == {"linear": {"x": 2.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
    assert received == [("/cmd_vel", "geometry_msgs/Twist", message)]


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ({"linear": {"x": None}}, "requires a float64 for field linear.x, but got a <class 'NoneType'>"),
        ({"linear": {"speed": 1}}, "does not have a field linear.speed"),
        ({"linear": [1, 2]}, "requires a geometry_msgs/Vector3 for field linear"),
        ([], "msg must be an object"),
    ],
)
async def test_a_message_that_is_not_of_its_type_goes_nowhere(
    bridge: RosBridge, probe: Probe, message: Any, why: str
) -> None:
    received: list[Any] = []
    bridge.on_publish.append(lambda *what: received.append(what))
    await probe.send(op="advertise", topic="/cmd_vel", type="geometry_msgs/Twist")
    await probe.send(op="publish", topic="/cmd_vel", msg=message, id="p7")
    status = await probe.hear()
    assert (status["level"], status["id"]) == ("error", "p7")
    assert why in status["msg"]
    assert received == []


async def test_times_that_ros_1_leaves_out_are_said_once_for_a_topic(bridge: RosBridge, probe: Probe) -> None:
    for topic in ("/a", "/b"):
        await probe.send(op="advertise", topic=topic, type="std_msgs/Header")
        for _ in range(3):
            await probe.send(op="publish", topic=topic, msg={"stamp": {"sec": 3, "nanosec": 4}})
    for topic in ("/a", "/b"):
        assert (await probe.hear())["msg"].startswith(f"publish: {topic}: stamp has no secs and nsecs")
    assert await probe.hears_nothing()


async def test_publishing_to_a_topic_without_a_type_is_refused(probe: Probe) -> None:
    await probe.send(op="publish", topic="/nowhere", msg={}, id=3)
    assert "no type yet: advertise it first" in (await probe.hear())["msg"]


async def test_publishing_to_a_topic_of_ours_needs_no_advertising(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel")
    await probe.send(op="publish", topic="vel", msg=TWIST)
    assert (await probe.hear())["msg"] == TWIST


async def test_advertising_another_type_is_refused(vel: RosBridge, probe: Probe) -> None:
    await probe.send(op="advertise", topic="/vel", type="std_msgs/String", id="x")
    assert "has the type geometry_msgs/Twist, not std_msgs/String" in (await probe.hear())["msg"]


async def test_unadvertising_ends_a_client_s_topic(bridge: RosBridge, probe: Probe) -> None:
    await probe.send(op="advertise", topic="/cmd", type="std_msgs/String", id="1")
    await probe.send(op="advertise", topic="/cmd", type="std_msgs/String", id="2")
    await probe.send(op="unadvertise", topic="/cmd", id="1")
    assert (await probe.call("rosapi/topics"))["values"]["topics"] == ["/cmd"]
    await probe.send(op="unadvertise", topic="/cmd", id="2")
    assert (await probe.call("rosapi/topics"))["values"]["topics"] == []


async def test_a_client_that_goes_leaves_nothing_behind(bridge: RosBridge, port: int) -> None:
    async with probing(port) as probe:
        await probe.send(op="advertise", topic="/cmd", type="std_msgs/String")
        await probe.subscribe("/later", type="std_msgs/String")
        assert len(bridge.graph.topics()) == 2
    await until(lambda: bridge.clients == 0)
    assert bridge.graph.topics() == []


async def test_services_answer_now_later_or_not(bridge: RosBridge, probe: Probe) -> None:
    async def later(args: Json) -> Json:
        await asyncio.sleep(0.01)
        if args.get("fail"):
            raise RuntimeError("the brake is stuck")
        return {"sum": args["a"] + args["b"]}

    bridge.add_service("/add", "demo/Add", later, arguments=("a", "b"))
    bridge.add_service("/now", "demo/Now", lambda args: {"got": dict(args)})
    assert (await probe.call("/now", {"x": 1}))["values"] == {"got": {"x": 1}}
    assert await probe.call("add", [1, 2]) == {
        "op": "service_response",
        "service": "add",
        "values": {"sum": 3},
        "result": True,
        "id": "call",
    }
    failed = await probe.call("/add", {"fail": True})
    why = "service [/add] responded with an error: b'error processing request: the brake is stuck'"
    assert (failed["result"], failed["values"]) == (False, why)
    broken = await probe.call("/add", {})
    assert broken["result"] is False


async def test_a_slow_service_holds_up_nobody(bridge: RosBridge, probe: Probe) -> None:
    gate = asyncio.Event()

    async def wait(args: Json) -> Json:
        await gate.wait()
        return {}

    bridge.add_service("/wait", "demo/Wait", wait)
    await probe.send(op="call_service", service="/wait", id="slow")
    assert (await probe.call("/rosapi/get_time"))["id"] == "call"
    gate.set()
    assert (await probe.hear())["id"] == "slow"


@pytest.mark.parametrize(
    ("operation", "why"),
    [
        ({"op": "subscribe"}, "expected a field topic"),
        ({"op": "subscribe", "topic": 5}, "topic must be text"),
        ({"op": "subscribe", "topic": ""}, "not a valid name"),
        ({"op": "subscribe", "topic": "/a", "throttle_rate": "fast"}, "throttle_rate must be a number"),
        ({"op": "subscribe", "topic": "/a", "queue_length": -1}, "queue_length must be a number, 0 or more"),
        ({"op": "subscribe", "topic": "/a", "type": 7}, "type must be text"),
        ({"op": "subscribe", "topic": "/a", "throttle_rate": -5}, "throttle_rate must be a number, 0 or more"),
        ({"op": "subscribe", "topic": "/a", "type": "nonsense"}, "not a valid type string"),
        ({"op": "subscribe", "topic": "/a", "compression": "zip"}, "compression 'zip' is not offered"),
        ({"op": "advertise", "topic": "/a"}, "expected a field type"),
        ({"op": "publish", "msg": {}}, "expected a field topic"),
        ({"op": "call_service"}, "expected a field service"),
        ({"op": "set_level", "level": "loud"}, "the level must be one of info, warning, error, none"),
        ({"op": "service_response", "service": "/a"}, "no call with this id waits"),
        ({"op": "advertise_service", "service": "/a"}, "expected a field type"),
        ({"op": "advertise_service", "service": "/rosapi/topics", "type": "a/B"}, "another node offers /rosapi/topics"),
        ({"op": "send_action_goal", "action": "/a"}, "this bridge does not do that"),
        ({"op": "fly"}, "unknown operation"),
        ({"op": 7}, "op must be text"),
        ({}, "expected a field op"),
    ],
)
async def test_wrong_operations_are_answered_with_their_id(probe: Probe, operation: dict[str, Any], why: str) -> None:
    await probe.send(**operation, id="the id")
    status = await probe.hear()
    assert (status["op"], status["level"], status["id"]) == ("status", "error", "the id")
    assert why in status["msg"]


async def test_an_unknown_compression_is_json_as_on_a_real_bridge(vel: RosBridge, probe: Probe) -> None:
    await probe.subscribe("/vel", compression="zip", throttle_rate=-5)
    vel.publish("/vel", TWIST)
    assert (await probe.hear())["msg"] == TWIST


async def test_text_that_is_not_utf_8_ends_the_connection(bridge: RosBridge, port: int) -> None:
    async with probing(port) as probe:
        await probe.send_text(b'{"op":"\xff"}')
        with pytest.raises(ConnectionClosed):
            await probe.hear()
    assert probe.socket.close_code == 1007  # RFC 6455, 8.1


@pytest.mark.parametrize("frame", ["", "{", "[1]", '{"op":"subscribe"', b"\x00\xff"])
async def test_what_is_not_json_is_answered(probe: Probe, frame: str | bytes) -> None:
    await probe.socket.send(frame)
    assert (await probe.hear())["level"] == "error"
    assert (await probe.call("/rosapi/get_time"))["result"] is True


async def test_levels_choose_which_reports_are_sent(bridge: RosBridge, probe: Probe) -> None:
    await probe.send(op="unsubscribe", topic="/never", id="quiet")  # a warning: not sent by default
    await probe.send(op="set_level", level="info")
    await probe.send(op="subscribe", topic="/a", type="std_msgs/String", id="s")
    assert await probe.hear() == {"op": "status", "level": "info", "msg": "subscribed to /a", "id": "s"}
    await probe.send(op="unsubscribe", topic="/never", id="u")
    assert (await probe.hear())["level"] == "warning"
    await probe.send(op="set_level", level="none")
    await probe.send(op="fly")
    assert await probe.hears_nothing()


async def test_fragments_are_put_together(vel: RosBridge, probe: Probe) -> None:
    whole = json.dumps({"op": "subscribe", "topic": "/vel", "id": "s"})
    for number, part in enumerate((whole[:10], whole[10:25], whole[25:])):
        await probe.send(op="fragment", id="f", num=number, total=3, data=part)
    await probe.settle()
    vel.publish("/vel", TWIST)
    assert (await probe.hear())["msg"] == TWIST


async def test_fragments_of_fragments_are_refused(probe: Probe) -> None:
    inner = json.dumps({"op": "fragment", "id": "f", "num": 0, "total": 1, "data": "{}"})
    await probe.send(op="fragment", id="outer", num=0, total=1, data=inner)
    assert "a fragment cannot hold fragments" in (await probe.hear())["msg"]


async def test_a_client_s_callback_that_fails_is_our_affair(
    vel: RosBridge, probe: Probe, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*what: object) -> None:
        raise RuntimeError("a mistake of ours")

    vel.on_publish.append(fail)
    await probe.send(op="publish", topic="/vel", msg=TWIST, id="p")
    assert "internal error of the bridge" in (await probe.hear())["msg"]
    assert "a mistake of ours" in caplog.text
    assert (await probe.call("/rosapi/get_time"))["result"] is True
