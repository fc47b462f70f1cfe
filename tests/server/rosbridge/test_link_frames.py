"""What a bridge can send that is no proper operation: counted with its reason, and the link goes on."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import cbor2
import orjson
import psutil
import pytest

from server.rosbridge.codec import MAX_CONTAINERS, MAX_DEPTH
from server.rosbridge.websocket import MAX_MESSAGE_BYTES, MAX_SKIPPED_BYTES
from tests.server.link_listener import LinkListener, accept, answering, bridging, linked, text_frame, until

pytestmark = pytest.mark.virtual_time

GOOD = {"op": "publish", "topic": "/a", "msg": {"data": 1}}

JUNK: dict[str, tuple[bytes | str, str]] = {
    "binary noise": (b"\xff\xfe\xfd", "binary noise"),
    "an empty binary frame": (b"", "binary noise"),
    "a PNG": (b"\x89PNG\r\n\x1a\n", "binary noise"),
    "text noise": ("hello", "text that is not JSON"),
    "an empty frame": ("", "text that is not JSON"),
    "a list": ("[]", "a frame that is not an object"),
    "a number": ("1", "a frame that is not an object"),
    "too many parts": ("[" + "[]," * MAX_CONTAINERS + "1]", "a message with too many parts"),
    "too deep": ('{"op":' + "[" * (MAX_DEPTH + 2) + "]" * (MAX_DEPTH + 2) + "}", "a frame that nests too deep"),
    "no operation": ("{}", "an operation that rosbridge does not have"),
    "an unknown operation": ('{"op":"explode"}', "an operation that rosbridge does not have"),
    "an operation that is a number": ('{"op":1}', "an operation that rosbridge does not have"),
    "an operation that is a list": ('{"op":["publish"]}', "an operation that rosbridge does not have"),
    "an operation that is an object": ('{"op":{}}', "an operation that rosbridge does not have"),
    "a client's operation": ('{"op":"subscribe","topic":"/a"}', "an operation that rosbridge does not have"),
    "a fragment": (
        '{"op":"fragment","id":"1","data":"{","num":1,"total":2}',
        "a fragment that does not fit the one before",
    ),
    "a publish without msg": ('{"op":"publish","topic":"/a"}', "a publish without topic or msg"),
    "a publish without topic": ('{"op":"publish","msg":{}}', "a publish without topic or msg"),
    "a topic that is a list": ('{"op":"publish","topic":["/a"],"msg":{}}', "a publish without topic or msg"),
    "a CBOR list that is too short": (b"\x82\x01", "binary noise"),
    "a CBOR list": (cbor2.dumps([GOOD]), "a frame that is not an object"),
    "a CBOR list by reference": (cbor2.dumps({"a": [shared := ["x"], shared]}, value_sharing=True), "binary noise"),
}


@pytest.mark.parametrize(("frame", "why"), JUNK.values(), ids=JUNK)
async def test_junk_is_counted_and_harms_nothing(frame: bytes | str, why: str) -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        await bridge.say(frame)
        await bridge.say(GOOD)
        await listener.wait_for("message")
        assert listener.received == [("opened", None), ("junk", why), ("message", ("/a", {"data": 1}, None))]


QUIET: dict[str, bytes | str] = {
    "an answer to nobody": '{"op":"service_response","id":"call:/x:9","values":{},"result":true}',
    "an answer without id": '{"op":"service_response","values":{}}',
    "an answer with a list for an id": '{"op":"service_response","id":[1],"values":{}}',
    "an answer with an object for an id": '{"op":"service_response","id":{"a":[]},"values":{}}',
    "an answer with an array for an id": cbor2.dumps({"op": "service_response", "id": cbor2.CBORTag(85, b"\0" * 8)}),
}


@pytest.mark.parametrize("frame", QUIET.values(), ids=QUIET)
async def test_answers_that_nobody_waits_for_are_passed_over(frame: bytes | str) -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        await bridge.say(frame)
        await bridge.say(GOOD)
        await listener.wait_for("message")
        assert [name for name, _ in listener.received] == ["opened", "message"]


STATUS: dict[str, tuple[dict[str, Any], tuple[str, str]]] = {
    "text": ({"level": "error", "msg": "no such topic"}, ("error", "no such topic")),
    "nothing": ({}, ("", "")),
    "much text": ({"level": "e" * 999, "msg": "m" * 99_999}, ("e" * 20, "m" * 500)),
    "no text": ({"level": 3, "msg": {"deep": [1]}}, ("(int)", "(dict)")),
    "a long list": ({"level": None, "msg": [1.5] * 100_000}, ("", "(list)")),
}


@pytest.mark.parametrize(("fields", "received"), STATUS.values(), ids=STATUS)
async def test_a_status_of_the_bridge_is_passed_on_shortened(fields: dict[str, Any], received: tuple[str, str]) -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        await bridge.say({"op": "status"} | fields)
        assert await listener.wait_for("status") == received


async def test_indulgence_is_noted() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        await bridge.say('{"op":"publish","topic":"/fix","msg":{"position_covariance":[NaN]}}')
        topic, message, note = await listener.wait_for("message")
        assert topic == "/fix"
        assert message["position_covariance"][0] != message["position_covariance"][0]
        assert note == "bare NaN or Infinity, read as unknown"


async def test_a_message_of_20_mb_is_skipped_and_the_link_stays() -> None:
    """Hanging up would not help: the next message of that topic would be as large, and the link would flap for ever."""
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        await bridge.say(b"x" * 20_000_000)
        await listener.wait_for("junk")
        pieces = ['{"op":"publish","topic":"/big","msg":"', *["x" * 5_000_000] * 4, '"}']
        await bridge.socket.send(pieces)  # in fragments, each small enough
        await bridge.say(GOOD)
        await listener.wait_for("message", within_s=8)
        why = "a message of more than 16 MB"
        assert listener.received == [
            ("opened", None),
            ("junk", why),
            ("large", (None, 20_000_000)),
            ("junk", why),
            ("large", ("/big", sum(map(len, pieces)))),
            ("message", ("/a", {"data": 1}, None)),
        ]


@pytest.mark.field
async def test_of_a_message_of_20_mb_nothing_is_kept() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        before = psutil.Process().memory_info().rss
        await bridge.say(b"x" * 20_000_000)
        await listener.wait_for("junk")
        grown = psutil.Process().memory_info().rss - before
        assert grown < 37e6  # the sender in this process holds 20 MB of it; a copy kept by the link would make it 40


async def test_a_message_just_as_large_as_may_be_is_read() -> None:
    listener = LinkListener()
    empty = len(orjson.dumps({"op": "publish", "topic": "/a", "msg": ""}))
    async with bridging() as bridge, linked(bridge.address, listener):
        await listener.wait_for("opened")
        await bridge.say({"op": "publish", "topic": "/a", "msg": "x" * (MAX_MESSAGE_BYTES - empty)})
        await listener.wait_for("message", within_s=8)
        await bridge.say({"op": "publish", "topic": "/a", "msg": "x" * (MAX_MESSAGE_BYTES - empty + 1)})
        await listener.wait_for("junk", within_s=8)


FAULTY = {
    "more than any message has": (b"\x82\x7f" + (MAX_SKIPPED_BYTES + 1).to_bytes(8, "big") + b"x" * 1000, "256 MB"),
    "a masked frame": (b"\x81\x82\x00\x00\x00\x00{}", "masked"),
    "reserved bits": (b"\xf1\x02{}", "RSV"),
    "an unknown kind of frame": (b"\x83\x00", "reserved opcode"),
    "a fragment of nothing": (b"\x80\x02{}", "continuation"),
    "a message inside a message": (b"\x01\x01{\x81\x02{}", "fragmented"),
    "a long ping": (b"\x89\x7e\x00\x80" + b"x" * 128, "125"),
    "a goodbye with half a code": (b"\x88\x01\x03", "close"),
    "a goodbye with a wrong code": (b"\x88\x02\x00\x01", "close code"),
}


@pytest.mark.parametrize(("frame", "text"), FAULTY.values(), ids=FAULTY)
async def test_what_is_no_websocket_any_more_ends_the_connection_and_it_is_made_anew(frame: bytes, text: str) -> None:
    listener = LinkListener()
    openings = 0

    async def err_once(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal openings
        openings += 1
        await accept(reader, writer)
        writer.write(frame if openings == 1 else text_frame(orjson.dumps(GOOD)))
        await asyncio.sleep(5)

    async with answering(err_once) as port, linked(f"127.0.0.1:{port}", listener):
        problem = await listener.wait_for("closed")
        assert problem.code == "closed"
        assert text in problem.hint
        await listener.wait_for("message")
        assert [name for name, _ in listener.received] == ["opened", "closed", "opened", "message"]


async def test_a_message_in_pieces_with_pings_between_is_whole() -> None:
    listener = LinkListener()
    text = orjson.dumps(GOOD)

    async def split(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        pieces = (
            text_frame(text[:5], final=False) + text_frame(b"hi", opcode=9) + text_frame(b"", opcode=0, final=False)
        )
        for letter in pieces + text_frame(text[5:], opcode=0):
            writer.write(bytes([letter]))
            await asyncio.sleep(0.0005)
        await asyncio.sleep(5)

    async with answering(split) as port, linked(f"127.0.0.1:{port}", listener):
        assert await listener.wait_for("message") == ("/a", {"data": 1}, None)


async def test_ten_thousand_messages_at_once_come_in_order() -> None:
    listener = LinkListener()
    one = b"".join(text_frame(b'{"op":"publish","topic":"/a","msg":%d}' % n) for n in range(10_000))

    async def flood(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        writer.write(one)
        await asyncio.sleep(5)

    async with answering(flood) as port, linked(f"127.0.0.1:{port}", listener):
        await listener.wait_for("message", 10_000)
        assert [message for _, message, _ in listener.all("message")] == list(range(10_000))


# -- faults of our own -------------------------------------------------------------------------------------------------


async def test_a_listener_that_fails_costs_one_message_and_is_logged_once() -> None:
    listener = LinkListener()
    logged: list[logging.LogRecord] = []
    handler = logging.Handler()
    handler.emit = logged.append  # type: ignore[method-assign]
    logging.getLogger("catgraph.link").addHandler(handler)
    take = listener.message_received

    def stumble(topic: str, message: Any, note: str | None) -> None:
        if topic == "/bad":
            raise KeyError(topic)
        take(topic, message, note)

    listener.message_received = stumble  # type: ignore[method-assign]
    try:
        async with bridging() as bridge, linked(bridge.address, listener):
            await listener.wait_for("opened")
            for _ in range(5):
                await bridge.say({"op": "publish", "topic": "/bad", "msg": {}})
            await bridge.say(GOOD)
            await listener.wait_for("message")
            assert listener.all("junk") == ["a message that caused an internal error"] * 5
            assert listener.all("closed") == []
            assert len(logged) == 1
    finally:
        logging.getLogger("catgraph.link").removeHandler(handler)


async def test_a_listener_that_stumbles_over_a_failed_dial_does_not_end_the_dialling() -> None:
    listener = LinkListener()
    problems: list[Any] = []

    def stumble(problem: Any) -> None:
        problems.append(problem)
        raise RuntimeError("no")

    listener.dial_failed = stumble  # type: ignore[method-assign]
    logging.getLogger("catgraph.link").addFilter(hush := lambda record: False)
    try:
        async with linked("127.0.0.1:1", listener):
            await until(lambda: len(problems) == 3)
    finally:
        logging.getLogger("catgraph.link").removeFilter(hush)
