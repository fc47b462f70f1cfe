"""The socket of the page of all cars: one list, commands to the car that is named, and what happened to items."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator
from typing import Any

import pytest
import websockets

from server.app.app import create_app
from server.protocol.commands import BY_KIND
from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.access.pairs import OPERATOR_KEY, VIEWER_KEY, keyed, paired_server
from tests.server.cars import driving
from tests.server.conftest import serving, serving_app, two
from tests.server.viewer import Viewer, viewer
from tests.server.web.test_cars import cars, named, speeding

pytestmark = pytest.mark.virtual_time

SEEN = {"kind": "present", "visible": True, "sound": "ready", "awake": "ready"}
ITEM = ("take_item", "release_item", "offer_item", "answer_item", "withdraw_item")
MORE: dict[str, dict[str, Any]] = {"offer_item": {"to": "page-ben"}, "answer_item": {"accept": True}}


@contextlib.asynccontextmanager
async def operator(base: str, name: str) -> AsyncIterator[Viewer]:
    """A page of all cars that reports once a second."""
    async with viewer(base, fleet=True, name=name, page=f"page-{name.lower()}") as one:

        async def report() -> None:
            with contextlib.suppress(websockets.ConnectionClosed):
                while True:
                    await one.send(SEEN | one.key)
                    await asyncio.sleep(0.5)

        reporting = asyncio.create_task(report())
        try:
            yield one
        finally:
            reporting.cancel()


def item(one: Viewer, car: str) -> dict[str, Any] | None:
    return (named(one, car) or {}).get("attention")


def holder(one: Viewer, car: str) -> str | None:
    assigned = (item(one, car) or {}).get("assigned")
    return assigned and assigned["name"]


def logged(one: Viewer) -> list[tuple[str, str, str | None]]:
    """The logged events of items."""
    return [(m["vehicle"], m["text"], m["by"]) for m in one.other if m["kind"] == "fleet_event"]


async def test_a_page_of_all_cars_gets_the_list_and_no_states(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server, fleet=True) as one:
        await one.until(lambda: (named(one, "car") or {}).get("speed", {}).get("value_mps") == 4.2)
        hello = one.other[0]
        assert (hello["kind"], hello["vehicle"], hello["vehicles"], hello["who"]["role"]) == (
            "hello", "", ["car"], "operator",
        )  # fmt: skip
        await one.until(lambda: len([m for m in one.other if m["kind"] == "cars"]) >= 5)
        assert (one.states, one.scans, one.events) == ([], [], [])
        assert {kind for offer in one.offers for kind in offer["of"]} == {"cars"}


async def test_a_page_that_takes_nothing_is_sent_nothing_and_then_the_newest(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server, fleet=True) as one:
        await one.until(lambda: cars(one))
        one.takes = False
        await one.until(lambda: len(one.offers) > 1)
        offered, frames = len(one.offers), len([m for m in one.other if m["kind"] == "cars"])
        await asyncio.sleep(1.6)
        assert len(one.offers) == offered
        assert len([m for m in one.other if m["kind"] == "cars"]) <= frames + 1
        one.takes = True
        newest_ms = one.other[-1]["time_ms"]
        await one.send({"kind": "take", "seq": one.offers[-1]["seq"]})
        await one.until(lambda: one.other[-1].get("time_ms", 0) >= newest_ms + 1000)


async def test_an_ordinary_page_of_one_car_has_no_list_beside_a_page_of_all(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as ordinary, viewer(server, fleet=True) as one:
        await one.until(lambda: cars(one))
        await ordinary.until(lambda: len(ordinary.states) > 10)
        assert cars(ordinary) == []


async def test_two_people_share_the_cars(bridge: RosBridge, other: RosBridge) -> None:
    async with (
        serving(two(bridge, other)) as base,
        driving(bridge),
        speeding(other, 30.0),
        operator(base, "Ann") as ann,
        operator(base, "Ben") as ben,
    ):
        await ann.until(lambda: item(ann, "serval") and item(ann, "serval")["escalates_ms"])  # type: ignore[index]
        assert (await ann.ask(kind="take_item", vehicle="serval"))["ok"]
        await ben.until(lambda: holder(ben, "serval") == "Ann")
        refused = await ben.ask(kind="take_item", vehicle="serval")
        assert (refused["ok"], refused["reason"]) == (False, "This car is assigned to Ann: take it over, or ask.")
        await ann.until(lambda: len((named(ann, "serval") or {})["people"]) == 2)
        assert (await ann.ask(kind="offer_item", vehicle="serval", to="page-ben"))["ok"]
        await ben.until(lambda: (item(ben, "serval") or {}).get("offered"))
        assert (await ben.ask(kind="answer_item", vehicle="serval", accept=True))["ok"]
        await ann.until(lambda: holder(ann, "serval") == "Ben")
        serval = named(ann, "serval")
        assert serval is not None
        alarm = {"alarm": serval["worst"]["id"], "occurrence": serval["worst"]["occurrence"]}
        assert (await ben.ask(kind="acknowledge", vehicle="serval", **alarm))["ok"]
        await ann.until(lambda: ((named(ann, "serval") or {})["worst"] or {}).get("state") != "UNACKED")
        expected = [
            ("serval", "Assigned to Ann.", "Ann"),
            ("serval", "Ann offered it to Ben.", "Ann"),
            ("serval", "Assigned to Ben: Ann had offered it.", "Ben"),
        ]
        for page in (ann, ben):
            await page.until(lambda page=page: len(logged(page)) >= 3)
            assert logged(page) == expected
        async with viewer(base, fleet=True) as late:
            await late.until(lambda: len(logged(late)) >= 3)
            assert logged(late) == expected, "the newest of the past"


async def test_a_page_of_all_cars_is_heard_by_every_car(bridge: RosBridge, other: RosBridge) -> None:
    async with serving(two(bridge, other)) as base, viewer(base, vehicle="serval", page="bbbb") as there:
        await there.until(lambda: there.states)
        async with viewer(base, fleet=True, page="aaaa") as one:
            await one.send({**SEEN, "announces": []})
            state = await there.state(lambda state: state["reach"]["can"] == 1)
            assert (state["reach"]["pages"], state["control"]["holder"]) == ([], None)
            await one.send({**SEEN, "sound": "asks"})
            await there.state(lambda state: state["reach"]["can"] == 0)
            await one.send(SEEN)
            await there.state(lambda state: state["reach"]["can"] == 1)
            await one.socket.close(code=1001)
            await there.state(lambda state: state["reach"]["can"] == 0, within_s=2.0)


async def test_a_command_needs_a_car_that_there_is(bridge: RosBridge, other: RosBridge) -> None:
    async with serving(two(bridge, other)) as base, viewer(base, fleet=True) as one:

        async def why(**command: Any) -> str:
            answer = await one.ask(**command)
            assert answer["ok"] is False, answer
            return str(answer["reason"])

        assert await why(kind="take_item", vehicle="jaguar") == "No car is named jaguar."
        assert await why(kind="take_item") == "Name the car that is meant."
        for odd in (None, 3, ["ocelot"], {"ocelot": 1}, ""):
            assert await why(kind="take_item", vehicle=odd) == "Name the car that is meant."
        assert await why(kind="take_item", vehicle="ocelot") == "This car needs nobody now."
        assert (await why(kind="take_item", vehicle="x" * 5000)).startswith("No car is named xxx")


async def test_what_acts_on_a_car_is_done_on_its_own_page(server: str) -> None:
    async with viewer(server, fleet=True) as one:
        for kind in sorted(BY_KIND.keys() - {"present"}):
            answer = await one.ask(kind=kind, vehicle="car", alarm="speed_limit", occurrence=1, **MORE.get(kind, {}))
            assert answer["ok"] is (kind == "end_planned_stop"), "no stop is in force, so it has ended"
            is_refused_here = answer.get("reason") == "Open the car's own page for this."
            assert is_refused_here is (not BY_KIND[kind].from_fleet), kind


async def test_a_planned_stop_is_ended_from_here_and_not_begun(bridge: RosBridge, other: RosBridge) -> None:
    async with (
        serving(two(bridge, other)) as base,
        http_client(base_url=base) as client,
        viewer(base, fleet=True) as one,
    ):
        await one.until(lambda: (named(one, "serval") or {}).get("phase") == "monitoring")
        begun = await client.post("/api/planned_stop", params={"vehicle": "serval"}, json={"reason": "parked"})
        assert begun.is_success, begun.text
        await one.until(lambda: (named(one, "serval") or {})["planned_stop"] == "parked")
        refused = await one.ask(kind="planned_stop", vehicle="serval", reason="parked")
        assert refused["reason"] == "Open the car's own page for this."
        assert (await one.ask(kind="end_planned_stop", vehicle="serval"))["ok"]
        await one.until(lambda: (named(one, "serval") or {})["planned_stop"] is None)
        events = (await client.get("/api/events", params={"vehicle": "serval"})).json()["events"]
        (ended,) = (event for event in events if event["change"] == "planned_stop_ended")
        assert ended["text"] == "The planned stop ended."


async def test_what_the_server_asks_of_a_session_is_refused(server: str) -> None:
    async with viewer(server, fleet=True) as one:
        for kind in ("announces", "refresh", "state", "settings", "signals", "", None, 7, ["state"]):
            answer = await one.ask(**{**SEEN, "kind": kind, "vehicle": "car"})
            assert (answer["ok"], answer["reason"]) == (False, "Unknown command."), kind


async def test_a_viewer_sees_and_changes_nothing(bridge: RosBridge) -> None:
    async with paired_server(keyed()) as served:
        async with viewer(served.base, fleet=True, key=VIEWER_KEY) as one:
            await one.until(lambda: cars(one))
            assert one.other[0]["who"]["role"] == "viewer"
            await one.send(SEEN)
            for kind in (*ITEM, "acknowledge", "end_planned_stop"):
                answer = await one.ask(kind=kind, vehicle="car", **MORE.get(kind, {}))
                assert answer["reason"] == "This device is paired as a viewer and cannot make changes."
            await one.until(lambda: (named(one, "car") or {}).get("people") == [])
        async with viewer(served.base, fleet=True, key=OPERATOR_KEY) as one:
            answer = await one.ask(kind="take_item", vehicle="car")
            assert answer["reason"] != "This device is paired as a viewer and cannot make changes."
        with pytest.raises(websockets.InvalidStatus):
            async with viewer(served.base, fleet=True):
                pass


async def test_a_page_cannot_say_who_sends(bridge: RosBridge, other: RosBridge) -> None:
    async with serving(two(bridge, other)) as base, speeding(other, 30.0), viewer(base, fleet=True, name="Ann") as one:
        await one.until(lambda: item(one, "serval"))
        forged = {"by": "root", "who": "somebody", "page": "page-of-ben", "console": True}
        assert (await one.ask(kind="take_item", vehicle="serval", **forged))["ok"]
        await one.until(lambda: holder(one, "serval") == "Ann")
        assert (item(one, "serval") or {})["assigned"]["page"] != "page-of-ben"


JUNK = (
    "", "x", "[]", "3", "null", '"take_item"', "[" * 5000, '{"kind":"take_item","id":3}',
    '{"kind":"take_item","vehicle":"car"}', '{"kind":"present"}', '{"kind":"present","visible":1}',
    '{"kind":"present","visible":true,"sound":"ready","awake":"ready","announces":[["x"]]}',
    '{"kind":"present","visible":true,"sound":"ready","awake":"ready","announces":7}', "x" * 17_000,
    '{"kind":"hello","page":["x"],"name":{}}', '{"kind":"have"}', '{"kind":"replay","do":"open"}',
)  # fmt: skip


async def test_what_is_no_message_harms_nothing(server: str) -> None:
    async with viewer(server, fleet=True) as one:
        for junk in JUNK:
            await one.socket.send(junk)
            await one.socket.send(junk.encode())
            assert (await one.ask(kind="take_item", vehicle="car"))["reason"]
        await one.until(lambda: cars(one))


async def test_a_page_that_sends_nothing_sensible_is_closed(server: str) -> None:
    async with viewer(server, fleet=True) as one:
        for _ in range(300):
            with contextlib.suppress(websockets.ConnectionClosed):
                await one.socket.send("junk")
        await asyncio.wait_for(one.socket.wait_closed(), 5.0)
        assert one.socket.close_code == 1008


async def test_orders_are_limited_as_on_other_pages(server: str) -> None:
    """Sent in portions: a page that does not take so many answers at once is closed."""
    reasons: list[str] = []
    async with viewer(server, fleet=True) as one:
        for portion in range(20):
            ids = {f"{portion} {number}" for number in range(40)}
            for id in sorted(ids):
                await one.send({"kind": "take_item", "vehicle": "car", "id": id})
            await one.until(lambda ids=ids: ids <= {m.get("id") for m in one.other})
            reasons = [m["reason"] for m in one.other if m["kind"] == "reply"]
            if reasons[-1] != reasons[0]:
                break
    assert reasons[0] == "This car needs nobody now."
    assert reasons[-1] == "Too many commands at once from this page: wait a second."
    assert len(reasons) > 80


async def test_the_same_over_http(bridge: RosBridge, other: RosBridge) -> None:
    async with (
        serving(two(bridge, other)) as base,
        speeding(other, 30.0),
        viewer(base, fleet=True) as one,
        http_client(base_url=base, headers={"X-Catgraph-Name": "dispatch"}) as client,
    ):
        await one.until(lambda: item(one, "serval"))
        unnamed = await client.post("/api/attention/take", json={})
        assert unnamed.status_code == 422
        serval = {"vehicle": "serval"}
        assert (await client.post("/api/attention/take", params=serval, json={})).status_code == 200
        await one.until(lambda: holder(one, "serval") == "dispatch")
        nobody = await client.post("/api/attention/take", params={"vehicle": "ocelot"}, json={"over": True})
        assert (nobody.status_code, nobody.json()["detail"]) in [
            (409, "This car needs nobody now."), (200, None),
        ]  # fmt: skip
        offered = await client.post("/api/attention/offer", params=serval, json={"to": "page-nobody"})
        assert (offered.status_code, offered.json()["detail"]) == (409, "That page is closed or not visible.")
        assert (await client.post("/api/attention/withdraw", params=serval)).status_code == 200
        assert (await client.post("/api/attention/answer", params=serval, json={"accept": True})).status_code == 409
        assert (await client.post("/api/attention/release", params=serval)).status_code == 200
        await one.until(lambda: item(one, "serval") and holder(one, "serval") is None)


async def test_on_its_own_page_a_car_is_not_named(bridge: RosBridge, server: str) -> None:
    async with driving(bridge, speed=lambda _: 30.0), viewer(server, name="Ann", page="page-ann") as page:
        await page.state(lambda state: any(alarm["priority"] == "critical" for alarm in state["alarms"]))
        assert (await page.ask(kind="take_item"))["ok"]
        await page.until(lambda: [e for e in page.events if e["change"] == "attention"])
        event = next(e for e in page.events if e["change"] == "attention")
        assert (event["act"], event["by"], event["page"]) == ("taken", "Ann", "page-ann")
        async with viewer(server, fleet=True) as one:
            await one.until(lambda: logged(one))
            assert logged(one) == [("car", "Assigned to Ann.", "Ann")], "of before any page of all cars was open"


async def test_a_car_whose_session_stopped_stays_listed(bridge: RosBridge, other: RosBridge) -> None:
    config = two(bridge, other)
    app = create_app(config, now=time.monotonic)
    async with serving_app(app, config) as base, viewer(base, fleet=True) as one:
        await one.until(lambda: named(one, "serval") and named(one, "ocelot"))
        for session in app.state.services.sessions.values():
            await session.stop()
        await one.until(lambda: [car["summary"] for car in cars(one)] == [None, None])
        frames = len([m for m in one.other if m["kind"] == "cars"])
        await one.until(lambda: len([m for m in one.other if m["kind"] == "cars"]) >= frames + 2, within_s=3.0)
        assert [car["name"] for car in cars(one)] == ["ocelot", "serval"]
        assert json.dumps(cars(one))
