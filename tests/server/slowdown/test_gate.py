"""Nothing is published to a car but through the one gate: looked for in the source, and by walking every road."""

from __future__ import annotations

import ast
import asyncio
import json
import re
import time
from collections.abc import Iterator
from typing import Any, get_args

import pytest
import websockets

from server.app.app import create_app
from server.app.config import Config
from server.protocol import commands, drive_commands
from server.rosbridge.outgoing import NotAllowed
from server.rosbridge_server.server import RosBridge
from server.vehicle.foxglove.commands import CLIENT_PUBLISH, Commands
from server.vehicle.foxglove.protocol import ServerInfo
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.access.test_rules import all_routes
from tests.server.cars import driving
from tests.server.conftest import serving_app
from tests.tree import PROJECT

GATE = "server/slowdown/publisher.py"
OTHER_SIDE = ("server/rosbridge_server/", "server/simulator/")  # the bridge's own end, and the car behind it
SPEAKS = {"publish", "advertise", "unadvertise", "advertise_service", "service_response"}


def operations(source: str) -> Iterator[str]:
    """Values of "op" in dictionaries that the source writes."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Constant) and key.value == "op":
                    yield value.value if isinstance(value, ast.Constant) else "?"


def test_one_file_makes_operations_that_publish() -> None:
    found: dict[str, set[str]] = {}
    for path in sorted((PROJECT / "server").rglob("*.py")):
        name = path.relative_to(PROJECT).as_posix()
        if not name.startswith(OTHER_SIDE):
            made = set(operations(path.read_text(encoding="utf-8")))
            if made:
                found[name] = made
    assert found.pop(GATE) == {"publish", "advertise", "unadvertise"}
    calls, rows = "server/rosbridge/link.py", "server/rosbridge/subscription.py"
    foxglove = found.pop("server/vehicle/foxglove/protocol.py")
    assert foxglove == {"subscribe", "unsubscribe", "subscribeConnectionGraph", "advertise", "unadvertise"}
    assert found == {calls: {"call_service"}, rows: {"?"}}  # subscribe, unsubscribe: see below
    sent = (PROJECT / "server/rosbridge/sent_rows.py").read_text(encoding="utf-8")
    assert {node.args[0].value for node in sent_rows(sent)} == {"subscribe", "unsubscribe"}


def sent_rows(source: str) -> Iterator[Any]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "_operate":
            yield node


def test_to_a_foxglove_server_only_what_passed_the_gate_is_published() -> None:
    speaks = {"advertise", "unadvertise", "message"}
    users: dict[str, set[str]] = {}
    for path in sorted((PROJECT / "server").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module == "server.vehicle.foxglove.protocol":
                assert speaks.isdisjoint(one.name for one in node.names), path
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "protocol":
                if node.attr in speaks:
                    users.setdefault(path.relative_to(PROJECT).as_posix(), set()).add(node.attr)
    assert users == {"server/vehicle/foxglove/commands.py": speaks}
    info = ServerInfo(name="car", capabilities=frozenset({CLIENT_PUBLISH}), encodings=("json",), session="")
    for operation in (
        {"op": "advertise", "topic": "/other", "type": "std_msgs/Bool"},
        {"op": "publish", "topic": "/other", "msg": {"data": True}},
        {"op": "call_service", "service": "/reset", "args": {}},
    ):
        with pytest.raises(NotAllowed):
            Commands(info).frames(operation, {"json"})


def test_one_file_uses_the_gate() -> None:
    users = [
        path.relative_to(PROJECT).as_posix()
        for path in sorted((PROJECT / "server").rglob("*.py"))
        if "slowdown.publisher" in path.read_text(encoding="utf-8")
    ]
    assert users == ["server/slowdown/guard_client.py", "server/slowdown/sender.py"]


VALUES: dict[str, Any] = {
    "address": "ws://127.0.0.1:1",
    "alarm": "speed_limit",
    "occurrence": 1,
    "minutes": 1.0,
    "toml": "",
    "on": True,
    "phone": "0123abcd",
    "handheld": True,
    "why": "denied",
    "do": "take",
    "visible": True,
    "sound": "ready",
    "awake": "ready",
    "number": 1,
    "trigger": "speed",
    "reason": "parked",
    "to": "0123abcd",
    "accept": True,
    "of": "p1",
    "ago_s": 1.0,
    "item": "doors",
    "result": "open",
    "check": "c1",
    "items": None,
    "line": "alarms:none",
    "version": "0123abcd",
    "intervention": "i-1",
    "mark": "m-1",
}
ORDERS = ("arm", "slow_down")  # walked last, and one after the other
UNANSWERED = ("present",)  # once a second from every page
ENDS = ("disconnect", "connect")  # after these nothing is monitored: not walked


def every_command() -> list[dict[str, Any]]:
    """Each kind of command once, with what it needs; those that order a slow-down last."""
    models = [*get_args(commands.Command), *get_args(drive_commands.SlowingCommand)]
    found = {}
    for model in models:
        if model is not drive_commands.SlowingCommand:
            (kind,) = get_args(model.model_fields["kind"].annotation)
            needed = {name for name, field in model.model_fields.items() if field.is_required() and name != "kind"}
            needed |= {"why"} if kind == "position" else set()
            found[kind] = {"kind": kind, "id": kind, **{name: VALUES[name] for name in needed}}
    assert set(ORDERS + ENDS) < set(found)
    return [found[kind] for kind in found if kind not in ENDS + ORDERS] + [found["arm"]]


@pytest.mark.slow
@pytest.mark.virtual_time
async def test_whatever_is_called_nothing_is_published_that_was_not_ordered(bridge: RosBridge) -> None:
    """Every route with every method, every command of a page: and arming alone sends nothing to the car."""
    bridge.advertise("/catvehicle/cmd_vel", "geometry_msgs/Twist")
    published: list[str] = []
    bridge.on_publish.append(lambda topic, kind, message: published.append(topic))
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    app = create_app(config, now=time.monotonic)
    async with (
        driving(bridge, steers=True),
        serving_app(app, config) as base,
        http_client(base_url=base) as client,
        websockets.connect(base.replace("http", "ws") + "/ws") as page,
    ):
        async with asyncio.timeout(20):
            while (await client.get("/api/state")).json()["decelerate"]["state"] != "not_armed":
                await asyncio.sleep(0.05)
        walked = 0
        for method, path in all_routes():
            if path not in ("/api/connect", "/api/disconnect"):
                way = re.sub(r"{[^}]*}", "1", path)
                await client.request(method, way, json=None if method in ("GET", "HEAD") else VALUES)
                walked += 1
        assert walked > 60
        answered: dict[str, Any] = {}
        ordered = every_command()
        await page.send(json.dumps({"kind": "hello"}))
        for command in ordered:
            await page.send(json.dumps(command))
        waited_for = {command["kind"] for command in ordered if command["kind"] not in UNANSWERED}
        ends_s = time.monotonic() + 20
        while waited_for - set(answered):
            assert time.monotonic() < ends_s, waited_for - set(answered)
            message = json.loads(await asyncio.wait_for(page.recv(), 20))
            if message["kind"] == "reply":
                answered[message["id"]] = message
            elif message["kind"] == "offer":
                await page.send(json.dumps({"kind": "take", "seq": message["seq"]}))
        assert answered["arm"]["ok"]
        await asyncio.sleep(0.3)
        assert published == []
        assert (await client.post("/api/slow-down/order")).is_success  # and now it is
        await asyncio.sleep(0.3)
        assert set(published) == {"/catvehicle/cmd_vel"}
