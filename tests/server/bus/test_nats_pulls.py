"""When a node requests frames of an agent."""

from __future__ import annotations

import asyncio
import random
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import orjson
import pytest
from nats.aio.client import Client
from nats.aio.msg import Msg

from server.bus import nats_wire as wire
from server.bus.nats_agent import NatsAgent
from server.bus.nats_bus import NatsBus
from server.bus.nats_pulls import EVERY_S, MOST, MOST_UNDER_WAY, Pulls, _Newest
from server.bus.nats_questions import GONE_AFTER_S, Questions
from tests.server.bus.buses import Clock, local_buses, until


async def test_an_agent_that_answers_at_once_does_not_keep_the_node_busy() -> None:
    requests = 0

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        nonlocal requests
        requests += 1
        assert wire.decode(wire.Pull, body).inflates
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


@pytest.mark.virtual_time
@pytest.mark.parametrize(("kind", "least", "greatest"), [("state", 2, MOST_UNDER_WAY), ("scan", 1, 1)])
async def test_over_a_slow_radio_a_few_states_are_requested_at_once_and_no_older_one_replaces_a_newer_one(
    kind: str, least: int, greatest: int
) -> None:
    now = asyncio.get_running_loop().time
    sent_s: list[float] = []
    kept: list[str | bytes] = []
    under_way, most = 0, 0

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        nonlocal under_way, most
        sent_s.append(now())
        under_way += 1
        most = max(most, under_way)
        number = len(sent_s) if len(sent_s) % 3 else len(sent_s) - 2  # each third one brings an older frame
        await asyncio.sleep(0.48 if len(sent_s) % 2 else 0.4)  # of four, two answers come close to each other
        under_way -= 1
        return SimpleNamespace(data=wire.encode_frame(wire.FrameHead(run="a", number=number, now_s=1.0), str(number)))

    questions = Questions(now=now)
    questions.client = cast(Client, SimpleNamespace(request=request))
    pulls = Pulls(questions, lambda *frame: kept.append(frame[2]), lambda *_: None, now=now)
    pulls.look("ocelot", kind, True)
    await until(lambda: len(kept) >= 4)
    await pulls.stop()
    assert least <= most <= greatest
    assert min(b - a for a, b in pairwise(sent_s)) >= EVERY_S - 0.01
    assert [int(one) for one in kept] == sorted({int(one) for one in kept})
    assert asyncio.all_tasks() == {asyncio.current_task()}, "none is left behind"


@pytest.mark.virtual_time
async def test_once_a_radio_is_fast_again_one_state_is_requested_at_a_time() -> None:
    now = asyncio.get_running_loop().time
    began_s = now()
    under_way = 0
    most = {True: 0, False: 0}  # while it is slow, and two seconds later
    requests = 0  # two seconds later

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        nonlocal under_way, requests
        under_way += 1
        is_slow = now() < began_s + 3
        if is_slow or now() > began_s + 5:
            most[is_slow] = max(most[is_slow], under_way)
            requests += not is_slow
        await asyncio.sleep(0.5 if is_slow else 0.02)
        under_way -= 1
        return SimpleNamespace(data=wire.encode_frame(wire.FrameHead(run="a", number=round(1000 * now()), now_s=1.0)))

    questions = Questions(now=now)
    questions.client = cast(Client, SimpleNamespace(request=request))
    pulls = Pulls(questions, lambda *_: None, lambda *_: None, now=now)
    pulls.look("ocelot", "state", True)
    await asyncio.sleep(8)
    await pulls.stop()
    assert most[True] > 1
    assert most[False] == 1
    assert requests >= 0.9 * 3 / 0.02, "the next one follows each answer at once"


async def test_a_late_answer_of_a_run_that_has_ended_is_left_out() -> None:
    kept: list[tuple[str, float]] = []
    answers: list[asyncio.Future[Any]] = []

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        answers.append(asyncio.get_running_loop().create_future())
        return await answers[-1]

    def frame(run: str, number: int) -> Any:
        return SimpleNamespace(data=wire.encode_frame(wire.FrameHead(run=run, number=number, now_s=1.0), run))

    clock = Clock()
    questions = Questions(now=clock)
    questions.client = cast(Client, SimpleNamespace(request=request))
    pulls = Pulls(questions, lambda *frame: kept.append((str(frame[2]), frame[3])), lambda *_: None, now=clock)
    newest = _Newest()
    earlier = asyncio.create_task(pulls._request("ocelot", "state", newest))
    await until(lambda: len(answers) == 1)
    clock.ahead_s += 0.1
    later = asyncio.create_task(pulls._request("ocelot", "state", newest))
    await until(lambda: len(answers) == 2)
    answers[1].set_result(frame("new", 1))
    await later
    answers[0].set_result(frame("old", 70))
    await earlier
    assert [run for run, _ in kept] == ["new"]
    assert newest.run == "new"


