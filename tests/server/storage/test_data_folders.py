"""Data folders of earlier versions, each left by a server that was killed: everything in them is shown as it was.

`make_data_folder.py` makes them, by a server of any version; `facts.json` is what that server answered before its end.
"""

from __future__ import annotations

import asyncio
import datetime as dt
import json
import shutil
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets

from server.app.app import create_app
from server.tls import server_certificate
from server.tls.authority import FILE, load_or_make
from tests.server.access.pairs import config
from tests.server.conftest import serving_app
from tests.server.viewer import Viewer

FOLDERS = sorted(Path(__file__).parent.joinpath("data_folders").glob("*.zip"))
HOST = "catgraph.test"  # behind a proxy with TLS, so that cookies are as they were set
RECORDING = (
    "id",
    "vehicle",
    "started_ms",
    "length_s",
    "size_bytes",
    "top_speed_mps",
    "alarms",
    "title",
    "note",
    "tags",
)
MAIL = ("n", "key", "recordings", "format", "to", "subject", "size_bytes", "sha256")
DEVICE = ("id", "name", "role", "paired_ms")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(240)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """A folder, and what the server that left it had answered."""

    data: Path
    facts: dict[str, Any]

    def answer(self, path: str) -> Any:
        return self.facts["answers"][path]


@pytest.fixture(params=FOLDERS, ids=[path.stem for path in FOLDERS])
def kept(request: pytest.FixtureRequest, tmp_path: Path) -> Kept:
    shutil.unpack_archive(request.param, tmp_path)
    for path in tmp_path.rglob("*"):
        path.chmod(0o700 if path.is_dir() else 0o600)  # an archive keeps no modes
    return Kept(data=tmp_path / "data", facts=json.loads((tmp_path / "facts.json").read_text()))


@pytest.fixture
async def phone(kept: Kept) -> AsyncIterator[httpx.AsyncClient]:
    """The phone that was paired, a day later, at a server of today on the folder of then."""
    of = config(kept.data, names=(f"https://{HOST}",))
    app = create_app(of, wall_ms=lambda: kept.facts["at_ms"] + 86_400_000)
    headers = {"Host": HOST, "Origin": f"https://{HOST}", "Cookie": kept.facts["cookie"]}
    async with (
        serving_app(app, of) as base,
        httpx.AsyncClient(base_url=base, headers=headers, timeout=60) as client,
    ):
        yield client


async def answer_of(phone: httpx.AsyncClient, path: str) -> Any:
    answer = await phone.get(path)
    assert answer.status_code == 200, (path, answer.text)
    return answer.json()


def parts(rows: Any, names: tuple[str, ...]) -> list[dict[str, Any]]:
    return [{name: row[name] for name in names} for row in rows]


async def recordings(phone: httpx.AsyncClient) -> list[dict[str, Any]]:
    """Both, once both are read; newest first."""
    async with asyncio.timeout(60):
        while True:
            rows: list[dict[str, Any]] = (await answer_of(phone, "/api/recordings"))["recordings"]
            if len(rows) == 2 and all(row["state"] == "read" for row in rows):
                return rows
            await asyncio.sleep(0.1)


async def test_devices_settings_alarms_and_mail_are_as_they_were(kept: Kept, phone: httpx.AsyncClient) -> None:
    assert (await answer_of(phone, "/api/me"))["name"] == "Pixel", "its cookie lets it in"
    assert (await answer_of(phone, "/api/health"))["problems"] == []
    before, now = kept.answer("/api/devices")["devices"], (await answer_of(phone, "/api/devices"))["devices"]
    assert parts(now, DEVICE) == parts(before, DEVICE)
    before, now = kept.answer("/api/settings"), await answer_of(phone, "/api/settings")
    assert now["version"] == before["version"]
    assert (await answer_of(phone, "/api/state"))["limits"]["speed_limit.max_mps"] == 9.5
    events = {event["n"]: event for event in await answer_of(phone, "/api/log.json")}
    before = kept.answer("/api/log.json")
    assert len(before) > 4
    assert [events[event["n"]] for event in before] == before
    assert "speed_limit" in {event["alarm"] for event in before}
    before, now = kept.answer("/api/mail")["mails"], (await answer_of(phone, "/api/mail"))["mails"]
    assert parts(now, MAIL) == parts(before, MAIL)
    assert [mail["state"] for mail in now] in (["queued", "sent"], ["sending", "sent"])
    since_then = {"report_to": []}
    assert (await answer_of(phone, "/api/mail/settings")) == since_then | kept.answer("/api/mail/settings")


@pytest.mark.field
async def test_recordings_are_listed_replayed_and_exported_and_the_cut_off_one_is_recovered(
    kept: Kept, phone: httpx.AsyncClient
) -> None:
    recovered, complete = await recordings(phone)
    (before,) = kept.answer("/api/recordings")["recordings"]
    assert parts([complete], RECORDING) == parts([before], RECORDING)
    assert not list(kept.data.rglob("*.writing"))
    assert recovered["length_s"] > 1.0
    assert recovered["damage"] == []
    for row in (recovered, complete):
        for format in ("bag", "csv"):
            answer = await phone.get(f"/api/recordings/{row['id']}/export/{format}")
            assert answer.status_code == 200, answer.text
            assert len(answer.content) > 1000
        await _replay(phone, row["id"])


async def _replay(phone: httpx.AsyncClient, recording: str) -> None:
    """A page that begins with a replay sees the car's speed of then."""
    ticket = (await phone.post("/api/ticket")).json()["ticket"]
    async with websockets.connect(
        f"ws://{HOST}/ws?ticket={ticket}&replay={recording}&t=1.0",
        additional_headers={name: phone.headers[name] for name in ("Origin", "Cookie")},
        host=phone.base_url.host,
        port=phone.base_url.port,
    ) as socket:
        page = Viewer(socket)
        await page.send({"kind": "hello", "have_event": None})
        reading = asyncio.create_task(page.read())
        try:
            frame = await page.state(lambda s: s.get("replay") is not None and s["replay"]["at_s"] >= 1.0, within_s=60)
            assert frame["signals"]["speed"]["value"]["speed_mps"] in (4.2, 13.0)
        finally:
            reading.cancel()


def test_phones_go_on_trusting_the_authority(kept: Kept) -> None:
    pem = (kept.data / "tls" / FILE).read_bytes()
    leaf = server_certificate.load(kept.data / "tls")
    now = dt.datetime.fromtimestamp(kept.facts["at_ms"] / 1000, dt.UTC)
    authority = load_or_make(kept.data / "tls", host="another", now=now)
    assert leaf is not None
    leaf.cert.verify_directly_issued_by(authority.cert)
    assert (kept.data / "tls" / FILE).read_bytes() == pem


def test_there_are_folders_of_two_versions() -> None:
    assert len(FOLDERS) >= 2
