"""The names our own authority may vouch for, and no other: what is private, on every network alike.

An authority that a phone trusts could pretend to be any bank, if its key were stolen. Ours says in its own certificate
that it speaks for these names only (RFC 5280 4.2.1.10), and browsers hold it to that.
"""

from __future__ import annotations

import ipaddress

RANGES = tuple(
    ipaddress.ip_network(text)
    for text in (
        "10.0.0.0/8",  # RFC 1918, with the two below
        "172.16.0.0/12",
        "192.168.0.0/16",
        "169.254.0.0/16",  # link-local: a cable and nobody who gives addresses, RFC 3927
        "127.0.0.0/8",
        "100.64.0.0/10",  # between a provider's router and the world, and every overlay network, RFC 6598
        "fc00::/7",  # unique local, RFC 4193
        "fe80::/10",  # link-local
        "::1/128",
    )
)
DOMAINS = ("local", "localhost")  # each with all beneath it: mDNS, RFC 6762, and this machine, RFC 6761


def may_vouch_for_address(ip: ipaddress.IPv4Address | ipaddress.IPv6Address) -> bool:
    """Whether an address lies in one of the ranges."""
    return any(ip.version == network.version and ip in network for network in RANGES)


def may_vouch_for_name(name: str) -> bool:
    """Whether a name, in lower case, is one of the domains or lies beneath one."""
    return name.rpartition(".")[2] in DOMAINS
