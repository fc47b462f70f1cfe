"""`--like real` on the wire: ends of connections, and what the commands make of it."""

from __future__ import annotations

import argparse
import asyncio
import json
from typing import Any

import pytest
import websockets

from server.cli import replay, simulate
from server.rosbridge_server.server import RealOptions, ServiceFailed
from server.simulator.service import CarService
from tests.server.rosbridge_server.conftest import bridging

pytestmark = pytest.mark.world(n=1)

TIME = json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "t"})
WITHIN_S = 5.0


async def end_of(socket: websockets.ClientConnection) -> int | None:
    await asyncio.wait_for(socket.wait_closed(), WITHIN_S)
    return socket.close_code


async def answer_of(socket: websockets.ClientConnection) -> Any:
    return json.loads(await asyncio.wait_for(socket.recv(), WITHIN_S))


@pytest.mark.parametrize(("ros", "server"), [(1, "AutobahnPython"), (2, "TornadoServer")])
async def test_the_server_names_itself(ros: Any, server: str) -> None:
    async with (
        bridging(ros_version=ros, like="real") as (_, port),
        websockets.connect(f"ws://127.0.0.1:{port}") as socket,
    ):
        assert socket.response is not None
        assert socket.response.headers["Server"].startswith(server)


async def test_ros_2_closes_on_a_frame_over_its_limit_with_1009() -> None:
    async with bridging(ros_version=2, like="real", real=RealOptions(max_message_bytes=4000)) as (_, port):
        async with websockets.connect(f"ws://127.0.0.1:{port}") as socket:
            await socket.send("x" * 5000)
            assert await end_of(socket) == 1009
            assert socket.close_reason == "message too big"


async def test_ros_1_reads_a_frame_over_ten_megabytes() -> None:
    async with bridging(ros_version=1, like="real") as (_, port):
        async with websockets.connect(f"ws://127.0.0.1:{port}", max_size=None) as socket:
            await socket.send(json.dumps({"op": "publish", "topic": "/big", "msg": {"data": "x" * 10_100_000}}))
            await socket.send(TIME)
            assert (await answer_of(socket))["id"] == "t"


async def test_authenticate_closes_without_a_code_on_ros_1_and_does_nothing_on_ros_2() -> None:
    for ros in (1, 2):
        async with bridging(ros_version=ros, like="real", real=RealOptions(authenticate=True)) as (_, port):
            async with websockets.connect(f"ws://127.0.0.1:{port}") as socket:
                await socket.send(TIME)
                if ros == 1:
                    assert await end_of(socket) == 1005
                else:
                    assert (await answer_of(socket))["result"] is True


@pytest.mark.parametrize(("ros", "code", "reason", "answered"), [
    (1, 1000, "", 1000), (1, 3001, "bye", 1000), (2, 1000, "", 1000), (2, 3001, "bye", 3001),
])  # fmt: skip
async def test_a_client_that_closes_is_answered_as_there(ros: Any, code: int, reason: str, answered: int) -> None:
    async with bridging(ros_version=ros, like="real") as (_, port):
        async with websockets.connect(f"ws://127.0.0.1:{port}") as socket:
            await socket.close(code, reason)
            assert socket.protocol.close_rcvd is not None
            assert (socket.protocol.close_rcvd.code, socket.protocol.close_rcvd.reason) == (answered, "")


@pytest.mark.parametrize("ros", [1, 2])
async def test_a_killed_bridge_is_1006_and_refuses(ros: Any) -> None:
    async with bridging(ros_version=ros, like="real") as (bridge, port):
        async with websockets.connect(f"ws://127.0.0.1:{port}") as socket:
            await bridge.kill()
            assert await end_of(socket) == 1006
        with pytest.raises(OSError, match=r"refused|failed"):
            await websockets.connect(f"ws://127.0.0.1:{port}")


async def test_a_fragment_size_takes_answers_apart() -> None:
    async with bridging(like="real") as (_, port), websockets.connect(f"ws://127.0.0.1:{port}") as socket:
        await socket.send(json.dumps({"op": "unsubscribe", "topic": "/x", "fragment_size": 60}))
        await socket.send(TIME)
        pieces = [await answer_of(socket), await answer_of(socket)]
        assert [one["op"] for one in pieces] == ["fragment"] * 2
        assert len(pieces[0]["data"]) == 60


