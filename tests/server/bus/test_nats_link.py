"""How a program connects to its broker again."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import psutil
import pytest
from nats.aio.client import Client

from server.bus import nats_link
from server.bus.broker import Broker as BrokerAddress
from server.bus.bus import NotServed
from server.bus.nats_agent import NatsAgent
from server.bus.nats_bus import NatsBus
from server.bus.nats_link import MOST_AT_ONCE, NEWER_AFTER_S, RETRY_S, BrokerLink
from server.bus.nats_spares import MOST_DIALS
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import local_buses, until
from tests.server.bus.test_broker_users import fleet, key_file, linked
from tests.server.bus.test_nats_spares import Idle
from tests.server.bus.test_orders_held import freeze
from tests.server.mail.post import certificates


async def test_over_tls_a_broker_that_does_not_answer_is_dialled_again_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As behind a gap of the radio: nothing waits for a last reply of the lost connection."""
    authority = tmp_path / "ca.pem"
    text, server_pem = certificates(tmp_path)
    authority.write_text(text)
    (tmp_path / "tls.conf").write_text(f'tls {{cert_file: "{server_pem}", key_file: "{server_pem}"}}\n')
    async with running_broker(include=tmp_path / "tls.conf") as broker:

        def ports() -> set[int]:
            """Ours of the connections to the broker."""
            made = psutil.Process().net_connections("tcp")
            ours = (one for one in made if one.raddr and one.raddr.port == broker.port)
            return {int(one.laddr.port) for one in ours if one.status == psutil.CONN_ESTABLISHED}

        address = BrokerAddress(address=broker.address.replace("nats:", "tls:"), authority=authority)
        link = BrokerLink(address, NatsBus(now=lambda: 0.0), name="test")
        dials: list[str] = []

        async def dial() -> Client:
            dials.append("new")
            return await link._dial()

        link.start()
        try:
            await until(lambda: link.complaint is None and len(ports()) == 1)
            (before,) = ports()
            link._spares._dial = dial
            freeze(broker.pid)
            monkeypatch.setattr(nats_link, "PING_ANSWERED_WITHIN_S", 1)
            await until(lambda: dials and before not in ports())
        finally:
            await link.stop()


def link_to(address: str, *parts: Any, spares: int = 2) -> BrokerLink:
    return BrokerLink(BrokerAddress(address=address), *parts, name="test", spares=spares)


class Ends(Idle):
    """A connection that the broker ends after it has answered so many pings."""

    def __init__(self, answers: int) -> None:
        super().__init__("x", [])
        self.is_connected = answers > 0
        self._left = answers

    async def rtt(self, timeout: float) -> float:
        await asyncio.sleep(0.001)
        self._left -= 1
        asyncio.get_running_loop().call_later(0.01, lambda: setattr(self, "is_connected", self._left > 0))
        return 0.001


@pytest.mark.virtual_time
@pytest.mark.parametrize("spares", [0, 2])
@pytest.mark.parametrize("ends_after", ["dial", "start", "ping", "second ping"])
async def test_a_broker_that_ends_each_connection_is_dialled_a_few_times_a_second(ends_after: str, spares: int) -> None:
    """As one does that allows fewer subscriptions than are needed, or a proxy whose broker is away."""
    made: list[Idle] = []
    most = starts = 0

    async def dial() -> Client:
        nonlocal most
        await asyncio.sleep(0.01)
        made.append(Ends({"dial": 0, "start": 1, "ping": 1, "second ping": 2}[ends_after]))
        most = max(most, sum(one.is_connected for one in made))
        return cast(Client, made[-1])

    async def start(client: Client) -> None:
        nonlocal starts
        starts += 1
        if ends_after == "start":
            await client.close()
            raise ConnectionResetError

    async def stop() -> None: ...

    part = SimpleNamespace(open=lambda: None, close=lambda: None, start=start, stop=stop)
    link = link_to("nats://127.0.0.1:1", part, spares=spares)
    link._spares._dial = dial
    link.start()
    try:
        await asyncio.sleep(60)
        assert 20 <= len(made) <= 60 * MOST_DIALS + MOST_DIALS
        assert starts <= 60 / RETRY_S + 2 * MOST_AT_ONCE, "each is logged"
        assert most <= 2 * MOST_DIALS + spares, "however long it goes on"
    finally:
        await link.stop()


