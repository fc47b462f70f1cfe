"""The life of a link: what it subscribes to and when, what it refuses to send, how it is hurried and ended."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import itertools
import socket
import time
from collections.abc import AsyncIterator
from typing import Any

import psutil
import pytest

from server.rosbridge import dialer
from server.rosbridge.address import parse
from server.rosbridge.link import MAX_PENDING_CALLS, RosLink
from server.rosbridge.live_source import CallFailed, LinkDown
from server.rosbridge.subscription import Subscription
from tests.server.link_listener import LinkListener, accept, answering, bridging, linked, until
from tests.server.rosbridge.rows import ANY, OVER, ROWS, SCAN, SPEED

pytestmark = pytest.mark.virtual_time


@contextlib.asynccontextmanager
async def leaving_nothing() -> AsyncIterator[None]:
    """No task, timer or descriptor more after the block than before it."""

    def timers() -> int:
        return sum(not handle.cancelled() for handle in asyncio.get_running_loop()._scheduled)  # type: ignore[attr-defined]

    process = psutil.Process()
    gc.freeze()  # what was there before is not searched again
    try:
        before = (asyncio.all_tasks(), timers(), process.num_fds())
        yield
        for _ in range(5):
            await asyncio.sleep(0)
        gc.collect()
        assert asyncio.all_tasks() == before[0]
        assert timers() <= before[1]
        assert process.num_fds() == before[2]
    finally:
        gc.unfreeze()


async def test_the_table_is_sent_once_an_opening_in_order_before_anything_else() -> None:
    listener = LinkListener()
    async with bridging() as bridge:
        link = RosLink(parse(bridge.address), listener, now=time.monotonic)
        for row in (SPEED, SCAN, ANY):
            link.subscribe(row)
        assert link.subscriptions == (SPEED, SCAN, ANY)
        listener.link_opened = lambda: link.send_now(OVER)  # type: ignore[method-assign]
        link.start()
        await until(lambda: OVER in bridge.operations)
        assert bridge.operations == [*ROWS, OVER]
        assert link.heard_s == pytest.approx(time.monotonic(), abs=0.01)
        link.stop()


async def test_a_changed_row_takes_the_place_of_the_old_one_an_equal_one_is_left() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        await listener.wait_for("opened")
        link.subscribe(SPEED)
        link.subscribe(Subscription(topic="/vel", type="geometry_msgs/Twist", queue_length=50))
        link.subscribe(Subscription(topic="/vel", type="geometry_msgs/Twist", queue_length=1))
        link.subscribe(Subscription(topic="/vel", type="geometry_msgs/TwistStamped", queue_length=1))
        link.unsubscribe("/vel")
        link.unsubscribe("/vel")
        link.unsubscribe("/never")
        link.subscribe(ANY)
        link.subscribe(SCAN)
        for row in link.subscriptions:
            link.unsubscribe(row.topic)
        link.send_now(OVER)
        await until(lambda: OVER in bridge.operations)
        brief = [(one["op"], one["topic"], one.get("id"), one.get("queue_length")) for one in bridge.operations[:-1]]
        assert brief == [
            ("subscribe", "/vel", "subscribe:/vel", 50),
            ("subscribe", "/vel", "subscribe:/vel", 1),
            ("unsubscribe", "/vel", "subscribe:/vel", None),
            ("subscribe", "/vel", "subscribe:/vel", 1),
            ("unsubscribe", "/vel", "subscribe:/vel", None),
            ("subscribe", "/any", "subscribe:/any", 0),
            ("subscribe", "/scan", "subscribe:/scan", 1),
            ("unsubscribe", "/any", "subscribe:/any", None),
            ("unsubscribe", "/scan", "subscribe:/scan", None),
        ]
        assert link.subscriptions == ()


async def test_what_changes_while_down_counts_at_the_next_opening() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        link.subscribe(SPEED)
        await listener.wait_for("opened")
        bridge.socket.transport.abort()
        await listener.wait_for("closed")
        link.unsubscribe("/vel")
        link.subscribe(ANY)
        await listener.wait_for("opened", 2)
        link.send_now(OVER)
        await until(lambda: OVER in bridge.operations)
        assert bridge.operations == [ROWS[2], OVER]


async def test_nothing_is_sent_while_down_and_nothing_later() -> None:
    """Before the first opening, between two, while the other side closes, and after the end."""
    listener = LinkListener()
    async with bridging() as bridge:
        link = RosLink(parse(bridge.address), listener, now=time.monotonic)
        with pytest.raises(LinkDown):
            link.send_now(OVER)
        link.start()
        with pytest.raises(LinkDown):
            link.send_now(OVER)
        await listener.wait_for("opened")
        bridge.socket.transport.abort()
        await listener.wait_for("closed")
        assert not link.is_open
        for _ in range(50):
            with pytest.raises(LinkDown):
                link.send_now(OVER)
        with pytest.raises(LinkDown):
            await link.call("/rosapi/topics")
        await listener.wait_for("opened", 2)
        link.send_now(OVER)
        await until(lambda: bridge.operations)
        link.stop()
        with pytest.raises(LinkDown):
            link.send_now(OVER)
        await asyncio.sleep(0.05)
        assert bridge.connections == [[], [OVER]]


async def test_after_the_bridges_goodbye_nothing_is_sent_and_the_link_closes_at_once() -> None:
    """A bridge that sends a close frame and then leaves the connection open."""
    listener = LinkListener()

    async def leave(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        await asyncio.sleep(0.05)
        writer.write(b"\x88\x12\x03\xe9roslaunch is over")
        await asyncio.sleep(5)

    async with answering(leave) as port, linked(f"127.0.0.1:{port}", listener) as link:
        await listener.wait_for("opened")
        problem = await listener.wait_for("closed", within_s=0.06)
        assert problem.code == "closed"
        assert "roslaunch is over" not in problem.title
        assert "(roslaunch is ove" in problem.hint
        assert not link.is_open
        with pytest.raises(LinkDown):
            link.send_now(OVER)


async def test_hurried_while_waiting_it_dials_at_once() -> None:
    listener = LinkListener()
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        async with linked(f"127.0.0.1:{closed.getsockname()[1]}", listener) as link:
            for attempt in range(1, 6):
                await listener.wait_for("failed", attempt, within_s=0.01)
                await asyncio.sleep(dialer.FIRST_RETRY_S - 0.05)
                assert link.attempts == attempt
                link.retry_now()


async def test_hurried_while_dialling_in_the_handshake_or_open_there_is_never_a_second_connection() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        for _ in range(100):
            link.retry_now()
            await asyncio.sleep(0)
        await listener.wait_for("opened")
        for _ in range(20):
            link.retry_now()
            await asyncio.sleep(0.01)
        assert len(bridge.connections) == 1
        bridge.socket.transport.abort()
        await listener.wait_for("closed")
        for _ in range(100):
            link.retry_now()
            await asyncio.sleep(0)
        await listener.wait_for("opened", 2)
        await asyncio.sleep(2 * dialer.LAST_RETRY_S)
        assert len(bridge.connections) == 2
        assert len(listener.all("opened")) == 2


async def test_hurried_in_the_very_moment_of_closing_it_goes_on_trying() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        listener.link_closed = lambda problem: link.retry_now()  # type: ignore[method-assign]
        for opening in range(1, 4):
            await listener.wait_for("opened", opening)
            bridge.socket.transport.abort()
        await listener.wait_for("opened", 4)


async def test_the_wait_between_two_tries_grows_to_its_limit_and_not_beyond() -> None:
    listener = LinkListener()
    times_s: list[float] = []
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        async with linked(f"127.0.0.1:{closed.getsockname()[1]}", listener):
            for count in range(1, 11):
                await listener.wait_for("failed", count)
                times_s.append(time.monotonic())
    waits_s = [later - earlier for earlier, later in itertools.pairwise(times_s)]
    assert waits_s == pytest.approx([0.2, 0.34, 0.578, 0.9826, 1.67042, 2.0, 2.0, 2.0, 2.0], abs=0.001)


async def test_ended_before_it_began() -> None:
    async with leaving_nothing():
        link = RosLink(parse("127.0.0.1:1"), LinkListener(), now=time.monotonic)
        link.stop()
        link.start()  # too late
        link.retry_now()
        assert not link.is_open


async def test_ended_while_open() -> None:
    listener = LinkListener()
    async with bridging() as bridge:
        async with leaving_nothing():
            async with linked(bridge.address, listener) as link:
                await listener.wait_for("opened")
                call = asyncio.create_task(link.call("/rosapi/topics"))
                await asyncio.sleep(0.05)
            with pytest.raises(LinkDown):
                await call
            await until(lambda: bridge.socket.state == 3)
            await bridge.socket.wait_closed()
            bridge.sockets.clear()
        assert [name for name, _ in listener.received] == ["opened"]


async def test_ended_during_the_handshake() -> None:
    listener = LinkListener()
    arrived, left = asyncio.Event(), asyncio.Event()

    async def say_nothing(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        arrived.set()
        with contextlib.suppress(ConnectionError):
            await reader.read()
        writer.transport.abort()
        left.set()

    async with answering(say_nothing) as port, leaving_nothing():
        async with linked(f"127.0.0.1:{port}", listener):
            await asyncio.wait_for(arrived.wait(), 2)
        await asyncio.wait_for(left.wait(), 0.01)
    assert listener.received == []


async def test_ended_just_before_the_handshake_is_done() -> None:
    listener = LinkListener()
    arrived, may_answer, left = asyncio.Event(), asyncio.Event(), asyncio.Event()

    async def answer_late(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        arrived.set()
        await may_answer.wait()
        with contextlib.suppress(ConnectionError):
            await accept(reader, writer)
            await reader.read()
        left.set()

    async with answering(answer_late) as port:
        async with linked(f"127.0.0.1:{port}", listener) as link:
            await asyncio.wait_for(arrived.wait(), 2)
            may_answer.set()
            link.stop()
            await asyncio.wait_for(left.wait(), 0.01)
    assert listener.received == []


async def test_ended_while_waiting_for_the_next_try() -> None:
    listener = LinkListener()
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        async with leaving_nothing():
            async with linked(f"127.0.0.1:{closed.getsockname()[1]}", listener):
                await listener.wait_for("failed")
                await asyncio.sleep(0.01)


async def test_ended_by_the_listener_itself() -> None:
    """A session may end its link from within what the link tells it."""
    async with bridging() as bridge:
        for kind in ("link_opened", "message_received", "link_closed"):
            listener = LinkListener()
            link = RosLink(parse(bridge.address), listener, now=time.monotonic)

            def end(*_: Any, link: RosLink = link) -> None:
                link.stop()

            setattr(listener, kind, end)
            link.start()
            openings = len(bridge.connections)
            while len(bridge.connections) == openings:
                await asyncio.sleep(0.005)
            with contextlib.suppress(Exception):
                await bridge.say({"op": "publish", "topic": "/a", "msg": {}})
                await bridge.say({"op": "publish", "topic": "/a", "msg": {}})
                bridge.socket.transport.abort()
            await asyncio.wait_for(bridge.socket.wait_closed(), 1)
            while link.is_open:
                await asyncio.sleep(0.005)
            link.stop()


# -- calls -------------------------------------------------------------------------------------------------------------


def respond(values: Any, **others: Any) -> Any:
    def answer(operation: dict[str, Any]) -> dict[str, Any] | None:
        if operation["op"] != "call_service":
            return None
        return {"op": "service_response", "id": operation["id"], "values": values, "result": True} | others

    return answer


async def test_a_call_is_answered_with_the_values() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        await listener.wait_for("opened")
        bridge.answer = respond({"topics": ["/a"]})
        assert await link.call("/rosapi/topic_type", {"topic": "/a"}) == {"topics": ["/a"]}
        assert bridge.operations[0] | {"id": ""} == {
            "op": "call_service",
            "id": "",
            "service": "/rosapi/topic_type",
            "args": {"topic": "/a"},
        }


async def test_answers_find_their_own_calls_in_any_order() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        await listener.wait_for("opened")
        calls = [asyncio.create_task(link.call("/rosapi/topic_type", {"topic": f"/s{n}"})) for n in range(5)]
        await until(lambda: len(bridge.operations) == 5)
        for operation in reversed(bridge.operations):
            await bridge.say({"op": "service_response", "id": operation["id"], "values": operation["args"]["topic"]})
        assert await asyncio.gather(*calls) == [f"/s{n}" for n in range(5)]


FAILURES = {
    "text": ("Service /x does not exist", "Service /x does not exist"),
    "no text": (None, ""),
    "an object": ({"deep": [[1]] * 9}, "(dict)"),
    "too much text": ("x" * 100_000, "x" * 300),
}


@pytest.mark.parametrize(("values", "text"), FAILURES.values(), ids=FAILURES)
async def test_a_failed_call_has_the_text_of_the_bridge(values: Any, text: str) -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        await listener.wait_for("opened")
        bridge.answer = respond(values, result=False)
        with pytest.raises(CallFailed) as failure:
            await link.call("/rosapi/get_time")
        assert str(failure.value) == text


async def test_a_call_without_an_answer_fails_in_time_and_a_late_answer_harms_nothing() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        await listener.wait_for("opened")
        with pytest.raises(CallFailed, match=r"/rosapi/topics did not answer within 0\.05 s"):
            await link.call("/rosapi/topics", timeout_s=0.05)
        identity = bridge.operations[0]["id"]
        for wrong in (identity, None, 1, True, [1], {"a": 1}, "call:/other:9"):
            await bridge.say({"op": "service_response", "id": wrong, "values": {}, "result": True})
        await bridge.say({"op": "service_response"})
        bridge.answer = respond("fine")
        assert await link.call("/rosapi/get_time") == "fine"
        assert listener.all("junk") == []


async def test_calls_end_with_the_link_that_carried_them() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        await listener.wait_for("opened")
        calls = [asyncio.create_task(link.call("/rosapi/get_time", timeout_s=5)) for _ in range(3)]
        await until(lambda: len(bridge.operations) == 3)
        bridge.socket.transport.abort()
        for call in calls:
            with pytest.raises(LinkDown):
                await call


async def test_unanswered_calls_are_bounded_and_a_cancelled_one_is_forgotten() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener) as link:
        await listener.wait_for("opened")
        calls = [asyncio.create_task(link.call("/rosapi/get_time", timeout_s=5)) for _ in range(MAX_PENDING_CALLS)]
        await until(lambda: len(bridge.operations) == len(calls))
        with pytest.raises(CallFailed, match="too many"):
            await link.call("/rosapi/get_time")
        for call in calls:
            call.cancel()
        await asyncio.gather(*calls, return_exceptions=True)
        bridge.answer = respond("fine")
        assert await link.call("/rosapi/get_time") == "fine"
