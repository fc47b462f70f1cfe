"""Marks at a web node: commands over the broker, voice notes and photos with the agent that keeps them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.bus import nats_http as http
from server.recording.marks.media import MAX_BYTES
from tests.server.marks.media_samples import VOICE
from tests.server.viewer import viewer
from tests.server.web.test_kept_at_agents import DRIVE, fleet, read, until

LARGE = b"\xff\xd8\xff\xe0" + bytes(range(256)) * 32_000  # 8.2 million bytes: less than 8 MB


@pytest.mark.slow
async def test_a_mark_with_its_photo_goes_through_the_node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.vehicle.marks.OLDEST_MS", 1e12)  # the recording is of any age
    async with fleet(tmp_path) as one:
        await read(one)
        room = one.room

        async def is_known() -> bool:
            return (await room.get("/api/marks", params={"vehicle": "ocelot"})).status_code == 200

        await until(is_known)
        start_ms = (await room.get(f"/agents/ocelot/api/recordings/{DRIVE}")).json()["started_ms"]
        placed = await room.post("/api/mark", params={"vehicle": "ocelot"}, json={"mark": "m", "words": "swerve"})
        assert placed.status_code == 200, placed.text
        async with viewer(str(room.base_url).rstrip("/"), vehicle="ocelot") as page:
            assert (await page.ask(kind="mark", mark="late", at_ms=start_ms + 2000.0, words="long ago"))["ok"]
        for path, content, type in (
            ("/api/marks/m/photo?vehicle=ocelot", LARGE, "image/jpeg"),
            ("/agents/ocelot/api/marks/late/voice", VOICE, "audio/webm"),
        ):
            answer = await room.post(path, content=content, headers={"content-type": type})
            assert answer.status_code == 200, answer.text
        seen = await room.get("/api/marks/m/photo", params={"vehicle": "ocelot"})
        assert seen.content == LARGE
        assert seen.headers["x-content-type-options"] == "nosniff"
        rows = (await room.get("/api/marks", params={"vehicle": "ocelot"})).json()["marks"]
        assert {(row["mark"], row["photo"], row["source"]) for row in rows} == {
            ("m", True, "http"),
            ("late", False, "page"),
        }

        async def recorded() -> Any:
            found = (await room.get(f"/agents/ocelot/api/recordings/{DRIVE}/marks")).json()["marks"]
            return [row for row in found if row["voice"]]

        assert [row["words"] for row in await until(recorded)] == ["long ago"]
        late = await room.get(f"/agents/ocelot/api/recordings/{DRIVE}/marks/late/voice")
        assert late.content == VOICE


def test_the_largest_photo_fits_into_a_request() -> None:
    assert MAX_BYTES["photo"] <= http.MOST_PARTS * http.CHUNK
    assert MAX_BYTES["photo"] == Config().limits.upload_bytes
