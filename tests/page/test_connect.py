"""The connect screen: from an address to a live car, and every way in which that fails."""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import expect

from server.rosbridge.address import parse
from tests.http import http_client
from tests.page.canned import Canned
from tests.page.canned import idle as no_car
from tests.page.conftest import Phone
from tests.page.processes import Process, running, server, simulate
from tests.ports import free_port


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def serving(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    async with running(*server(tmp_path_factory.mktemp("data"))) as process:
        yield process


@pytest_asyncio.fixture(loop_scope="session")
async def idle(serving: Process) -> Process:
    """A server that watches no car."""
    await disconnect(serving)
    return serving


async def disconnect(serving: Process) -> None:
    async with http_client() as client:
        (await client.post(f"{serving.console}/api/disconnect")).raise_for_status()


@contextlib.asynccontextmanager
async def web_server() -> AsyncIterator[int]:
    """Something that answers HTTP and is no rosbridge."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            await reader.readuntil(b"\r\n\r\n")
            writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi")
            await writer.drain()
            writer.close()

    listening = await asyncio.start_server(answer, "127.0.0.1", 0)
    try:
        yield listening.sockets[0].getsockname()[1]
    finally:
        listening.close()
        await listening.wait_closed()


async def connect(phone: Phone, address: str) -> None:
    await phone.page.fill("#address", address)
    await phone.f("go", "#connect").tap()


async def change_address(phone: Phone) -> None:
    await phone.page.locator("#sheet-failed [data-f=change]").tap()
    await expect(phone.page.locator("#sheet-failed")).to_be_hidden()


@pytest.mark.gate
@pytest.mark.own_phone
async def test_from_the_address_to_a_live_car_and_back_by_stop(phone: Phone, idle: Process) -> None:
    await phone.page.context.grant_permissions(["geolocation"])
    await phone.page.context.set_geolocation({"latitude": 32.23, "longitude": -110.95, "accuracy": 50})
    async with running(*simulate()) as car:
        await phone.open(idle.address)
        await expect(phone.page.locator("#connect h1")).to_have_text("Connect to a car")
        await expect(phone.page.locator("#connect [data-f=found]")).to_contain_text("None found")
        await connect(phone, car.shown)
        await phone.live()
        await phone.has_speed()
        for name in ("latitude", "longitude", "altitude", "heading", "brake", "accelerator", "steering", "distance"):
            await expect(phone.f(name)).to_have_text(re.compile(r"\d"))
        await expect(phone.page.locator(".checks li", has_text="Fuel")).to_contain_text("not published")
        await expect(phone.f("sound-off")).to_be_hidden()  # the tap armed the sound

        await phone.f("stop").tap()
        sheet = phone.page.locator("#sheet-stop")
        await expect(sheet).to_contain_text("This ends monitoring, not the car's motion.")
        await sheet.locator("[data-f=no]").tap()
        await phone.live()
        await phone.f("stop").tap()
        await sheet.locator("[data-f=yes]").tap()
        await expect(phone.page.locator("#connect")).to_be_visible()
        await expect(phone.f("sound", "#connect")).to_have_text("Ready")
        await expect(phone.f("position", "#connect")).to_have_text("Ready")

        await phone.f("history", "#connect").tap()  # the address is remembered on this phone
        await phone.page.locator("#sheet-history").get_by_text(car.shown).tap()
        await expect(phone.page.locator("#address")).to_have_value(car.shown)


@pytest.mark.gate
async def test_case_11_a_refused_port_says_so_and_goes_home_by_itself_when_the_bridge_comes(
    phone: Phone, idle: Process
) -> None:
    port = free_port()
    await phone.open(idle.address)
    await connect(phone, f"127.0.0.1:{port}")
    sheet = phone.page.locator("#sheet-failed")
    await expect(sheet).to_contain_text(f"127.0.0.1 is there, but nothing listens on port {port}.")
    await expect(sheet.locator(".bigchain .bad")).to_have_text("refused")
    await expect(sheet.locator(".bigchain")).to_have_attribute(
        "aria-label", "The link is broken between Server and Bridge"
    )
    await sheet.locator("[data-f=retry]").tap()
    await expect(sheet).to_be_visible()
    async with running(*simulate(port=port)):
        await phone.live()
        await expect(sheet).to_be_hidden()


WRONG = (
    ("no-such-car.invalid", "There is no host named no-such-car.invalid.", "no such host"),
    ("http://10.0.0.7:11311", "This is a ROS master address; catgraph connects to rosbridge.", "not tried"),
    ("ftp://10.0.0.7", "“ftp” is not a supported scheme.", "not tried"),
    ("10.0.0.7:99999", "The port is not a number from 1 to 65535.", "not tried"),
    ("<img src=x onerror=alert(1)>", "This is not an address.", "not tried"),
    ("", "No address is given.", "not tried"),
)


async def test_each_wrong_address_gets_its_own_sentence(phone: Phone, idle: Process) -> None:
    sheet = phone.page.locator("#sheet-failed")
    for address, sentence, mark in WRONG:
        await disconnect(idle)
        await phone.open(idle.address)
        await expect(phone.page.locator("#connect")).to_be_visible()
        await connect(phone, address)
        await expect(sheet).to_contain_text(sentence, timeout=15_000)
        await expect(sheet.locator(".bigchain .bad")).to_have_text(mark)
        is_master = "11311" in address  # the better address is offered and taken over
        if is_master:
            await expect(sheet.locator("[data-f=change]")).to_have_text("Use ws://10.0.0.7:9090")
        await change_address(phone)
        await expect(phone.page.locator("#address")).to_have_value("ws://10.0.0.7:9090" if is_master else address)
        assert await phone.page.locator("img").count() == 0


async def test_something_that_is_no_rosbridge_is_called_so(phone: Phone, idle: Process) -> None:
    async with web_server() as port:
        await phone.open(idle.address)
        await connect(phone, f"127.0.0.1:{port}")
        sheet = phone.page.locator("#sheet-failed")
        await expect(sheet).to_contain_text(
            f"Something answers on 127.0.0.1:{port}, but it is not a rosbridge.", timeout=15_000
        )


async def test_without_a_server_the_page_says_so_and_comes_by_itself(phone: Phone, tmp_path: Path) -> None:
    port = free_port()
    async with running(*server(tmp_path, port=port)) as first:
        await phone.open(first.address)
        await expect(phone.page.locator("#connect")).to_be_visible()
    await expect(phone.f("message", "#connect")).to_have_text("The server does not answer; this page keeps trying.")
    await phone.page.fill("#address", "127.0.0.1:1")
    await phone.f("go", "#connect").tap()
    await expect(phone.f("message", "#connect")).to_have_text("Not sent: the server does not answer.")
    async with running(*server(tmp_path, port=port)):
        await expect(phone.f("message", "#connect")).to_be_hidden()


DIALS = ("192.168.4.1", "car.local:9091", "ws://car/bridge", "wss://car/bridge?x=1", "wss://car:9090", "fd00::1")


@pytest.mark.gate
async def test_the_box_shows_what_will_be_dialled_before_it_is(phone: Phone, canned: Canned) -> None:
    canned.state = no_car()
    await phone.open(canned.address)
    dials = phone.f("dials", "#connect")
    for typed in DIALS:
        await phone.page.fill("#address", typed)
        await expect(dials).to_have_text(f"Dials {parse(typed).url}")
    for refused in ("http://car:11311", "ws:/car", "my car"):
        await phone.page.fill("#address", refused)
        await expect(dials).to_be_hidden()
