"""The bucket of paired devices at a real broker, with the keys that `catgraph fleet` makes."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from server.access.access import Access
from server.access.devices_bucket import DevicesBucket
from server.access.identity import Role
from server.access.shared_access import SharedDevices
from server.bus import broker_users
from server.bus.broker import Broker as BrokerAddress
from server.bus.nats_link import BrokerLink
from tests.server.access.pairs import access_of, config
from tests.server.bus.broker import Broker, running_broker
from tests.server.bus.buses import until

TODAY = "2026-11-25"


class Node:
    """A web node, as far as it keeps devices."""

    def __init__(self) -> None:
        self.now_ms = 0
        self.access: Access = access_of(config(None), now=lambda: 0.0, wall_ms=lambda: self.now_ms)
        self.bucket = DevicesBucket(SharedDevices(self.access, wall_ms=lambda: self.now_ms))
        self.access.devices.on_kept = self.bucket.changed

    async def pair(self) -> str:
        device, _ = await self.access.pair(token=self.access.invitation().token, pin=None, name="Pixel", peer="")
        return device.id

    def role(self, id: str) -> Role | None:
        device = self.access.devices.get(id)
        return None if device is None else device.role


@contextlib.asynccontextmanager
async def linked(node: Node, broker: Broker, key: Path) -> AsyncIterator[BrokerLink]:
    link = BrokerLink(BrokerAddress(address=broker.address, key=key), node.bucket, name="test")
    link.start()
    try:
        yield link
    finally:
        await link.stop()


def keys(folder: Path) -> list[Path]:
    found = []
    for name in ("room-1", "room-2"):
        _, seed = broker_users.add(folder, name, "web", today=TODAY)
        found.append(folder / f"{name}.key")
        found[-1].write_text(seed)
    return found


@pytest.mark.field
async def test_two_nodes_have_the_same_devices_also_after_the_broker_was_killed(tmp_path: Path) -> None:
    (tmp_path / "conf").mkdir()
    first_key, second_key = keys(tmp_path / "conf")
    first, second = Node(), Node()
    conf = tmp_path / "conf" / broker_users.CONF
    async with (
        running_broker(include=conf, store=tmp_path / "store") as broker,
        linked(first, broker, first_key),
        linked(second, broker, second_key),
    ):
        await until(lambda: first.bucket.is_alike and second.bucket.is_alike)
        assert first.access.devices.signing_key == second.access.devices.signing_key
        id = await first.pair()
        await until(lambda: second.role(id) is Role.OPERATOR)
        second.now_ms = 1
        await second.access.change(id, role=Role.VIEWER, name=None)
        await until(lambda: first.role(id) is Role.VIEWER)
        await broker.kill()
        other = await first.pair()  # nobody waits for the broker
        await second.access.remove(id, by="Ann")
        await broker.start()
        await until(lambda: second.role(other) is Role.OPERATOR, within_s=30)
        await until(lambda: first.role(id) is None, within_s=30)


async def test_a_broker_without_jetstream_leaves_each_node_its_own_list(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (key, _) = keys(tmp_path)
    node = Node()
    async with running_broker(include=tmp_path / broker_users.CONF) as broker, linked(node, broker, key) as link:
        await until(lambda: link.complaint is None)
        id = await node.pair()
        await until(lambda: "known at this node only" in caplog.text)
        assert node.role(id) is Role.OPERATOR
        assert link.complaint is None
        assert not node.bucket.is_alike


async def test_an_agent_neither_reads_nor_changes_the_devices(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "conf").mkdir()
    key, _ = keys(tmp_path / "conf")
    _, seed = broker_users.add(tmp_path / "conf", "ocelot", "agent", today=TODAY)
    agent_key = tmp_path / "agent.key"
    agent_key.write_text(seed)
    node, agent = Node(), Node()
    conf = tmp_path / "conf" / broker_users.CONF
    async with (
        running_broker(include=conf, store=tmp_path / "store") as broker,
        linked(node, broker, key),
        linked(agent, broker, agent_key),
    ):
        await until(lambda: node.bucket.is_alike)
        id = await node.pair()
        await until(lambda: "known at this node only" in caplog.text)
        assert agent.role(id) is None
        assert not agent.bucket.is_alike
        assert agent.access.devices.signing_key != node.access.devices.signing_key
