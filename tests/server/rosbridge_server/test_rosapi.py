"""What rosapi tells."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

import pytest

from server.judge.message import RosVersion
from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import Probe, probing

DEFINITION = "float64 volume  # litres\nstring note\n"


@pytest.fixture
async def car() -> AsyncIterator[tuple[RosBridge, Probe]]:
    async with bridging(now=lambda: 1464818234.25, node="/catvehicle") as (bridge, port), probing(port) as probe:
        bridge.advertise("/vel", "geometry_msgs/Twist")
        bridge.advertise("/fuel", "tank_msgs/Fuel", DEFINITION)
        yield bridge, probe


async def values(car: tuple[RosBridge, Probe], service_name: str, **args: object) -> Any:
    response = await car[1].call(service_name, args)
    assert response["result"] is True, response
    return response["values"]


@pytest.mark.parametrize("name", ["/rosapi/topics", "rosapi/topics"])
async def test_topics_with_their_types(car: tuple[RosBridge, Probe], name: str) -> None:
    assert await values(car, name) == {"topics": ["/fuel", "/vel"], "types": ["tank_msgs/Fuel", "geometry_msgs/Twist"]}


async def test_a_subscribed_topic_shows_as_it_does_in_ros(car: tuple[RosBridge, Probe]) -> None:
    await car[1].subscribe("/other", type="std_msgs/String")
    assert "/other" in (await values(car, "/rosapi/topics"))["topics"]
    assert await values(car, "/rosapi/publishers", topic="/other") == {"publishers": []}
    assert await values(car, "/rosapi/subscribers", topic="/other") == {"subscribers": ["/rosbridge_websocket"]}


async def test_the_type_of_a_topic(car: tuple[RosBridge, Probe]) -> None:
    assert await values(car, "/rosapi/topic_type", topic="/vel") == {"type": "geometry_msgs/Twist"}
    assert await values(car, "/rosapi/topic_type", topic="vel") == {"type": ""}  # as the real one
    assert await values(car, "/rosapi/topic_type", topic="/nothing") == {"type": ""}
    assert await values(car, "/rosapi/topics_for_type", type="geometry_msgs/Twist") == {"topics": ["/vel"]}


async def test_definitions_ours_and_standard(car: tuple[RosBridge, Probe]) -> None:
    found = await values(car, "/rosapi/topics_and_raw_types")
    texts = dict(zip(found["topics"], found["typedefs_full_text"], strict=True))
    assert texts["/fuel"] == DEFINITION
    assert texts["/vel"].startswith("geometry_msgs/Vector3 linear")


async def test_the_time_is_the_one_given(car: tuple[RosBridge, Probe]) -> None:
    assert await values(car, "/rosapi/get_time") == {"time": {"secs": 1464818234, "nsecs": 250_000_000}}


async def test_ros_2_tells_time_and_version_its_own_way() -> None:
    async with bridging(ros_version=2, now=lambda: 7.5) as (_, port), probing(port) as probe:
        assert (await probe.call("/rosapi/get_time"))["values"] == {"time": {"sec": 7, "nanosec": 500_000_000}}
        assert (await probe.call("/rosapi/get_ros_version"))["values"]["version"] == 2
        assert (await probe.call("/rosapi/service_type", {"service": "/rosapi/topics"}))["values"] == {
            "type": "rosapi_msgs/srv/Topics"
        }


async def test_nodes_and_who_publishes(car: tuple[RosBridge, Probe]) -> None:
    assert await values(car, "/rosapi/nodes") == {"nodes": ["/catvehicle", "/rosapi", "/rosbridge_websocket"]}
    assert await values(car, "/rosapi/publishers", topic="/vel") == {"publishers": ["/catvehicle"]}
    await car[1].send(op="advertise", topic="/vel", type="geometry_msgs/Twist")
    assert await values(car, "/rosapi/publishers", topic="/vel") == {
        "publishers": ["/catvehicle", "/rosbridge_websocket"]
    }
    details = await values(car, "/rosapi/node_details", node="/catvehicle")
    assert details == {"subscribing": [], "publishing": ["/fuel", "/vel"], "services": []}


async def test_services_and_their_types(car: tuple[RosBridge, Probe]) -> None:
    car[0].add_service("/stop", "std_srvs/Trigger", lambda _: {})
    services = (await values(car, "/rosapi/services"))["services"]
    assert "/stop" in services
    assert "/rosapi/topics" in services
    assert await values(car, "/rosapi/service_type", service="/stop") == {"type": "std_srvs/Trigger"}
    assert await values(car, "/rosapi/services_for_type", type="std_srvs/Trigger") == {"services": ["/stop"]}
    assert await values(car, "/rosapi/service_node", service="/stop") == {"node": "/catvehicle"}


async def test_message_details_name_every_type_inside(car: tuple[RosBridge, Probe]) -> None:
    typedefs = (await values(car, "/rosapi/message_details", type="geometry_msgs/TwistStamped"))["typedefs"]
    types = [typedef["type"] for typedef in typedefs]
    assert types == [
        "geometry_msgs/TwistStamped",
        "std_msgs/Header",
        "time",
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3",
    ]
    assert typedefs[1]["fieldnames"] == ["seq", "stamp", "frame_id"]
    assert typedefs[1]["fieldtypes"] == ["uint32", "time", "string"]
    own = (await values(car, "/rosapi/message_details", type="tank_msgs/Fuel"))["typedefs"]
    assert [(d["fieldnames"], d["fieldtypes"]) for d in own] == [(["volume", "note"], ["float64", "string"])]


async def test_message_details_of_arrays_and_constants(car: tuple[RosBridge, Probe]) -> None:
    fix = (await values(car, "/rosapi/message_details", type="sensor_msgs/NavSatFix"))["typedefs"][0]
    lengths = dict(zip(fix["fieldnames"], fix["fieldarraylen"], strict=True))
    assert (lengths["latitude"], lengths["position_covariance"]) == (-1, 9)
    assert dict(zip(fix["constnames"], fix["constvalues"], strict=True))["COVARIANCE_TYPE_KNOWN"] == "3"
    scan = (await values(car, "/rosapi/message_details", type="sensor_msgs/LaserScan"))["typedefs"][0]
    assert dict(zip(scan["fieldnames"], scan["fieldarraylen"], strict=True))["ranges"] == 0


@pytest.mark.parametrize("version", [1, 2])
async def test_its_own_services_are_described(version: RosVersion) -> None:
    """The answer of each service matches its description."""
    args = {"type": "std_msgs/String", "service": "/rosapi/topics", "topic": "/vel", "node": "/car", "name": "/a:b"}
    async with bridging(ros_version=version) as (bridge, port), probing(port) as probe:
        bridge.advertise("/vel", "geometry_msgs/Twist")
        for service in bridge.services.all():
            details = await probe.call("/rosapi/service_response_details", {"type": service.type})
            assert details["result"], service.name
            named = [name.removeprefix("_") for name in details["values"]["typedefs"][0]["fieldnames"]]
            args["type"] = service.type if "service_re" in service.name else "std_msgs/String"
            wanted = {name: args.get(name, "0") for name in service.arguments}
            assert sorted((await probe.call(service.name, wanted))["values"]) == sorted(named), service.name


@pytest.mark.parametrize(
    ("service", "args", "why"),
    [
        ("/rosapi/nothing", {"name": "x"}, "Service /rosapi/nothing does not exist"),
        ("/rosapi/message_details", {"type": "no_such/Type"}, "Unable to load the manifest for package no_such"),
        ("/rosapi/topic_type", {"topic": 7}, "requires a string for field topic, but got a <class 'int'>"),
    ],
)
async def test_what_cannot_be_answered_fails_with_the_reason(
    car: tuple[RosBridge, Probe], service: str, args: object, why: str
) -> None:
    await car[1].send(op="call_service", service=service, args=args, id="q")
    response = await car[1].hear()
    assert (response["op"], response["result"], response["id"]) == ("service_response", False, "q")
    assert why in response["values"]


@pytest.mark.parametrize("constant", ["int8 kLeft=1", "int8 kLeft = 1", "string NONE="])
async def test_a_service_whose_type_has_constants_of_ros_1(car: tuple[RosBridge, Probe], constant: str) -> None:
    both = f"{constant}\nint32 side\n"
    car[0].add_service("/turn", "demo/Turn", lambda args: {"got": dict(args)}, request=both, response=both)
    for side in ("request", "response"):
        [found] = (await values(car, f"/rosapi/service_{side}_details", type="demo/Turn"))["typedefs"]
        assert (found["fieldnames"], found["fieldtypes"]) == (["side"], ["int32"])
    assert await values(car, "/turn", side=3) == {"got": {"side": 3}}


async def test_a_service_without_fields_but_constants(car: tuple[RosBridge, Probe]) -> None:
    only = "int8 kLeft=1\n"
    car[0].add_service("/turn", "demo/Turn", lambda args: {"got": dict(args)}, request=only, response=only)
    [found] = (await values(car, "/rosapi/service_request_details", type="demo/Turn"))["typedefs"]
    assert found["fieldnames"] == []
    assert await values(car, "/turn") == {"got": {}}
