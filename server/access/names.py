"""The allowed values of Host and Origin, compared by equality.

This refuses DNS rebinding (a foreign name that resolves to this server is in Host) and cross-site requests and sockets
(the foreign page is in Origin).
"""

from __future__ import annotations

import ipaddress
import re
import socket
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from urllib.parse import urlsplit

import ifaddr

from server.system.loopback import is_loopback

_AUTHORITY = re.compile(r"(\[[0-9a-f:.]{2,45}\]|[a-z0-9._-]{1,253})(?::([0-9]{1,5}))?")
_LOOK_EVERY_S = 2.0
_PRIVATE = tuple(
    ipaddress.ip_network(text)
    for text in "10.0.0.0/8 172.16.0.0/12 192.168.0.0/16 100.64.0.0/10 169.254.0.0/16 fc00::/7 fe80::/10".split()
)


def is_in_container() -> bool:
    """Whether this machine is one in another, whose addresses it cannot know, though it is reached by them."""
    return any(Path(mark).exists() for mark in ("/.dockerenv", "/run/.containerenv"))


def own_addresses() -> frozenset[str]:
    """The addresses of this machine's interfaces now."""
    found = set()
    for adapter in ifaddr.get_adapters():
        for ip in adapter.ips:
            text = ip.ip if isinstance(ip.ip, str) else ip.ip[0]
            found.add(str(ipaddress.ip_address(text.partition("%")[0])))
    return frozenset(found)


def own_names() -> frozenset[str]:
    """What the machine is called, by itself and by multicast DNS."""
    name = socket.gethostname().lower().rstrip(".")
    return frozenset({name, f"{name.partition('.')[0]}.local"}) if name else frozenset()


class Names:
    """The names of one server."""

    def __init__(
        self,
        given: Iterable[str],
        *,
        is_open: bool,
        now: Callable[[], float] = time.monotonic,
        addresses: Callable[[], frozenset[str]] = own_addresses,
        in_container: bool | None = None,
    ) -> None:
        """`given`: hosts, or origins of a proxy before it; `is_open`: it is called by names of this machine alone;
        `in_container`: any private address may be that of the machine around it; a stranger can make a name point here,
        but not an address. None: as it is found.

        Raises ValueError with one sentence where one is no name.
        """
        self._is_open = is_open
        self._in_container = is_in_container() if in_container is None else in_container
        self._now = now
        self._look_up = addresses
        self._addresses: frozenset[str] = frozenset()
        self._looked_s: float | None = None
        self._names = set() if is_open else set(own_names())
        self._origins: dict[str, str] = {}  # of proxies, by their host and port
        for name in given:
            self._give(name)

    def knows(self, host: str) -> bool:
        """Whether the Host of a request names this server."""
        found = _AUTHORITY.fullmatch(host.lower())
        if found is None or int(found[2] or 0) > 65535:
            return False
        name = found[1]
        if name in self._names:
            return True
        bare = name.removeprefix("[").removesuffix("]")
        return is_loopback(bare) or (not self._is_open and self._is_own_address(bare))

    def may_ask(self, origin: str, *, scheme: str, host: str) -> bool:
        """Whether a page from `origin` is one of this server's, which was reached by `scheme` and `host`."""
        return origin.lower() in {f"{scheme}://{host.lower()}", self._origins.get(host.lower(), "")} - {""}

    def is_behind_tls(self, host: str) -> bool:
        """Whether a proxy with TLS serves this name."""
        return self._origins.get(host.lower(), "").startswith("https://")

    def _is_own_address(self, text: str) -> bool:
        try:
            found = ipaddress.ip_address(text)
        except ValueError:
            return False
        address = str(found)
        if address in self._addresses or (self._in_container and any(found in network for network in _PRIVATE)):
            return True
        if self._looked_s is None or self._now() - self._looked_s >= _LOOK_EVERY_S:  # a lease of DHCP may be new
            self._looked_s = self._now()
            self._addresses = self._look_up()
        return address in self._addresses

    def _give(self, text: str) -> None:
        scheme, separator, rest = text.strip().lower().partition("://")
        authority = rest.removesuffix("/") if separator else scheme
        found = _AUTHORITY.fullmatch(authority)
        if found is None or (separator and scheme not in ("http", "https")) or urlsplit(f"//{authority}").path:
            raise ValueError(f"“{text[:60]}” is no name of this server: give a host, or https://host of a proxy.")
        self._names.add(found[1])
        if separator:
            self._origins[authority] = f"{scheme}://{authority}"