async def test_what_accepts_a_connection_and_ends_it_is_no_broker() -> None:
    """As a proxy does whose broker is away."""

    async def end(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b'INFO {"max_payload": 1048576}\r\n')
        while not (await reader.readline()).startswith(b"PING"):
            pass
        writer.close()

    async with await asyncio.start_server(end, "127.0.0.1", 0) as server:
        link = link_to(f"nats://127.0.0.1:{server.sockets[0].getsockname()[1]}")
        with pytest.raises(OSError, match="it ended the connection"):
            await link._dial()
        await link._spares.close()


@pytest.mark.virtual_time
async def test_while_a_broker_is_away_its_port_is_dialled_ten_times_a_second_and_then_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    dials = 0
    connect = asyncio.open_connection

    async def counted(*args: Any, **more: Any) -> Any:
        nonlocal dials
        dials += 1
        return await connect(*args, **more)

    monkeypatch.setattr(asyncio, "open_connection", counted)
    link = link_to("nats://127.0.0.1:1")
    link.start()
    try:
        await asyncio.sleep(60)
        assert 550 <= dials <= 650
        await asyncio.sleep(10)
        dials = 0
        await asyncio.sleep(60)
        assert 50 <= dials <= 70
        assert "Connect call failed" in str(link.complaint)
    finally:
        await link.stop()


@pytest.mark.virtual_time
async def test_complaints_that_come_in_turn_are_logged_once_a_minute_each(caplog: pytest.LogCaptureFixture) -> None:
    link = link_to("nats://127.0.0.1:1")
    with caplog.at_level(logging.WARNING, "catgraph.bus"):
        for number in range(100):
            await link._on_error(OSError("odd" if number % 2 else "even"))
        assert len(caplog.records) == 2
        await asyncio.sleep(nats_link.LOG_AGAIN_S + 1)
        for number in range(100):
            await link._on_error(OSError(f"number {number}"))
        assert len(caplog.records) == 2 + nats_link.MOST_LOGGED


async def test_with_keys_no_answer_is_sent_by_another_connection_than_the_request_came_by(tmp_path: Path) -> None:
    """The broker would refuse it, and that would be reported as a right that is missing."""
    async with fleet(tmp_path) as (broker, seeds), local_buses() as both:
        page = NatsBus(now=both.clock)
        agent = NatsAgent(both.session, run="run-1", now=both.clock, is_limited=True)
        both.session._handlers.pop("margay")  # this agent's key is that of ocelot alone
        room_key, key = key_file(tmp_path, "room", seeds["room"]), key_file(tmp_path, "ocelot", seeds["ocelot"])
        async with linked(page, broker, room_key), linked(agent, broker, key) as link:
            await until(lambda: page.vehicles and page.trouble("ocelot") is None)
            before = cast(Client, link._client)
            command = {"vehicle": "ocelot", "takes_s": 0.5}
            order = asyncio.create_task(page.request("ocelot", command, deadline_s=1.5))
            await until(lambda: both.commands)
            await before.close()
            with pytest.raises(NotServed) as why:
                await order
            assert why.value.outcome == "unknown"
            assert link._client is not before
            assert link.complaint is link.refused is None


@pytest.mark.virtual_time
@pytest.mark.parametrize(
    ("answers_after_s", "is_replaced"), [(NEWER_AFTER_S - 0.2, False), (NEWER_AFTER_S + 0.2, True)]
)
async def test_a_new_connection_takes_no_place_before_the_one_that_was_taken_can_answer(
    answers_after_s: float, is_replaced: bool
) -> None:
    """Behind a gap dials end at about the same time: each replaced one is lost for the next gap."""
    link = BrokerLink(BrokerAddress(address="nats://127.0.0.1:1"), name="test")
    link._spares = cast(Any, SimpleNamespace(is_newer=True, is_any=True))

    async def rtt(timeout: float) -> None:
        await asyncio.sleep(answers_after_s)

    answer = link._answers(cast(Client, SimpleNamespace(rtt=rtt, is_connected=True)))
    with pytest.raises(TimeoutError) if is_replaced else contextlib.nullcontext():
        await answer
