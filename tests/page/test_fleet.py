"""Cars whose agents are elsewhere: agents, a real broker and a web node as processes, and the page of the node."""

from __future__ import annotations

import asyncio
import contextlib
import re
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.async_api import expect

from server.access.order_signer import OrderSigner
from server.bus import broker_users
from tests.http import http_client
from tests.page.conftest import Phone
from tests.page.processes import Process, running, simulate
from tests.server.bus.broker import Broker, running_broker

SOON_S = 20.0


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """`car` and `agent` of ocelot; margay is expected, and never there."""

    broker: Broker
    car: Process
    agent: Process
    node: Process


def credentials(folder: Path, broker: Broker, name: str) -> tuple[str, ...]:
    return ("--broker", broker.address, "--key", str(folder / f"{name}.key"), "--port", "0")


@contextlib.asynccontextmanager
async def fleet(folder: Path) -> AsyncIterator[Fleet]:
    users: tuple[tuple[str, broker_users.Kind], ...] = (("ocelot", "agent"), ("room", "web"))
    for name, kind in users:
        (folder / f"{name}.key").write_text(broker_users.add(folder, name, kind, today="2026-11-25")[1])
    async with running_broker(include=folder / broker_users.CONF) as broker, running(*simulate()) as car:
        agent = ("agent", *credentials(folder, broker, "ocelot"), "--vehicle", f"ocelot={car.address}")
        node = ("web", *credentials(folder, broker, "room"), "--expect", "margay", "--expect", "ocelot")
        async with running(*agent, "--data", str(folder / "agent")) as at_car:
            async with running(*node, "--data", str(folder / "node")) as at_room:
                yield Fleet(broker=broker, car=car, agent=at_car, node=at_room)


async def until(found: Callable[[], Awaitable[Any]]) -> Any:
    async with asyncio.timeout(SOON_S):
        while not (answer := await found()):
            await asyncio.sleep(0.02)
    return answer


async def test_a_node_answers_for_the_cars_of_agents(tmp_path: Path) -> None:
    async with fleet(tmp_path) as one, http_client(base_url=one.node.address) as room:

        async def phase() -> bool:
            listed = (await room.get("/api/vehicles")).json()["vehicles"]
            return bool([row["phase"] for row in listed] == ["lost", "monitoring"])

        await until(phase)
        assert (await room.get("/api/state", params={"vehicle": "ocelot"})).json()["vehicle"] == "ocelot"
        refused = await room.get("/api/state", params={"vehicle": "margay"})
        assert (refused.status_code, refused.json()["detail"]) == (503, "Nothing was received from margay yet.")
        assert (await room.get("/api/state", params={"vehicle": "nobody"})).status_code == 404

        for log in ("/api/log", "/api/log.csv", "/api/log.json"):
            assert (await room.get(log, params={"vehicle": "margay"})).status_code == 503, log
        for kept in ("/api/recordings", "/api/mail/settings"):
            assert (await room.get(kept)).status_code == 422, "the car is not named"
            assert (await room.get(f"/agents/ocelot{kept}")).status_code == 200, kept
            lost = await room.get(f"/agents/margay{kept}")
            assert (lost.status_code, "margay has sent nothing" in lost.json()["detail"]) == (503, True), kept
        assert (await room.post("/api/slow-down/arm")).status_code == 422, "the car is named, however many sent data"

        # An order goes through, and what it causes is in the log of the agent and of the node alike.
        state = (await room.get("/api/state", params={"vehicle": "ocelot"})).json()
        proof = {"vehicle": "ocelot", "by": "Ann", "challenge": state["server"]["challenge"]}
        signed = OrderSigner().header({"kind": "pause"}, **proof)
        assert (await room.post("/api/pause", headers=signed, params={"vehicle": "ocelot"})).status_code == 200
        events = (await room.get("/api/log", params={"vehicle": "ocelot"})).json()["events"]
        assert any(event["by"] == "Ann" for event in events)
        async with http_client(base_url=one.agent.address) as car:
            assert (await car.get("/api/log")).json()["events"] == events
            assert (await car.get("/api/health")).json()["problems"] == []
            counted = (await room.get("/metrics")).text
            assert "catgraph_broker_connected 1\n" in counted
            assert "catgraph_vehicles_heard 1\n" in counted

            # Without a broker the agent goes on, and both say what is lost.
            await one.broker.kill()

            async def complains() -> bool:
                health = (await room.get("/api/health")).json()
                return any("is not connected" in what for what in health["problems"])

            await until(complains)
            counted = (await room.get("/metrics")).text
            assert "catgraph_broker_connected 0\n" in counted
            assert "catgraph_vehicles_heard 0\n" in counted
            assert (await car.get("/api/state")).json()["session"]["phase"] == "monitoring"
            health = (await car.get("/api/health")).json()
            assert any("is not connected" in what for what in health["problems"])
            query = {"params": {"vehicle": "ocelot"}}
            assert (await room.post("/api/resume", **query)).status_code == 503  # type: ignore[arg-type]
            await one.broker.start()
            await until(phase)
            assert (await car.get("/api/state")).json()["session"]["paused"] is True, "no late command"

        # A node that is started again while the agent is off shows its car as lost, and does not leave it out.
        await one.agent.kill()
        await one.node.kill()
        node = ("web", *credentials(tmp_path, one.broker, "room"), "--data", str(tmp_path / "node"))
        async with running(*node) as again, http_client(base_url=again.address) as room:
            rows = (await room.get("/api/vehicles")).json()["vehicles"]
            assert [(row["name"], row["phase"]) for row in rows] == [("ocelot", "lost")]


