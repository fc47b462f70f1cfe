"""Paired devices of several web nodes: what each shares, and what it does with what the others shared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.access.access import Access
from server.access.devices import SEEN_EVERY_MS, Device
from server.access.identity import Role
from server.access.shared_access import IDENTITY, KEPT_MS, BadEntry, SharedDevices
from tests.server.access.pairs import access_of, config

HOST = {"host": "room"}


class Node:
    """One web node; `bucket` is what all of them have."""

    def __init__(self, bucket: dict[str, bytes], data: Path | None = None) -> None:
        self.now_ms = 0
        self.bucket = bucket
        self.access: Access = access_of(config(data), now=lambda: self.now_ms / 1000, wall_ms=lambda: self.now_ms)
        self.shared = SharedDevices(self.access, wall_ms=lambda: self.now_ms)

    def connect(self) -> None:
        """As the real bucket does: read all of it, then put what it lacks."""
        self.bucket.setdefault(IDENTITY, self.shared.identity)
        self.shared.begin()
        self.hear()
        for key in self.shared.outdated():
            self.bucket.pop(key, None)
        self.bucket |= self.shared.due()

    def hear(self) -> None:
        for key, value in self.bucket.items():
            self.shared.take(key, value)

    async def pair(self, role: Role = Role.OPERATOR) -> tuple[Device, dict[str, str]]:
        """The device and the headers that it sends from then on."""
        device, secret = await self.access.pair(
            token=self.access.invitation(role).token, pin=None, name="Pixel", peer=""
        )
        cookie = self.access.cookie(device, secret, scheme="http", host="room").partition(";")[0]
        return device, {"cookie": cookie, **HOST}

    def knows(self, headers: dict[str, str]) -> Role | None:
        found = self.access.known(headers, scheme="http")
        return None if found is None else found.who.role


async def test_a_device_of_one_node_is_known_at_the_other() -> None:
    bucket: dict[str, bytes] = {}
    first, second = Node(bucket), Node(bucket)
    first.connect()
    second.connect()
    _, headers = await first.pair(Role.VIEWER)
    first.connect()
    assert second.knows(headers) is None
    second.hear()
    assert second.knows(headers) is Role.VIEWER
    assert all(headers["cookie"].rpartition(":")[2].encode() not in value for value in bucket.values())


async def test_who_is_removed_at_one_node_is_out_at_all_and_stays_out(tmp_path: Path) -> None:
    bucket: dict[str, bytes] = {}
    first, second = Node(bucket, tmp_path / "a"), Node(bucket, tmp_path / "b")
    first.connect()
    second.connect()
    device, headers = await first.pair()
    first.connect()
    second.connect()
    await second.access.remove(device.id, by="Ann")  # the broker is away
    again = Node(bucket, tmp_path / "b")  # and the node begins anew
    again.connect()
    assert again.knows(headers) is None
    first.hear()
    assert first.knows(headers) is None
    assert "another web node" in first.access.why_unknown(headers, scheme="http")[1]
    first.connect()
    assert [orjson.loads(value) for key, value in bucket.items() if key.startswith("device.")] == [{"removed_ms": 0}]


async def test_the_later_change_of_a_role_holds_whoever_is_connected_first() -> None:
    for is_first_later in (True, False):
        bucket: dict[str, bytes] = {}
        nodes = Node(bucket), Node(bucket)
        nodes[0].connect()
        nodes[1].connect()
        device, headers = await nodes[0].pair()
        nodes[0].connect()
        nodes[1].connect()
        for node, role, at_ms in ((nodes[0], Role.VIEWER, 500 + is_first_later), (nodes[1], Role.OPERATOR, 501)):
            node.now_ms = at_ms
            await node.access.change(device.id, role=role, name=f"at {at_ms}")
        nodes[1].now_ms = 501 - is_first_later
        changed = replace(nodes[1].access.devices.get(device.id) or device, changed_ms=501 - is_first_later)
        nodes[1].access.devices.put(changed)
        for node in (*nodes, *nodes):
            node.connect()
        found = {node.access.devices.get(device.id) for node in nodes}
        assert len({(one.role, one.changed_ms) for one in found if one}) == 1
        assert [node.knows(headers) for node in nodes] == [Role.VIEWER if is_first_later else changed.role] * 2


async def test_a_visit_at_one_node_keeps_the_device_known_at_the_other() -> None:
    bucket: dict[str, bytes] = {}
    first, second = Node(bucket), Node(bucket)
    first.connect()
    device, headers = await first.pair()
    first.connect()
    second.connect()
    first.now_ms = SEEN_EVERY_MS - 1
    assert first.knows(headers)
    assert first.shared.due() == {}
    first.now_ms = SEEN_EVERY_MS
    assert first.knows(headers)
    bucket |= first.shared.due()
    second.hear()
    assert [one.seen_ms for one in second.access.devices.all()] == [SEEN_EVERY_MS]
    assert device.id in str(list(bucket))


async def test_nothing_is_shared_twice_and_the_old_is_removed(tmp_path: Path) -> None:
    bucket: dict[str, bytes] = {}
    node = Node(bucket, tmp_path)
    node.connect()
    await node.pair()
    removed, _ = await node.pair()
    await node.access.remove(removed.id, by="Ann")
    assert len(node.shared.due()) == 2
    assert node.shared.due() == {}
    node.connect()
    node.now_ms = KEPT_MS + 1
    assert len(node.shared.outdated()) == 4


async def test_a_lost_bucket_is_made_again_from_the_lists_of_the_nodes() -> None:
    bucket: dict[str, bytes] = {}
    first, second = Node(bucket), Node(bucket)
    first.connect()
    second.connect()
    _, headers = await first.pair()
    removed, _ = await first.pair()
    await first.access.remove(removed.id, by="Ann")
    first.connect()
    second.connect()
    before = dict(bucket)
    bucket.clear()
    second.connect()
    first.connect()
    assert bucket == before
    third = Node(bucket)
    third.connect()
    assert third.knows(headers) is Role.OPERATOR


async def test_a_change_ends_the_sockets_at_the_other_node() -> None:
    bucket: dict[str, bytes] = {}
    first, second = Node(bucket), Node(bucket)
    first.connect()
    second.connect()
    device, _ = await first.pair()
    first.connect()
    second.hear()
    ended: list[tuple[str, bool]] = []
    second.access.visits.end = (  # type: ignore[method-assign]
        lambda id, because, *, only_sockets=False, but=None: ended.append((because, only_sockets)) or 0
    )
    first.now_ms = 1
    await first.access.change(device.id, role=Role.VIEWER, name=None)
    first.connect()
    second.hear()
    await first.access.remove(device.id, by="Ann")
    first.connect()
    second.hear()
    assert ended == [
        ("The role of this device was changed.", False),
        ("This device was removed at another web node.", False),
    ]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("device.a", b"{"),
        ("device.a", b"[]"),
        ("device.a", b'{"name": "x"}'),
        ("device.a", b'{"removed_ms": "now"}'),
        ("device.a", orjson.dumps({"name": "x" * 2000})),
        ("seen.a", b"null"),
        ("identity", b'{"server": "x", "signing_key": "short"}'),
        ("identity", orjson.dumps({"server": "a;b=c;d=", "signing_key": "0" * 64})),
        ("other", b"{}"),
    ],
)
def test_an_entry_that_is_none_changes_nothing(key: str, value: bytes) -> None:
    node = Node({})
    before = node.shared.identity
    with pytest.raises(BadEntry):
        node.shared.take(key, value)
    assert node.access.devices.all() == []
    assert node.shared.identity == before


@given(st.text(max_size=20), st.binary(max_size=60))
def test_whatever_an_entry_is_nothing_else_is_raised(key: str, value: bytes) -> None:
    node = Node({})
    try:
        node.shared.take(key, value)
    except BadEntry:
        pass
