"""What an operator types, and what is never dialled."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import pytest
from autobahn.websocket.util import parse_url
from hypothesis import given, settings
from hypothesis import strategies as st

from server.rosbridge.address import Address, BadAddress, parse, refuse_forbidden, url_of, without_login

DIALLED = {
    "bare host": ("car", "ws://car:9090"),
    "host and port": ("car:9091", "ws://car:9091"),
    "capital letters": ("Car.Local", "ws://car.local:9090"),
    "root dot": ("car.local.", "ws://car.local.:9090"),
    "underscores, as docker names have": ("my_car", "ws://my_car:9090"),
    "ip": ("192.168.4.1", "ws://192.168.4.1:9090"),
    "ip and port": ("192.168.4.1:8080", "ws://192.168.4.1:8080"),
    "ws": ("ws://car", "ws://car:80"),
    "ws with a slash": ("ws://car/", "ws://car:80"),
    "ws in capitals": ("WS://car:9090", "ws://car:9090"),
    "wss": ("wss://car:443", "wss://car:443"),
    "wss without port": ("wss://car", "wss://car:443"),
    "wss in capitals": ("WSS://car", "wss://car:443"),
    "wss with a path": ("wss://car/bridge?x=1", "wss://car:443/bridge?x=1"),
    "wss and port": ("wss://car:9090/bridge", "wss://car:9090/bridge"),
    "wss with a colon": ("wss://car:/bridge", "wss://car:443/bridge"),
    "wss on IPv6": ("wss://[fd00::1]/x", "wss://[fd00::1]:443/x"),
    "slash at the end": ("ws://car:9090/", "ws://car:9090"),
    "path": ("ws://car/bridge/1", "ws://car:80/bridge/1"),
    "path without a scheme": ("car/bridge/1", "ws://car:9090/bridge/1"),
    "path and query": ("car:9090/b?token=a%20b&x=1", "ws://car:9090/b?token=a%20b&x=1"),
    "query only": ("car?x=1", "ws://car:9090/?x=1"),
    "fragment": ("car#top", "ws://car:9090"),
    "foreign letters in the path": ("car/ü", "ws://car:9090/%C3%BC"),
    "quotes in the path": ('car/"x"', "ws://car:9090/%22x%22"),
    "colon without a port": ("car:", "ws://car:9090"),
    "IPv6": ("fd00::1", "ws://[fd00::1]:9090"),
    "IPv6 in brackets": ("[fd00::1]", "ws://[fd00::1]:9090"),
    "IPv6 and port": ("[fd00::1]:9091", "ws://[fd00::1]:9091"),
    "IPv6 with ws": ("ws://[fd00::1]:9091/x", "ws://[fd00::1]:9091/x"),
    "IPv6 loopback": ("::1", "ws://[::1]:9090"),
    "spaces and a line end around": ("  car:9090 \n", "ws://car:9090"),
    "highest port": ("car:65535", "ws://car:65535"),
    "lowest port": ("car:1", "ws://car:1"),
    "foxglove": ("foxglove://car", "foxglove://car:8765"),
    "foxglove in capitals, with a port": ("Foxglove://Car:9000/", "foxglove://car:9000"),
    "foxglove over TLS": ("foxglove+tls://car/x?y=1", "foxglove+tls://car:8765/x?y=1"),
    "foxglove on IPv6": ("foxglove://[fd00::1]", "foxglove://[fd00::1]:8765"),
    "longest label": ("a" * 63, f"ws://{'a' * 63}:9090"),
}


@pytest.mark.parametrize(("typed", "url"), DIALLED.values(), ids=DIALLED)
def test_is_dialled(typed: str, url: str) -> None:
    address = parse(typed)
    assert address.url == url
    assert parse(address.url) == address
    assert parse_url(address.websocket_url)[1:3] == (address.host, address.port)  # what the transport makes of it


def test_a_foxglove_server_is_dialled_as_a_websocket() -> None:
    assert parse("foxglove://car").websocket_url == "ws://car:8765"
    assert parse("foxglove+tls://car").websocket_url == "wss://car:8765"
    assert not parse("ws://car:8765").is_foxglove


def test_shown_is_host_and_port() -> None:
    assert parse("wss://car/x").shown == "car:443"
    assert parse("fd00::1").shown == "[fd00::1]:9090"


REFUSED = {
    "nothing": ("", "address", "No address", None),
    "spaces": ("   ", "address", "No address", None),
    "space inside": ("my car", "address", "not an address", None),
    "line end inside": ("car\r\nHost: evil", "address", "not an address", None),
    "nul": ("car\0", "address", "not an address", None),
    "letter without width": ("car\u200b", "address", "not an address", None),
    "turned writing": ("\u202ecar", "address", "not an address", None),
    "very long": ("c" * 301, "address", "not an address", None),
    "label too long": ("c" * 64, "address", "not a host name", None),
    "two dots": ("car..local", "address", "not a host name", None),
    "minus first": ("-oProxyCommand=x", "address", "not a host name", None),
    "minus last": ("car-", "address", "not a host name", None),
    "foreign letters": ("büro", "address", "not a host name", None),
    "full-width letters": ("\uff43\uff41\uff52", "address", "not a host name", None),
    "full-width stop": ("car\u3002local", "address", "not a host name", None),
    "percent": ("car%2elocal", "address", "not a host name", None),
    "script": ("<script>", "address", "not a host name", None),
    "no host": ("ws://", "address", "names no host", None),
    "no host but a port": (":9090", "address", "names no host", None),
    "no host but a path": ("ws:///x", "address", "names no host", None),
    "brackets around a name": ("[car]", "address", "not a host name", None),
    "open bracket": ("[fd00::1", "address", "not a host name", None),
    "IPv6 with the port run on": ("[fd00::1]9090", "address", "separated", None),
    "two ports": ("car:9090:9091", "address", "separated", None),
    "port 0": ("car:0", "address", "Port 0", None),
    "port 65536": ("car:65536", "address", "port is not a number", None),
    "port abc": ("car:abc", "address", "port is not a number", None),
    "port below zero": ("car:-1", "address", "port is not a number", None),
    "port with a sign": ("car:+90", "address", "port is not a number", None),
    "port in other digits": ("car:٩٠٩٠", "address", "port is not a number", None),
    "user": ("ros@car", "address", "user name", None),
    "user and password": ("ws://ros:secret@car", "address", "user name", None),
    "http": ("http://car", "scheme", "http://", "ws://car:9090"),
    "http with a port": ("HTTP://car:8080/x", "scheme", "http://", "ws://car:8080"),
    "https": ("https://car", "scheme", "https://", "wss://car:9090"),
    "http without a host": ("http://", "scheme", "http://", None),
    "http with nonsense": ("http://<b>:x", "scheme", "http://", None),
    "rosrpc": ("rosrpc://car:4000", "scheme", "rosrpc://", "ws://car:4000"),
    "tcp": ("tcp://car", "scheme", "tcp", None),
    "file": ("file:///etc/passwd", "scheme", "file", None),
    "javascript": ("javascript://car", "scheme", "javascript", None),
    "slashes alone": ("://car", "scheme", "not a supported scheme", None),
    "one slash": ("ws:/car:9090", "scheme", "two slashes", "ws://car:9090"),
    "no slash": ("wss:car", "scheme", "two slashes", "wss://car"),
    "no slash and an ip": ("ws:10.0.0.1:9090", "scheme", "two slashes", "ws://10.0.0.1:9090"),
    "ROS master": ("http://car:11311", "ros_master", "ROS master", "ws://car:9090"),
    "ROS master with a slash": ("http://car:11311/", "ros_master", "ROS master", "ws://car:9090"),
    "ROS master on IPv6": ("http://[fd00::1]:11311", "ros_master", "ROS master", "ws://[fd00::1]:9090"),
    "ROS master without scheme": ("car:11311", "ros_master", "ROS master", "ws://car:9090"),
    "ROS master with ws": ("ws://[fd00::1]:11311", "ros_master", "ROS master", "ws://[fd00::1]:9090"),
    "interface named": ("fe80::1%eth0", "forbidden", "never dialled", None),
    "interface named in brackets": ("[fe80::1%eth0]:9090", "forbidden", "never dialled", None),
}


@pytest.mark.parametrize(("typed", "code", "text", "suggestion"), REFUSED.values(), ids=REFUSED)
def test_is_refused(typed: str, code: str, text: str, suggestion: str | None) -> None:
    with pytest.raises(BadAddress, match=text) as refusal:
        parse(typed)
    assert refusal.value.code == code
    assert refusal.value.suggestion == suggestion
    assert str(refusal.value).endswith(".")
    assert len(str(refusal.value)) < 120
    if suggestion is not None:
        assert suggestion in refusal.value.hint
        parse(suggestion)


SPELLINGS = json.loads(Path(__file__).with_name("spellings.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("typed", "url"), SPELLINGS, ids=[ascii(typed) for typed, _ in SPELLINGS])
def test_the_page_shows_what_is_dialled(typed: str, url: str | None) -> None:
    """tests/page/screens.test.js reads the same table: what the page shows is what the server dials."""
    assert url_of(typed) == url


@pytest.mark.parametrize("rows", [DIALLED, REFUSED], ids=["dialled", "refused"])
def test_the_page_is_tried_with_each_spelling_of_this_file(rows: dict[str, tuple[str, ...]]) -> None:
    """Except for the longest ones, which screens.test.js makes itself."""
    assert {row[0] for row in rows.values() if len(row[0]) < 130} <= {typed for typed, _ in SPELLINGS}


FORBIDDEN = [
    "169.254.169.254",
    "169.254.0.1",
    "0.0.0.0",
    "0.1.2.3",
    "224.0.0.1",
    "239.255.255.250",
    "255.255.255.255",
    "100.100.100.200",
    "::",
    "fe80::1",
    "fe80::1%eth0",
    "ff02::1",
    "fd00:ec2::254",
    "::ffff:224.0.0.1",  # IPv4 in IPv6, of a group that no connection leads to
    "::ffff:e000:1",
    "::224.0.0.1",
    "64:ff9b::224.0.0.1",
    "64:ff9b:1::e000:1",
    "2002:e000:1::1",
    "::ffff:0:224.0.0.1",
    "fd00::5efe:224.0.0.1",
    "2001:0:e000:1::1",
]
ALLOWED = [
    "127.0.0.1",
    "192.168.4.1",
    "10.0.0.1",
    "100.64.0.1",
    "8.8.8.8",
    "::1",
    "fd00::1",
    "2001:db8::1",
    "::ffff:10.0.0.1",
    "64:ff9b::10.0.0.1",
]


@pytest.mark.parametrize("ip", FORBIDDEN)
def test_never_dialled(ip: str) -> None:
    with pytest.raises(BadAddress, match="never dialled") as refusal:
        refuse_forbidden(ip)
    assert refusal.value.code == "forbidden"


@pytest.mark.parametrize("ip", ALLOWED)
def test_may_be_dialled(ip: str) -> None:
    refuse_forbidden(ip)


@pytest.mark.parametrize(
    "spelling",
    ["224.0.0.1", "3758096385", "0xe0000001", "224.1"],
)
def test_other_spellings_of_an_address_come_out_of_the_resolver(spelling: str) -> None:
    """A number may be written in many ways: what is looked at is what would be dialled."""
    address = parse(spelling)
    found = {str(entry[4][0]) for entry in socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)}
    assert found == {"224.0.0.1"}
    for ip in found:
        with pytest.raises(BadAddress):
            refuse_forbidden(ip)


@pytest.mark.parametrize(
    ("typed", "kept"),
    [
        ("ws://ros:secret@car:9090/x", "ws://…@car:9090/x"),
        (" ros:secret@car", " …@car"),
        ("http://a:b@c@d", "http://…@d"),
        ("car:9090/a@b", "car:9090/a@b"),
        ("car", "car"),
    ],
)
def test_a_login_that_was_typed_is_not_written_down(typed: str, kept: str) -> None:
    assert without_login(typed) == kept


def answer_to(typed: str) -> Address | str:
    try:
        return parse(typed)
    except BadAddress as why:
        return str(why)


@settings(deadline=None)
@given(st.text(max_size=320) | st.from_regex(r"(wss?://)?[^\s/]{0,20}(:[0-9a-z]{0,6})?(/.{0,10})?", fullmatch=True))
def test_any_text_is_an_address_or_refused_with_a_sentence(typed: str) -> None:
    address = answer_to(typed)
    if isinstance(address, str):
        assert address.endswith(".")
        return
    assert 1 <= address.port <= 65535
    assert address.url.isascii()
    assert not any(letter.isspace() for letter in address.url)
    assert parse_url(address.url)[:3] == (address.secure, address.host, address.port)
    assert parse(address.url) == address