async def test_the_page_of_a_node_names_what_is_lost(phone: Phone, tmp_path: Path) -> None:
    page = phone.page
    async with fleet(tmp_path) as one:
        await phone.open(f"{one.node.address}/?vehicle=ocelot")
        await phone.live()

        await one.car.type("speeding 30")
        await expect(page.locator("#sheet-alarm[open]")).to_contain_text("Speed above limit", timeout=SOON_S * 1000)
        shown_s = time.time()
        async with http_client() as car:
            events = (await car.get(f"{one.agent.address}/api/log")).json()["events"]
        raised_ms = next(event["at_ms"] for event in events if event["title"] == "Speed above limit")
        assert shown_s - raised_ms / 1000 <= 1.0 + phone.slack_s
        await phone.acknowledge_all()
        await expect(phone.f("strip")).to_contain_text("Speed above limit")

        one.agent.freeze()
        lost = page.locator("#sheet-lost[open]")
        await expect(lost).to_contain_text("the agent of ocelot: it or the broker", timeout=SOON_S * 1000)
        await expect(lost).to_contain_text("The server answers.")
        await expect(lost.locator("[data-f=chain]")).to_contain_text("Agent")
        one.agent.thaw()
        await expect(lost).to_have_count(0, timeout=SOON_S * 1000)
        await phone.live()

        await one.broker.kill()
        await expect(lost).to_contain_text("The broker between the server and the car", timeout=SOON_S * 1000)
        await one.broker.start()
        await expect(lost).to_have_count(0, timeout=SOON_S * 1000)
        await phone.live()
        phone.complaints[:] = [line for line in phone.complaints if "503" not in line]  # its request to a lost agent

        # A car without data is no blank page, and another one can be chosen on it.
        await phone.open(f"{one.node.address}/?vehicle=margay")
        start = page.locator("#start")
        await expect(start).to_contain_text("The agent of margay has sent nothing", timeout=SOON_S * 1000)
        await start.locator("[data-f=who]").click()
        await page.locator("dialog[open]").get_by_role("button", name="ocelot").first.click()
        await phone.live()
        await expect(phone.f("car-name")).to_have_text("ocelot")


async def test_a_person_says_that_silent_cars_are_off_and_one_that_is_heard_is_not(
    phone: Phone, tmp_path: Path
) -> None:
    page = phone.page
    async with fleet(tmp_path) as one, http_client(base_url=one.node.address) as room:
        await phone.open(f"{one.node.address}/fleet")
        row = page.locator('[data-car="ocelot"]')
        lost = page.locator('#fleet [data-f="lost"]')
        await expect(row).to_contain_text(re.compile(r"\d\.\d"), timeout=SOON_S * 1000)
        await expect(lost).to_be_hidden()
        await one.agent.kill()
        await expect(lost).to_contain_text("agent of ocelot", timeout=SOON_S * 1000)
        assert (await room.get("/api/health")).json()["status"] == "cars lost"
        for name in ("ocelot", "margay"):
            await lost.get_by_role("button", name=f"It is off: {name}").tap()
            await expect(lost.get_by_role("button", name=f"It is off: {name}")).to_have_count(0)
        await expect(lost).to_be_hidden()
        item = page.locator('[data-item="ocelot"]')
        await expect(item).to_contain_text("Off on purpose")
        await expect(item).to_contain_text(" at ")
        await expect(row).to_contain_text("Off on purpose")
        await expect(page.locator('#fleet [data-f="strip-text"]')).to_have_text("Nothing needs a person")
        assert (await room.get("/api/health")).json()["status"] == "ok"

        await page.wait_for_timeout(500)  # a key that has just moved under a finger is not meant
        await page.locator('[data-item="margay"]').get_by_role("button", name="Not off").tap()
        await expect(page.locator('[data-item="margay"]')).to_have_count(0)
        agent = ("agent", *credentials(tmp_path, one.broker, "ocelot"), "--vehicle", f"ocelot={one.car.address}")
        async with running(*agent, "--data", str(tmp_path / "agent")):
            await expect(lost).to_be_hidden(timeout=SOON_S * 1000)
            await expect(item.filter(has_text="Off on purpose")).to_have_count(0)
            await expect(row).not_to_contain_text("Off on purpose", timeout=SOON_S * 1000)
            assert (await room.get("/api/health")).json()["off"] == []
