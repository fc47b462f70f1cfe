"""A program with a web node's credentials that lies about who sent a command: what the agent does with it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import nats
import pytest
from nats.aio.client import Client
from starlette.requests import Request

from server.access.order_signer import OrderSigner
from server.access.signed_orders import FORGED, NOT_SIGNED, OTHER_CAR, REPLAYED, TOO_OLD
from server.app.config import Config
from server.bus import broker_users
from server.bus import nats_wire as wire
from server.bus.broker import Broker
from server.bus.nats_http import Begin, Sender
from server.protocol.commands import NO_SUCH
from server.protocol.signed_order import short
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from server.web.agents.at_agent import scope_of
from tests.http import http_client
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import until
from tests.server.cars import driving
from tests.server.conftest import serving

PAGE = "0123abcd"


class LyingNode:
    """Sends anything, as far as the broker allows it."""

    def __init__(self, client: Client) -> None:
        self._client = client

    async def ask(self, **body: Any) -> wire.Answer:
        sent = wire.encode(wire.Ask(**body))
        return wire.decode(wire.Answer, (await self._client.request("veh.ocelot.ask", sent, timeout=5)).data)

    async def pass_on(self, **command: Any) -> dict[str, Any]:
        clock = await self.ask(do="clock")
        return (await self.ask(do="command", command=command, run=clock.run, not_after_s=clock.now_s + 3)).answer

    async def challenge(self) -> str:
        return str((await self.pass_on(kind="state"))["server"]["challenge"])


@contextlib.asynccontextmanager
async def lying(folder: Path, bridge: RosBridge, **more: Any) -> AsyncIterator[tuple[LyingNode, str]]:
    """The node, and the address of the agent's own page."""
    users: tuple[tuple[str, broker_users.Kind], ...] = (("ocelot", "agent"), ("room", "web"))
    for name, kind in users:
        (folder / f"{name}.key").write_text(broker_users.add(folder, name, kind, today="2026-11-25")[1])
    async with running_broker(include=folder / broker_users.CONF) as broker, driving(bridge):
        at = Broker(address=broker.address, key=folder / "ocelot.key")
        car = Vehicle(name="ocelot", address=bridge.address)  # type: ignore[attr-defined]
        async with serving(replace(Config(broker=at, vehicles=(car,)), **more)) as base:
            client = await nats.connect(broker.address, nkeys_seed_str=(folder / "room.key").read_text())
            try:
                node = LyingNode(client)
                await until(lambda: client.is_connected)
                for _ in range(100):
                    with contextlib.suppress(nats.errors.Error, TimeoutError):
                        await node.ask(do="clock")
                        break
                yield node, base
            finally:
                await client.close()


async def log_of(base: str) -> list[dict[str, Any]]:
    async with http_client(base_url=base) as car:
        events: list[dict[str, Any]] = (await car.get("/api/events")).json()["events"]
        return events


async def test_no_order_is_carried_out_that_its_device_did_not_sign(bridge: RosBridge, tmp_path: Path) -> None:
    ann, mallory = OrderSigner(), OrderSigner()
    async with lying(tmp_path, bridge) as (node, base):

        async def signed(by: OrderSigner, vehicle: str = "ocelot", **command: Any) -> dict[str, str]:
            challenge = await node.challenge()
            return by.sign(command, vehicle=vehicle, by="Ann", challenge=challenge, page=PAGE)

        async def refused(**message: Any) -> str:
            answer = await node.pass_on(**message)
            assert answer["ok"] is False
            return str(answer["reason"])

        # What Ann signed is carried out, once.
        ends = await signed(ann, kind="pause")
        ann_says = {"by": "Ann", "who": ann.id, "page": PAGE, "console": False}
        assert await node.pass_on(kind="pause", signed=ends, **ann_says) == {"ok": True}
        assert (await node.pass_on(kind="resume", signed=await signed(ann, kind="resume"), **ann_says))["ok"]
        assert await refused(kind="pause", signed=ends, **ann_says) == REPLAYED

        # In her name, without her.
        for console in (False, True):
            lie = ann_says | {"console": console}
            assert await refused(kind="pause", **lie) == NOT_SIGNED
            assert await refused(kind="slow_down", vehicle="ocelot", **lie) == NOT_SIGNED
        assert await refused(kind="pause", signed=await signed(mallory, kind="pause"), **ann_says) == FORGED
        another_key = {**(await signed(mallory, kind="pause")), "key": ends["key"]}
        assert await refused(kind="pause", signed=another_key, **ann_says) == FORGED

        # What she signed, for something else.
        release = await signed(ann, kind="release", number=4)
        altered = {**release, "text": release["text"].replace('"number":4', '"number":5')}
        assert await refused(kind="release", number=5, signed=altered, **ann_says) == FORGED
        other = await signed(ann, vehicle="margay", kind="pause")
        assert await refused(kind="pause", signed=other, **ann_says) == OTHER_CAR
        old = ann.sign({"kind": "pause"}, vehicle="ocelot", by="Ann", challenge="1.0", page=PAGE)
        assert await refused(kind="pause", signed=old, **ann_says) == TOO_OLD

        async with http_client(base_url=base) as car:
            assert (await car.get("/api/state")).json()["session"]["paused"] is False, "nothing of that was carried out"
        events = await log_of(base)
        devices = [event["text"] for event in events if event["change"] == "device"]
        assert devices == [
            f"First order of Ann, whose device has the key {short(ann.id)}.",
            f"{REPLAYED} A web node passed it on.",
        ]

        # A device that the node makes up is never taken for hers.
        pause = await signed(mallory, kind="pause")
        assert await node.pass_on(kind="pause", signed=pause, by="Ann", who=mallory.id, page=PAGE) == {"ok": True}
        events = await log_of(base)
        assert [event["by"] for event in events if event["change"] == "paused"] == ["Ann", f"Ann · {short(mallory.id)}"]
        assert any("a name that another key has" in event["text"] for event in events)