async def test_the_likely_offset_of_an_agents_clock_begins_anew_with_its_run() -> None:
    clock, later_s = Clock(), []
    run, ahead_s = "old", 1000.0

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        clock.ahead_s += 0.3
        head = wire.FrameHead(run=run, number=1, now_s=clock() + ahead_s)
        clock.ahead_s += 0.3
        return SimpleNamespace(data=wire.encode_frame(head, "x"))

    questions = Questions(now=clock)
    questions.client = cast(Client, SimpleNamespace(request=request))
    pulls = Pulls(questions, lambda *frame: later_s.append(frame[4]), lambda *_: None, now=clock)
    newest = _Newest()
    await pulls._request("ocelot", "state", newest)
    run, ahead_s = "new", 1000.2  # by less than a round trip: this contradicts nothing of the earlier run
    await pulls._request("ocelot", "state", newest)
    assert later_s == pytest.approx([0.3, 0.3], abs=0.02)


async def test_no_state_was_likely_put_before_the_moment_that_is_certain() -> None:
    later_s: list[float] = []
    clock = Clock()
    pulls = Pulls(Questions(now=clock), lambda *frame: later_s.append(frame[4]), lambda *_: None, now=clock)
    newest = _Newest()
    newest.likely.answered(0.0, 1000.5, 1000.5, 0.6)  # likely put at 0.3, but 0.4 is certain by an earlier pull
    pulls._take("ocelot", "state", newest, wire.FrameHead(run="a", number=1, now_s=1000.5), "x", 0.4)
    assert later_s == [0.0]


async def test_an_agent_that_waits_for_its_next_frame_has_one_pull_of_it() -> None:
    time_s = 0.0
    requests = under_way = most = 0

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        nonlocal time_s, requests, under_way, most
        requests, under_way = requests + 1, under_way + 1
        most = max(most, under_way)
        await asyncio.sleep(1.5 * EVERY_S)
        time_s, under_way = time_s + 1.0, under_way - 1
        return SimpleNamespace(
            data=wire.encode_frame(wire.FrameHead(run="a", number=requests, now_s=1.0, waited_s=0.9))
        )

    questions = Questions(now=lambda: time_s)
    questions.client = cast(Client, SimpleNamespace(request=request))
    pulls = Pulls(questions, lambda *_: None, lambda *_: None, now=lambda: time_s)
    pulls.look("ocelot", "state", True)
    await until(lambda: requests >= 5)
    await pulls.stop()
    assert most == 1


async def test_what_was_requested_of_an_agent_that_was_gone_is_requested_anew_once_it_is_back() -> None:
    """Behind a gap no page waits until the lost request has ended."""
    requests: list[str] = []

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        requests.append(subject)
        await asyncio.Event().wait()

    clock = Clock()
    bus = NatsBus(now=clock)
    bus._questions.client = cast(Client, SimpleNamespace(request=request, is_connected=True))

    async def come(vehicle: str) -> None:
        here = wire.encode(wire.Here(run="a", last=0, resumes=True))
        await bus._on_here(cast(Msg, SimpleNamespace(subject=wire.subject(vehicle, "here"), data=here)))
        await asyncio.sleep(0)

    for vehicle in ("ocelot", "margay"):
        await come(vehicle)
        bus.watch(vehicle, lambda _: None)
    await until(lambda: len(requests) == 2)
    clock.ahead_s += 1.0
    await come("ocelot")
    assert len(requests) == 2, "it was not gone"
    clock.ahead_s += GONE_AFTER_S + 0.1
    await come("ocelot")
    await until(lambda: len(requests) == 3)
    assert requests[2] == wire.subject("ocelot", "pull.state")
    await bus.stop()


async def test_behind_a_gap_only_the_newest_connection_of_an_agent_counts() -> None:
    """What an earlier one had sent is delivered late: it shows nothing of now, and requests would be lost with it."""
    requests: list[str] = []

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        requests.append(subject)
        await asyncio.Event().wait()

    clock = Clock()
    bus = NatsBus(now=clock)
    bus._questions.client = cast(Client, SimpleNamespace(request=request, is_connected=True))

    async def come(connection: int, run: str = "a") -> None:
        here = wire.encode(wire.Here(run=run, last=0, resumes=True, connection=connection))
        await bus._on_here(cast(Msg, SimpleNamespace(subject=wire.subject("ocelot", "here"), data=here)))
        await asyncio.sleep(0)

    await come(2)
    bus.watch("ocelot", lambda _: None)
    await until(lambda: len(requests) == 1)
    clock.ahead_s += GONE_AFTER_S + 0.1
    await come(1)
    assert len(requests) == 1
    assert bus.link_trouble("ocelot") is not None
    await come(3)
    await until(lambda: len(requests) == 2)
    assert bus.link_trouble("ocelot") is None
    await come(4)
    await until(lambda: len(requests) == 3)  # it was lost for a moment, and requests with it
    await come(4)
    assert len(requests) == 3
    clock.ahead_s += GONE_AFTER_S + 0.1
    await come(1, run="b")
    await until(lambda: len(requests) == 4)
    assert bus.link_trouble("ocelot") is None, "it has started again"
    await bus.stop()


