"""In a container, the addresses of the machine around it are learnt as people type them."""

from __future__ import annotations

import ipaddress
from pathlib import Path

import pytest

from server.app.config import Config, Tls
from server.app.tls_process import secure
from server.tls.names import EVERY_S, MOST, HostAddresses


class Clock:
    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.mark.parametrize(
    ("host", "is_learnt"),
    [
        ("192.168.4.1", True),
        ("fd00::5", True),
        ("10.0.0.1", False),  # known already
        ("127.0.0.1", False),
        ("::1", False),
        ("8.8.8.8", False),
        ("2001:db8::1", False),
        ("pit.local", False),
        ("192.168.4.1:8000", False),
        ("", False),
        (None, False),
    ],
)
def test_only_private_addresses_are_learnt(host: str | None, is_learnt: bool) -> None:
    outside = HostAddresses([ipaddress.ip_address("10.0.0.1")], now=Clock())
    assert outside.learn(host) is is_learnt
    assert (host in outside.addresses) is (is_learnt or host == "10.0.0.1")


def test_many_in_a_hurry_do_not_make_a_certificate_each_and_the_oldest_go() -> None:
    clock = Clock()
    outside = HostAddresses([], now=clock)
    assert [outside.learn(f"10.0.0.{n}") for n in range(5)] == [True, False, False, False, False]
    for n in range(100, 100 + MOST):
        clock.now_s += EVERY_S
        assert outside.learn(f"10.0.0.{n}")
    assert len(outside.addresses) == MOST
    assert outside.addresses[0] == f"10.0.0.{99 + MOST}"
    assert "10.0.0.0" not in outside.addresses


def test_what_was_typed_is_covered_at_once_and_after_a_restart(tmp_path: Path) -> None:
    config = Config(host="0.0.0.0", data=tmp_path, tls=Tls())
    secured = secure(config, in_container=True)
    assert secured is not None
    assert "192.168.44.5" not in secured.hosts()
    secured.typed("192.168.44.5")
    assert secured.hosts()[0] == "192.168.44.5"
    again = secure(config, in_container=True)
    assert again is not None
    assert "192.168.44.5" in again.hosts()


def test_beside_a_container_nothing_is_learnt(tmp_path: Path) -> None:
    secured = secure(Config(host="0.0.0.0", data=tmp_path, tls=Tls()), in_container=False)
    assert secured is not None
    secured.typed("192.168.44.5")
    assert "192.168.44.5" not in secured.hosts()