async def test_what_is_not_signed_is_shown_as_that_where_it_is_taken(bridge: RosBridge, tmp_path: Path) -> None:
    async with lying(tmp_path, bridge, requires_signed=False) as (node, base):
        assert await node.pass_on(kind="pause", by="Ann", who="local", console=True) == {"ok": True}
        assert [one["by"] for one in await log_of(base) if one["change"] == "paused"] == ["Ann (not signed)"]


async def test_the_devices_of_a_list_and_no_other(bridge: RosBridge, tmp_path: Path) -> None:
    ann, mallory = OrderSigner(), OrderSigner()
    listed = tmp_path / "known"
    listed.write_text(f"{ann.id} Ann\n")
    async with lying(tmp_path, bridge, known_devices=listed) as (node, _):
        for signer, is_known in ((mallory, False), (ann, True)):
            challenge = await node.challenge()
            signed = signer.sign({"kind": "pause"}, vehicle="ocelot", by="Ann", challenge=challenge)
            answer = await node.pass_on(kind="pause", signed=signed, by="Ann", who=signer.id)
            assert answer["ok"] is is_known
            assert is_known or mallory.id in answer["reason"]


async def test_a_program_signs_its_requests(bridge: RosBridge) -> None:
    async with running_broker() as broker, driving(bridge):
        at = Broker(address=broker.address)
        car = Vehicle(name="ocelot", address=bridge.address)  # type: ignore[attr-defined]
        async with (
            serving(Config(broker=at, vehicles=(car,))),
            serving(Config(broker=at, is_node=True, vehicles=())) as room,
        ):
            async with http_client(base_url=room, params={"vehicle": "ocelot"}) as client:
                async with asyncio.timeout(15):
                    while not (state := await client.get("/api/state")).is_success:
                        await asyncio.sleep(0.05)
                plain = await client.post("/api/pause")
                assert (plain.status_code, plain.json()["detail"]) == (409, NOT_SIGNED)
                challenge = state.json()["server"]["challenge"]
                signer = OrderSigner()
                headers = signer.header({"kind": "pause"}, vehicle="ocelot", by="nightly test", challenge=challenge)
                assert (await client.post("/api/pause", headers=headers)).is_success
                assert (await client.post("/api/pause", headers={"X-Catgraph-Signed": "x"})).status_code == 422
                events = (await client.get("/api/events")).json()["events"]
                assert any(event["change"] == "paused" and event["by"] == "nightly test" for event in events)


async def test_no_mark_is_of_a_person_whose_device_did_not_sign_it(bridge: RosBridge, tmp_path: Path) -> None:
    ann = OrderSigner()
    async with lying(tmp_path, bridge) as (node, base):
        mark = {"kind": "mark", "mark": "m1", "words": "wet"}
        ends = ann.sign(mark, vehicle="ocelot", by="Ann", challenge=await node.challenge(), page=PAGE)
        stated = {"by": "Ann", "who": ann.id, "page": PAGE, "person": {"name": "Ann B.", "role": "supervisor"}}
        assert await node.pass_on(**mark, signed=ends, **stated) == {"ok": True}
        assert await node.pass_on(**{**mark, "mark": "m2"}, **stated) == {"ok": True}
        file = {"kind": "mark_file", "mark": "m1", "file": "m1.photo.jpg", **stated}
        assert await node.pass_on(**file) == {"ok": False, "reason": NO_SUCH}
        async with http_client(base_url=base) as car:
            marks = (await car.get("/api/marks")).json()["marks"]
        assert {one["mark"]: one["by"] for one in marks} == {"m1": "Ann", "m2": "Ann (not signed)"}


def test_a_request_for_files_names_nobody_for_sure() -> None:
    sender = Sender(id="device", name="tablet", role="operator")

    def name(**headers: str) -> str:
        begin = Begin(id="0" * 32, method="POST", path="/api/marks/m1/photo", headers=headers, sender=sender)
        return Request(scope_of(begin)).headers["x-catgraph-name"]

    assert name(**{"x-catgraph-name": "Ann"}) == "Ann (not signed)"
    assert name(**{"x-catgraph-name": "A" * 99}) == f"{'A' * 27} (not signed)"
    assert name(**{"user-agent": "curl/8"}) == "api · curl (not signed)"


@pytest.mark.parametrize("kind", ["state", "signals", "settings"])
async def test_what_only_asks_needs_no_signature(bridge: RosBridge, tmp_path: Path, kind: str) -> None:
    async with lying(tmp_path, bridge) as (node, _):
        assert "ok" not in await node.pass_on(kind=kind)
