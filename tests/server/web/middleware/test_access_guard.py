"""As an attacker: from other pages, by other names, with credentials that are tried, used, forged, old or of others."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import socket as sockets
import time
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
import websockets
from starlette.types import Message, Receive, Scope, Send

from server.access.identity import Role
from server.app.config import Config
from server.protocol.rate_limit import Limits
from server.web.middleware.access_guard import Guard
from tests.http import http_client
from tests.server.access.pairs import (
    OPERATOR_KEY,
    VIEWER_KEY,
    Served,
    access_of,
    config,
    cookie_of,
    keyed,
    paired_server,
)
from tests.server.conftest import serving


@pytest.fixture
async def served(tmp_path: Path) -> AsyncIterator[Served]:
    async with paired_server(keyed(tmp_path)) as one:
        yield one


async def refused(served: Served, **how: str) -> bool:
    """Whether a socket is refused before it opens."""
    ticket = how.pop("ticket", None)
    try:
        async with served.socket(ticket, **how) as open_socket:  # type: ignore[arg-type]
            await open_socket.recv()
            return False
    except websockets.InvalidStatus as why:
        return why.response.status_code in (401, 403) and "problem" in why.response.headers["content-type"]


async def closed(page: websockets.ClientConnection) -> tuple[int, str]:
    """The code and the reason with which the server closes it, soon."""
    async with asyncio.timeout(6):
        with contextlib.suppress(websockets.ConnectionClosed):
            while True:
                await page.recv()
    return page.close_code or 0, page.close_reason or ""


# -- pairing -----------------------------------------------------------------------------------------------------------


async def test_a_link_pairs_one_device_once_and_its_cookie_is_all_it_takes(served: Served) -> None:
    token = served.access.invitation(Role.OPERATOR).token
    async with served.browser() as browser, served.browser() as second:
        assert (await browser.get("/api/state")).status_code == 401
        answer = await browser.post("/api/pair", json={"token": token, "name": "Pixel 7"})
        assert answer.json() == {"id": answer.json()["id"], "name": "Pixel 7", "role": "operator"}
        kept = answer.headers["set-cookie"]
        assert re.fullmatch(r"catgraph-[0-9a-f]{8}=[\w.:-]+; Path=/; Max-Age=7776000; HttpOnly; SameSite=Strict", kept)
        assert (await browser.get("/api/state")).status_code == 200
        assert (await browser.get("/api/me")).json()["name"] == "Pixel 7"
        again = await second.post("/api/pair", json={"token": token, "name": "Thief"})
        assert (again.status_code, again.json()["code"]) == (403, "used")
        assert served.access.invitation(Role.OPERATOR).token != token  # another one stands on the terminal


async def test_a_pin_lets_one_device_in_and_takes_the_link_beside_it_along(served: Served) -> None:
    invitation = served.access.invitation(Role.VIEWER)
    async with served.browser() as browser:
        typed = f"{invitation.pin[:3]} {invitation.pin[3:]}"
        answer = await browser.post("/api/pair", json={"pin": typed, "name": "<b>\u202ephone"})
        assert (answer.status_code, answer.json()["role"]) == (200, "viewer")
        assert answer.json()["name"] == "<b> phone"  # a label, cleaned; the page writes it as text
        for credentials in ({"pin": invitation.pin}, {"token": invitation.token}):
            assert (await browser.post("/api/pair", json=credentials)).status_code == 403


@pytest.mark.parametrize(
    "credentials",
    [
        {},
        {"token": "x", "pin": "1"},
        {"pin": ""},
        {"pin": 123456},
        {"token": "t" * 101},
        {"pin": "1", "role": "operator"},
    ],
    ids=["neither", "both", "empty", "number", "long", "a-role-of-its-own"],
)
async def test_words_that_are_none_are_refused(served: Served, credentials: dict[str, object]) -> None:
    async with served.browser() as browser:
        assert (await browser.post("/api/pair", json=credentials)).status_code == 422


async def test_guessing_is_slowed_also_when_all_guesses_come_at_once(served: Served) -> None:
    right = served.access.invitation(Role.OPERATOR).pin
    pins = [f"{n:06d}" for n in range(200) if f"{n:06d}" != right][:60]
    async with served.browser() as browser:
        answers = await asyncio.gather(*(browser.post("/api/pair", json={"pin": pin}) for pin in pins))
        codes = [answer.json()["code"] for answer in answers]
        assert codes.count("wrong") == 3
        assert codes.count("wait") == len(pins) - 3
        # The sender does not matter: the right PIN is refused with the same text.
        late = await browser.post("/api/pair", json={"pin": right})
        assert (late.status_code, late.json()["code"]) == (429, "wait")
        assert int(late.headers["retry-after"]) >= 1
        assert late.json()["detail"] == "Too many wrong PINs. Wait, or scan the QR code instead."
        # The link has 144 bits and needs no waits: nobody who tries PINs can lock out a crew.
        token = served.access.invitation(Role.OPERATOR).token
        assert (await browser.post("/api/pair", json={"token": token})).status_code == 200


async def test_a_forwarded_address_makes_nobody_another_guesser(served: Served) -> None:
    served.access.invitation(Role.OPERATOR)
    async with served.browser() as browser:
        codes = []
        for n in range(5):
            forged = {"X-Forwarded-For": f"10.0.0.{n}", "Forwarded": f"for=10.0.0.{n}", "X-Real-IP": "127.0.0.1"}
            answer = await browser.post("/api/pair", json={"pin": "000000x"}, headers=forged)
            codes.append(answer.json()["code"])
        assert codes == ["wrong"] * 3 + ["wait"] * 2


# -- Host and Origin ---------------------------------------------------------------------------------------------------

BAD_HOSTS = [
    "evil.example",
    "evil.example:{port}",
    "127.0.0.1.evil.example:{port}",
    "localhost.evil.example",
    "evil-localhost",
    "8.8.8.8:{port}",
    "[2001:db8::1]:{port}",
    "localhost:99999",
    "user@localhost",
    "localhost/evil",
    "127.0.0.1 evil",
    "134744072",
]


def stranger_origins(served_host: str) -> list[str]:
    port = served_host.partition(":")[2]
    return [
        "http://evil.example",
        f"http://{served_host}.evil.example",
        f"http://evil-{served_host}",
        f"http://{served_host}0",
        f"https://{served_host}",
        f"http://localhost:{port}",
        "http://127.0.0.1",
        f"http://127.0.0.1:{port}/",
        f"http://127.0.0.1:{port}, http://evil.example",
        f"http://127x0x0x1:{port}",
        "http://127.0.0.1:.*",
        "null",
        "*",
        "file://",
    ]


async def test_a_name_that_is_not_its_own_is_refused_everywhere(served: Served) -> None:
    async with served.paired(Role.OPERATOR) as browser:
        for host in BAD_HOSTS:
            shown = host.format(port=served.host.partition(":")[2])
            for method, path in (
                ("GET", "/"),
                ("GET", "/api/me"),
                ("POST", "/api/pause"),
                ("GET", "/static/js/main.js"),
            ):
                answer = await browser.request(method, path, headers={"Host": shown, "Origin": f"http://{shown}"})
                assert (answer.status_code, answer.json()["code"]) == (403, "host"), (host, path)
            head = (
                f"GET /ws?ticket={await served.ticket(browser)} HTTP/1.1\r\nHost: {shown}\r\nOrigin: http://{shown}\r\n"
                f"Cookie: {cookie_of(browser)}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n"
            )
            assert (await raw(served, head)).startswith(("HTTP/1.1 403", "HTTP/1.1 400")), host


async def raw(served: Served, head: str) -> str:
    """What comes back for bytes that no client of ours would send."""
    name, _, port = served.host.partition(":")
    reader, writer = await asyncio.open_connection(name, int(port))
    writer.write(head.encode())
    answer = (await asyncio.wait_for(reader.read(300), 5)).decode("latin-1")
    writer.close()
    return answer


@pytest.mark.parametrize(
    "extra", ["", "Host: {host}\r\nHost: evil.example\r\n", "Host: \r\n"], ids=["none", "two", "empty"]
)
async def test_without_one_name_nothing_is_answered(served: Served, extra: str) -> None:
    head = f"GET /api/health HTTP/1.1\r\n{extra.format(host=served.host)}\r\n"
    assert (await raw(served, head))[:12] in ("HTTP/1.1 400", "HTTP/1.1 403")


async def test_a_strangers_page_is_refused_on_socket_and_on_what_changes_something(served: Served) -> None:
    async with served.paired(Role.OPERATOR) as browser:
        for origin in stranger_origins(served.host):
            for path in ("/api/pause", "/api/ticket", "/api/pair", "/api/devices/invite"):
                answer = await browser.post(path, json={}, headers={"Origin": origin})
                assert (answer.status_code, answer.json()["code"]) == (403, "origin"), (origin, path)
            ticket = await served.ticket(browser)
            assert await refused(served, ticket=ticket, cookie=cookie_of(browser), Origin=origin), origin
        assert (await browser.get("/api/me")).status_code == 200
        # Without an Origin the page that sends the request is not known: no browser leaves it out there.
        del browser.headers["Origin"]
        assert (await browser.post("/api/ticket")).status_code == 403
        assert (await browser.post("/api/pair", json={"pin": "1"})).status_code == 403


async def test_a_picture_on_a_strangers_page_fetches_nothing(served: Served) -> None:
    async with served.paired(Role.VIEWER) as browser:
        for site, mode, status in (
            ("cross-site", "no-cors", 403),
            ("same-site", "cors", 403),
            ("same-origin", "cors", 200),
        ):
            headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": mode}
            assert (await browser.get("/api/state", headers=headers)).status_code == status


# -- sockets and tickets -----------------------------------------------------------------------------------------------


async def test_a_greeting_brings_the_ticket_of_the_next_socket(served: Served) -> None:
    async with served.paired(Role.VIEWER) as browser, served.paired(Role.VIEWER, "Tablet") as other:
        cookie = cookie_of(browser)
        async with served.socket(await served.ticket(browser), cookie=cookie) as page:
            ticket = json.loads(await page.recv())["ticket"]
            assert await refused(served, ticket=ticket, cookie=cookie_of(other))
        async with served.socket(await served.ticket(browser), cookie=cookie) as page:
            ticket = json.loads(await page.recv())["ticket"]
            async with served.socket(ticket, cookie=cookie) as again:  # the server has not seen the end of the first
                after = json.loads(await again.recv())["ticket"]
            assert await refused(served, ticket=ticket, cookie=cookie)  # used
        async with served.socket(after, cookie=cookie) as again:
            assert json.loads(await again.recv())["kind"] == "hello"


async def test_a_socket_opens_once_with_a_fresh_ticket_and_the_cookie_it_was_given_to(served: Served) -> None:
    async with served.paired(Role.VIEWER) as browser, served.paired(Role.OPERATOR, "Other") as other:
        cookie = cookie_of(browser)
        ticket = await served.ticket(browser)
        async with served.socket(ticket, cookie=cookie) as page:
            hello = await page.recv()
            assert '"role":"viewer"' in hello.replace(" ", "")
        assert await refused(served, ticket=ticket, cookie=cookie)  # used
        assert await refused(served, cookie=cookie)  # none
        assert await refused(served, ticket=await served.ticket(browser))  # without the cookie
        stolen = await served.ticket(other)
        assert await refused(served, ticket=stolen, cookie=cookie)  # of another device
        assert await refused(served, ticket=stolen, cookie=cookie_of(other))  # and used up by that
        assert await refused(served, ticket=await served.ticket(browser), cookie=cookie, Origin="")
        async with served.socket(await served.ticket(browser), cookie=cookie) as page:
            await page.recv()


async def test_a_program_opens_a_socket_by_its_key_alone(served: Served) -> None:
    for key, is_in in ((OPERATOR_KEY, True), (VIEWER_KEY, True), (OPERATOR_KEY[:-1], False), ("", False)):
        assert await refused(served, Authorization=f"Bearer {key}", Origin="") is not is_in
    assert await refused(served, Authorization=f"Bearer {OPERATOR_KEY}", Origin="http://evil.example")


# -- cookies and keys --------------------------------------------------------------------------------------------------


async def test_a_cookie_that_was_touched_forged_or_cut_is_nothing(served: Served) -> None:
    async with served.paired(Role.VIEWER) as viewer, served.paired(Role.OPERATOR, "Other") as operator:
        name, _, value = cookie_of(viewer).partition("=")
        other_value = cookie_of(operator).partition("=")[2]
        id, _, rest = value.partition(":")
        other_id = other_value.partition(":")[0]
        forged = [
            value[:-2] + ("A" if value[-2] != "A" else "B") + value[-1],  # the last letter has bits that say nothing
            f"{other_id}:{rest}",
            f"{other_id}:{rest.partition('.')[0]}." + other_value.partition(".")[2],
            id,
            f"{id}:",
            f"{id}::",
            value.upper(),
            value.rpartition(".")[0],
            "x" * 5000,
            "",
            "..",
        ]
    async with served.browser() as browser:
        for one in forged:
            answer = await browser.get("/api/state", headers={"Cookie": f"{name}={one}"})
            assert answer.status_code in (401, 400), one
        for other_name in (f"__Host-{name}", "catgraph", "catgraph-00000000"):
            answer = await browser.get("/api/state", headers={"Cookie": f"{other_name}={value}"})
            assert answer.status_code == 401


async def test_keys_are_of_their_roles_and_a_wrong_one_hides_behind_no_cookie(served: Served) -> None:
    async with http_client(base_url=served.base) as program:
        for key, read, act in ((OPERATOR_KEY, 200, 409), (VIEWER_KEY, 200, 403), ("x" * 24, 401, 401)):
            program.headers["Authorization"] = f"Bearer {key}"
            assert (await program.get("/api/state")).status_code == read
            assert (await program.post("/api/record", json={"on": True})).status_code == act
        for scheme in ("Basic", "", "Token"):
            program.headers["Authorization"] = f"{scheme} {OPERATOR_KEY}".strip()
            assert (await program.get("/api/state")).status_code == 401
    async with served.paired(Role.OPERATOR) as browser:
        answer = await browser.get("/api/state", headers={"Authorization": "Bearer nonsense"})
        assert (answer.status_code, answer.json()["code"]) == (401, "key")


async def test_two_headers_of_one_name_are_refused(served: Served) -> None:
    for name, value in (("Origin", served.base), ("Authorization", f"Bearer {OPERATOR_KEY}")):
        head = f"GET /api/state HTTP/1.1\r\nHost: {served.host}\r\n{name}: {value}\r\n{name}: {value}\r\n\r\n"
        assert (await raw(served, head)).startswith("HTTP/1.1 400")


# -- what needs nobody -------------------------------------------------------------------------------------------------


async def test_the_shell_needs_nobody_and_tells_nothing_of_the_car(served: Served) -> None:
    async with served.browser() as browser:
        page = await browser.get("/")
        assert page.status_code == 200
        assert 'data-access="paired"' in page.text
        assert (await browser.get("/static/js/main.js")).status_code == 200
        health = (await browser.get("/api/health")).json()
        assert sorted(health) == ["status", "version"]
        for path in (
            "/docs",
            "/openapi.json",
            "/metrics",
            "/api/recordings",
            "/api/recordings/x/file.mcap",
            "/api/nothing",
        ):
            answer = await browser.get(path)
            assert (answer.status_code, answer.json()["code"]) == (401, "unpaired"), path
            assert answer.headers["www-authenticate"] == "Bearer"
        for path in (
            "/static/../api/state",
            "/static/%2e%2e/api/state",
            "//api/state",
            "/api/./state",
            "/API/state",
            "/static",
        ):
            assert (await browser.get(path)).status_code in (401, 404, 307), path


async def test_a_link_in_a_mail_leads_over_the_pairing_to_what_it_names(served: Served) -> None:
    headers = {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Site": "cross-site"}
    async with served.browser() as browser:
        del browser.headers["Origin"]
        answer = await browser.get("/api/recordings/drive%201/file.mcap?a=b&c=d", headers=headers)
        assert answer.status_code == 303
        assert answer.headers["location"] == "/?then=%2Fapi%2Frecordings%2Fdrive%25201%2Ffile.mcap%3Fa%3Db%26c%3Dd"
        assert answer.text == ""


# -- removal -----------------------------------------------------------------------------------------------------------


async def test_who_is_removed_is_out_at_once_with_sockets_and_requests(served: Served) -> None:
    async with served.paired(Role.OPERATOR, "Boss") as boss, served.paired(Role.VIEWER, "Lost") as lost:
        cookie = cookie_of(lost)
        listed = (await boss.get("/api/devices")).json()
        id = next(one["id"] for one in listed["devices"] if one["name"] == "Lost")
        async with served.socket(await served.ticket(lost), cookie=cookie) as page:
            await page.recv()
            late = await served.ticket(lost)
            assert (await boss.delete(f"/api/devices/{id}")).json() == {"ok": True}
            assert await closed(page) == (4401, "This device was removed by Boss.")
        assert await refused(served, ticket=late, cookie=cookie)
        answer = await lost.get("/api/state")
        assert (answer.status_code, answer.json()["code"]) == (401, "removed")
        assert answer.json()["detail"] == "This device was removed by Boss."
        assert (await boss.delete(f"/api/devices/{id}")).status_code == 404


async def test_a_request_of_who_is_removed_ends(served: Served) -> None:
    async with served.paired(Role.OPERATOR, "Boss") as boss, served.paired(Role.OPERATOR, "Lost") as lost:
        id = (await lost.get("/api/me")).json()["id"]

        name, _, port = served.host.partition(":")
        reader, writer = await asyncio.open_connection(name, int(port))
        head = f"POST /api/connect HTTP/1.1\r\nHost: {served.host}\r\nOrigin: {served.base}\r\n"
        head += f"Cookie: {cookie_of(lost)}\r\n"
        writer.write(f'{head}Content-Type: application/json\r\nContent-Length: 16\r\n\r\n{{"addr'.encode())
        await boss.get("/api/state")  # a round trip, so that it is under way
        await boss.delete(f"/api/devices/{id}")
        answer = (await asyncio.wait_for(reader.read(4000), 5)).decode()
        assert answer.startswith("HTTP/1.1 401")
        writer.close()


async def test_an_answer_half_given_to_who_is_removed_breaks_off() -> None:
    access = access_of(config(), now=time.monotonic, wall_ms=lambda: 1_790_000_000_000)
    device, secret = await access.pair(token=access.invitation().token, pin=None, name="Lost", peer="")
    sent: list[str] = []

    async def endless(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        while True:
            await send({"type": "http.response.body", "body": b"x", "more_body": True})
            await asyncio.sleep(0)

    async def receive() -> Message:
        return {"type": "http.request"}

    async def send(message: Message) -> None:
        sent.append(message["type"])

    cookie = access.cookie(device, secret, scheme="http", host="localhost").partition(";")[0]
    headers = [(b"host", b"localhost"), (b"cookie", cookie.encode())]
    scope = {"type": "http", "method": "GET", "path": "/x", "scheme": "http", "query_string": b"", "headers": headers}
    answering = asyncio.create_task(Guard(endless, access=access)(scope, receive, send))
    while len(sent) < 10:
        await asyncio.sleep(0)
    await access.remove(device.id, by="Boss")
    async with asyncio.timeout(20):
        await answering
    assert set(sent[1:]) == {"http.response.body"}


async def test_a_new_role_counts_at_once_and_an_operator_may_remove_itself(served: Served) -> None:
    async with served.paired(Role.OPERATOR, "Boss") as boss, served.paired(Role.VIEWER, "Helper") as helper:
        id = (await helper.get("/api/me")).json()["id"]
        async with served.socket(await served.ticket(helper), cookie=cookie_of(helper)) as page:
            await page.recv()
            assert (await helper.patch(f"/api/devices/{id}", json={"role": "operator"})).status_code == 403
            changed = await boss.patch(f"/api/devices/{id}", json={"role": "operator", "name": " Ann\u202e "})
            assert (changed.json()["role"], changed.json()["name"]) == ("operator", "Ann")
            assert await closed(page) == (4401, "The role of this device was changed.")
        assert (await helper.get("/api/devices")).json()["you"] == id
        mine = (await boss.get("/api/me")).json()["id"]
        assert (await boss.delete(f"/api/devices/{mine}")).status_code == 200
        assert (await boss.get("/api/me")).status_code == 401


async def test_who_was_paired_is_paired_after_a_restart_and_who_was_removed_is_not(tmp_path: Path) -> None:
    async with paired_server(keyed(tmp_path)) as first:
        async with first.paired(Role.OPERATOR, "Boss") as boss, first.paired(Role.VIEWER, "Lost") as lost:
            kept, gone = cookie_of(boss), cookie_of(lost)
            await boss.delete(f"/api/devices/{(await lost.get('/api/me')).json()['id']}")
    async with paired_server(keyed(tmp_path)) as second, second.browser() as browser:
        assert (await browser.get("/api/me", headers={"Cookie": kept})).json()["name"] == "Boss"
        assert (await browser.get("/api/me", headers={"Cookie": gone})).status_code == 401


# -- open --------------------------------------------------------------------------------------------------------------


async def test_on_this_machine_alone_nobody_pairs_and_still_no_strangers_page_comes_in() -> None:
    async with serving(Config()) as base:
        host = base.removeprefix("http://")
        port = host.partition(":")[2]
        async with http_client(base_url=base) as anybody:
            assert (await anybody.get("/api/state")).status_code == 200
            assert 'data-access="open"' in (await anybody.get("/")).text
            assert (await anybody.post("/api/pause")).status_code != 403
            for name in (f"localhost:{port}", "127.0.0.1", f"127.0.0.2:{port}", f"[::1]:{port}"):
                assert (await anybody.get("/api/me", headers={"Host": name})).json()["role"] == "operator"
            own = sockets.gethostname().lower()
            for name in ("evil.example", "192.168.4.1", own if own != "localhost" else "car.local"):
                assert (await anybody.get("/api/me", headers={"Host": name})).status_code == 403
            for origin in stranger_origins(host):
                assert (await anybody.post("/api/pause", headers={"Origin": origin})).status_code == 403
        async with websockets.connect(f"ws://{host}/ws") as page:
            assert "hello" in str(await page.recv())
        for origin in stranger_origins(host):
            with pytest.raises(websockets.InvalidStatus):
                await websockets.connect(f"ws://{host}/ws", additional_headers={"Origin": origin})


async def test_one_device_opens_so_many_pages_and_another_still_gets_in() -> None:
    of = config(limits=Limits(pages=3))
    async with (
        paired_server(of) as served,
        served.paired(Role.OPERATOR) as greedy,
        served.paired(Role.OPERATOR, "Galaxy") as other,
        contextlib.AsyncExitStack() as stack,
    ):

        async def page(browser: httpx.AsyncClient) -> websockets.ClientConnection:
            socket = served.socket(await served.ticket(browser), cookie=cookie_of(browser))
            opened: websockets.ClientConnection = await stack.enter_async_context(socket)
            return opened

        pages = [await page(greedy) for _ in range(3)]
        for one in pages:
            assert json.loads(await one.recv())["kind"] == "hello"
        assert await closed(await page(greedy)) == (1013, "too many pages")
        assert json.loads(await (await page(other)).recv())["kind"] == "hello"
        await pages[0].close()
        async with asyncio.timeout(6):
            while (await closed_at_once(await page(greedy))) is not None:  # the place of the one that left is free soon
                pass


async def closed_at_once(page: websockets.ClientConnection) -> int | None:
    """The code with which it was closed instead of a hello; None: it was not."""
    try:
        await page.recv()
    except websockets.ConnectionClosed:
        return page.close_code
    return None
