"""The plain page: what it serves, where its links lead, and that it serves nothing else."""

from __future__ import annotations

import datetime as dt
import plistlib
import re
import subprocess
from pathlib import Path

import httpx
import pytest

from server.tls import authority, steps
from server.tls.setup import CERTIFICATE, SetupAddresses, explaining, leading, mobileconfig
from server.tls.steps import PLATFORMS, platform_of
from tests.http import http_client

NOW = dt.datetime(2027, 3, 1, tzinfo=dt.UTC)
OURS = authority.make(host="pit", now=NOW)
WHERE = SetupAddresses(hosts=("192.168.4.1", "pit.local", "fd00::2"), port=8000, setup_port=8001)


def client(host: str = "192.168.4.1:8001") -> httpx.AsyncClient:
    app = explaining(OURS, lambda: WHERE)
    return http_client(transport=httpx.ASGITransport(app=app), base_url=f"http://{host}")


async def test_the_certificate_is_handed_out_as_every_system_takes_it(tmp_path: Path) -> None:
    async with client() as page:
        answer = await page.get("/ca.crt")
    assert answer.headers["content-type"] == CERTIFICATE
    assert 'filename="catgraph-ca.crt"' in answer.headers["content-disposition"]
    assert b"PRIVATE" not in answer.content
    assert fingerprint_by_openssl(answer.content, tmp_path) == OURS.fingerprint


