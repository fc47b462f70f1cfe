"""Mail over HTTP: orders are taken or refused with a sentence, the password is never returned, the outbox is listed."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app.config import Config
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.mail.post import Post, certificates, posting
from tests.server.recording.made import record

DRIVE = "car_20260921T141320Z"


@pytest.fixture
async def api(tmp_path: Path) -> AsyncIterator[httpx.AsyncClient]:
    """A server with one recording."""
    record(tmp_path / "data" / "recordings" / "car" / f"{DRIVE}.mcap", seconds=2.0)
    async with serving(Config(data=tmp_path / "data")) as base, httpx.AsyncClient(base_url=base, timeout=30) as client:
        async with asyncio.timeout(20):
            while not (await client.get(f"/api/recordings/{DRIVE}")).is_success:
                await asyncio.sleep(0.05)
        yield client


@pytest.fixture
async def post(tmp_path: Path) -> AsyncIterator[Post]:
    async with posting(tmp_path / "post", "--refuse", "gone@example.org") as one:
        yield one


def settings(post: Post, **more: Any) -> dict[str, Any]:
    return {"host": "127.0.0.1", "port": post.port, "security": "none", "sender": "car@test.example", **more}


def order(**more: Any) -> dict[str, Any]:
    return {"recordings": [DRIVE], "to": ["ann@example.org"], "subject": "Drive", "text": "See alarm 3.", **more}


async def over(api: httpx.AsyncClient, n: int) -> dict[str, Any]:
    async with asyncio.timeout(30):
        while (one := (await api.get(f"/api/mail/{n}")).json())["state"] in ("queued", "sending"):
            await asyncio.sleep(0.02)
    found: dict[str, Any] = one
    return found


async def test_a_recording_is_mailed(api: httpx.AsyncClient, post: Post) -> None:
    (await api.put("/api/mail/settings", json=settings(post))).raise_for_status()
    answer = await api.post("/api/mail", json=order(), headers={"x-catgraph-name": "Pixel 7"})
    assert answer.status_code == 202
    placed = answer.json()
    assert (placed["state"], placed["is_ready"], placed["by"]) == ("queued", False, "Pixel 7")
    done = await over(api, placed["n"])
    assert (done["state"], done["way"], done["parts"][0]["attempts"]) == ("sent", "attached", 1)
    assert done["said"].startswith("250 2.0.0 OK queued as")
    assert done["parts"][0]["recipients"] == [{"address": "ann@example.org", "state": "accepted", "said": done["said"]}]
    (mail,) = post.mails()
    assert next(mail.iter_attachments()).get_filename() == f"{DRIVE}.zip"
    listed = (await api.get("/api/mail")).json()
    assert listed == {"mails": [done], "next": None, "trouble": None}


async def test_the_same_key_is_one_order(api: httpx.AsyncClient, post: Post) -> None:
    (await api.put("/api/mail/settings", json=settings(post))).raise_for_status()
    both = [(await api.post("/api/mail", json=order(key="0123456789abcdef"))).json()["n"] for _ in range(2)]
    assert both[0] == both[1]
    await over(api, both[0])
    assert len(post.taken) == 1


@pytest.mark.parametrize("format", ["csv", "html", "bag"])
async def test_a_recording_is_mailed_in_other_formats(api: httpx.AsyncClient, post: Post, format: str) -> None:
    (await api.put("/api/mail/settings", json=settings(post))).raise_for_status()
    placed = (await api.post("/api/mail", json=order(format=format))).json()
    done = await over(api, placed["n"])
    assert (done["state"], done["format"]) == ("sent", format), done["said"]


async def test_what_is_too_large_is_linked_by_the_address_the_page_used(api: httpx.AsyncClient, post: Post) -> None:
    (await api.put("/api/mail/settings", json=settings(post, limit_mb=0.1))).raise_for_status()
    placed = (await api.post("/api/mail", json=order(too_large="link"))).json()
    assert (await over(api, placed["n"]))["way"] == "attached", "it is small"


@pytest.mark.field
@pytest.mark.parametrize(
    ("more", "status", "field", "text"),
    [
        ({"to": ["a@b, evil@x"]}, 422, "to", "is not one address"),
        ({"to": ["a@b\r\nBcc: evil@x"]}, 422, "to", "is not one address"),
        ({"to": ["Ann <a@b>"]}, 422, "to", "is not one address"),
        ({"to": []}, 422, None, "to"),
        ({"to": [f"a{i}@b" for i in range(21)]}, 422, None, "to"),
        ({"to": "a@b"}, 422, None, "to"),
        ({"subject": "a\r\nBcc: evil@x"}, 422, "subject", "one line"),
        ({"subject": "a\u202eb"}, 422, "subject", "one line"),
        ({"subject": "x" * 201}, 422, None, "subject"),
        ({"text": "a\x00b"}, 422, "text", "signs that are no text"),
        ({"text": "x" * 20_001}, 422, None, "text"),
        ({"format": "exe"}, 422, None, "format"),
        ({"too_large": "drop"}, 422, None, "too_large"),
        ({"recordings": []}, 422, None, "recordings"),
        ({"recordings": ["../../etc/passwd"]}, 404, "recordings", "no finished recording"),
        ({"key": "../x"}, 422, None, "key"),
        ({"bcc": ["evil@x"]}, 422, None, "bcc"),
    ],
    ids=str,
)
async def test_what_is_refused_has_a_reason(
    api: httpx.AsyncClient, more: dict[str, Any], status: int, field: str | None, text: str
) -> None:
    await api.put("/api/mail/settings", json={"host": "127.0.0.1", "sender": "a@b"})
    answer = await api.post("/api/mail", json=order(**more))
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    body = answer.json()
    assert text in body["detail"]
    assert body.get("field") == field
    assert (await api.get("/api/mail")).json()["mails"] == []


async def test_an_order_without_settings_is_refused(api: httpx.AsyncClient) -> None:
    answer = await api.post("/api/mail", json=order())
    assert (answer.status_code, answer.json()["detail"]) == (
        409,
        "Mail is not set up: enter SMTP host and sender in Settings, E-mail.",
    )
    assert (await api.post("/api/mail/test", json={})).status_code == 409
    for sent in (api.get("/api/mail/7"), api.post("/api/mail/7/cancel"), api.post("/api/mail/7/resend")):
        answer = await sent
        assert (answer.status_code, answer.json()["detail"]) == (404, "There is no mail number 7.")


async def test_the_password_goes_one_way(
    api: httpx.AsyncClient, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("DEBUG")
    given = {
        "host": "smtp.example.org", "port": 587, "security": "starttls", "user": "car", "password": "hunter2",
        "sender": "car@example.org", "sender_name": "Prüfstand", "allowed": ["example.org"], "report_to": [],
        "limit_mb": 10.0,
    }  # fmt: skip
    first = (await api.put("/api/mail/settings", json=given)).raise_for_status()
    body = (await api.get("/api/mail/settings")).json()
    assert body == {
        **{name: value for name, value in given.items() if name != "password"},
        "has_password": True, "link_base": "", "ca": "", "is_complete": True, "complaints": [],
    }  # fmt: skip
    kept = {name: value for name, value in given.items() if name != "password"}
    assert (await api.put("/api/mail/settings", json=kept)).json()["has_password"] is True
    stolen = await api.put("/api/mail/settings", json=kept | {"host": "evil.example.org"})
    assert (stolen.status_code, stolen.json()["field"]) == (422, "password")
    refused = await api.put("/api/mail/settings", json=given | {"port": 70_000})
    assert refused.status_code == 422
    gone = await api.put("/api/mail/settings", json=kept | {"password": ""})
    assert gone.json()["has_password"] is False
    for answer in (first, stolen, refused, gone):
        assert "hunter2" not in answer.text
    assert "hunter2" not in caplog.text
    assert (tmp_path / "data" / "mail" / "settings.toml").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "data" / "mail").stat().st_mode & 0o077 == 0


async def test_the_settings_can_be_tried(api: httpx.AsyncClient, post: Post) -> None:
    (await api.put("/api/mail/settings", json=settings(post, allowed=["example.org"]))).raise_for_status()
    login = (await api.post("/api/mail/test", json={})).json()
    assert login["sentence"] == f"127.0.0.1:{post.port} answers, NOT encrypted."
    assert post.taken == []
    sent = (await api.post("/api/mail/test", json={"to": "ann@example.org"})).json()
    assert sent["sentence"].endswith("It accepted a mail to ann@example.org.")
    assert sent["said"].startswith("250 2.0.0 OK")
    assert sent["largest_bytes"] == 33_554_432
    for to, status, text in (
        ("gone@example.org", 502, "refuses the mail to gone@example.org: 550 5.1.1"),
        ("ann@example.com", 422, "is not among the allowed recipients"),
        ("a@b, c@d", 422, "is not one address"),
    ):
        answer = await api.post("/api/mail/test", json={"to": to})
        assert answer.status_code == status
        assert text in answer.json()["detail"]
    await post.kill()
    answer = await api.post("/api/mail/test", json={})
    assert (answer.status_code, answer.json()["detail"]) == (502, f"127.0.0.1:{post.port} refuses the connection.")
    assert (await api.get("/api/mail")).json()["mails"] == [], "a trial is no mail of the outbox"


async def test_a_trial_over_tls_says_so_and_never_the_password(api: httpx.AsyncClient, tmp_path: Path) -> None:
    ca, cert = certificates(tmp_path)
    mood = ("--cert", str(cert), "--starttls", "--user", "car", "--password", "hunter2", "--size", "9000000")
    async with posting(tmp_path / "tls", *mood) as post:
        given = settings(post, security="starttls", user="car", password="hunter2", ca=ca)
        (await api.put("/api/mail/settings", json=given)).raise_for_status()
        sentence = (await api.post("/api/mail/test", json={})).json()["sentence"]
        assert "answers, encrypted, and accepts the login of car." in sentence
        assert sentence.endswith("It accepts mails of at most 9.0 MB: set the limit to 6.4 MB.")
        (await api.put("/api/mail/settings", json=given | {"password": "secret-wrong"})).raise_for_status()
        answer = await api.post("/api/mail/test", json={})
        assert answer.status_code == 502
        assert "refuses the login of car: 535 5.7.8 not accepted: •••" in answer.json()["detail"]


async def test_cancel_and_resend(api: httpx.AsyncClient, post: Post) -> None:
    (await api.put("/api/mail/settings", json=settings(post))).raise_for_status()
    n = (await api.post("/api/mail", json=order(to=["gone@example.org"]))).json()["n"]
    failed = await over(api, n)
    assert (failed["state"], failed["parts"][0]["next_ms"]) == ("failed", None)
    assert (await api.post(f"/api/mail/{n}/resend")).status_code == 200
    assert (await over(api, n))["state"] == "failed"
    assert (await api.post(f"/api/mail/{n}/cancel")).json()["state"] == "cancelled"
    twice = await api.post(f"/api/mail/{n}/cancel")
    assert (twice.status_code, twice.json()["detail"]) == (409, "It is already cancelled.")


async def test_the_outbox_is_told_page_by_page(api: httpx.AsyncClient, post: Post) -> None:
    (await api.put("/api/mail/settings", json=settings(post))).raise_for_status()
    for i in range(3):
        await over(api, (await api.post("/api/mail", json=order(subject=f"Drive {i}"))).json()["n"])
    first = (await api.get("/api/mail?limit=2")).json()
    assert [one["n"] for one in first["mails"]] == [3, 2]
    rest = (await api.get(f"/api/mail?limit=2&before={first['next']}")).json()
    assert ([one["n"] for one in rest["mails"]], rest["next"]) == ([1], None)


async def test_a_server_that_keeps_nothing_mails_nothing() -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        answer = await client.get("/api/mail")
        assert (answer.status_code, answer.json()["detail"]) == (
            404,
            "This server stores nothing: start it with --data FOLDER to send mail.",
        )


async def test_the_interface_is_described(api: httpx.AsyncClient) -> None:
    described = (await api.get("/openapi.json")).json()
    assert {path for path in described["paths"] if path.startswith("/api/mail")} == {
        "/api/mail", "/api/mail/settings", "/api/mail/test",
        "/api/mail/{n}", "/api/mail/{n}/cancel", "/api/mail/{n}/resend",
    }  # fmt: skip
    assert "password" not in described["components"]["schemas"]["MailSettingsOut"]["properties"]
    assert described["components"]["schemas"]["MailSettingsIn"]["properties"]["password"]["writeOnly"] is True
