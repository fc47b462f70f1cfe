"""The unit of a signal, live: a question requests it, and the answer applies at once and to this car alone."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from server.rosbridge_server.server import RosBridge
from tests.server.cars import driving
from tests.server.viewer import viewer

UNKNOWN = "unit unknown: 0 to 1 or 0 to 100 %"


@asynccontextmanager
async def pressing(bridge: RosBridge, numbers: dict[str, float]) -> AsyncIterator[None]:
    """Publishes the pedals 20 times a second until the block ends."""
    for topic in numbers:
        bridge.advertise(topic, "std_msgs/Float32")

    async def publish() -> None:
        while True:
            for topic, number in numbers.items():
                bridge.publish(topic, {"data": number})
            await asyncio.sleep(0.05)

    task = asyncio.create_task(publish())
    try:
        yield
    finally:
        task.cancel()


def shown(state: dict[str, Any], signal: str) -> tuple[Any, Any, Any]:
    one = state["signals"][signal]
    return one["freshness"], one["unit"], one["value"] and one["value"]["percent"]


def verdict(state: dict[str, Any]) -> str:
    return str(next(one["verdict"] for one in state["checks"] if one["id"] == "pedals"))


@pytest.mark.virtual_time
async def test_the_operator_gets_a_question_and_the_answer_holds_at_once(bridge: RosBridge, server: str) -> None:
    pedals = {"/brake": 0.0, "/throttle": 0.0}
    async with pressing(bridge, pedals), driving(bridge), viewer(server) as one:
        state = await one.state(lambda s: shown(s, "brake") == shown(s, "accelerator") == ("fresh", "%", 0.0))
        assert state["questions"] == []
        pedals |= {"/brake": 1.0, "/throttle": 1.0}
        state = await one.state(lambda s: len(s["questions"]) == 2)
        assert shown(state, "brake") == shown(state, "accelerator") == ("not_measured", "", None)
        assert state["signals"]["brake"]["note"] == UNKNOWN
        assert verdict(state) == "unknown"
        question = state["questions"][0]
        assert (question["signal"], question["kind"]) == ("brake", "unit")
        assert question["words"] == "Brake: in which unit is /brake?"
        assert [option["label"] for option in question["options"]] == ["0 to 1", "0 to 100 %"]
        answer = await one.ask(kind="set", units={"brake": "share", "accelerator": "share"})
        assert answer["ok"]
        state = await one.state(lambda s: verdict(s) == "fault")
        assert state["questions"] == []
        assert shown(state, "brake") == shown(state, "accelerator") == ("fresh", "%", 100.0)
        await one.state(lambda s: any(alarm["id"] == "pedals" for alarm in s["alarms"]))


@pytest.mark.virtual_time
async def test_two_publishers_are_a_sentence_and_no_question(bridge: RosBridge, server: str) -> None:
    pedals = {"/brake": 0.3}
    async with pressing(bridge, pedals), driving(bridge), viewer(server) as one:
        await one.state(lambda s: s["signals"]["brake"]["note"] == UNKNOWN)
        for _ in range(6):
            pedals["/brake"] = 30.3 - pedals["/brake"]
            await asyncio.sleep(0.05)
        state = await one.state(lambda s: "two publishers" in str(s["signals"]["brake"]["note"]))
        assert shown(state, "brake") == ("not_measured", "", None)
        assert state["questions"] == []
