"""Behind a gap an agent works by a connection that was idle, and what the lost one still carries does no harm."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from nats.aio.client import Client

from server.bus import nats_link, nats_spares
from server.bus.broker import Broker as BrokerAddress
from server.bus.bus import NotServed
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.bus.nats_agent import NatsAgent
from server.bus.nats_link import BrokerLink
from server.bus.nats_spares import KEEP_EVERY_S, KEPT_WITHIN_S, SETTLES_S, Spares
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import Buses, event, local_buses, node, numbers, until


class Line:
    """One connection through the cable."""

    def __init__(self) -> None:
        self.passes = asyncio.Event()
        self.passes.set()


class Cable:
    """Forwards connections to one port. What a line carries while it is held waits, and comes late."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._tasks: set[asyncio.Task[None]] = set()
        self.lines: list[Line] = []

    @contextlib.asynccontextmanager
    async def laid(self) -> AsyncIterator[str]:
        listening = await asyncio.start_server(self._join, "127.0.0.1", 0)
        try:
            yield f"nats://127.0.0.1:{listening.sockets[0].getsockname()[1]}"
        finally:
            listening.close()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _join(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._port)
        except OSError:
            writer.transport.abort()
            return
        self.lines.append(line := Line())
        for source, sink in ((reader, far_writer), (far_reader, writer)):
            task = asyncio.create_task(self._carry(line, source, sink))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _carry(self, line: Line, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        try:
            with contextlib.suppress(OSError):
                while data := await source.read(65536):
                    await line.passes.wait()
                    sink.write(data)
                    await sink.drain()
            await line.passes.wait()
        finally:
            sink.close()
            if line in self.lines:
                self.lines.remove(line)


@pytest.fixture
def _soon_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nats_link, "PING_EVERY_S", 0.05)
    monkeypatch.setattr(nats_link, "PING_ANSWERED_WITHIN_S", 3)
    monkeypatch.setattr(nats_link, "ANSWERS_WITHIN_S", 1.0)
    monkeypatch.setattr(nats_spares, "SETTLES_S", 0.05)


@contextlib.asynccontextmanager
async def with_spares(*, more: bool = True) -> AsyncIterator[tuple[Cable, BrokerLink, Buses]]:
    """An agent whose three connections have each a line: the first one works, and two are spare. `more`: it can dial
    others."""
    turn = asyncio.Lock()
    made: list[Client] = []

    async def dial() -> Client:
        async with turn:  # in the order of the lines
            if len(made) == 3 and not more:
                raise ConnectionRefusedError
            made.append(await link._dial())
            return made[-1]

    async with running_broker() as broker, local_buses() as both, node(broker.address, both.clock) as page:
        both.page = page
        cable = Cable(broker.port)
        async with cable.laid() as address:
            agent = NatsAgent(both.session, run="run-1", now=both.clock)
            link = BrokerLink(BrokerAddress(address=address), agent, name="test", spares=2)
            link._spares._dial = dial
            link.start()
            try:
                await until(lambda: link.complaint is None and page.knows("ocelot") and page.knows("margay"))
                await until(lambda: len(link._spares._idle) == 2 and len(cable.lines) == 3)
                yield cable, link, both
            finally:
                await link.stop()


@pytest.mark.usefixtures("_soon_lost")
@pytest.mark.parametrize("lost", [1, 2, 3])
async def test_the_first_connection_that_answers_takes_the_place_of_a_lost_one(lost: int) -> None:
    async with with_spares(more=lost == 3) as (cable, link, both):
        before = link._client
        spares = list(link._spares._idle)
        for line in cable.lines[:lost]:
            line.passes.clear()
        await until(lambda: link._client is not before and link.complaint is None)
        assert (link._client in spares) == (lost < 3)
        both.session.put("ocelot", "state", "back")
        both.page.watch("ocelot", lambda _: None)
        await until(lambda: (frame := both.page.newest("ocelot", "state")) and frame.payload == "back")
        assert (await both.page.request("ocelot", {"what": 1}))["got"] == 1
        await until(lambda: len(link._spares._idle) == (2 if lost == 3 else 2 - lost))
        assert both.page.link_trouble("ocelot") is None  # type: ignore[attr-defined]


