"""What failed is named: login, rosapi, a dead node, roscore, a neighbour, a glob; and nothing else is blamed."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

import pytest

from server.rosbridge import connection_errors
from server.rosbridge.diagnosis import SILENT_S, Diagnosis
from server.rosbridge.link import RosLink
from server.rosbridge.live_source import CallFailed, LinkDown
from server.rosbridge.rosapi_client import Questions
from server.vehicle import discovery
from server.vehicle.delivery import Delivery
from server.vehicle.rosapi_watch import MissingWatch
from server.vehicle.undelivered import BLOCKED_AFTER_S, OWN_CLIENTS, Passing
from tests.server.cli.test_doctor import doctor
from tests.server.link_listener import Bridge, LinkListener, bridging, linked, until
from tests.world.bridge_player import FILES, name_of, playing

pytestmark = pytest.mark.world(n=8)

MISSING = "Service /rosapi/get_time does not exist"
NO_MASTER = "Unable to communicate with master!"
KILLED = "Unable to communicate with service [/rosapi/get_time], address [rosrpc://127.0.0.1:40583]"
NO_PACKAGE = "call_service InvalidPackageException: Unable to load the manifest for package rosapi. Caused by: rosapi"
NO_NODE = "failed to get service names and types: rcl node's context is invalid, at /project/src/rcl/node.c:401"

# Answers one a second, None: good; what is named at the end, while messages of the car come.
ENDINGS = {
    "all is well": ([None, None], None),
    "one failure is none": ([None, MISSING], None),
    "never there": ([MISSING, MISSING], "no_rosapi"),
    "ended": ([None, MISSING, MISSING], "rosapi_ended"),
    "killed": ([None, KILLED, KILLED], "rosapi_ended"),
    "roscore is gone": ([None, NO_MASTER], "roscore_gone"),
    "another roscore, without rosapi": ([None, NO_MASTER, MISSING], "roscore_restarted"),
    "another roscore, with rosapi": ([None, NO_MASTER, MISSING, None], "roscore_restarted"),
    "the node has died": ([None, NO_NODE], "bridge_node_dead"),
    "the node is dead from the beginning": ([NO_NODE], "bridge_node_dead"),
    "mended": ([None, MISSING, MISSING, None], None),
    "another error, twice": ([None, "busy", "busy"], None),
    "another error, again and again": ([None, "busy", "busy", "busy"], "rosapi_failing"),
    "rosapi is not installed where the bridge runs": ([NO_PACKAGE] * 3, "rosapi_failing"),
    "mended after another error": ([NO_PACKAGE] * 3 + [None], None),
}


@pytest.mark.parametrize(("answers", "code"), ENDINGS.values(), ids=ENDINGS)
def test_the_errors_of_a_real_bridge_name_the_part_that_failed(answers: list[str | None], code: str | None) -> None:
    one = Diagnosis()
    one.opened()
    for second, error in enumerate(answers):
        if error is None:
            one.answered(float(second))
        else:
            one.failed(error)
    found = one.problem(len(answers) - 0.9, flows=True)
    assert (found.code if found else None) == code
    assert one.is_rosbridge


def test_a_restarted_rosbridge_has_nothing_left_to_mend() -> None:
    one = Diagnosis()
    one.answered(0.0)
    one.failed(NO_MASTER)
    one.opened()
    one.answered(1.0)
    assert one.problem(1.1, flows=True) is None


def test_the_subscriptions_are_renewed_once_roscore_is_back() -> None:
    one = Diagnosis()
    one.answered(0.0)
    assert not one.master_restarted()
    one.failed(NO_MASTER)
    assert not one.master_restarted()
    one.answered(2.0)
    assert one.master_restarted()
    assert not one.master_restarted()


@pytest.mark.parametrize(
    ("was_there", "flows", "code"),
    [(True, True, "rosapi_silent"), (True, False, "ros_gone"), (False, False, "bridge_deaf")],
)
def test_no_answer_is_named_after_a_while(was_there: bool, flows: bool, code: str) -> None:
    one = Diagnosis()
    if was_there:
        one.answered(0.0)
    one.unanswered(1.0)
    assert one.problem(1.0 + SILENT_S - 0.1, flows=flows) is None
    found = one.problem(1.0 + SILENT_S + 0.1, flows=flows)
    assert found is not None
    assert found.code == code
    one.answered(9.0)
    assert one.problem(9.1, flows=flows) is None


def test_a_rosapi_that_hangs_stays_named_when_the_bridge_gives_its_question_up() -> None:
    """A real bridge of ROS 1 answers 5 s after the question, with the error of a rosapi that was killed."""
    one = Diagnosis()
    one.answered(0.0)
    one.unanswered(1.0)
    assert one.problem(4.0, flows=True) == connection_errors.ROSAPI_SILENT
    one.failed(KILLED)
    assert one.problem(6.1, flows=True) == connection_errors.ROSAPI_SILENT
    one.answered(9.0)
    assert one.problem(9.1, flows=True) is None


def passing(subscribers: tuple[str, ...] | None, *, clients: int | None = None) -> Passing:
    one = Passing(bridges=frozenset({"/rosbridge_websocket"}))
    one.follow(["/gps_fix"], 0.0)
    assert one.to_ask(0.0) == ["/gps_fix"]
    one.answered("/gps_fix", subscribers, 0.0)
    if clients is not None:
        one.counted({"data": clients + 2})
    return one


def test_a_topic_that_the_bridge_did_not_subscribe_to_is_hidden() -> None:
    found = passing(("/logger",)).problem(0.1)
    assert found is not None
    assert found.code == "topics_hidden"
    assert "/gps_fix" in found.title
    assert "topics_glob" in found.hint
    assert "types are not installed" in found.hint, "a bridge without a type's package behaves the same"


def test_a_topic_that_is_subscribed_and_does_not_come_is_blocked_by_a_neighbour() -> None:
    one = passing(("/rosbridge_websocket",), clients=1)
    assert one.problem(BLOCKED_AFTER_S - 0.1) is None
    found = one.problem(BLOCKED_AFTER_S + 0.1)
    assert found is not None
    assert found.code == "topics_blocked"
    assert "raw form" in found.hint
    one.follow([], 9.0)  # it came
    assert one.problem(9.0) is None


@pytest.mark.parametrize(
    "one", [passing(None), passing(("/rosbridge_websocket",)), passing(("/rosbridge_websocket",), clients=0)]
)
def test_an_idle_publisher_is_nobody_elses_fault(one: Passing) -> None:
    assert one.problem(99.0) is None


def test_without_the_bridges_name_nothing_is_requested_and_nothing_blamed() -> None:
    one = Passing()
    one.follow(["/gps_fix"], 0.0)
    assert one.to_ask(0.0) == []
    assert one.problem(99.0) is None


@pytest.mark.parametrize(("disconnects", "moments"), [(True, [12, 17]), (False, [15])])
async def test_after_a_neighbour_left_its_topics_are_subscribed_to_anew_and_no_glob_is_blamed(
    monkeypatch: pytest.MonkeyPatch, disconnects: bool, moments: list[int]
) -> None:
    """ROS 1 then forgets our subscription, so that its bridge is no subscriber, as behind a topics_glob."""
    clock: list[float] = [0.0]
    subscribers: tuple[str, ...] = ("/rosbridge_websocket",)
    renewed: list[tuple[float, str]] = []

    async def fetch_subscribers(questions: Any, topic: str) -> tuple[str, ...]:
        return subscribers

    monkeypatch.setattr(discovery, "fetch_subscribers", fetch_subscribers)
    watch = MissingWatch(
        now=lambda: clock[0],
        renew=lambda topic: renewed.append((clock[0], topic)),
        remap=lambda: None,
        resubscribe=lambda: None,
        noted=lambda _: None,
        type_of=lambda _: None,
    )
    watch._undelivered.bridges = frozenset(subscribers)
    monkeypatch.setattr(Delivery, "never_came", lambda *_: ["/vel"])
    found = []
    for tick in range(30):
        clock[0] = float(tick)
        if clock[0] == 12:
            subscribers = ()
        watch.client_count({"data": OWN_CLIENTS + (clock[0] < 12 or not disconnects)})
        await watch.look_behind(None)  # type: ignore[arg-type]
        problem = watch.problem(clock[0])
        found.append(problem.code if problem else None)
    assert set(found[5:12]) == {"topics_blocked"}
    assert "topics_hidden" not in found[: moments[-1] + 5], "not before the new subscriptions had their time"
    assert found[-1] == "topics_hidden"
    assert renewed == [(at_s, "/vel") for at_s in moments]


# -- questions -------------------------------------------------------------------------------------------------------


def answered(values: Any = None, *, result: bool = True) -> Callable[[dict[str, Any]], dict[str, Any] | None]:
    def answer(operation: dict[str, Any]) -> dict[str, Any] | None:
        if operation["op"] != "call_service":
            return None
        return {"op": "service_response", "id": operation["id"], "values": values, "result": result}

    return answer


async def opened(link: RosLink, listener: LinkListener) -> tuple[Questions, Diagnosis]:
    await listener.wait_for("opened")
    diagnosis = Diagnosis()
    return Questions(link, diagnosis, now=time.monotonic), diagnosis


@pytest.mark.virtual_time
async def test_a_question_that_is_not_answered_holds_up_no_command() -> None:
    """On ROS 2 the bridge reads nothing more from a connection until its call is answered."""
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        questions, _ = await opened(link, listener)
        with pytest.raises(CallFailed):
            await questions.call("/rosapi/get_time", timeout_s=0.05)
        for row in link.subscriptions:
            link.unsubscribe(row.topic)
        link.send_now({"op": "advertise", "id": "a", "topic": "/cmd", "type": "geometry_msgs/Twist"})
        await until(lambda: any(sent for sent in bridge.connections if sent and sent[0]["op"] == "advertise"))
        assert [[one["op"] for one in sent] for sent in bridge.connections] == [["advertise"], ["call_service"]]
        questions.stop()


@pytest.mark.virtual_time
async def test_while_a_question_waits_no_other_is_put_behind_it_and_a_late_answer_frees_it() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        questions, diagnosis = await opened(link, listener)
        for _ in range(3):
            with pytest.raises(CallFailed):
                await questions.call("/rosapi/get_time", timeout_s=0.05)
        assert len(bridge.operations) == 1
        await bridge.say({"op": "service_response", "id": bridge.operations[0]["id"], "values": {}, "result": True})
        bridge.answer = answered({"time": {}})
        await until(lambda: diagnosis.is_rosbridge)
        assert await questions.call("/rosapi/get_time") == {"time": {}}
        questions.stop()


@pytest.mark.virtual_time
async def test_a_slow_link_is_not_held_against_rosapi() -> None:
    """Only where the bridge has answered the ping behind a question has it read the question."""
    listener = LinkListener()

    async def slow(bridge: Bridge) -> None:
        for socket in bridge.sockets:
            socket.transport.pause_reading()  # type: ignore[attr-defined]

    async with bridging() as bridge, linked(bridge.address, listener) as link:
        questions, diagnosis = await opened(link, listener)
        bridge.answer = answered({"time": {}})
        await questions.call("/rosapi/get_time")
        await slow(bridge)
        with pytest.raises(CallFailed):
            await questions.call("/rosapi/get_time", timeout_s=0.1)
        assert diagnosis.problem(time.monotonic() + 60.0, flows=True) is None
        questions.stop()


@pytest.mark.virtual_time
async def test_rosapi_that_does_not_answer_is_named_where_the_bridge_has_read_the_question() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        questions, diagnosis = await opened(link, listener)
        with pytest.raises(CallFailed):
            await questions.call("/rosapi/get_time", timeout_s=0.3)
        found = diagnosis.problem(time.monotonic() + 60.0, flows=True)
        assert found == connection_errors.ROSAPI_SILENT
        questions.stop()


@pytest.mark.virtual_time
async def test_questions_end_with_the_link() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        questions, _ = await opened(link, listener)
        link.abort()
        await listener.wait_for("closed")
        with pytest.raises(LinkDown):
            await questions.call("/rosapi/get_time")
        questions.stop()
        assert bridge.operations == []


# -- doctor, on transcripts of real bridges --------------------------------------------------------------------------

DIAGNOSES = {
    "ros1/auth": (2, "wants a login"),
    "ros1/discover_no_rosapi": (1, "rosapi is not running"),
    "ros1/lifecycle_roscore": (2, "roscore"),
    "ros2/lifecycle_sigterm": (2, "ROS node has died"),
}


@pytest.mark.field
@pytest.mark.skipif(not FILES, reason="the transcripts of real bridges are not here")
@pytest.mark.parametrize("name", DIAGNOSES)
async def test_doctor_names_it(name: str) -> None:
    path = next(path for path in FILES if name_of(path) == name)
    code, text = DIAGNOSES[name]
    async with playing(path) as player:
        async with asyncio.timeout(60):
            found, out, err = await doctor(f"127.0.0.1:{player.port}")
    assert text in out + err
    assert "not a rosbridge" not in out + err
    assert found == code
