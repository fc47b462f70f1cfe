"""The names for which our own authority may sign: private ones only.

A stolen key of a trusted authority could impersonate any site. The name constraints of ours (RFC 5280 4.2.1.10) limit
it to these names, and browsers enforce them.
"""

from __future__ import annotations

import ipaddress

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


def may_vouch_for_address(ip: ipaddress.IPv4Address | ipaddress.IPv6Address) -> bool:
    """Whether an address is in one of the ranges."""
    return any(ip.version == network.version and ip in network for network in RANGES)


def may_vouch_for_name(name: str) -> bool:
    """Whether a lower-case name is one of the domains or a subdomain."""
    return name.rpartition(".")[2] in DOMAINS