@pytest.mark.usefixtures("_soon_lost")
async def test_a_lost_connection_that_comes_to_life_again_answers_and_doubles_nothing() -> None:
    async with with_spares() as (cable, link, both):
        came: list[int] = []
        shown: list[str] = []

        def read(kind: str) -> None:
            if kind == "events":
                came.extend(numbers(both.page.recent_events("ocelot", came[-1] if came else 0, 1000) or []))
            elif kind == "state" and (frame := both.page.newest("ocelot", "state")) is not None:
                shown.append(str(frame.payload))

        both.page.watch("ocelot", read)
        both.page.watch_events("ocelot", read)
        both.session.put("ocelot", "state", "1")
        both.session.append("ocelot", [event()])
        await until(lambda: shown == ["1"] and came == [1])
        before, line = link._client, cable.lines[0]
        line.passes.clear()
        both.session.put("ocelot", "state", "2")  # the answer to a pull, and an event, are under way by the lost one
        both.session.append("ocelot", [event()])
        with pytest.raises(NotServed) as why:
            await both.page.request("ocelot", {"what": "lost"}, deadline_s=0.2)
        assert why.value.outcome == "unknown"
        await until(lambda: link._client is not before and link.complaint is None)
        assert (await both.page.request("ocelot", {"what": "by the spare"}, deadline_s=10.0))["ok"]
        both.session.put("ocelot", "state", "3")
        both.session.append("ocelot", [event()])
        await until(lambda: shown[-1] == "3" and came[-1] == 3)

        line.passes.set()
        for number in range(4, 8):
            assert (await both.page.request("ocelot", {"what": number}))["got"] == number
            both.session.put("ocelot", "state", str(number))
            both.session.append("ocelot", [event()])
            await until(lambda n=number: shown[-1] == str(n) and came[-1] == n)  # type: ignore[misc]
        assert [one["what"] for one in both.commands] == ["by the spare", 4, 5, 6, 7]
        assert came == list(range(1, 8))
        assert shown == sorted(shown)
        assert link.complaint is None


@pytest.mark.usefixtures("_soon_lost")
async def test_a_connection_that_nothing_reads_any_more_is_given_up() -> None:
    """A client whose reading task has ended goes on as connected, and its flush returns at once."""
    async with with_spares(more=False) as (_, link, both):
        first, spare, other = link._client, *link._spares._idle
        worked: list[Client | None] = []

        def is_other() -> bool:
            if link.complaint is None and link._client not in worked:
                worked.append(link._client)
            return other in worked

        for client in (first, spare):
            cast(Any, client)._reading_task.cancel()
        await until(is_other)
        assert spare not in worked
        assert (await both.page.request("ocelot", {"what": 1}, deadline_s=10.0))["ok"]


@pytest.mark.usefixtures("_soon_lost")
async def test_a_spare_connection_that_nothing_reads_any_more_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nats_spares, "KEEP_EVERY_S", 0.05)
    monkeypatch.setattr(nats_spares, "KEPT_WITHIN_S", 1)
    async with with_spares() as (_, link, _both):
        spare = link._spares._idle[0]
        cast(Any, spare)._reading_task.cancel()
        await until(lambda: spare.is_closed)


@pytest.mark.usefixtures("_soon_lost")
async def test_the_answer_to_an_order_comes_by_the_connection_that_follows() -> None:
    async with with_spares() as (_, link, both):
        before = link._client
        order = asyncio.create_task(both.page.request("ocelot", {"what": 1, "takes_s": 1.5}, deadline_s=10.0))
        await until(lambda: both.commands)
        await cast(Client, before).close()
        assert (await order)["got"] == 1
        assert link._client is not before
        assert len(both.commands) == 1


@pytest.mark.usefixtures("_soon_lost")
async def test_a_new_connection_is_taken_at_once_where_the_idle_ones_are_dead_as_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As after a change of this program's address."""
    for name in ("ANSWERS_WITHIN_S", "ANSWERS_AT_LAST_S"):
        monkeypatch.setattr(nats_link, name, 60.0)
    async with with_spares() as (cable, link, _):
        before = [link._client, *link._spares._idle]
        for line in cable.lines:
            line.passes.clear()
        await until(lambda: link._client not in before and link.complaint is None)


async def test_a_broker_that_refuses_spare_connections_is_used_without(tmp_path: Any) -> None:
    (tmp_path / "few.conf").write_text("max_connections: 1\n")
    async with running_broker(include=tmp_path / "few.conf") as broker, local_buses() as both:
        agent = NatsAgent(both.session, run="run-1", now=both.clock)
        link = BrokerLink(BrokerAddress(address=broker.address), agent, name="test", spares=2)
        link.start()
        try:
            await until(lambda: link._logged and link.complaint is None)  # a spare one was refused
            assert not link._spares.is_any
        finally:
            await link.stop()


class Idle:
    """A client, as far as spare connections need one."""

    def __init__(self, name: str, pinged: list[str]) -> None:
        self.name = name
        self.answers = self.is_connected = True
        self.last_error: Exception | None = None
        self._pinged = pinged

    async def rtt(self, timeout: float) -> float:
        self._pinged.append(self.name)
        if not self.answers:
            await asyncio.sleep(timeout)
            raise TimeoutError
        return 0.0

    async def close(self) -> None:
        self.is_connected = False


