"""Requests and page commands that nobody would write: made from the interface's own description and from the commands'
models, with every value bent. The server answers each, never with a mistake of its own, and lives."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.errors import Unsatisfiable

from server.protocol import commands
from server.recording.marks.media import TYPES
from server.web.routes.session_request import TOML
from tests.server.recording.made import record
from tests.tree import PROJECT

pytestmark = pytest.mark.field

ID = "car_20160601T120000Z"


class Victim:
    """The process and what it complained of."""

    def __init__(self, process: subprocess.Popen[str], complaints: Path) -> None:
        self.process = process
        assert process.stdout is not None
        self.base = process.stdout.readline().strip()
        self._complaints = complaints
        assert self.base.startswith("http://"), complaints.read_text()

    def assert_well(self) -> None:
        assert self.process.poll() is None, self._complaints.read_text()[-4000:]
        assert httpx.get(f"{self.base}/api/health", timeout=20).status_code == 200
        assert "Traceback" not in self._complaints.read_text(), self._complaints.read_text()[-4000:]


@pytest.fixture
def victim(tmp_path: Path) -> Iterator[Victim]:
    data = tmp_path / "data"
    record(data / "recordings" / "car" / f"{ID}.mcap", seconds=2.0)
    complaints = tmp_path / "complaints"
    with complaints.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.server.security.victim", str(data)],
            cwd=PROJECT, stdout=subprocess.PIPE, stderr=file, text=True,
        )  # fmt: skip
        try:
            yield Victim(process, complaints)
        finally:
            process.kill()
            process.wait()
            assert process.stdout is not None
            process.stdout.close()


# -- the JSON interface ---


@pytest.mark.parametrize(
    "calls", [pytest.param(300, id="short"), pytest.param(10_000, id="10000", marks=pytest.mark.soak)]
)
@pytest.mark.filterwarnings("ignore")  # schemathesis warns of what it uses itself
@pytest.mark.timeout(3600)
def test_no_call_finds_a_mistake(victim: Victim, calls: int) -> None:
    import schemathesis  # takes a second, which every other test process is spared
    from schemathesis.generation import GenerationMode

    with httpx.Client(base_url=victim.base, timeout=30) as client:
        for kind in (TOML, *TYPES["voice"], *TYPES["photo"]):
            schemathesis.serializer.alias(kind, "application/octet-stream")
        schema = schemathesis.openapi.from_dict(client.get("/openapi.json").json())
        operations = [found.ok() for found in schema.get_all_operations()]
        assert len(operations) > 40
        # A route with nothing to fill in is called a few times and no more: the others make up for it.
        each = math.ceil(1.4 * calls / len(operations) / (2 if calls > 1000 else 1))
        answers: Counter[int] = Counter()
        for number, operation in enumerate(operations):
            modes = [GenerationMode.NEGATIVE, GenerationMode.POSITIVE]
            for mode in modes if calls > 1000 else modes[number % 2 : number % 2 + 1]:  # what is made once costs most
                _try(client, operation, mode, each, number, answers)
            victim.assert_well()
    print(f"\n{sum(answers.values())} calls to {len(operations)} routes: {dict(sorted(answers.items()))}")
    assert sum(answers.values()) >= 0.9 * calls
    assert sum(count for status, count in answers.items() if 400 <= status < 500) > sum(answers.values()) / 4


def _try(client: httpx.Client, operation: Any, mode: Any, each: int, number: int, answers: Counter[int]) -> None:
    sent = 0
    described = operation.definition.raw["responses"]

    @seed(number)
    @settings(
        max_examples=each,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(generation_mode=mode))
    def call(case: Any) -> None:
        nonlocal sent
        sent += 1
        if "id" in (case.path_parameters or {}) and sent % 2:
            case.path_parameters["id"] = ID  # else nothing of the sort is ever there
        if operation.path == "/api/mail/test":  # no mail server is dialled
            client.put("/api/mail/settings", json={"host": "", "sender": ""})
        arguments = case.as_transport_kwargs(base_url=str(client.base_url).rstrip("/"))
        arguments.pop("cookies", None)
        files = arguments.pop("files", None)
        try:
            request = client.build_request(**{k: v for k, v in arguments.items() if k in _TAKEN}, files=files)
        except (ValueError, TypeError, UnicodeError, httpx.InvalidURL):
            return  # what no client can write
        try:
            answer = client.send(request)
        except httpx.LocalProtocolError:
            return
        answers[answer.status_code] += 1
        assert answer.status_code < 500, (operation.label, sent, answer.text[:500])
        assert str(answer.status_code) in described, (operation.label, answer.status_code, "is not in the description")
        if answer.status_code >= 400:
            assert answer.headers["content-type"] == "application/problem+json", (operation.label, answer.text[:200])
        assert "content-security-policy" in answer.headers

    with contextlib.suppress(Unsatisfiable):  # a route without anything to fill in cannot be called wrongly
        call()


_TAKEN = ("method", "url", "params", "headers", "content", "data", "json")


# -- the page's socket ---


@pytest.mark.parametrize(
    "orders", [pytest.param(1000, id="short"), pytest.param(10_000, id="10000", marks=pytest.mark.soak)]
)
@pytest.mark.timeout(3600)
async def test_no_order_finds_a_mistake(victim: Victim, orders: int) -> None:
    chance = random.Random(6)
    answers: Counter[str] = Counter()
    sent = 0
    while sent < orders:
        with contextlib.suppress(websockets.ConnectionClosed):
            async with websockets.connect(victim.base.replace("http", "ws") + "/ws", max_size=None) as socket:
                listening = asyncio.create_task(_listen(socket, answers))
                try:
                    await socket.send('{"kind":"hello"}')  # before it, no command is carried out
                    for _ in range(min(150, orders - sent)):
                        await socket.send(_order(chance))
                        sent += 1
                        if sent % 10 == 0:
                            await asyncio.sleep(0.005)  # a page that never reads is let go
                    await socket.send('{"kind":"pause","id":"last"}')
                    await asyncio.wait_for(listening, 20)
                finally:
                    listening.cancel()
                    with contextlib.suppress(asyncio.CancelledError):
                        await listening
        await asyncio.to_thread(victim.assert_well)
    print(f"\n{sent} orders: {dict(answers.most_common(12))}")
    assert sum(answers.values()) > orders / 4, "most were answered"


async def _listen(socket: websockets.ClientConnection, answers: Counter[str]) -> None:
    async for text in socket:
        message = json.loads(text) if isinstance(text, str) else {"kind": "scan"}
        if message["kind"] in ("reply", "problem"):
            answers[f"{message['kind']} {message.get('ok', '')}".strip()] += 1
        if message.get("id") == "last":
            return


def _order(chance: random.Random) -> str | bytes:
    """A command with the right fields and bent values; now and then none at all."""
    roll = chance.random()
    if roll < 0.02:
        return chance.randbytes(chance.randrange(200))
    if roll < 0.05:
        return "".join(chance.choice('{}[]":,\\u0d8012eE-.ntf ') for _ in range(chance.randrange(200)))
    kinds = [_fields_of(model) for model in commands.Command.__args__]
    fields = {name: _value(chance) for name in chance.choice(kinds) if chance.random() < 0.9}
    names = [
        "connect",
        "disconnect",
        "pause",
        "resume",
        "record",
        "acknowledge",
        "silence",
        "shelve",
        "unshelve",
        "set",
        "import",
    ]
    names += ["retry", "position", "replay", "hello", "take", "have", "watch", "present", "control", "ride"]
    fields["kind"] = chance.choice(names) if chance.random() < 0.95 else _value(chance)
    if chance.random() < 0.9:
        fields["id"] = f"{chance.random()}"
    if fields["kind"] == "replay":
        fields |= {"do": chance.choice(["open", "seek", "play", "pause", "rate", "leave", _value(chance)])}
        fields |= {"recording": chance.choice([ID, _value(chance)]), "at_s": _value(chance), "rate": _value(chance)}
    if fields["kind"] == "connect" and chance.random() < 0.5:
        fields["address"] = chance.choice(["127.0.0.1:1", "169.254.169.254", "ws://x:y@z", "\u202e", "x" * 301])
    return json.dumps(fields)


def _fields_of(model: Any) -> list[str]:
    return list(model.model_fields)


def _value(chance: random.Random, depth: int = 0) -> Any:
    match chance.randrange(14 if depth < 4 else 10):
        case 0:
            return None
        case 1:
            return chance.random() < 0.5
        case 2:
            return chance.choice([0, -1, 1, 2**31, -(2**31), 2**53, 2**63, 2**64, -(2**63) - 1, 10**30])
        case 3:
            return chance.choice([0.0, -0.0, 0.5, 1e308, -1e308, 5e-324, 15.000001])
        case 4:
            return chance.choice([math.nan, math.inf, -math.inf])
        case 5:
            return "".join(
                chr(chance.choice([0, 10, 13, 27, 34, 39, 60, 92, 0x202E, 0xD800, 0xFFFF, 0x1F600, 97]))
                for _ in range(chance.randrange(20))
            )
        case 6:
            return "a" * chance.choice([0, 1, 80, 81, 120, 121, 300, 301, 5000])
        case 7:
            return chance.choice(
                [
                    "../../etc/passwd",
                    "<script>alert(1)</script>",
                    "'; DROP TABLE events; --",
                    "${x}",
                    "%s%n",
                    "speed_limit",
                ]
            )
        case 8:
            return chance.choice(["speed_limit.max_mps", "auto", "true", "null", "1e400", "0x10", "[values]\nx = 1"])
        case 9:
            return chance.randrange(-1000, 1000)
        case 10 | 11:
            return [_value(chance, depth + 1) for _ in range(chance.randrange(5))]
        case _:
            keys = [
                "x",
                "kind",
                "id",
                "lat_deg",
                "lon_deg",
                "accuracy_m",
                "at_ms",
                "__proto__",
                "speed_limit.max_mps",
                "",
            ]
            return {chance.choice(keys): _value(chance, depth + 1) for _ in range(chance.randrange(5))}
