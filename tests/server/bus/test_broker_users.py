"""Who gets what at a real broker: by the keys and permissions that `catgraph fleet` writes."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import platform
import shutil
import subprocess
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import nats
import pytest
from nats.aio.client import Client

from server.bus import broker_users
from server.bus.broker import Broker as BrokerAddress
from server.bus.broker import BrokerRefused
from server.bus.broker_users import FleetRefused
from server.bus.bus import NotServed
from server.bus.nats_agent import NatsAgent
from server.bus.nats_bus import NatsBus
from server.bus.nats_link import SPARES, BrokerLink, processed
from tests.server.bus.broker import PINNED, Broker, check_pinned, nats_server, running_broker
from tests.server.bus.buses import local_buses, until
from tests.server.mail.post import certificates

TODAY = "2026-11-25"
DEPLOY = Path(__file__).resolve().parents[3] / "deploy"


@contextlib.asynccontextmanager
async def fleet(folder: Path) -> AsyncIterator[tuple[Broker, dict[str, str]]]:
    """A broker with the agents ocelot and margay and the web node room; the secret of each."""
    users: tuple[tuple[str, broker_users.Kind], ...] = (("ocelot", "agent"), ("margay", "agent"), ("room", "web"))
    seeds = {name: broker_users.add(folder, name, kind, today=TODAY)[1] for name, kind in users}
    async with running_broker(include=folder / broker_users.CONF) as broker:
        yield broker, seeds


class Guest:
    """A client with one of the keys, which notes what the broker refuses."""

    def __init__(self, client: Client, refused: list[str]) -> None:
        self.client = client
        self.refused = refused
        self.got: list[str] = []

    async def hear(self, subject: str) -> None:
        async def note(message: object) -> None:
            self.got.append(getattr(message, "subject", ""))

        await self.client.subscribe(subject, cb=note)
        await processed(self.client)

    async def say(self, subject: str) -> None:
        await self.client.publish(subject, b"{}")
        await processed(self.client)


@contextlib.asynccontextmanager
async def guest(broker: Broker, seed: str) -> AsyncIterator[Guest]:
    refused: list[str] = []

    async def note(why: Exception) -> None:
        refused.append(str(why))

    client = await nats.connect(broker.address, nkeys_seed_str=seed, error_cb=note)
    try:
        yield Guest(client, refused)
    finally:
        await client.close()


async def test_an_agent_has_its_own_subjects_and_nothing_else(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (broker, seeds), guest(broker, seeds["ocelot"]) as ocelot:
        async with guest(broker, seeds["room"]) as room:
            await room.hear("veh.*.events")
            others = ("veh.margay.events", "veh.margay.here", "veh.margay.ask", "veh.ocelot.http.pull", "_INBOX.room.x")
            for subject in others:
                await ocelot.say(subject)
            for subject in ("veh.margay.ask", "veh.margay.http.*", "veh.*.events", "veh.>", "_INBOX.>", ">"):
                await ocelot.hear(subject)
            assert len(ocelot.refused) == 11, ocelot.refused
            await ocelot.say("veh.ocelot.events")
            await processed(room.client)
            await until(lambda: room.got)
            assert room.got == ["veh.ocelot.events"]
            await ocelot.hear("veh.ocelot.http.*")
            assert len(ocelot.refused) == 11


async def test_a_web_node_speaks_for_no_car(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (broker, seeds), guest(broker, seeds["room"]) as room:
        for subject in ("veh.ocelot.events", "veh.ocelot.here", "$SYS.REQ.SERVER.PING"):
            await room.say(subject)
        for subject in ("veh.*.ask", "veh.*.http.*"):
            await room.hear(subject)
        await room.say("veh.ocelot.http.begin")
        assert len(room.refused) == 5, room.refused


async def answer_to(broker: Broker, connect: str) -> str:
    """What the broker answers to a CONNECT with these options, by its protocol."""
    reader, writer = await asyncio.open_connection("127.0.0.1", broker.port)
    try:
        assert (await reader.readline()).startswith(b"INFO ")
        writer.write(f"CONNECT {connect}\r\nPING\r\n".encode())
        return (await reader.readline()).decode()
    finally:
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()


@pytest.mark.parametrize(
    "connect", ["{}", '{"user": "nobody", "pass": "nobody"}', '{"auth_token": "x"}', '{"nkey": "UABC"}']
)
async def test_a_stranger_gets_nothing(tmp_path: Path, connect: str) -> None:
    async with fleet(tmp_path) as (broker, _):
        assert "Authorization Violation" in await answer_to(broker, connect)


async def test_an_empty_list_lets_nobody_in(tmp_path: Path) -> None:
    broker_users.write(tmp_path, [])
    async with running_broker(include=tmp_path / broker_users.CONF) as broker:
        assert "Authorization Violation" in await answer_to(broker, "{}")


@contextlib.asynccontextmanager
async def linked(part: NatsAgent | NatsBus, broker: Broker, key: Path) -> AsyncIterator[BrokerLink]:
    spares = SPARES if isinstance(part, NatsAgent) else 0
    link = BrokerLink(BrokerAddress(address=broker.address, key=key), part, name="test", spares=spares)
    link.start()
    try:
        yield link
    finally:
        await link.stop()


def key_file(folder: Path, name: str, seed: str) -> Path:
    path = folder / f"{name}.key"
    path.write_text(seed + "\n")
    return path


# nats-py drops, and does not close, the connection that a broker refused while it connects again.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
async def test_a_withdrawn_key_is_sent_away_and_a_returned_one_serves_again(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (broker, seeds), local_buses() as both:
        node = NatsBus(now=both.clock)
        agent = NatsAgent(both.session, run="run-1", now=both.clock)
        both.session._handlers.pop("margay")  # this agent's key is that of ocelot alone
        room_key, key = key_file(tmp_path, "room", seeds["room"]), key_file(tmp_path, "ocelot", seeds["ocelot"])
        async with linked(node, broker, room_key), linked(agent, broker, key) as link:
            assert link.complaint is not None
            await until(lambda: node.vehicles and node.trouble("ocelot") is None)
            await requests(lambda: node)
            assert link.complaint is None

            withdrawn = broker_users.read(tmp_path)
            broker_users.remove(tmp_path, "ocelot")
            broker.reload()
            await until(lambda: link.complaint)
            await until(lambda: node.trouble("ocelot"))
            assert node.vehicles == ("ocelot",), "who is gone is lost, not left out"
            with pytest.raises(NotServed):
                await node.request("ocelot", {"vehicle": "ocelot"}, deadline_s=0.5)
            await until(lambda: "does not know this program's key" in (link.complaint or ""))

            broker_users.write(tmp_path, withdrawn)
            broker.reload()
            await until(lambda: link.complaint is None and node.trouble("ocelot") is None)
            await requests(lambda: node)


async def requests(node: Callable[[], NatsBus]) -> None:
    async with asyncio.timeout(10):
        while True:
            with contextlib.suppress(NotServed):
                answer = await node().request("ocelot", {"vehicle": "ocelot", "what": "x"})
                assert answer == {"ok": True, "got": "x"}
                return
            await asyncio.sleep(0.05)


async def test_a_link_outlives_its_broker(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (broker, seeds), local_buses() as both:
        node = NatsBus(now=both.clock, expected=("ocelot", "margay"))
        notified: list[str] = []
        node.watch("margay", notified.append)
        both.session._handlers.pop("margay")
        agent = NatsAgent(both.session, run="run-1", now=both.clock)
        room_key, key = key_file(tmp_path, "room", seeds["room"]), key_file(tmp_path, "ocelot", seeds["ocelot"])
        await broker.kill()
        async with linked(node, broker, room_key) as link, linked(agent, broker, key):
            await until(lambda: "unserved" in notified)
            assert "broker" in str(node.trouble("ocelot"))
            assert "broker" in str(link.complaint)
            for _ in range(2):
                await broker.start()
                await until(lambda: node.trouble("ocelot") is None)
                assert node.trouble("margay") == "The agent of margay has sent nothing since the server started."
                await requests(lambda: node)
                await broker.kill()
                await until(lambda: node.trouble("ocelot"))


async def test_what_the_broker_refuses_is_reported_while_connected(tmp_path: Path) -> None:
    """An agent with the key of another car: it is connected, and nothing of its own car arrives."""
    async with fleet(tmp_path) as (broker, seeds), local_buses() as both:
        agent = NatsAgent(both.session, run="run-1", now=both.clock)  # of ocelot and margay
        async with linked(agent, broker, key_file(tmp_path, "ocelot", seeds["ocelot"])) as link:
            await until(lambda: "veh.margay.here" in (link.refused or ""))
            assert link.refused is not None
            assert link.refused.startswith(f"The broker {broker.address} refuses a part of what this program needs: ")
            assert "veh.margay.ask" in link.refused
            assert "veh.ocelot" not in link.refused
            await until(lambda: link.complaint is None)
            broker_users.write(tmp_path, [])
            broker.reload()
            await until(lambda: link.complaint)
            assert link.refused is None, "by a connection that is gone"


async def test_a_car_that_a_wildcard_silently_leaves_out_is_shown_as_missing(tmp_path: Path) -> None:
    """A node may receive all cars but one: its subscription is accepted, and no error shows that one is left out."""
    async with fleet(tmp_path) as (broker, seeds), local_buses() as both:
        conf = tmp_path / broker_users.CONF
        allowed = '["veh.*.events","veh.*.here","_INBOX.>"]'
        assert allowed in conf.read_text()
        denied = f'{{"allow": {allowed}, "deny": ["veh.margay.>"]}}'
        conf.write_text(conf.read_text().replace(allowed, denied))
        broker.reload()
        node = NatsBus(now=both.clock, expected=("ocelot", "margay"))
        node.watch("margay", lambda _: None)
        room = key_file(tmp_path, "room", seeds["room"])
        async with linked(node, broker, room) as link, contextlib.AsyncExitStack() as agents:
            for name in ("ocelot", "margay"):  # each offers both, and has the right to one
                agent = NatsAgent(both.session, run="run-1", now=both.clock)
                await agents.enter_async_context(linked(agent, broker, key_file(tmp_path, name, seeds[name])))
            await until(lambda: node.knows("ocelot") and node.trouble("ocelot") is None)
            both.clock.ahead_s += 10.0
            await until(lambda: node.trouble("ocelot") is None)
            assert node.trouble("margay") == "The agent of margay has sent nothing since the server started."
            assert set(node.vehicles) == {"ocelot", "margay"}
            assert (link.complaint, link.refused) == (None, None), "the broker does not report it"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # as above
async def test_over_tls_the_broker_proves_who_it_is(tmp_path: Path) -> None:
    authority_pem, server_pem = certificates(tmp_path)
    authority = tmp_path / "ca.pem"
    authority.write_text(authority_pem)
    _, seed = broker_users.add(tmp_path, "room", "web", today=TODAY)
    key = key_file(tmp_path, "room", seed)
    whole = tmp_path / "whole.conf"
    whole.write_text(f'tls {{cert_file: "{server_pem}", key_file: "{server_pem}"}}\ninclude ./fleet.conf\n')
    async with running_broker(include=whole) as broker:
        address = broker.address.replace("nats:", "tls:")
        for given, is_well in (
            (BrokerAddress(address=address, key=key, authority=authority), True),
            (BrokerAddress(address=address, key=key), False),
            (BrokerAddress(address=broker.address, key=key), False),  # nor is a request for less followed
        ):
            assert ("certificate" in await outcome(given)) is not is_well


async def outcome(broker: BrokerAddress) -> str:
    """Why a link does not come about; "": it does."""
    link = BrokerLink(broker, NatsBus(now=lambda: 0.0), name="test")
    link.start()
    try:
        await until(lambda: link.complaint is None or "certificate" in link.complaint.lower())
        return (link.complaint or "").lower()
    finally:
        await link.stop()


def test_the_broker_takes_the_configuration_that_comes_along(tmp_path: Path) -> None:
    shutil.copy(DEPLOY / "broker.conf", tmp_path)
    _, server_pem = certificates(tmp_path)
    for name in ("broker.crt", "broker.key"):
        shutil.copy(server_pem, tmp_path / name)
    broker_users.add(tmp_path, "ocelot", "agent", today=TODAY)
    checked = subprocess.run([nats_server(), "-t", "-c", "broker.conf"], cwd=tmp_path, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr


def test_the_list_and_what_it_refuses(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "fleet"
    assert broker_users.read(folder) == []
    user, seed = broker_users.add(folder, "ocelot", "agent", today=TODAY)
    assert broker_users.read(folder) == [user]
    for path in folder.iterdir():
        assert seed not in path.read_text(), "the secret is kept by nobody but the car"
    with pytest.raises(FleetRefused, match="in the list already"):
        broker_users.add(folder, "ocelot", "web", today=TODAY)
    for name in ("", "a b", "a.b", "ü", "*", "x" * 41, "-a", "a\nb"):
        with pytest.raises(FleetRefused, match="is no name"):
            broker_users.add(folder, name, "agent", today=TODAY)
    with pytest.raises(FleetRefused, match="not in the list"):
        broker_users.remove(folder, "margay")
    assert broker_users.remove(folder, "ocelot") == user
    assert broker_users.read(folder) == []
    many = [dataclasses.replace(user, name=f"car-{i}") for i in range(300)]
    broker_users.write(folder, many)
    with pytest.raises(FleetRefused, match="too long"):
        broker_users.write(folder, [dataclasses.replace(user, name=f"car-{i}") for i in range(600)])
    assert len(broker_users.read(folder)) == 300
    for broken in ("[[user]]\nname = 3", "user = 3", "x = [", '[[user]]\nname="a"\nkind="king"\nkey="x"\nadded=""'):
        (folder / broker_users.LIST).write_text(broken)
        with pytest.raises(FleetRefused):
            broker_users.read(folder)


@pytest.mark.parametrize(
    ("text", "why"),
    [("", "begins with SU"), ("UABC", "begins with SU"), ("SUABC", "is no key"), (None, "cannot be read")],
)
def test_a_key_file_that_is_none_is_refused_with_a_sentence(tmp_path: Path, text: str | None, why: str) -> None:
    path = tmp_path / "x.key"
    if text is not None:
        path.write_text(text)
    with pytest.raises(BrokerRefused, match=why):
        BrokerLink(BrokerAddress(address="nats://127.0.0.1:1", key=path), NatsBus(now=lambda: 0), name="x")


def test_a_broker_that_is_not_the_pinned_one_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "nats-server"
    program.write_bytes(b"another program")
    monkeypatch.setattr(platform, "machine", lambda: "an unknown one")
    check_pinned.__wrapped__(program)
    monkeypatch.undo()
    if (platform.system(), platform.machine()) in PINNED:
        with pytest.raises(AssertionError, match="is not the pinned nats-server"):
            check_pinned.__wrapped__(program)


def test_a_connection_over_a_bad_radio_has_time_to_prove_its_key() -> None:
    """Three round trips, and a packet that is repeated after a second and after two more."""
    text = broker_users.conf([])
    assert float(text.split("authorization {\n  timeout: ")[1].split()[0]) >= 3 * 0.6 + 1 + 2
