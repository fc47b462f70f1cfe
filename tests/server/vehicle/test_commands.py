"""Each command is declared once: who may send it, what handles it, and where it is served over HTTP."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator
from typing import Any

import pytest

from server.access.order_signer import OrderSigner
from server.app.app import create_app
from server.app.config import Config
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.protocol.command_base import OF_PAGE
from server.protocol.commands import BY_KIND, COMES_WITHIN_S, comes_within_s
from server.vehicle.outcomes import GIVEN_UP, LONGEST_WAY_S
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.server.bus.buses import Clock

# What changes the car's monitoring for everybody. Slowing the car is not among it, letting it go is.
NEEDS_CONTROL = {
    "connect", "retry", "disconnect", "pause", "resume", "record", "set", "import", "ride", "arm", "disarm", "release",
    "planned_stop",
}  # fmt: skip
FIELDS = {  # of the commands whose required fields alone are no command
    "connect": {"address": "http://no.bridge"},
    "control": {"do": "withdraw"},
    "position": {"phone": "phone-1", "handheld": True, "why": "denied"},
}
OF_TYPE = {"string": "text", "integer": 1, "number": 1.0, "boolean": True}
PHONE_A = {"by": "Ann", "who": "a", "page": "page-a"}
PHONE_B = {"by": "Ben", "who": "b", "page": "page-b"}


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
async def bus(clock: Clock) -> AsyncIterator[LocalBus]:
    """Serves a session without a car, of which Ann is in control; Ben's page is seen as well."""
    bus = LocalBus(Journal(None), now=clock)
    session = Session(Vehicle(name="car"), bus, now=clock, wall_ms=lambda: time.time_ns() // 1_000_000, server=dict)
    await session.start()
    for sender in (PHONE_A, PHONE_B):
        await bus.request("car", example("present") | sender)
    assert (await bus.request("car", {"kind": "control", "do": "take", **PHONE_A}))["ok"]
    yield bus
    await session.stop()


def example(kind: str) -> dict[str, Any]:
    """A message of a kind, which a session without a car may execute or refuse."""
    schema = BY_KIND[kind].model_json_schema()
    fields = {name: schema["properties"][name] for name in schema.get("required", ()) if name != "kind"}
    made = {name: of["enum"][0] if "enum" in of else OF_TYPE.get(of.get("type")) for name, of in fields.items()}
    return {"kind": kind, **made, **FIELDS.get(kind, {})}


@pytest.mark.parametrize("kind", BY_KIND)
async def test_a_command_is_handled_and_needs_what_it_declares(bus: LocalBus, kind: str) -> None:
    if kind in NEEDS_CONTROL:
        assert BY_KIND[kind].needs == "control"
    refused = await bus.request("car", example(kind) | PHONE_B)
    assert (refused.get("held_by") == "Ann") is (BY_KIND[kind].needs == "control"), refused
    answer = await bus.request("car", example(kind) | PHONE_A)
    assert answer["ok"] or answer["reason"]  # what no case handles raises instead
    assert "held_by" not in answer


def test_a_command_is_served_over_http_where_it_is_declared() -> None:
    paths = create_app(Config()).openapi()["paths"]
    served = {kind: command.path or f"/api/{kind}" for kind, command in BY_KIND.items() if command.http}
    assert len(set(served.values())) == len(served) >= 11
    for kind, path in served.items():
        request = paths[path]["post"]
        named = set(BY_KIND[kind].model_fields) - OF_PAGE - {"kind", "id", "vehicle"}  # the car is in the query
        in_path = {one["name"] for one in request.get("parameters", ()) if one["in"] == "path"}
        assert ("requestBody" in request) is bool(named - in_path), kind


# What would slow or release the car, hide alarms, or move control, long after somebody pressed it.
OF_MOMENT = {
    "connect", "disconnect", "pause", "silence", "shelve", "control", "accept_control", "arm", "disarm", "slow_down",
    "release", "veto", "planned_stop",
}  # fmt: skip
OTHER_TIMES = {"resume": 3.0}


def test_what_is_for_the_moment_has_a_time() -> None:
    assert COMES_WITHIN_S == dict.fromkeys(OF_MOMENT, 0.5) | OTHER_TIMES


def test_a_signed_command_that_has_the_time_of_a_state_needs_no_time_on_its_way() -> None:
    """As a page signs it, all but the kind is in the signed text. Over a slow radio to the car it would be refused."""

    def signed(**fields: Any) -> dict[str, Any]:
        text = {"kind": "slow_down", **fields}
        return {
            "kind": "slow_down",
            "id": "p1",
            "vehicle": "car",
            "signed": OrderSigner().sign(text, vehicle="car", by="Ann", challenge="1.a", page="page-of-ann"),
        }

    assert comes_within_s(signed(heard_ms=5.0, held_s=0.1)) is None
    assert comes_within_s(signed()) == comes_within_s({"kind": "slow_down", "heard_ms": 5.0}) == 0.5
    assert comes_within_s({"kind": "pause", "signed": "none"}) == 0.5
    assert comes_within_s({"kind": "acknowledge"}) is None


@pytest.mark.parametrize("kind", sorted(OF_MOMENT))
async def test_what_was_long_on_its_way_is_refused_and_the_same_pressed_now_is_not(bus: LocalBus, kind: str) -> None:
    within_s, wall_ms = COMES_WITHIN_S[kind], time.time_ns() // 1_000_000
    for way_s in (within_s + 0.1, 20.0):
        late = {"heard_ms": wall_ms - 1000 * (way_s + 3600), "held_s": 3600.0}
        answer = await bus.request("car", example(kind) | late | PHONE_A)
        assert "ago: press again if still needed" in answer["reason"], answer
    answer = await bus.request("car", example(kind) | {"pressed_ago_s": within_s + 0.1} | PHONE_A)
    assert "ago: press again if still needed" in answer["reason"], answer
    logged = [event for event in bus.past_events("car") if "ago: press again if still needed" in event["text"]]
    assert [(event["change"], event["by"]) for event in logged] == 3 * [
        ("slow_down" if kind == "slow_down" else "late", PHONE_A["by"])
    ]
    assert all(kind in event["text"] or event["step"] == "refused" for event in logged)
    now = {"heard_ms": float(time.time_ns() // 1_000_000), "held_s": 0.0}
    answer = await bus.request("car", example(kind) | now | PHONE_A)
    assert "press again" not in answer.get("reason", "")


async def test_what_its_page_had_given_up_is_logged_when_it_comes(bus: LocalBus, clock: Clock) -> None:
    clock.ahead_s += LONGEST_WAY_S + 2.0  # of what was given before it began a session knows nothing
    asked = {"kind": "outcome", "id": "p1?", "of": "p1", "ago_s": 1.0, **PHONE_A}
    assert (await bus.request("car", asked))["became"] == "never"
    answer = await bus.request("car", {"kind": "resume", "id": "p1", **PHONE_A})
    assert answer == {"ok": False, "reason": GIVEN_UP}
    for n, other in enumerate((example("mark"), {"kind": "none such"})):
        await bus.request("car", asked | {"of": f"q{n}"})
        assert (await bus.request("car", other | {"id": f"q{n}", **PHONE_A}))["reason"] == GIVEN_UP
    (event,) = bus.past_events("car", change="late")  # of orders only: others are delivered again, or are none
    assert (event["text"], event["by"]) == (f"“resume” was not carried out: {GIVEN_UP}", PHONE_A["by"])


async def test_what_is_not_for_the_moment_may_come_late(bus: LocalBus) -> None:
    """A position, a mark or an acknowledgement names what it belongs to."""
    late = {"heard_ms": 1.7e12, "held_s": 0.0, "pressed_ago_s": 20.0}
    answer = await bus.request("car", {"kind": "record", "on": True, **late, **PHONE_A})
    assert "press again" not in answer.get("reason", "")
