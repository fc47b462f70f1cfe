"""Addresses of a container's host machine, learned from requests, because they cannot be looked up inside.

A request to the plain page has the typed address in `Host`. Only private addresses are accepted; a false one does no
harm, because the certificate serves this server only.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Callable, Iterable

from server.tls.names import IpAddress
from server.tls.ranges import may_vouch_for_address

MOST = 12  # then the one with the oldest use is dropped
EVERY_S = 1.0  # each new one is a new certificate


class HostAddresses:
    """The addresses learnt, the newest first."""

    def __init__(self, known: Iterable[IpAddress], *, now: Callable[[], float]) -> None:
        """`known`: those the certificate of before was for."""
        self._addresses = [ip for ip in known if not ip.is_loopback][:MOST]
        self._now = now
        self._learnt_s: float | None = None

    @property
    def addresses(self) -> tuple[str, ...]:
        return tuple(map(str, self._addresses))

    def learn(self, host: str | None) -> bool:
        """Whether `host`, as somebody typed it, was new."""
        try:
            ip = ipaddress.ip_address(host or "")
        except ValueError:
            return False
        if ip in self._addresses or ip.is_loopback or not may_vouch_for_address(ip):
            return False
        if self._learnt_s is not None and self._now() - self._learnt_s < EVERY_S:
            return False
        self._learnt_s = self._now()
        self._addresses = [ip, *self._addresses][:MOST]
        return True
