"""The interface over HTTP, before programs that read its description and its metrics."""

from __future__ import annotations

import asyncio
import json
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from openapi_spec_validator import OpenAPIV31SpecValidator

from tests.http import http_client
from tests.peers.conftest import DRIVE, Tally
from tests.peers.programs import output_of

FUZZ_S = 180
CHECKS = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_headers_conformance",
    "response_schema_conformance",
    "unsupported_method",
    "allow_header_conformance",
)
# Not called: what dials another machine, and what takes the car away from all later calls.
LEFT_OUT = r"^(dis)?connect_|^off_|_api_mail_.*(post|put)$"
READS = f"""
[[operations]]
include-path-regex = "/api/recordings/[{{]id[}}]/"
include-method = "GET"
parameters = {{ id = "{DRIVE}" }}
"""


@pytest.fixture
async def monitored(base: str) -> str:
    """The server, once the car's data has come."""
    async with http_client(base_url=base) as client, asyncio.timeout(60):
        while (await client.get("/api/state")).json().get("session", {}).get("phase") != "monitoring":
            await asyncio.sleep(0.2)
    return base


@pytest.mark.peers("schemathesis")
@pytest.mark.timeout(900)
async def test_calls_made_from_the_description_are_answered_as_described(
    monitored: str, tally: Tally, tmp_path: Path
) -> None:
    config, log = tmp_path / "schemathesis.toml", tmp_path / "events.ndjson"
    config.write_text(READS)
    options = {
        "--max-time": FUZZ_S,
        "--phases": "examples,coverage,fuzzing",
        "--checks": ",".join(CHECKS),
        "--exclude-operation-id-regex": LEFT_OUT,
        "--request-timeout": 60,
        "--seed": 1,
        "--report": "ndjson",
        "--report-ndjson-path": log,
    }
    program = (str(Path(sys.executable).with_name("schemathesis")), "--config-file", str(config))
    given = [str(part) for option in options.items() for part in option]
    code, printed = await output_of(
        *program,
        "run",
        f"{monitored}/openapi.json",
        *given,
        "--continue-on-failure",
        "--no-shrink",
        within_s=800,
        cwd=tmp_path,
    )
    assert code in (0, 1), printed[-4000:]
    statuses: Counter[int] = Counter()
    for event in map(json.loads, log.read_text().splitlines()):
        for kind, value in event.items():
            if kind == "NonFatalError":
                tally.found(f"{value['value']['type']} {value['label']}: {value['value']['message']}")
            elif kind == "ScenarioFinished":
                statuses.update(answered(value["recorder"]))
                for finding in failures(value["recorder"]):
                    tally.found(finding)
    tally.tried(statuses.total())
    print(f"\n{statuses.total()} calls: {dict(sorted(statuses.items()))}")
    assert tally.unexplained == []
    assert statuses.total() > 500
    assert statuses[200] > statuses.total() / 10
    async with http_client(base_url=monitored) as client:
        assert (await client.get("/api/health")).status_code == 200


def answered(recorder: dict[str, Any]) -> Iterator[int]:
    """The statuses of a scenario's calls."""
    for one in recorder.get("interactions", {}).values():
        if one.get("response"):
            yield one["response"]["status_code"]


def failures(recorder: dict[str, Any]) -> Iterator[str]:
    """What the checks of a scenario found wrong."""
    for one in recorder.get("checks", {}).values():
        for check in one:
            if failure := check.get("failure_info"):
                what = failure["failure"]
                yield f"{what['code']} {recorder['label']}: {what['title']}: {what['message']}"


@pytest.mark.peers("openapi-spec-validator")
async def test_the_served_description_is_valid(base: str, tally: Tally) -> None:
    async with http_client(base_url=base) as client:
        description = (await client.get("/openapi.json")).json()
    tally.tried(len(description["paths"]) + len(description["components"]["schemas"]))
    for error in OpenAPIV31SpecValidator(description).iter_errors():
        tally.found(f"{list(error.absolute_path)}: {error.message}")
    assert tally.unexplained == []
    assert tally.run > 100


@pytest.mark.peers("promtool")
async def test_the_metrics_are_in_prometheus_own_form(monitored: str, tally: Tally) -> None:
    async with http_client(base_url=monitored) as client:
        metrics = (await client.get("/metrics")).content
    names = {line.split()[2] for line in metrics.decode().splitlines() if line.startswith("# TYPE")}
    tally.tried(len(names))
    code, printed = await output_of("promtool", "check", "metrics", within_s=60, given=metrics)
    for line in printed.splitlines():
        tally.found(line)
    assert tally.unexplained == []
    assert code in (0, 3)  # 3: it has remarks
    assert len(names) > 10
