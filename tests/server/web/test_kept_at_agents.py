"""What agents keep, at web nodes: whole servers and a real broker. Recordings, exports, mail and replays of the car
that is named; what is not for a viewer is not for one at a node either; and a car that is off on purpose."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import email
import json
import secrets
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.access.credentials import Keys
from server.app.config import Config
from server.bus.broker import Broker
from server.vehicle.vehicle import Vehicle
from server.web.agents import kept
from tests.http import http_client
from tests.server.access.pairs import VIEWER_KEY, keyed
from tests.server.bus.broker import running_broker
from tests.server.conftest import serving
from tests.server.recording.made import record
from tests.server.replay.test_replay_socket import order
from tests.server.viewer import Viewer, viewer

DRIVE = "ocelot_20260921T141320Z"
SOON_S = 20.0


async def until(found: Callable[[], Awaitable[Any]]) -> Any:
    async with asyncio.timeout(SOON_S):
        while not (answer := await found()):
            await asyncio.sleep(0.05)
    return answer


@dataclasses.dataclass(frozen=True, kw_only=True)
class Fleet:
    room: httpx.AsyncClient
    agent: httpx.AsyncClient
    broker: Broker
    of_agent: Config
    stop_agent: Callable[[], Awaitable[None]]


@contextlib.asynccontextmanager
async def fleet(data: Path, *, pad: str = "", **of_room: Any) -> AsyncIterator[Fleet]:
    """The agent of ocelot with one recording, and a node that expects margay too."""
    record(data / "agent" / "recordings" / "ocelot" / f"{DRIVE}.mcap", seconds=8.0, alarms=[(2.0, "critical")], pad=pad)
    async with running_broker() as process:
        at = Broker(address=process.address)
        agent = Config(broker=at, vehicles=(Vehicle(name="ocelot"),), data=data / "agent")
        node = Config(broker=at, is_node=True, expected=("ocelot", "margay"), data=data / "node", vehicles=())
        async with contextlib.AsyncExitStack() as stack, contextlib.AsyncExitStack() as of_agent:
            room_at = await stack.enter_async_context(serving(dataclasses.replace(node, **of_room)))
            agent_at = await of_agent.enter_async_context(serving(agent))
            room = await stack.enter_async_context(httpx.AsyncClient(base_url=room_at, timeout=30))
            one = await stack.enter_async_context(httpx.AsyncClient(base_url=agent_at, timeout=30))
            yield Fleet(room=room, agent=one, broker=at, of_agent=agent, stop_agent=of_agent.aclose)


async def read(one: Fleet) -> None:
    """Wait until the recording was read."""

    async def is_read() -> bool:
        listing = await one.room.get("/agents/ocelot/api/recordings")
        return listing.status_code == 200 and listing.json()["recordings"][0]["state"] == "read"

    await until(is_read)


async def test_a_node_answers_as_the_agent_does_and_names_who_does_not_answer(tmp_path: Path) -> None:
    async with fleet(tmp_path) as one:
        await read(one)
        room, file = one.room, f"/api/recordings/{DRIVE}/file.mcap"
        for path in ("/api/recordings", f"/api/recordings/{DRIVE}", f"/api/recordings/{DRIVE}/track.svg", "/api/trash"):
            near, far = await one.agent.get(path), await room.get(f"/agents/ocelot{path}")
            assert (far.status_code, far.content) == (near.status_code, near.content), path
            for name in ("etag", "content-type", "cache-control"):
                assert far.headers.get(name) == near.headers.get(name), path
            assert "sandbox" in far.headers["content-security-policy"]
        listing = await room.get("/agents/ocelot/api/recordings")
        again = await room.get("/agents/ocelot/api/recordings", headers={"If-None-Match": listing.headers["etag"]})
        assert again.status_code == 304
        whole = await room.get(f"/agents/ocelot{file}")
        assert whole.content == next((tmp_path / "agent").rglob(f"{DRIVE}.mcap")).read_bytes()
        assert "attachment" in whole.headers["content-disposition"]
        part = await room.get(
            f"/agents/ocelot{file}", headers={"Range": "bytes=10-99", "If-Range": whole.headers["etag"]}
        )
        assert (part.status_code, part.content) == (206, whole.content[10:100])
        head = await room.head(f"/agents/ocelot{file}")
        assert (head.headers["content-length"], head.content) == (str(len(whole.content)), b"")

        changed = await room.patch(f"/agents/ocelot/api/recordings/{DRIVE}", json={"title": "Wet", "tags": ["rain"]})
        assert changed.json()["title"] == "Wet"
        assert (await room.patch(f"/agents/ocelot/api/recordings/{DRIVE}", json={"x": 1})).status_code == 422
        job = (await room.post(f"/agents/ocelot/api/recordings/{DRIVE}/exports", json={"format": "csv"})).json()["job"]

        async def done() -> bool:
            return (await room.get(f"/agents/ocelot/api/exports/{job}")).json()["state"] == "done"

        await until(done)
        assert (await room.get(f"/agents/ocelot/api/exports/{job}/file")).content.startswith(b"PK")

        assert (await room.get("/api/recordings")).status_code == 422, "whose is not stated"
        assert (await room.get("/agents/nobody/api/recordings")).status_code == 404
        assert (await room.get("/agents/ocelot/api/state")).status_code == 404, "not kept at the agent"
        assert (await room.get(f"/agents/ocelot{kept.REPLAYS}/x")).status_code == 404
        lost = await room.get("/agents/margay/api/recordings")
        assert (lost.status_code, lost.json()["detail"]) == (
            503,
            "The agent of margay has sent nothing since the server started.",
        )
        await one.stop_agent()
        gone = await room.get("/agents/ocelot/api/recordings")
        assert gone.status_code == 503


async def test_a_link_in_a_mail_leads_through_the_node(tmp_path: Path) -> None:
    async with fleet(tmp_path, pad=secrets.token_hex(700_000)) as one:
        await read(one)
        mail = "/agents/ocelot/api/mail"
        wanted = {"host": "127.0.0.1", "port": 9, "security": "none", "sender": "car@test.example", "limit_mb": 1}
        assert (await one.room.put(f"{mail}/settings", json=wanted)).status_code == 200
        letter = {"recordings": [DRIVE], "to": ["ann@example.org"], "too_large": "link", "key": "0123abcd"}
        n = (await one.room.post(mail, json=letter)).json()["n"]
        assert (await one.room.post(mail, json=letter)).json()["n"] == n, "one order"

        async def composed() -> bool:
            return bool((await one.room.get(f"{mail}/{n}")).json()["is_ready"])

        await until(composed)
        assert (await one.room.get(f"{mail}/{n}")).json()["way"] == "link"
        sent = email.message_from_bytes(next((tmp_path / "agent" / "mail").rglob("*.eml")).read_bytes())
        text = b"".join(part.get_payload(decode=True) or b"" for part in sent.walk() if not part.is_multipart())
        link = f"http://{one.room.base_url.netloc.decode()}/agents/ocelot/api/recordings/{DRIVE}/file.mcap"
        assert link in text.decode()


async def test_a_viewer_at_a_node_reads_and_changes_nothing(tmp_path: Path) -> None:
    keys: Keys = keyed().keys
    async with fleet(tmp_path, host="0.0.0.0", keys=keys) as one:
        async with http_client(base_url=one.room.base_url, headers={"Authorization": f"Bearer {VIEWER_KEY}"}) as room:
            path = f"/agents/ocelot/api/recordings/{DRIVE}"

            async def is_read() -> bool:
                return (await room.get(path)).status_code == 200

            await until(is_read)
            assert (await room.patch(path, json={"title": "x"})).status_code == 403
            assert (await room.delete(path)).status_code == 403
            assert (await room.get("/agents/ocelot/api/mail/settings")).status_code == 403
            assert (await room.put("/api/off/margay")).status_code == 403
        assert (await one.room.get(path)).status_code == 401


@pytest.mark.field
async def test_a_replay_runs_at_the_agent_and_only_its_newest_frames_come(tmp_path: Path) -> None:
    async with fleet(tmp_path) as one:
        await read(one)
        async with viewer(str(one.room.base_url), vehicle="ocelot") as page:
            await page.until(lambda: page.states, SOON_S)
            assert (await order(page, "open", recording="no_such_drive"))["ok"] is False
            answer = await order(page, "open", recording=DRIVE, at_s=1.0)
            assert answer["ok"], answer
            await page.until(lambda: replay_of(page), SOON_S)
            shown = replay_of(page)
            assert (shown["id"], shown["vehicle"]) == (DRIVE, "ocelot")
            assert (await order(page, "seek", at_s=5.0))["ok"]
            await page.until(lambda: replay_of(page)["at_s"] >= 5.0, SOON_S)
            trends = await one.room.get("/api/trends", params={"replay": shown["token"]})
            assert trends.status_code == 200
            await page.until(lambda: any(message.get("kind") == "timeline" for message in page.other), SOON_S)
            await one.stop_agent()
            await page.until(
                lambda: any(message.get("kind") == "replay" and message["ended"] for message in page.other), 40.0
            )


def replay_of(page: Viewer) -> Any:
    return page.states[-1].get("replay") if page.states else None


async def test_a_car_that_is_off_on_purpose_is_not_lost_until_it_is_heard(tmp_path: Path) -> None:
    async with fleet(tmp_path) as one:

        async def health() -> Any:
            answer = await one.room.get("/api/health")
            assert answer.status_code == 200, "another node would not hear it either"
            return answer.json()

        async def is_heard() -> bool:
            return list((await health())["lost"]) == ["margay"]

        await until(is_heard)
        found = await health()
        assert found["status"] == "cars lost"
        assert found["lost"] == {"margay": "The agent of margay has sent nothing since the server started."}
        ann = {"x-catgraph-name": "Ann"}
        assert (await one.room.put("/api/off/ocelot", headers=ann)).status_code == 409, "it sends data"
        assert (await one.room.put("/api/off/nobody", headers=ann)).status_code == 404
        assert (await one.room.put("/api/off/margay", headers=ann)).status_code == 200
        found = await health()
        assert (found["status"], found["lost"], found["off"]) == ("ok", {}, ["margay"])
        async with viewer(str(one.room.base_url), fleet=True) as page:
            await page.until(lambda: off_of(page, "margay"), SOON_S)
            assert off_of(page, "margay")["by"] == "Ann"
        assert (await one.room.delete("/api/off/margay", headers=ann)).status_code == 200
        assert (await health())["status"] == "cars lost"
        await one.room.put("/api/off/margay", headers=ann)

        async def written() -> bool:
            return set(json.loads((tmp_path / "node" / "off.json").read_text())) == {"margay"}

        await until(written)
        back = dataclasses.replace(one.of_agent, vehicles=(Vehicle(name="margay"),), data=None)
        async with serving(back):
            await until(is_on(health))
        assert (await one.agent.put("/api/off/ocelot")).status_code == 409, "a server that is no node"


def is_on(health: Callable[[], Awaitable[Any]]) -> Callable[[], Awaitable[bool]]:
    async def one() -> bool:
        found = await health()
        return found["off"] == [] and found["status"] == "ok"

    return one


def off_of(page: Viewer, name: str) -> Any:
    for message in reversed(page.other):
        if message.get("kind") == "cars":
            return next((car.get("off") for car in message["cars"] if car["name"] == name), None)
    return None


@pytest.mark.parametrize("path", ["/agents/a/api/mail", "/agents/a%2Fb/api/mail/settings"])
def test_who_may_is_decided_by_the_agents_own_path(path: str) -> None:
    from server.access.identity import Needs, needs_of

    assert needs_of("GET", path) is Needs.OPERATOR
