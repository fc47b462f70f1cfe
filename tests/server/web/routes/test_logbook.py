"""The table of the logbook, column by column, against drives whose truth is known."""

from __future__ import annotations

import asyncio
import csv
import io
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
import pytest_asyncio

from server.app.config import Config
from server.recording.catalog import annotations
from server.vehicle.vehicle import Vehicle
from tests.server.conftest import serving
from tests.server.recording.drive.story import BEGIN_MS, EVIL, check, in_two_parts, logged, recorded

FIRST, SECOND, THIRD = "car_20231114T221320Z", "car_20231114T231320Z", "car_20231115T001320Z"
Rows = list[dict[str, str]]


def failing(begin_s: float) -> list[tuple[int, str, dict[str, object]]]:
    """A check in which two items failed, one of them by a hostile name."""
    counts = {"done": 1, "failed": 2, "of": 3}
    return [
        check(begin_s + 1.0, "begun"),
        check(
            begin_s + 2.0, "item", item="tyres", item_title="Tyres", result="failed", value="", note="flat", failed=1
        ),
        check(begin_s + 3.0, "item", item="hitch", item_title=EVIL, result="failed", value="", note="", failed=2),
        check(begin_s + 4.0, "signed", hash="7c1e" * 16, **counts),
        logged(begin_s + 5.0, "raised", "speed_limit", state="UNACKED"),
    ]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    data = tmp_path_factory.mktemp("data")
    folder = data / "recordings" / "car"
    folder.mkdir(parents=True)
    paths = in_two_parts(folder, session=FIRST)
    annotations.write(paths[0], annotations.Annotations(title="=1+1", tags=("wet", "night")))
    begin_s = 3600.0
    recorded(folder, failing(begin_s), name=f"{SECOND}.mcap", from_s=begin_s, length_s=20.0, session=SECOND)
    recorded(folder, [], name=f"{THIRD}.mcap", from_s=2 * begin_s, length_s=10.0, session=THIRD, vehicle="")
    for bag in folder.glob("*.bag"):
        bag.unlink()
    return data


@pytest_asyncio.fixture
async def client(data: Path) -> AsyncIterator[httpx.AsyncClient]:
    async with (
        serving(Config(vehicles=(Vehicle(name="car"),), data=data)) as base,
        httpx.AsyncClient(base_url=base, timeout=60) as client,
    ):
        async with asyncio.timeout(60):
            while sum(len(drive["recordings"]) for drive in (await client.get("/api/logbook")).json()["drives"]) < 4:
                await asyncio.sleep(0.05)
        yield client


async def rows(client: httpx.AsyncClient, **which: str) -> Rows:
    answer = await client.get("/api/logbook.csv", params=which)
    assert answer.status_code == 200
    return list(csv.DictReader(io.StringIO(answer.text, newline="")))


def number(row: dict[str, str], *heads: str) -> list[float | None]:
    """Cells as numbers; None: the cell is empty."""
    return [float(row[head]) if row[head] else None for head in heads]


async def test_each_column_shows_what_was_driven(client: httpx.AsyncClient) -> None:
    first, second, third = await rows(client)
    texts = {
        "recording": FIRST, "vehicle": "car", "started": "2023-11-14T22:13:20.000000Z", "title": "'=1+1",
        "tags": "wet; night", "people": "A. K.", "parts": "2", "interventions": "2", "not described": "1",
        "alarms": "4", "marks": "3", "departure check": "signed", "check signed": "2023-11-14T22:13:26.000000Z",
        "signed by": "A. K. (Pixel)", "items failed": "0", "failed items": "",
        "alarms by component": "Speed: 2; Laser: 1; Position: 1",
    }  # fmt: skip
    assert {head: first[head] for head in texts} == texts
    measured = {  # 10 m/s for 120 s and 60 s, by hand from 0 to 10, 80 to 120 and 170 to 210 s
        "distance [m]": (1800, 12), "recorded [s]": (180, 0.2), "blind [s]": (4, 0.2),
        "autonomous [m]": (900, 8), "manual [m]": (900, 8), "mode not known [m]": (0, 0),
        "autonomous [s]": (90, 0.5), "manual [s]": (90, 0.5), "mode not known [s]": (0, 0),
        "interventions per autonomous km": (2 / 0.9, 0.02), "alarms per km": (4 / 1.8, 0.02),
    }  # fmt: skip
    for head, (truth, within) in measured.items():
        assert float(first[head]) == pytest.approx(truth, abs=within), head
    assert set(first) == set(texts) | set(measured), "each column is read"
    checked = ("departure check", "check signed", "signed by", "items failed", "failed items")
    assert [second[head] for head in checked] == [
        *("signed", "2023-11-14T23:13:24.000000Z", "A. K. (Pixel)", "2", f"Tyres; {EVIL}"),
    ]
    assert number(second, "alarms", "alarms per km") == [1, pytest.approx(5, abs=0.2)]
    assert [third[head] for head in checked] == ["none", "", "", "", ""]


async def test_what_nobody_knows_is_an_empty_cell_and_no_zero(client: httpx.AsyncClient) -> None:
    _, second, third = await rows(client)
    for row in (second, third):
        assert number(row, "interventions", "not described", "interventions per autonomous km") == [None] * 3
        assert number(row, "mode not known [m]", "mode not known [s]") == number(row, "distance [m]", "recorded [s]")
    assert number(third, "alarms", "marks", "alarms per km") == [0, 0, 0]


async def test_the_table_has_the_drives_that_were_chosen(client: httpx.AsyncClient) -> None:
    assert [row["recording"] for row in await rows(client)] == [FIRST, SECOND, THIRD]
    assert [row["recording"] for row in await rows(client, tag="wet")] == [FIRST]
    assert [row["recording"] for row in await rows(client, person="A. K.")] == [FIRST]
    assert await rows(client, person="nobody") == await rows(client, vehicle="other") == []
    since = str(BEGIN_MS + 3_000_000)
    assert [row["recording"] for row in await rows(client, **{"from": since})] == [SECOND, THIRD]
    assert [row["recording"] for row in await rows(client, to=since)] == [FIRST]
