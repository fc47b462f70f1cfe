"""The names by which this machine's page is reached: its addresses, its name in mDNS, localhost, given names.

Our own authority may sign for private names only: a stolen key of a trusted authority could impersonate any site. The
name constraints of ours (RFC 5280 4.2.1.10) limit it to these names, and browsers enforce them.

Addresses of a container's host machine cannot be looked up inside; they are learned from requests. A request to the
plain page has the typed address in `Host`. Only private addresses are accepted; a false one does no harm, because the
certificate serves this server only.
"""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import ifaddr

RANGES = tuple(
    ipaddress.ip_network(text)
    for text in (
        "10.0.0.0/8",  # RFC 1918, with the two below
        "172.16.0.0/12",
        "192.168.0.0/16",
        "169.254.0.0/16",  # link-local: a cable without DHCP, RFC 3927
        "127.0.0.0/8",
        "100.64.0.0/10",  # between a provider's router and the world, and every overlay network, RFC 6598
        "fc00::/7",  # unique local, RFC 4193
        "fe80::/10",  # link-local
        "::1/128",
    )
)
DOMAINS = ("local", "localhost")  # each with all beneath it: mDNS, RFC 6762, and this machine, RFC 6761

IpAddress = ipaddress.IPv4Address | ipaddress.IPv6Address
MAX_NAMES = 60  # a certificate is sent with every handshake; a machine with more addresses has them from containers
_CONTAINERS = re.compile(r"docker|veth|br-|virbr|lxc|cni|podman", re.IGNORECASE)

MOST = 12  # then the one with the oldest use is dropped
EVERY_S = 1.0  # each new one is a new certificate


def may_vouch_for_address(ip: ipaddress.IPv4Address | ipaddress.IPv6Address) -> bool:
    """Whether an address is in one of the ranges."""
    return any(ip.version == network.version and ip in network for network in RANGES)


def may_vouch_for_name(name: str) -> bool:
    """Whether a lower-case name is one of the domains or a subdomain."""
    return name.rpartition(".")[2] in DOMAINS


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """The names of one server, each once, in the order in which they are offered to a person."""

    dns: tuple[str, ...]
    ips: tuple[IpAddress, ...]
    left_out: tuple[str, ...] = ()  # has them, but our authority may not certify them

    @property
    def reachable(self) -> tuple[IpAddress, ...]:
        """The addresses that another device can type: neither loopback nor bound to one cable's end."""
        return tuple(ip for ip in self.ips if not ip.is_loopback and not (ip.version == 6 and ip.is_link_local))


def names_of(addresses: Iterable[IpAddress], host: str, given: Iterable[str] = ()) -> Names:
    """The names our authority can certify, of a machine called `host` with these addresses; `given` are names or
    addresses that somebody else's router or name server leads here by."""
    dns = ["localhost"]
    ips: list[IpAddress] = []
    left_out: list[str] = []
    label = label_of(host)
    if label:
        dns.insert(0, f"{label}.local")
    for text in given:
        if "://" in text:
            continue  # a proxy's address: it has a certificate of its own
        try:
            ips.append(ipaddress.ip_address(text.strip("[]")))
        except ValueError:
            dns.append(text.rstrip(".").lower())
    ips.extend(addresses)
    ips.extend((ipaddress.IPv4Address("127.0.0.1"), ipaddress.IPv6Address("::1")))
    for name in [name for name in dns if not may_vouch_for_name(name)]:
        left_out.append(name)
        dns.remove(name)
    left_out.extend(str(ip) for ip in dict.fromkeys(ips) if not may_vouch_for_address(ip))
    vouched = [ip for ip in dict.fromkeys(ips) if may_vouch_for_address(ip)]
    return Names(dns=tuple(dict.fromkeys(dns)), ips=tuple(vouched[:MAX_NAMES]), left_out=tuple(left_out))


def addresses_now() -> tuple[IpAddress, ...]:
    """The addresses of this machine's interfaces, those a phone is most likely to reach first. Raises OSError."""
    found: list[tuple[tuple[bool, bool, bool], IpAddress]] = []
    for adapter in ifaddr.get_adapters():
        is_container = bool(_CONTAINERS.match(adapter.nice_name))
        for one in adapter.ips:
            ip = ipaddress.ip_address(str(one.ip if one.is_IPv4 else one.ip[0]).partition("%")[0])
            found.append(((is_container, ip.is_link_local, ip.version == 6), ip))
    return tuple(dict.fromkeys(ip for _, ip in sorted(found, key=lambda pair: pair[0]) if not ip.is_loopback))


def host_now() -> str:
    """This machine's name, as it calls itself."""
    return socket.gethostname()


def label_of(host: str) -> str:
    """The name under which mDNS announces a machine called `host`: its first label, in letters, digits and hyphens
    (RFC 1123, at most 63); empty where nothing is left or it is localhost."""
    label = re.sub(r"[^a-z0-9-]+", "-", host.partition(".")[0].lower()).strip("-")[:63].strip("-")
    return "" if label == "localhost" else label


class HostAddresses:
    """Addresses of a container's host machine, learned from requests.

    The addresses learnt, the newest first.
    """

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
