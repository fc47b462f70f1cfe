"""How often a node requests frames of an agent."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, cast

from nats.aio.client import Client

from server.bus import nats_wire as wire
from server.bus.nats_pulls import MOST, Pulls
from server.bus.nats_questions import Questions
from tests.server.bus.buses import until


async def test_an_agent_that_answers_at_once_does_not_keep_the_node_busy() -> None:
    requests = 0

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        nonlocal requests
        requests += 1
        await asyncio.sleep(0)
        head = wire.FrameHead(run="a", number=requests if requests % 2 else 0, now_s=1.0)
        return SimpleNamespace(data=wire.encode_frame(head, "x"))

    now = asyncio.get_running_loop().time
    questions = Questions(now=now)
    questions.client = cast(Client, SimpleNamespace(request=request))
    pulls = Pulls(questions, lambda *_: None, lambda *_: None, now=now)
    pulls.look("ocelot", "state", True)
    began_s = now()
    await until(lambda: requests > 2 * MOST + 5)
    took_s = now() - began_s
    assert requests <= MOST * (took_s + 1) + 5
    assert took_s >= 1.9, "the third hundred is not requested before the third second"
    await pulls.stop()
