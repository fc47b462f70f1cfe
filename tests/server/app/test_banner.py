"""The text in the terminal when a server starts."""

from __future__ import annotations

from pathlib import Path

import pytest
import segno

from server.app.banner import Announcement, Pairing, addresses, code, fingerprint_lines, lines
from server.app.config import Config, Tls
from server.tls.setup import SetupAddresses
from server.vehicle.vehicle import Vehicle

FINGERPRINT = ":".join(f"{n:02X}" for n in range(32))
PAIRING = Pairing(token="a-token-that-is-random", pin="012345", minutes=10)
FIELD = Announcement(
    config=Config(host="0.0.0.0", vehicles=(Vehicle(name="car", address="ws://10.0.0.1:9090"),)),
    url="https://192.168.4.1:8000/",
    others=("https://pit.local:8000/",),
    setup="http://192.168.4.1:8001/",
    fingerprint=FINGERPRINT,
    authority="catgraph pit 1A2B",
    left_out=("203.0.113.5",),
    pairing=PAIRING,
)


def text(announcement: Announcement, *, draws: bool = False) -> str:
    return "\n".join(lines(announcement, draws=draws))


def test_the_first_line_is_for_scripts() -> None:
    assert next(lines(FIELD, draws=True)) == "catgraph listens on https://192.168.4.1:8000/"


def test_a_person_gets_addresses_fingerprint_codes_and_pin() -> None:
    printed = text(FIELD, draws=True)
    for part in ("http://192.168.4.1:8001/", "https://pit.local:8000/", "catgraph pit 1A2B", "PIN 012345", "10 min"):
        assert part in printed
    assert all(line in printed for line in fingerprint_lines(FINGERPRINT))
    assert sum("▀" in line or "▄" in line for line in printed.splitlines()) > 20  # two codes
    assert "203.0.113.5" in printed


def test_a_log_gets_neither_pin_nor_token_nor_codes() -> None:
    printed = text(FIELD)
    assert "012345" not in printed
    assert "a-token" not in printed
    assert "▀" not in printed
    assert "catgraph pair" in printed


@pytest.mark.parametrize("text", ["http://192.168.4.1:8001/", f"https://192.168.4.1:8000/#pair={PAIRING.token}"])
def test_a_code_is_that_of_its_text_in_colours_of_its_own(text: str) -> None:
    rows = []
    for line in code(text):
        assert line.startswith("\x1b[97;40m")
        assert line.endswith("\x1b[0m")
        drawn = line.removeprefix("\x1b[97;40m").removesuffix("\x1b[0m")
        rows.append([letter not in "█▀" for letter in drawn])  # dark where nothing white is drawn
        rows.append([letter not in "█▄" for letter in drawn])
    wanted = [[bool(module) for module in row] for row in segno.make(text, error="l").matrix_iter(border=4)]
    assert rows[: len(wanted)] == wanted


def test_the_token_itself_stands_only_in_the_code() -> None:
    assert PAIRING.token not in text(FIELD, draws=True)


def test_without_https_it_lists_what_the_phone_will_lack() -> None:
    printed = text(Announcement(config=Config(host="0.0.0.0", tls=Tls(mode="off")), url="http://192.168.4.1:8000/"))
    for part in ("no position", "screen awake", "installs nothing", "shares files", "copies text", "eavesdrop"):
        assert part in printed


def test_on_this_machine_alone_there_is_nothing_to_lack_and_nobody_to_pair() -> None:
    printed = text(Announcement(config=Config(), url="http://127.0.0.1:8000/", pairing=PAIRING), draws=True)
    assert "Only this machine can open it" in printed
    assert "Without HTTPS" not in printed
    assert "PIN" not in printed


def test_a_fault_of_a_provided_certificate_is_reported() -> None:
    tls = Tls(mode="files", cert=Path("c"), key=Path("k"))
    announcement = Announcement(
        config=Config(host="0.0.0.0", tls=tls), url="https://x/", warning="it expires on 2027-05-30"
    )
    assert "Warning: it expires on 2027-05-30." in text(announcement)


@pytest.mark.parametrize(
    ("hosts", "first", "others"),
    [
        (("192.168.4.1", "pit.local", "localhost", "127.0.0.1", "fe80::1"), "192.168.4.1", ["pit.local"]),
        (("fd00::2", "10.0.0.1"), "[fd00::2]", ["10.0.0.1"]),
        (("localhost",), "localhost", []),
    ],
)
def test_addresses_that_another_device_may_try(hosts: tuple[str, ...], first: str, others: list[str]) -> None:
    url, more = addresses(SetupAddresses(hosts=hosts, port=8000, setup_port=8001))
    assert url == f"https://{first}:8000/"
    assert more == tuple(f"https://{host}:8000/" for host in others)


def test_a_fingerprint_is_four_lines_of_eight_pairs() -> None:
    assert [len(line.split()) for line in fingerprint_lines(FINGERPRINT)] == [8, 8, 8, 8]