def fingerprint_by_openssl(certificate: bytes, folder: Path) -> str:
    (folder / "ca.crt").write_bytes(certificate)
    command = ["openssl", "x509", "-in", "ca.crt", "-noout", "-fingerprint", "-sha256"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.strip().partition("=")[2]


async def test_the_profile_holds_the_certificate_and_no_more() -> None:
    async with client() as page:
        answer = await page.get("/ca.mobileconfig")
    assert answer.headers["content-type"] == "application/x-apple-aspen-config"
    profile = plistlib.loads(answer.content)
    (root,) = profile["PayloadContent"]
    assert profile["PayloadType"] == "Configuration"
    assert root["PayloadType"] == "com.apple.security.root"
    assert root["PayloadContent"] == OURS.der
    for one in (profile, root):
        assert re.fullmatch(r"[0-9A-F]{8}(-[0-9A-F]{4}){3}-[0-9A-F]{12}", one["PayloadUUID"])
        assert one["PayloadVersion"] == 1
        assert one["PayloadIdentifier"].startswith("catgraph.")
    assert profile["PayloadUUID"] != root["PayloadUUID"]
    assert b"PRIVATE" not in answer.content


def test_a_second_installation_replaces_the_first_and_another_server_s_does_not() -> None:
    other = authority.make(host="pit", now=NOW)
    profiles = [plistlib.loads(mobileconfig(one)) for one in (OURS, OURS, other)]
    for name in ("PayloadIdentifier", "PayloadUUID"):
        for ids in ([one[name] for one in profiles], [one["PayloadContent"][0][name] for one in profiles]):
            assert ids[0] == ids[1] != ids[2]


@pytest.mark.parametrize(
    ("typed", "secure"),
    [
        ("192.168.4.1:8001", "https://192.168.4.1:8000/"),
        ("pit.local:8001", "https://pit.local:8000/"),
        ("PIT.local:8001", "https://pit.local:8000/"),
        ("[fd00:0::2]:8001", "https://[fd00::2]:8000/"),
        ("evil.example.org", "https://192.168.4.1:8000/"),
        ("192.168.4.1.evil.example.org:8001", "https://192.168.4.1:8000/"),
        ("[::1", "https://192.168.4.1:8000/"),
        ('"><script>', "https://192.168.4.1:8000/"),
        ("", "https://192.168.4.1:8000/"),
    ],
)
async def test_it_leads_to_the_page_by_the_name_that_was_typed_if_it_is_ours(typed: str, secure: str) -> None:
    async with client() as page:
        answer = await page.get("/", headers={"Host": typed})
    assert answer.status_code == 200
    assert set(re.findall(r'href="(https://[^"]*)"', answer.text)) == {secure}
    assert f'data-secure="{secure}"' in answer.text
    assert "evil" not in answer.text
    assert "<script>" not in answer.text


@pytest.mark.parametrize("method", ["GET", "POST", "PUT", "DELETE", "OPTIONS"])
@pytest.mark.parametrize(
    "path", ["/x", "/api/health", "/ca.key", "/ca.crt/", "//evil.example.org/", "/%2e%2e/x", "/a\\b"]
)
async def test_everything_else_leads_to_the_page_itself(method: str, path: str) -> None:
    async with client() as page:
        answer = await page.request(method, httpx.URL("http://192.168.4.1:8001").copy_with(raw_path=path.encode()))
    assert (answer.status_code, answer.headers["location"], answer.content) == (303, "/", b"")


async def test_a_given_certificate_needs_no_page() -> None:
    transport = httpx.ASGITransport(app=leading(lambda: WHERE))
    async with http_client(transport=transport, base_url="http://pit.local") as page:
        for path in ("/", "/ca.crt"):
            assert (await page.get(path)).headers["location"] == "https://pit.local:8000/"


async def test_it_needs_nothing_from_elsewhere_and_runs_nothing_but_its_own() -> None:
    async with client() as page:
        answer = await page.get("/")
        policy = answer.headers["content-security-policy"]
        own = re.findall(r'(?:src|href)="(/[^"]+)"', answer.text)
        style = (await page.get("/setup.css")).text
        own += [f"/{name}" for name in re.findall(r'url\("\.\./([^"]+)"\)', style)]
        found = {path: (await page.get(path)).status_code for path in own}
    assert "default-src 'none'" in policy
    assert "connect-src https://192.168.4.1:8000;" in policy
    assert "unsafe" not in policy
    assert set(found.values()) == {200}
    assert len(found) >= 7  # style, script, code, two files, two fonts
    assert "<style" not in answer.text
    assert " style=" not in answer.text


async def test_the_fingerprint_stands_on_it_as_on_the_terminal() -> None:
    async with client() as page:
        text = (await page.get("/")).text
    pairs = OURS.fingerprint.split(":")
    assert [" ".join(pairs[i : i + 8]) for i in (0, 8, 16, 24)] == re.findall(r"<li>([0-9A-F ]{23})</li>", text)


@pytest.mark.parametrize("platform", PLATFORMS, ids=lambda platform: platform.id)
def test_every_platform_has_its_file_its_pictures_and_the_way_back(platform: steps.Platform) -> None:
    files = [step.file for step in platform.steps if step.file]
    assert files == ["ca.mobileconfig" if platform.id == "iphone" else "ca.crt"]
    assert any(step.screen for step in platform.steps)
    assert platform.removal.endswith(".")
    for step in platform.steps:
        assert step.text.endswith((".", ":"))
        if step.screen is not None:
            lines = [*step.screen.head.split("|"), *(line for row in step.screen.rows for line in row.lines)]
            assert max(map(len, lines)) <= 24  # what the drawn screen has room for


def test_the_iphone_gets_both_steps() -> None:
    (iphone,) = (one for one in PLATFORMS if one.id == "iphone")
    text = " ".join(step.text for step in iphone.steps)
    assert "Profile Downloaded" in text
    assert "Certificate Trust Settings" in text


@pytest.mark.parametrize(
    ("agent", "id"),
    [
        ("Mozilla/5.0 (Linux; Android 16; Pixel 7) AppleWebKit/537.36 Chrome/150.0 Mobile Safari/537.36", "android"),
        ("Mozilla/5.0 (Android 16; Mobile; rv:150.0) Gecko/150.0 Firefox/150.0", "firefox"),
        ("Mozilla/5.0 (iPhone; CPU iPhone OS 19_0 like Mac OS X) Version/19.0 Mobile Safari/604.1", "iphone"),
        ("Mozilla/5.0 (iPad; CPU OS 19_0 like Mac OS X) Version/19.0 Safari/604.1", "iphone"),
        ("Mozilla/5.0 (Windows NT 10.0; Win64; x64) Chrome/150.0 Safari/537.36 Edg/150.0", "windows"),
        ("Mozilla/5.0 (Windows NT 10.0; Win64; x64; rv:150.0) Gecko/20100101 Firefox/150.0", "windows"),
        ("Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7) Version/19.0 Safari/605.1.15", "macos"),
        ("Mozilla/5.0 (X11; Linux x86_64) Chrome/150.0 Safari/537.36", "linux"),
        ("Mozilla/5.0 (X11; Linux x86_64; rv:150.0) Gecko/20100101 Firefox/150.0", "firefox"),
        ("", "android"),
    ],
)
async def test_the_steps_of_this_device_stand_first_and_open(agent: str, id: str) -> None:
    assert platform_of(agent) == id
    async with client() as page:
        text = (await page.get("/", headers={"User-Agent": agent})).text
    assert re.findall(r'<details name="platform" id="(\w+)"( open)?>', text)[0] == (id, " open")
    assert text.count(" open>") == 1