async def test_each_connection_of_an_agent_has_a_higher_number() -> None:
    sent: list[wire.Here] = []

    async def nothing(*_: Any, **__: Any) -> Any:
        return SimpleNamespace(unsubscribe=nothing)

    async def publish(subject: str, body: bytes) -> None:
        sent.append(wire.decode(wire.Here, body))

    async with local_buses() as both:
        agent = NatsAgent(both.session, run="a", now=Clock())
        for is_stopped in (False, True, False):
            client = SimpleNamespace(publish=publish, subscribe=nothing, flush=nothing, is_connected=True)
            await agent.start(cast(Client, client))
            if is_stopped:
                await agent.stop()
        await agent.stop()
    assert [here.connection for here in sent] == [1, 1, 2, 2, 3, 3]


async def test_an_agent_compresses_a_frame_for_a_node_that_inflates_it_and_by_a_frame_that_the_node_has() -> None:
    answers: list[bytes] = []

    async def publish(subject: str, data: bytes) -> None:
        if subject == "node":
            answers.append(data)

    async def pull(kind: str, **more: Any) -> bytes:
        before = len(answers)
        body = orjson.dumps({"have": 0, "run": "", **more})
        message = SimpleNamespace(subject=f"veh.ocelot.pull.{kind}", data=body, reply="node")
        await agent._on_pull(cast(Msg, message))
        await until(lambda: len(answers) > before)
        return answers[-1]

    state = random.Random(1).randbytes(8000).hex()
    async with local_buses() as both:
        agent = NatsAgent(both.session, run="a", now=Clock())
        agent._client = cast(Client, SimpleNamespace(is_connected=True, max_payload=1 << 20, publish=publish))
        both.session.put("ocelot", "state", f"{state}1")
        assert len(await pull("state")) > 16_000, "a node of the version before last"
        compressed = await pull("state", inflates=True)
        assert 7000 < len(compressed) < 10_000
        have = wire.decode_frame(compressed)[0].number
        both.session.put("ocelot", "state", f"{state}2")
        small = await pull("state", have=have, run="a", inflates=True, is_base=True)
        assert len(small) < 500
        assert wire.decode_frame(small, f"{state}1".encode())[1] == f"{state}2"
        for more in ({"have": have, "run": "a"}, {"have": have, "is_base": True}, {"run": "a", "is_base": True}):
            answer = await pull("state", inflates=True, **more)
            assert wire.decode_frame(answer)[1] == f"{state}2", f"not by another frame: {more}"
        both.session.put("ocelot", "scan", bytes(5000))
        assert wire.decode_frame(await pull("scan", inflates=True))[1] == bytes(5000)
        agent._client = None
        await agent.stop()


async def test_a_node_has_its_newest_state_as_a_base_also_behind_a_gap_until_an_answer_cannot_be_read() -> None:
    pulls_sent: list[wire.Pull] = []
    state = random.Random(1).randbytes(8000).hex()

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        pulls_sent.append(pull := wire.decode(wire.Pull, body))
        number = len(pulls_sent)
        if number == 3:
            await asyncio.sleep(3600)
        frame = wire.encode_frame(wire.FrameHead(run="a", number=number, now_s=1.0), f"{state}{number}")
        base = f"{state}{pull.have}".encode() if pull.is_base else b""
        data = wire.compressed(frame, f"{state}of another run".encode() if number == 5 else base)
        return SimpleNamespace(data=data)

    kept: list[str | bytes] = []
    questions = Questions(now=Clock())
    questions.client = cast(Client, SimpleNamespace(request=request))
    pulls = Pulls(questions, lambda *frame: kept.append(frame[2]), lambda *_: None, now=Clock())
    pulls.look("ocelot", "state", True)
    await until(lambda: len(pulls_sent) == 3)
    pulls.again("ocelot")
    await until(lambda: len(pulls_sent) >= 7)
    await pulls.stop()
    assert [(one.have, one.is_base) for one in pulls_sent[:7]] == [
        (0, False), (1, True), (2, True), (2, True), (4, True), (4, False), (6, True),
    ]  # fmt: skip
    assert kept[:4] == [f"{state}{number}" for number in (1, 2, 4, 6)]
    assert questions.refused == 1
