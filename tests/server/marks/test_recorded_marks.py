"""Marks in the drive's own file, as another reader of MCAP finds them, and beside it what came later."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from server.recording.verify import verify
from server.rosbridge_server.server import RosBridge
from tests.server.marks.marked_drive import JPEG, WEBM, marked_drive, now_ms
from tests.server.marks.media_samples import PHOTO, VOICE
from tests.server.viewer import viewer

pytestmark = pytest.mark.slow
HOSTILE = '<img src=x onerror=alert(1)>"]]>=cmd|\u202e\x1b[2J'
SHOWN = '<img src=x onerror=alert(1)>"]]>=cmd| [2J'


async def test_marks_and_their_media_are_in_the_file_of_the_drive(bridge: RosBridge, tmp_path: Path) -> None:
    async with marked_drive(bridge, tmp_path) as drive:
        at_ms = now_ms()
        await drive.mark("m-1", at_ms=at_ms, words=HOSTILE, category="Planner")
        await drive.send("m-1", "voice", VOICE, WEBM)
        await drive.send("m-1", "photo", PHOTO, JPEG)
        await drive.mark("m-2", at_ms=now_ms())
        await drive.mark("m-3", at_ms=now_ms())
        await drive.client.post("/api/marks/m-3/remove", json={})
        id = await drive.ended()
        path = drive.path(id)
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            found = [(s, m) for s, c, m in reader.iter_messages(topics=["/catgraph/marks"])]
            files = {one.name: one for one in reader.iter_attachments()}
        assert {schema.name for schema, _ in found if schema} == {"foxglove.Log"}
        first = json.loads(found[0][1].data)
        marked_ms = found[0][1].log_time // 1_000_000
        assert abs(marked_ms - at_ms) <= 1  # by the session's clock and back, in whole milliseconds
        assert first["timestamp"] == {"sec": marked_ms // 1000, "nsec": marked_ms % 1000 * 1_000_000}
        assert (first["message"], first["level"]) == (f"Planner: {SHOWN}", 2)
        voice, photo = files["mark-m-1.voice.webm"], files["mark-m-1.photo.jpg"]
        assert (voice.media_type, voice.data, voice.log_time) == ("audio/webm", VOICE, marked_ms * 1_000_000)
        assert (photo.media_type, photo.data) == ("image/jpeg", PHOTO)
        assert verify(path).state == "intact"

        rows = (await drive.get(f"/api/recordings/{id}/marks"))["marks"]
        assert [(row["mark"], row["words"], row["voice"], row["late"]) for row in rows] == [
            ("m-1", SHOWN, True, False),
            ("m-2", "", False, False),
        ]
        start_ms = (await drive.get(f"/api/recordings/{id}"))["started_ms"]
        assert abs(rows[0]["at_s"] - (at_ms - start_ms) / 1000) < 0.2
        for way in ("/api/marks/m-1", f"/api/recordings/{id}/marks/m-1"):
            assert (await drive.client.get(f"{way}/voice")).content == VOICE
            assert (await drive.client.get(f"{way}/photo")).content == PHOTO
        assert not list((tmp_path / "marks" / "car").iterdir()), "nothing waits any more"
        assert not Path(f"{path}.json").exists()


@pytest.mark.field
async def test_what_comes_too_late_is_kept_beside_and_found(bridge: RosBridge, tmp_path: Path) -> None:
    async with marked_drive(bridge, tmp_path) as drive:
        at_ms = now_ms()
        await drive.mark("m-1", at_ms=at_ms, words="first")
        await drive.mark("m-2", at_ms=now_ms())
        id = await drive.ended()
        before = drive.path(id).read_bytes()
        await drive.mark("late", at_ms=at_ms + 20, words="ÜBERHOLT on the left", category="Perception")
        await drive.send("late", "voice", VOICE, WEBM)
        await drive.send("m-1", "photo", PHOTO, JPEG)
        await drive.mark("m-1", words="changed")
        await drive.client.post("/api/marks/m-2/remove", json={})
        await drive.client.patch(f"/api/recordings/{id}", json={"title": "Lap"})

        async def is_listed() -> bool:
            await drive.settled()
            return bool((await drive.get("/api/recordings", text="überholt"))["recordings"])

        await drive.until(is_listed)
        assert drive.path(id).read_bytes() == before
        rows = (await drive.get(f"/api/recordings/{id}/marks"))["marks"]
        assert [(row["mark"], row["words"], row["late"]) for row in rows] == [
            ("m-1", "changed", True),
            ("late", "ÜBERHOLT on the left", True),
        ]
        assert (await drive.get(f"/api/recordings/{id}"))["title"] == "Lap"
        assert (await drive.client.get(f"/api/recordings/{id}/marks/late/voice")).content == VOICE
        assert (await drive.client.get("/api/marks/m-1/photo")).content == PHOTO
        for text, count in (("perception", 1), ("changed", 1), ("first", 0), ("nothing", 0)):
            assert len((await drive.get("/api/recordings", text=text))["recordings"]) == count, text

        async with viewer(str(drive.client.base_url).rstrip("/")) as page:
            assert (await page.ask(within_s=60.0, kind="replay", do="open", recording=id))["ok"]
            line = await page.until(lambda: next((f for f in page.other if f.get("flags")), None), 30.0)
            assert [flag["mark"] for flag in line["flags"]] == ["m-1", "late"]
            assert (await page.ask(kind="mark", mark="meanwhile"))["ok"], "of the live drive"

        assert (await drive.client.delete(f"/api/recordings/{id}")).status_code == 200
        assert not list(drive.path(id).parent.iterdir())
        assert (await drive.client.post(f"/api/trash/{id}/restore")).status_code == 200
        assert (await drive.client.get(f"/api/recordings/{id}/marks/late/voice")).content == VOICE
        await drive.client.delete(f"/api/recordings/{id}")
        assert (await drive.client.delete(f"/api/trash/{id}")).status_code == 200
        assert not list((tmp_path / "recordings" / ".trash").rglob("*"))
