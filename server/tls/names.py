"""What this machine is called by who wants its page: its addresses, its name in mDNS, localhost, given names."""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Iterable
from dataclasses import dataclass

import ifaddr

from server.tls.ranges import may_vouch_for_address, may_vouch_for_name

IpAddress = ipaddress.IPv4Address | ipaddress.IPv6Address
MAX_NAMES = 60  # a certificate is sent with every handshake; a machine with more addresses has them from containers
_CONTAINERS = re.compile(r"docker|veth|br-|virbr|lxc|cni|podman", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """The names of one server, each once, in the order in which a person would want them."""

    dns: tuple[str, ...]
    ips: tuple[IpAddress, ...]
    left_out: tuple[str, ...] = ()  # has them, but our authority may not vouch for them

    @property
    def reachable(self) -> tuple[IpAddress, ...]:
        """The addresses that another device can type: neither loopback nor bound to one cable's end."""
        return tuple(ip for ip in self.ips if not ip.is_loopback and not (ip.version == 6 and ip.is_link_local))


def names_of(addresses: Iterable[IpAddress], host: str, given: Iterable[str] = ()) -> Names:
    """The names our authority can vouch for, of a machine called `host` with these addresses; `given` are names or
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
