"""A client that a generator of others makes of our description reads everything, with types, errors included."""

from __future__ import annotations

import asyncio
import importlib
import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import AsyncExitStack
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from server.app.app import create_app
from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.server.conftest import serving
from tests.server.recording.made import record

pytestmark = pytest.mark.slow
DRIVE = "car_20260921T141320Z"
NAME = "catgraph_client"
# What stands in a path: something that is there, or else nothing that is.
THERE = {"id": DRIVE, "check": "speed_limit", "format_": "csv", "name": "Leaflet"}
MISSING = {
    "mark": "no-such-mark",
    "job": "none",
    "n": 9,
    "z": "1",
    "x": "1",
    "y": "1",
    "intervention": "none",
    "folder": "none",
}

WITHOUT = {"listed_api_stored_get", "picture_map_site_name_get"}  # this server has no store and no image of a site


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    """The generated client. The generator has nothing to complain of, and leaves nothing out."""
    folder = tmp_path_factory.mktemp("client")
    description = create_app(Config()).openapi()
    (folder / "openapi.json").write_text(json.dumps(description))
    binary = {name for name in media_types(description) if not name.startswith("text/") and not name.endswith("json")}
    config = {"content_type_overrides": dict.fromkeys(binary, "application/octet-stream"), "post_hooks": []}
    (folder / "config.json").write_text(json.dumps(config))
    arguments = ["--path", "openapi.json", "--config", "config.json", "--output-path", NAME, "--meta", "none"]
    generator = Path(sys.executable).with_name("openapi-python-client")
    made = subprocess.run(
        [generator, "generate", *arguments, "--fail-on-warning"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stdout + made.stderr
    sys.path.insert(0, str(folder))
    try:
        yield importlib.import_module(NAME)
    finally:
        sys.path.remove(str(folder))
        for name in [name for name in sys.modules if name.partition(".")[0] == NAME]:
            del sys.modules[name]


def media_types(found: Any) -> set[str]:
    """All keys of `content` in a description."""
    if isinstance(found, list):
        return {name for one in found for name in media_types(one)}
    if not isinstance(found, dict):
        return set()
    own = set(found["content"]) if isinstance(found.get("content"), dict) else set()
    return own | {name for one in found.values() for name in media_types(one)}


def reads(package: ModuleType) -> list[ModuleType]:
    """The modules of the client with an operation that reads."""
    folder = Path(str(package.__file__)).parent / "api"
    files = [path for path in sorted(folder.glob("*/*.py")) if path.name != "__init__.py"]
    found = [path for path in files if '"method": "get"' in path.read_text()]
    return [importlib.import_module(f"{NAME}.api.{path.parent.name}.{path.stem}") for path in found]


def arguments(module: ModuleType) -> dict[str, Any]:
    """What an operation needs, for a thing that is there."""
    known = {**THERE, **MISSING}
    code = module._get_kwargs.__code__
    positional = code.co_varnames[: code.co_argcount]
    return {name: known[name] for name in positional}


@pytest.mark.timeout(600)  # it makes two exports
async def test_every_read_is_called_and_its_answer_typed(
    package: ModuleType, bridge: RosBridge, tmp_path: Path
) -> None:
    record(tmp_path / "recordings" / "car" / f"{DRIVE}.mcap", alarms=[(2.0, "critical")])
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    problem = importlib.import_module(f"{NAME}.models").ProblemDocument
    statuses: dict[str, int] = {}
    needs: dict[str, Any] = {}
    async with serving(config) as base, AsyncExitStack() as stack:
        client = importlib.import_module(f"{NAME}.client").Client(base_url=base, timeout=300.0)
        await stack.enter_async_context(client)
        one = importlib.import_module(f"{NAME}.api.recordings.one_api_recordings_id_get")
        async with asyncio.timeout(60):
            while (await one.asyncio_detailed(DRIVE, client=client)).parsed.state.value != "read":
                await asyncio.sleep(0.05)
        for module in reads(package):
            answer = await module.asyncio_detailed(**arguments(module), client=client)
            name, status = module.__name__.rpartition(".")[2], int(answer.status_code)
            statuses[name], needs[name] = status, arguments(module).keys()
            if status in (200, 204):
                assert isinstance(answer.parsed, problem) is False, name
                assert (answer.parsed is None) is (status == 204), name
                assert type(answer.parsed) is not dict, name
            else:
                assert isinstance(answer.parsed, problem), (name, status, answer.content)
                assert (answer.parsed.status, bool(answer.parsed.detail)) == (status, True), name
        missing = await one.asyncio_detailed("no_such", client=client)
        assert isinstance(missing.parsed, problem)
        assert missing.parsed.detail == "There is no such recording."
        events = importlib.import_module(f"{NAME}.api.alarms.events_api_events_get")
        wrong = await events.asyncio_detailed(client=client, limit=-1)
        assert (wrong.parsed.status, wrong.parsed.errors[0].where) == (422, "limit")
    assert len(statuses) > 45
    found = {name for name, status in statuses.items() if status == 200}
    absent = {name for name, needed in needs.items() if needed & MISSING.keys()} | WITHOUT
    assert found == needs.keys() - absent
    assert {statuses[name] for name in absent} == {404, 409}
