"""What a server is called, and which of its names the authority may certify."""

from __future__ import annotations

import ipaddress

import pytest

from server.tls.names import MAX_NAMES, addresses_now, label_of, may_vouch_for_address, may_vouch_for_name, names_of

ip = ipaddress.ip_address


@pytest.mark.parametrize(
    ("address", "may"),
    [
        ("10.0.0.0", True),
        ("10.255.255.255", True),
        ("11.0.0.0", False),
        ("9.255.255.255", False),
        ("172.15.255.255", False),
        ("172.16.0.0", True),
        ("172.31.255.255", True),
        ("172.32.0.0", False),
        ("192.167.255.255", False),
        ("192.168.4.1", True),
        ("192.169.0.0", False),
        ("169.254.0.1", True),
        ("127.0.0.1", True),
        ("100.64.0.0", True),
        ("100.127.255.255", True),
        ("100.128.0.0", False),
        ("203.0.113.5", False),
        ("::1", True),
        ("::2", False),
        ("fe80::1", True),
        ("fec0::1", False),
        ("fd00::1", True),
        ("fbff::1", False),
        ("2001:db8::1", False),
        ("::ffff:8.8.8.8", False),
    ],
)
def test_only_private_addresses_are_vouched_for(address: str, may: bool) -> None:
    assert may_vouch_for_address(ip(address)) is may


@pytest.mark.parametrize(
    ("name", "may"),
    [
        ("pit.local", True),
        ("local", True),
        ("localhost", True),
        ("a.localhost", True),
        ("example.org", False),
        ("notlocal", False),
        ("local.example.org", False),
        ("", False),
    ],
)
def test_only_private_names_are_vouched_for(name: str, may: bool) -> None:
    assert may_vouch_for_name(name) is may


@pytest.mark.parametrize(
    ("host", "label"),
    [
        ("pit-laptop", "pit-laptop"),
        ("Pit Laptop.lan", "pit-laptop"),
        ("PIT_1", "pit-1"),
        ("Žebra", "ebra"),
        ("localhost", ""),
        ("localhost.localdomain", ""),
        ("---", ""),
        ("", ""),
        ("a" * 80, "a" * 63),
        ("a" * 62 + "-b", "a" * 62),
    ],
)
def test_the_name_in_mdns_is_the_host_s_own_in_letters_digits_and_hyphens(host: str, label: str) -> None:
    assert label_of(host) == label


def test_what_cannot_be_vouched_for_is_left_out_and_named() -> None:
    names = names_of([ip("203.0.113.5"), ip("192.168.4.1")], "pit", ["car.example.org", "Track.Local.", "[fd00::9]"])
    assert names.dns == ("pit.local", "localhost", "track.local")
    assert names.ips == tuple(map(ip, ("fd00::9", "192.168.4.1", "127.0.0.1", "::1")))
    assert names.left_out == ("car.example.org", "203.0.113.5")


def test_a_proxy_s_origin_is_no_name_of_ours() -> None:
    assert names_of([], "pit", ["https://car.example.org"]) == names_of([], "pit")


def test_what_another_device_can_type_is_neither_loopback_nor_an_end_of_a_cable() -> None:
    names = names_of(map(ip, ("fe80::1", "169.254.3.4", "10.0.0.2", "fd00::2")), "pit")
    assert names.reachable == tuple(map(ip, ("169.254.3.4", "10.0.0.2", "fd00::2")))


def test_names_stand_once_and_their_number_is_bounded() -> None:
    many = [ip("10.0.0.1") + n for n in range(200)]
    assert len(names_of(many, "pit").ips) == MAX_NAMES
    assert names_of([ip("10.0.0.1")] * 3, "pit", ["10.0.0.1"]).ips.count(ip("10.0.0.1")) == 1


def test_this_machine_s_addresses_are_read_without_zones_and_loopback() -> None:
    found = addresses_now()
    assert len(set(found)) == len(found)
    assert not any(one.is_loopback or getattr(one, "scope_id", None) for one in found)