async def test_of_idle_connections_two_have_copies_and_one_stays_unused_and_is_given_next() -> None:
    def idle() -> str:
        return "".join(cast(Any, one).name for one in spares._idle)

    spares = Spares(cast(Any, None), "nats://127.0.0.1:1", 4)
    for names, used, then in (
        ("abcd", "ab", "cdab"),
        ("abc", "ab", "cab"),
        ("ab", "a", "ba"),
        ("a", "a", "a"),
        ("", "", ""),
    ):
        spares._idle = [cast(Client, Idle(name, [])) for name in names]
        assert "".join(cast(Any, one).name for one in spares.beside()) == used
        assert idle() == then
    ended, lives = Idle("a", []), Idle("b", [])
    ended.is_connected = False
    spares._idle = [cast(Client, ended), cast(Client, lives)]
    assert spares.beside() == [lives]
    await spares.close()


@pytest.mark.virtual_time
async def test_spare_connections_are_pinged_in_turn_and_the_one_that_was_silent_for_longest_is_given_first() -> None:
    made: list[Idle] = []
    pinged: list[str] = []

    names = iter("abcdef")

    async def dial() -> Client:
        name = next(names)
        await asyncio.sleep(1.1 if name == "b" else 1.2 if name == "c" else 1.0)
        made.append(Idle(name, pinged))
        return cast(Client, made[-1])

    spares = Spares(dial, "nats://127.0.0.1:1", 2)
    running = asyncio.create_task(spares.run())
    try:
        assert cast(Any, await spares.take()).name == "a"
        spares.works()
        await asyncio.sleep(SETTLES_S - 0.1)
        assert not spares._idle
        await asyncio.sleep(3.5 * KEEP_EVERY_S)
        assert pinged == ["b", "c", "b", "c", "b"], "first once the broker has pinged it, then in turn"
        spares._probe.reached_s = asyncio.get_running_loop().time()  # the broker's port has just answered
        assert cast(Any, await spares.take()).name == "c"
        spares.works()
        made[1].answers = False
        await asyncio.sleep(SETTLES_S + KEEP_EVERY_S + KEPT_WITHIN_S + 3)
        assert not made[1].is_connected
        await asyncio.sleep(SETTLES_S + 2)
        assert {cast(Any, one).name for one in spares._idle} == {"d", "e"}
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await spares.close()


@pytest.mark.virtual_time
async def test_an_agent_goes_on_announcing_itself_whatever_a_client_raises() -> None:
    sent: list[str] = []

    async def nothing(*_: Any, **__: Any) -> Any: ...

    async def publish(subject: str, body: bytes) -> None:
        sent.append(subject)
        if len(sent) == 3:
            raise RuntimeError("unable to perform operation; the handler is closed")

    async with local_buses() as both:
        agent = NatsAgent(both.session, run="a", now=both.clock)
        client = SimpleNamespace(subscribe=nothing, publish=publish, is_connected=True)
        await agent.start(cast(Client, client))
        await asyncio.sleep(5)
        assert len(sent) >= 9
        agent._client = None
        agent._subscriptions.clear()
        await agent.stop()


async def test_an_agent_announces_itself_in_one_packet_with_its_subscriptions() -> None:
    """A packet more could be lost, and a client writes what was given to it without a pause between."""
    sent: list[str] = []

    async def subscribe(subject: str, cb: Any) -> Any:
        sent.append(f"SUB {subject}")

    async def publish(subject: str, body: bytes) -> None:
        sent.append(f"PUB {subject}")

    async with local_buses() as both:
        agent = NatsAgent(both.session, run="a", now=both.clock)
        client = SimpleNamespace(subscribe=subscribe, publish=publish, is_connected=True)
        asyncio.get_running_loop().call_soon(lambda: sent.append("a pause"))
        await agent.start(cast(Client, client))
        assert [one.split()[0] for one in sent] == ["SUB"] * 4 + ["PUB"] * 2
        agent._client = None
        agent._subscriptions.clear()
        await agent.stop()


async def test_an_agent_offers_a_vehicle_that_came_later_from_its_next_connection_on() -> None:
    begun, sent = [], []

    async def subscribe(subject: str, cb: Any) -> Any:
        sent.append(subject)

    async def publish(subject: str, body: bytes) -> None:
        sent.append(subject)

    client = cast(Client, SimpleNamespace(subscribe=subscribe, publish=publish, is_connected=True))
    async with local_buses() as both:
        bus = LocalBus(Journal(None), now=both.clock)
        agent = NatsAgent(bus, run="a", now=both.clock)
        for vehicle in (None, None, "ocelot", "margay"):
            if vehicle is not None:
                bus.serve(vehicle, both.answer)
            sent.clear()
            await agent.start(client)
            begun.append(
                {task for task in asyncio.all_tasks() if task.get_name() == "agent at the broker announcements"}
            )
        assert len(begun[0]) == 1
        assert begun == [begun[0]] * 4, "one task announces it, however many connections there were"
        assert {subject.split(".")[1] for subject in sent if subject.endswith("here")} == {"ocelot", "margay"}
        agent._client = None
        agent._subscriptions.clear()
        await agent.stop()