@pytest.mark.parametrize("ros", [1, 2])
async def test_a_muted_topic_comes_to_those_who_subscribe_after_its_end(ros: Any) -> None:
    word = {"op": "subscribe", "topic": "/word"}
    async with bridging(ros_version=ros, like="real") as (bridge, port):
        bridge.advertise("/word", bridge.message_type("std_msgs/String"))
        async with websockets.connect(f"ws://127.0.0.1:{port}") as socket:
            await socket.send(json.dumps(word))
            await socket.send(TIME)
            assert (await answer_of(socket))["id"] == "t"
            bridge.publish("/word", {"data": "before"})
            assert (await answer_of(socket))["msg"] == {"data": "before"}
            bridge.mute("/word")
            bridge.publish("/word", {"data": "while it is muted"})
            bridge.unmute("/word")
            bridge.publish("/word", {"data": "to an old subscription"})
            await socket.send(json.dumps(word | {"op": "unsubscribe"}))
            await socket.send(json.dumps(word))
            await socket.send(TIME)
            assert (await answer_of(socket))["id"] == "t"
            bridge.publish("/word", {"data": "after"})
            assert (await answer_of(socket))["msg"] == {"data": "after"}


@pytest.mark.parametrize("ros", [1, 2])
async def test_a_question_that_fails_is_answered_and_the_next_too(ros: Any) -> None:
    """Whatever a service raises is said to the caller; the services of its node stay."""
    async with bridging(ros_version=ros, like="real") as (bridge, port):

        def says_no(_: Any) -> Any:
            raise ServiceFailed("no")

        bridge.add_service("/car/no", bridge.message_type("std_srvs/Trigger"), says_no, node="/rosapi", request="")
        async with websockets.connect(f"ws://127.0.0.1:{port}") as socket:
            await socket.send(json.dumps({"op": "call_service", "service": "/car/no", "id": "n"}))
            answer = await answer_of(socket)
            assert (answer["id"], answer["result"]) == ("n", False)
            await socket.send(TIME)
            assert (await answer_of(socket))["result"] is True


@pytest.mark.parametrize(("like", "statuses"), [("real", 0), ("helpful", 3)])
async def test_errors_are_status_messages_only_of_the_helpful_bridge(like: Any, statuses: int) -> None:
    async with bridging(like=like) as (_, port), websockets.connect(f"ws://127.0.0.1:{port}") as socket:
        for operation in ({"op": "nothing"}, {"op": "subscribe", "topic": 7}, {"op": "publish", "topic": "/no"}):
            await socket.send(json.dumps(operation))
        await socket.send(TIME)
        seen = []
        while not seen or seen[-1]["op"] != "service_response":
            seen.append(await answer_of(socket))
        assert [one["op"] for one in seen] == ["status"] * statuses + ["service_response"]


def test_both_commands_take_it() -> None:
    for module, rest in ((simulate, []), (replay, ["drive.bag"])):
        parser = argparse.ArgumentParser()
        module.add_arguments(parser)
        assert parser.parse_args(rest).like == "helpful"
        assert parser.parse_args([*rest, "--like", "real"]).like == "real"


@pytest.mark.parametrize("ros", [1, 2])
async def test_the_simulated_car_drives_behind_it(ros: Any) -> None:
    service = CarService(ros_version=ros, like="real", rate=5.0)
    port = await service.start()
    try:
        async with websockets.connect(f"ws://127.0.0.1:{port}") as socket:
            await socket.send(json.dumps({"op": "subscribe", "topic": "/catvehicle/vel"}))
            assert (await answer_of(socket))["msg"].keys() >= {"linear", "angular"}
            await socket.send(json.dumps({"op": "subscribe", "topic": "/gps_fix", "compression": "cbor"}))
            for _ in range(40):  # a fixed array in CBOR: nothing comes
                frame = await asyncio.wait_for(socket.recv(), WITHIN_S)
                assert isinstance(frame, str)
    finally:
        await service.stop()
