"""Our client copes with every transcript of a real bridge: no crash, no wrong value, endings named, all resumed."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import cbor2
import numpy as np
import orjson
import pytest

from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.rosbridge.raw_frame import RawFrame
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.world.bridge_player import FILES, Player, name_of, playing

pytestmark = [
    pytest.mark.world(n=1),
    pytest.mark.skipif(not FILES, reason="the transcripts of real bridges are not here"),
]
each = pytest.mark.parametrize("path", FILES, ids=name_of)
TYPED = {64: "u1", 69: "<u2", 70: "<u4", 71: "<u8", 72: "i1", 77: "<i2", 78: "<i4", 79: "<i8", 85: "<f4", 86: "<f8"}

# What the page names at some time while the transcript is played; other files end without a problem or with a close.
NAMED = {
    "ros2/discover": "no_topics",  # rosapi had not yet found the car
    "ros1/auth": "login_wanted",
    "ros1/discover_no_rosapi": "no_rosapi",
    "ros2/discover_no_rosapi": "no_rosapi",
    "ros2/ops_max_message_size": "no_rosapi",
    "ros1/lifecycle_roscore": "roscore_gone",
    "ros2/lifecycle_sigterm": "bridge_node_dead",
    "ros1/lifecycle_sigterm": "closed",
    "ros1/lifecycle_sigint": "closed",
    "ros1/lifecycle_sigkill": "closed",
    "ros2/lifecycle_sigint": "closed",
    "ros2/lifecycle_sigkill": "closed",
}


class Watched(Session):
    """A session that keeps what its link delivers, and all that it names."""

    def __init__(self, *what: Any, **more: Any) -> None:
        self.messages: list[tuple[str, Any]] = []
        self.junk: list[str] = []
        self.named: set[str] = set()
        super().__init__(*what, **more)
        intake = self._parts.intake
        take, take_raw, take_junk = intake.message_received, intake.frame_received, intake.junk_received

        def message_received(topic: str, message: Any, note: str | None) -> None:
            self.messages.append((topic, message))
            take(topic, message, note)

        def frame_received(frame: RawFrame) -> bool:
            is_done = take_raw(frame)
            if is_done:  # not parsed: of transforms that move, a few a second are
                assert frame.topic == "/tf"
                self.messages.append((frame.topic, frame.message()))
            return is_done

        def junk_received(why: str) -> None:
            self.junk.append(why)
            take_junk(why)

        intake.message_received, intake.junk_received = message_received, junk_received  # type: ignore[method-assign]
        intake.frame_received = frame_received  # type: ignore[method-assign]

    def look(self) -> dict[str, Any]:
        state = json.loads(orjson.dumps(self.frame()))
        if state["link"]["problem"] is not None:
            self.named.add(state["link"]["problem"]["code"])
        return state


@contextlib.asynccontextmanager
async def watching(player: Player) -> AsyncIterator[Watched]:
    bus = LocalBus(Journal(None), now=time.monotonic)
    session = Watched(
        Vehicle(name="car", address=f"ws://127.0.0.1:{player.port}"),
        bus,
        now=time.monotonic,
        wall_ms=lambda: time.time_ns() // 1_000_000,
        server=dict,
    )
    await session.start()
    try:
        yield session
    finally:
        await session.stop()


async def until(condition: Any, session: Watched, within_s: float = 20.0) -> None:
    deadline_s = time.monotonic() + within_s
    while not condition():
        session.look()
        assert time.monotonic() < deadline_s, (session.look()["link"], session.look()["session"]["phase"])
        await asyncio.sleep(0.02)


def expected(frame: str | bytes) -> tuple[str, Any] | None:
    """The message of a frame, decoded independently; None: it is no message."""
    if isinstance(frame, bytes):
        hooked = cbor2.loads(frame, tag_hook=lambda tag, _: np.frombuffer(tag.value, TYPED[tag.tag]).tolist())
        return (hooked["topic"], hooked["msg"]) if hooked.get("op") == "publish" else None
    operation = json.loads(frame)
    return (operation["topic"], operation["msg"]) if operation.get("op") == "publish" else None


def put_together(frames: list[str | bytes]) -> list[str | bytes]:
    """The frames, with the message in place of its last fragment; without answers, for which nobody waits any more."""
    whole: list[str | bytes] = []
    text = ""
    for frame in frames:
        operation = json.loads(frame) if isinstance(frame, str) and '"fragment"' in frame[:20] else {}
        if operation.get("op") != "fragment":
            whole.append(frame)
            continue
        text = operation["data"] if operation["num"] == 0 else text + operation["data"]
        is_last = operation["num"] == int(operation["total"]) - 1
        if is_last and json.loads(text)["op"] != "service_response":
            whole.append(text)
    return whole


def same(mine: Any, other: Any) -> bool:
    """Equal to the last bit; a token NaN or Infinity, which is no JSON, may be read as unknown."""
    if isinstance(mine, np.ndarray):
        mine = mine.tolist()
    if isinstance(mine, dict) and isinstance(other, dict):
        return mine.keys() == other.keys() and all(same(mine[key], other[key]) for key in mine)
    if isinstance(mine, list) and isinstance(other, list):
        return len(mine) == len(other) and all(same(a, b) for a, b in zip(mine, other, strict=True))
    if isinstance(other, float) and not math.isfinite(other):
        return mine is None or (isinstance(mine, float) and (mine == other or (mine != mine and other != other)))
    return type(mine) is type(other) and mine == other


@pytest.mark.virtual_time
@each
async def test_a_transcript_is_played_to_our_client(path: Path, caplog: pytest.LogCaptureFixture) -> None:
    name = name_of(path)
    async with playing(path) as player, watching(player) as session:
        transcript = player.transcript
        if name in NAMED:
            await until(lambda: NAMED[name] in session.named, session)
        if name not in ("ros1/auth", "ros2/discover"):  # nothing can be subscribed to there
            await until(lambda: player.played >= 1 + player.closed, session)
            frames = put_together(transcript.frames)
            wanted = [one for one in map(expected, frames) if one is not None]
            await until(lambda: len(session.messages) >= len(wanted), session)
            for mine, other in zip(session.messages, wanted, strict=False):
                assert mine[0] == other[0]
                assert same(mine[1], other[1]), (mine, other)
            others = len(frames) - len(wanted)
            assert len(session.junk) == others * player.played
            await until(lambda: session.look()["session"]["phase"] == "monitoring", session)
            check_resubscribed(player)
        state = session.look()
        assert "not_rosbridge" not in session.named
        assert state["session"]["phase"] == ("failed" if name == "ros1/auth" else "monitoring")
        if name not in NAMED and player.closed == 0:
            assert session.named <= {"car_silent", "no_message", "rosapi_silent", "ros_gone"}, session.named
        problems = [record for record in caplog.records if record.levelno >= logging.ERROR]
        assert [record.getMessage() for record in problems] == []


def check_resubscribed(player: Player) -> None:
    """After a close every row of the connection before is there again, once."""
    rows = [[op["topic"] for op in received if op["op"] == "subscribe"] for received in player.received]
    carriers = [row for row in rows if row]
    if player.closed:
        assert len(carriers) >= 2
        assert set(carriers[0]) <= set(carriers[-1])
    for received in player.received:
        assert all(op["op"] in ("subscribe", "unsubscribe", "call_service") for op in received), received
        if any(op["op"] == "subscribe" for op in received):
            assert not any(op["op"] == "call_service" for op in received), "a call may hold up what stands behind it"


async def test_a_number_of_64_bits_arrives_whole_in_cbor_too() -> None:
    from server.rosbridge import codec as frames

    operation, _ = frames.decode(cbor2.dumps({"op": "publish", "msg": {"data": 2**64 - 1}}), True)
    assert operation["msg"]["data"] == 2**64 - 1
    tagged = b"\xa1\x62op\xc2\x48" + b"\xff" * 8
    assert frames.decode(tagged, True)[0] == {"op": 2**64 - 1}
