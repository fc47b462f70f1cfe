"""The recordings over HTTP: listed, named, fetched in parts, deleted, restored; every refusal as a sentence."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import pytest
import pytest_asyncio
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from server.app.config import Config
from server.recording.export.formats import FORMATS
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.recording.made import BEGAN_MS, record
from tests.server.recording.read.test_bag2 import left_open

FIRST, SECOND = "car_20260921T141320Z", "car_20260921T151320Z"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    data = tmp_path_factory.mktemp("data")
    record(data / "recordings" / "car" / f"{FIRST}.mcap", alarms=[(2.0, "critical")])
    record(data / "recordings" / "car" / f"{SECOND}.mcap", began_ms=BEGAN_MS + 3_600_000, at=None)
    return data


@pytest_asyncio.fixture
async def client(data: Path) -> AsyncIterator[httpx.AsyncClient]:
    async with (
        serving(Config(vehicles=(Vehicle(name="car"),), data=data)) as base,
        httpx.AsyncClient(base_url=base, timeout=20) as client,
    ):
        async with asyncio.timeout(60):
            while (await client.get("/api/health")).json()["recordings"] != {
                "count": 2,
                "bytes": sizes(data),
                "unread": 0,
            }:
                await asyncio.sleep(0.05)
        yield client


def sizes(data: Path) -> int:
    return sum(path.stat().st_size for path in (data / "recordings" / "car").glob("*.mcap"))


def problem(answer: httpx.Response, status: int) -> str:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    detail: str = answer.json()["detail"]
    assert detail.endswith(".")
    return detail


async def test_the_list(client: httpx.AsyncClient, data: Path) -> None:
    answer = await client.get("/api/recordings", params={"limit": 1})
    body = answer.json()
    (row,) = body["recordings"]
    assert (row["id"], row["sketch"], row["alarms"]) == (SECOND, None, {"critical": 0, "warning": 0, "advisory": 0})
    assert body["all"] == body["found"] == {"count": 2, "bytes": sizes(data)}
    assert body["trash"] == {"count": 0, "bytes": 0}
    assert body["free_bytes"] > 0
    assert (body["vehicles"], body["tags"], body["waiting"]) == (["car"], [], 0)
    assert [form["name"] for form in body["formats"]] == [*FORMATS]
    assert {"bag", "ros2", "csv", "gpx", "geojson", "html"} <= FORMATS.keys()
    assert {form["name"]: form["ros_version"] for form in body["formats"]}["ros2"] == 2
    after = (await client.get("/api/recordings", params={"limit": 1, "cursor": body["next"]})).json()
    assert [row["id"] for row in after["recordings"]] == [FIRST]
    assert after["next"] is None
    for _ in range(10):  # the free space is part of the answer, and others write on this disk
        tag = (await client.get("/api/recordings", params={"limit": 1})).headers["etag"]
        again = await client.get("/api/recordings", params={"limit": 1}, headers={"if-none-match": tag})
        if again.status_code == 304:
            break
    assert (again.status_code, again.content) == (304, b"")
    assert (await client.get("/api/recordings", params={"text": "none such"})).json()["recordings"] == []
    assert problem(await client.get("/api/recordings", params={"cursor": "../../x"}), 409)
    assert problem(await client.get("/api/recordings", params={"limit": 0}), 422)


async def test_a_recording_and_its_picture(client: httpx.AsyncClient) -> None:
    row = (await client.get(f"/api/recordings/{FIRST}")).json()
    assert row["raised"][0]["title"] == "A critical alarm"
    picture = await client.get(row["thumbnail"])
    assert picture.headers["content-type"].startswith("image/svg+xml")
    assert picture.headers["content-security-policy"].startswith("default-src 'none'")
    assert "The track, with 1 alarm on it" in picture.text
    assert "No usable position was recorded" in (await client.get(f"/api/recordings/{SECOND}/track.svg")).text
    assert problem(await client.get("/api/recordings/none/track.svg"), 404)


async def test_the_file_whole_and_in_parts(client: httpx.AsyncClient, data: Path) -> None:
    content = (data / "recordings" / "car" / f"{FIRST}.mcap").read_bytes()
    whole = await client.get(f"/api/recordings/{FIRST}/file.mcap")
    assert whole.content == content
    assert whole.headers["content-type"] == "application/x-mcap"
    assert whole.headers["content-disposition"] == f'attachment; filename="{FIRST}.mcap"'
    part = await client.get(f"/api/recordings/{FIRST}/file.mcap", headers={"range": "bytes=100-199"})
    assert (part.status_code, part.content) == (206, content[100:200])
    assert (await client.head(f"/api/recordings/{FIRST}/file.mcap")).headers["content-length"] == str(len(content))
    assert problem(await client.get(f"/api/recordings/{FIRST}/file.mcap", headers={"range": "bytes=0-1,4-5"}), 416)
    assert problem(await client.get("/api/recordings/none/file.mcap"), 404)


async def test_a_database_is_not_downloaded_without_its_log(
    client: httpx.AsyncClient, data: Path, tmp_path: Path
) -> None:
    killed = left_open(tmp_path)
    there = data / "recordings" / "killed"
    shutil.copytree(killed.parent, there)
    try:
        await client.post("/api/recordings/rescan")
        rows = (await client.get("/api/recordings")).json()["recordings"]
        address = f"/api/recordings/{next(row['id'] for row in rows if row['format'] == 'db3')}/file.mcap"
        assert "a database with a log that holds a part of it: export it" in problem(await client.get(address), 409)
        (there / "drive_0.db3-wal").write_bytes(b"")  # of a database that was closed nothing is in it
        assert (await client.get(address)).content == killed.read_bytes()
    finally:
        shutil.rmtree(there)


async def test_a_title_names_the_file_and_does_no_harm(client: httpx.AsyncClient) -> None:
    change = {"title": '../"Wet"\r\nX: y\u202e <b>lot</b> Straße', "note": "a\nb", "tags": ["wet", "Wet"]}
    row = (await client.patch(f"/api/recordings/{SECOND}", json=change)).json()
    assert row["title"] == '../"Wet" X: y <b>lot</b> Straße'
    assert (row["note"], row["tags"]) == ("a\nb", ["wet"])
    name = (await client.get(f"/api/recordings/{SECOND}/file.mcap")).headers["content-disposition"]
    assert name.startswith(f'attachment; filename="{SECOND} .._')
    assert name.endswith("Stra%C3%9Fe.mcap")
    assert "\r" not in name
    found = (await client.get("/api/recordings", params={"tag": "WET"})).json()
    assert [one["id"] for one in found["recordings"]] == [SECOND]
    assert found["tags"] == ["wet"]
    kept = (await client.patch(f"/api/recordings/{SECOND}", json={"title": "Lot"})).json()
    assert (kept["title"], kept["note"], kept["tags"]) == ("Lot", "a\nb", ["wet"])
    await client.patch(f"/api/recordings/{SECOND}", json={"title": "", "note": "", "tags": []})


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ({"title": "x" * 10_000}, "A title has at most 120 letters; this has 10000."),
        ({"note": "x" * 4001}, "at most 4000 letters"),
        ({"tags": ["x" * 41]}, "at most 40 letters"),
        ({"tags": "wet"}, "tags"),
        ({"title": 7}, "title"),
        ({"name": "x"}, "name"),
        ({"title": "x" * 30_000}, "title"),
    ],
    ids=lambda value: str(value)[:30],
)
async def test_what_cannot_be_said_of_it(client: httpx.AsyncClient, body: dict[str, Any], text: str) -> None:
    assert text in problem(await client.patch(f"/api/recordings/{FIRST}", json=body), 422)
    assert (await client.get(f"/api/recordings/{FIRST}")).json()["title"] == ""


async def test_deleted_taken_back_and_gone_for_good(client: httpx.AsyncClient, data: Path) -> None:
    extra = record(data / "recordings" / "car" / "car_20260921T161320Z.mcap", seconds=1.0)
    await client.post("/api/recordings/rescan")
    id = extra.stem
    assert (await client.delete(f"/api/recordings/{id}")).json()["trashed_ms"]
    assert problem(await client.delete(f"/api/recordings/{id}"), 404) == "There is no such recording."
    assert problem(await client.get(f"/api/recordings/{id}/file.mcap"), 404)
    assert [row["id"] for row in (await client.get("/api/trash")).json()["recordings"]] == [id]
    assert (await client.post(f"/api/trash/{id}/restore")).json()["trashed_ms"] is None
    assert problem(await client.post(f"/api/trash/{id}/restore"), 404)
    assert extra.exists()
    await client.delete(f"/api/recordings/{id}")
    assert (await client.delete(f"/api/trash/{id}")).json()["count"] == 1
    assert (await client.delete("/api/trash")).json() == {"ok": True, "count": 0, "bytes": 0}
    assert not extra.exists()
    writing = extra.with_name(f"{id}.mcap.writing")
    writing.write_text("x")
    assert "being recorded now" in problem(await client.delete(f"/api/recordings/{id}"), 409)
    writing.unlink()


async def test_counters(client: httpx.AsyncClient) -> None:
    text = (await client.get("/metrics")).text
    assert 'catgraph_recordings{place="kept"} 2' in text
    assert 'catgraph_recordings{place="trash"} 0' in text
    assert "catgraph_recordings_unreadable 0" in text
    assert "catgraph_disk_free_bytes " in text


async def test_a_server_that_keeps_nothing_says_so() -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        assert "--data" in problem(await client.get("/api/recordings"), 404)
        assert "--data" in problem(await client.delete("/api/recordings/x"), 404)
        assert (await client.get("/api/health")).json()["recordings"] is None
        assert "catgraph_recordings" not in (await client.get("/metrics")).text


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    id=st.one_of(
        st.text(min_size=1, max_size=120), st.sampled_from(["../car", "..%2f..%2fetc", "%00", ".", "a/b", "~"])
    )
)
async def test_no_id_finds_what_is_not_a_recording(client: httpx.AsyncClient, id: str) -> None:
    safe = quote(id.encode("utf-8", "surrogatepass"), safe="%").replace(".", "%2E")
    for way in ("", "/file.mcap", "/track.svg"):
        answer = await client.get(f"/api/recordings/{safe}{way}")
        assert answer.status_code in (307, 404, 405, 422), (id, answer.text)
    assert (await client.delete(f"/api/recordings/{safe}")).status_code in (307, 404, 405, 422)


async def test_verified_on_request_and_only_then(client: httpx.AsyncClient, data: Path) -> None:
    row = (await client.get(f"/api/recordings/{FIRST}")).json()
    assert len(row["head"]) == 64
    assert row["verified"] is None, "the list never claims what was not verified"
    found = (await client.get(f"/api/recordings/{FIRST}/verify")).json()
    assert (found["state"], found["is_broken"], found["head"]) == ("intact", False, row["head"])
    assert found["short"] == f"Intact · {row['head'][:8]}"
    assert (await client.get(f"/api/recordings/{FIRST}")).json()["verified"] == found
    path = data / "recordings" / "car" / f"{FIRST}.mcap"
    raw = path.read_bytes()
    path.write_bytes(raw[:-300] + bytes((raw[-300] ^ 1,)) + raw[-299:])
    try:
        found = (await client.get(f"/api/recordings/{FIRST}/verify")).json()
    finally:
        path.write_bytes(raw)
    assert found["is_broken"]
    assert found["short"].startswith("Broken at record ")
    assert (await client.get(f"/api/recordings/{FIRST}")).json()["verified"] is None, "the file is another again"
    assert problem(await client.get("/api/recordings/none/verify"), 404)
