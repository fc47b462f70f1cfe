"""Services that a client of the bridge offers to the others."""

from __future__ import annotations

from typing import Any

import pytest

from server.rosbridge_server.calls import MOST_CALLS
from server.rosbridge_server.client import MOST_OFFERED
from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.probe import Probe, probing, until

pytestmark = pytest.mark.virtual_time


async def offer(probe: Probe, name: str = "/lamp") -> None:
    await probe.send(op="advertise_service", service=name, type="std_srvs/SetBool")
    await probe.settle()


def failed(why: str) -> str:
    """As rosbridge passes the failure of a node on."""
    return f"service [/lamp] responded with an error: b'error processing request: {why}'"


async def request(probe: Probe) -> dict[str, Any]:
    """The next call that reaches the client that offers the service."""
    return await probe.hear_op("call_service")


async def test_a_call_is_answered_by_the_other_client(port: int, probe: Probe) -> None:
    async with probing(port) as caller:
        await offer(probe)
        assert "/lamp" in (await caller.call("/rosapi/services"))["values"]["services"]
        assert (await caller.call("/rosapi/service_type", {"service": "/lamp"}))["values"] == {
            "type": "std_srvs/SetBool"
        }
        await caller.send(op="call_service", service="/lamp", args={"data": True}, id="c1")
        forwarded = await request(probe)
        assert forwarded == {"op": "call_service", "id": forwarded["id"], "service": "/lamp", "args": {"data": True}}
        values = {"success": True, "message": "on"}
        await probe.send(op="service_response", id=forwarded["id"], service="/lamp", values=values, result=True)
        assert await caller.hear() == {
            "op": "service_response",
            "service": "/lamp",
            "values": values,
            "result": True,
            "id": "c1",
        }


async def test_a_failure_is_passed_on(port: int, probe: Probe) -> None:
    async with probing(port) as caller:
        await offer(probe)
        await caller.send(op="call_service", service="/lamp", id="c1")
        forwarded = await request(probe)
        await probe.send(op="service_response", id=forwarded["id"], service="/lamp", values="no bulb", result=False)
        answer = await caller.hear()
        assert (answer["result"], answer["values"]) == (False, failed("no bulb"))


async def test_a_provider_that_goes_leaves_no_caller_waiting(bridge: RosBridge, port: int, probe: Probe) -> None:
    async with probing(port) as other:
        await offer(other)
        await probe.send(op="call_service", service="/lamp", id="c1")
        await request(other)
    answer = await probe.hear()
    assert (answer["result"], answer["id"]) == (False, "c1")
    assert answer["values"] == failed("the client that offers the service has gone")
    assert bridge.services.find("/lamp") is None


async def test_a_caller_that_goes_leaves_nothing_behind(bridge: RosBridge, port: int, probe: Probe) -> None:
    await offer(probe)
    async with probing(port) as caller:
        await caller.send(op="call_service", service="/lamp", id="c1")
        forwarded = await request(probe)
    await until(lambda: bridge.clients == 1)
    await probe.send(op="service_response", id=forwarded["id"], service="/lamp", values={}, result=True)
    assert "no call with this id waits for an answer" in (await probe.hear())["msg"]


async def test_what_is_offered_is_withdrawn(port: int, probe: Probe) -> None:
    async with probing(port) as caller:
        await offer(probe)
        await probe.send(op="unadvertise_service", service="/lamp")
        await probe.settle()
        answer = await caller.call("/lamp")
        assert (answer["result"], answer["values"]) == (False, "Service /lamp does not exist")


async def test_a_withdrawn_service_answers_its_waiting_calls_at_once(port: int, probe: Probe) -> None:
    async with probing(port) as caller:
        await offer(probe)
        await caller.send(op="call_service", service="/lamp", id="c1")
        await request(probe)
        await probe.send(op="unadvertise_service", service="/lamp")
        answer = await caller.hear()
        assert (answer["id"], answer["result"]) == ("c1", False)
        assert answer["values"] == failed("the service /lamp was withdrawn")


async def test_a_late_answer_fits_no_call_of_the_service_when_it_is_offered_anew(port: int, probe: Probe) -> None:
    async with probing(port) as caller:
        await offer(probe)
        await caller.send(op="call_service", service="/lamp", id="c1")
        first = await request(probe)
        await probe.send(op="unadvertise_service", service="/lamp")
        assert (await caller.hear())["id"] == "c1"
        await offer(probe)
        await caller.send(op="call_service", service="/lamp", id="c2")
        second = await request(probe)
        assert second["id"] != first["id"]
        for forwarded, success in ((first, False), (second, True)):
            await probe.send(op="service_response", id=forwarded["id"], values={"success": success}, result=True)
        answer = await caller.hear()
        assert (answer["id"], answer["values"]) == ("c2", {"success": True})


async def test_nobody_takes_the_service_of_another(port: int, probe: Probe) -> None:
    async with probing(port) as other:
        await offer(probe)
        await other.send(op="advertise_service", service="lamp", type="std_srvs/SetBool", id="x")
        assert "another node offers /lamp" in (await other.hear())["msg"]
        await offer(probe)  # its own, again: as when a client advertises anew after a reconnect
        assert "/lamp" in (await other.call("/rosapi/services"))["values"]["services"]


async def test_the_number_of_services_of_a_client_is_bounded(probe: Probe) -> None:
    for number in range(MOST_OFFERED):
        await offer(probe, f"/s{number}")
    await probe.send(op="advertise_service", service="/more", type="std_srvs/SetBool", id="x")
    assert f"a client may offer {MOST_OFFERED} services" in (await probe.hear())["msg"]


async def test_one_call_more_than_may_wait_is_answered_at_once(port: int, probe: Probe) -> None:
    async with probing(port) as caller:
        await offer(probe)
        for number in range(MOST_CALLS + 1):
            await caller.send(op="call_service", service="/lamp", id=f"c{number}")
        answer = await caller.hear_op("service_response")
        assert (answer["id"], answer["result"]) == (f"c{MOST_CALLS}", False)
        assert "100 service calls have no answer yet" in answer["values"]
