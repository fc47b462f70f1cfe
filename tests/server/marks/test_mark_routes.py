"""Marks over HTTP: placed, changed, taken back, listed; their voice notes and photos."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app.config import Config
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.marks.media_samples import OGG, PHOTO, VOICE
from tests.server.viewer import viewer

WEBM = {"content-type": "audio/webm;codecs=opus"}
JPEG = {"content-type": "image/jpeg"}


def now_ms() -> int:
    return time.time_ns() // 1_000_000


async def marks(client: httpx.AsyncClient) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = (await client.get("/api/marks")).json()["marks"]
    return found


async def mark_events(client: httpx.AsyncClient) -> list[dict[str, Any]]:
    events = (await client.get("/api/log", params={"limit": 500})).json()["events"]
    return [event for event in events if event["change"].startswith("mark")]


@pytest.fixture
def config(tmp_path: Path) -> Config:
    return Config(vehicles=(Vehicle(name="car"),), data=tmp_path)


async def test_a_mark_is_placed_changed_and_taken_back_once_each(config: Config) -> None:
    async with serving(config) as base, http_client(base_url=base) as client:
        at_ms = now_ms() - 2000
        for _ in range(3):
            placed = await client.post("/api/mark", json={"mark": "m-1", "at_ms": at_ms, "words": "swerve"})
            assert placed.status_code == 200, placed.text
        for _ in range(2):
            assert (await client.post("/api/mark", json={"mark": "m-1", "category": "Planner"})).status_code == 200
        (row,) = await marks(client)
        assert row == {
            "mark": "m-1", "marked_ms": at_ms, "category": "Planner", "words": "swerve", "voice": False,
            "photo": False, "source": "http", "by": row["by"],
        }  # fmt: skip
        assert (await client.get("/api/state")).json()["marks"] == 1
        for _ in range(2):
            assert (await client.post("/api/marks/m-1/remove", json={})).status_code == 200
        assert (await client.post("/api/mark", json={"mark": "m-1"})).status_code == 200
        assert await marks(client) == []
        assert (await client.get("/api/state")).json()["marks"] == 0
        assert [event["change"] for event in await mark_events(client)] == ["mark_removed", "mark_changed", "mark"]
        refused = await client.post("/api/marks/never/remove", json={})
        assert (refused.status_code, refused.json()["detail"]) == (409, "There is no such mark.")


@pytest.mark.parametrize(
    ("off_ms", "kept", "note"),
    [
        (3_600_000, False, "60 min ahead of the server's clock: the time it arrived counts."),
        (-3_600_000, True, "It arrived 60 min after its moment."),
        (-40 * 86_400_000, False, "40 days ago, which cannot be: the time it arrived counts."),
        (-500, True, ""),
    ],
    ids=["an hour ahead", "an hour late", "40 days old", "just now"],
)
async def test_a_time_that_cannot_be_is_corrected_and_said(config: Config, off_ms: int, kept: bool, note: str) -> None:
    async with serving(config) as base, http_client(base_url=base) as client:
        began_ms = now_ms()
        at_ms = began_ms + off_ms
        for _ in range(2):
            assert (await client.post("/api/mark", json={"mark": "m", "at_ms": at_ms})).status_code == 200
        (row,) = await marks(client)
        assert abs(row["marked_ms"] - at_ms) <= 1 if kept else began_ms <= row["marked_ms"] <= now_ms()
        (event,) = await mark_events(client)
        assert event["text"].endswith(note or "Mark.")


async def test_fifty_marks_in_a_moment_are_all_kept(config: Config) -> None:
    async with serving(config) as base, viewer(base) as page:
        replies = await asyncio.gather(*(page.ask(kind="mark", mark=f"m-{n}", at_ms=now_ms()) for n in range(50)))
        assert all(reply["ok"] for reply in replies)
        async with http_client(base_url=base) as client:
            found = await marks(client)
            assert {row["mark"] for row in found} == {f"m-{n}" for n in range(50)}
            assert {row["source"] for row in found} == {"page"}


async def test_a_voice_note_and_a_photo_are_kept_and_given_back(config: Config) -> None:
    async with serving(config) as base, http_client(base_url=base) as client:
        early = await client.post("/api/marks/m/voice", content=VOICE, headers=WEBM)
        assert (early.status_code, early.json()["detail"]) == (
            409,
            "This mark is not known here: send the mark first.",
        )
        await client.post("/api/mark", json={"mark": "m"})
        for _ in range(2):
            added = await client.post("/api/marks/m/voice", content=VOICE, headers=WEBM)
            assert (added.status_code, added.json()["voice"]) == (200, True), added.text
            added = await client.post("/api/marks/m/photo", content=PHOTO, headers=JPEG)
            assert (added.status_code, added.json()["photo"]) == (200, True), added.text
        assert [event["change"] for event in await mark_events(client)] == ["mark_changed", "mark_changed", "mark"]
        voice, seen = await client.get("/api/marks/m/voice"), await client.get("/api/marks/m/photo")
        assert (voice.content, voice.headers["content-type"]) == (VOICE, "audio/webm")
        assert (seen.content, seen.headers["content-type"]) == (PHOTO, "image/jpeg")
        for answer in (voice, seen):
            assert answer.headers["x-content-type-options"] == "nosniff"
            assert "sandbox" in answer.headers["content-security-policy"]
            assert answer.headers["content-disposition"].startswith("inline; ")
        assert (await client.get("/api/marks/other/photo")).status_code == 404


@pytest.mark.parametrize(
    ("kind", "content", "type", "status", "note"),
    [
        ("photo", bytes(50 << 20), "image/jpeg", 413, "At most 8 MB are taken."),
        ("voice", bytes(2 << 20), "audio/webm", 413, "A voice note of a mark has at most 1 MB: this one is larger."),
        ("photo", b"<svg onload=alert(1)>", "image/svg+xml", 415, "A photo is sent as one of image/jpeg"),
        ("photo", b"<html>", "image/png", 415, "This is no image/png: its first bytes are those of something else."),
        ("voice", OGG, "audio/webm", 415, "This is no audio/webm"),
        ("voice", b"", "audio/ogg", 415, "The voice note is empty."),
    ],
    ids=["photo of 50 MB", "voice of 2 MB", "svg", "html as png", "ogg as webm", "empty"],
)
async def test_what_is_no_voice_note_or_photo_is_refused(
    config: Config, kind: str, content: bytes, type: str, status: int, note: str
) -> None:
    async with serving(config) as base, http_client(base_url=base) as client:
        await client.post("/api/mark", json={"mark": "m"})
        answer = await client.post(f"/api/marks/m/{kind}", content=content, headers={"content-type": type})
        assert answer.status_code == status
        assert note in answer.json()["detail"]
        assert not (await marks(client))[0][kind]
