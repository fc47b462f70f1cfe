"""What an operator types as the vehicle's address, and what may be dialled."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Collection
from dataclasses import dataclass, replace
from urllib.parse import SplitResult, quote, urlsplit

from server.system.loopback import is_ip

DEFAULT_PORT = 9090  # rosbridge's own, of an address without a scheme
SCHEME_PORTS = {"ws": 80, "wss": 443}  # of a URL without a port (RFC 6455, 3)
FOXGLOVE_PORT = 8765  # of a Foxglove server
FOXGLOVE_SCHEMES = {"foxglove": "ws", "foxglove+tls": "wss"}  # what is dialled for each
MASTER_PORT = 11311  # a ROS master, which uses XML-RPC and not rosbridge
LONGEST = 300  # letters; a host name has at most 253

_LABEL = r"[A-Za-z0-9_]([A-Za-z0-9_-]{0,61}[A-Za-z0-9_])?"
_HOST = re.compile(rf"(?=.{{1,253}}\Z){_LABEL}(\.{_LABEL})*\.?\Z")
# Metadata services of clouds, which return keys; those of the large clouds are link-local too.
_METADATA = frozenset(
    map(ipaddress.ip_address, ("169.254.169.254", "100.100.100.200", "192.0.0.192", "fd00:ec2::254", "fd20:ce::254"))
)
_THIS_NETWORK = ipaddress.ip_network("0.0.0.0/8")
_EVERYONE = ipaddress.ip_address("255.255.255.255")
_NAT64 = (ipaddress.ip_network("64:ff9b::/96"), ipaddress.ip_network("64:ff9b:1::/48"))  # RFC 6052, RFC 8215
# IPv4 in the last four bytes: as of old (RFC 4291 2.5.5.1), translated (RFC 2765 2.1), tunnelled (RFC 5214).
_COMPATIBLE = (ipaddress.ip_network("::/96"), ipaddress.ip_network("::ffff:0:0:0/96"))
_ISATAP = (0x00005EFE, 0x02005EFE)

_NETLOC = re.compile(r"(\[[^\[\]]*\]|[^\[\]:]*)(:[^:]*)?\Z")
_RUN_ON = re.compile(r"^\[[^\]/?#]*\][^:/?#]")  # a bracket and then no colon
_FEW_SLASHES = re.compile(r"(?i)(wss?|foxglove(?:\+tls)?):/?(?=[^/\d]|\d+\.)")
_LOGIN = re.compile(r"(^\s*|//)[^/?#]*@")
_QUERY = "/%:@!$&'()*+,;=~?"
_EXAMPLE = "Type a host and a port, such as 192.168.4.1:9090."
_IpAddress = ipaddress.IPv4Address | ipaddress.IPv6Address


class BadAddress(ValueError):
    """The address cannot be dialled; `str()` is one sentence for the operator, `hint` what to do instead."""

    def __init__(self, sentence: str, hint: str = "", *, code: str = "address", suggestion: str | None = None) -> None:
        super().__init__(sentence)
        self.hint = hint
        self.code = code
        self.suggestion = suggestion


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Where a rosbridge, or a Foxglove server, listens."""

    host: str  # name or IP address, IPv6 without brackets
    port: int
    secure: bool = False
    path: str = ""  # with its query, as transmitted
    is_foxglove: bool = False

    @property
    def shown(self) -> str:
        """`host:port`, as the operator typed it."""
        return f"{_bracketed(self.host)}:{self.port}"

    @property
    def url(self) -> str:
        """What is typed for this address, in full."""
        return f"{self.scheme(secure=self.secure)}://{self.shown}{self.path}"

    @property
    def websocket_url(self) -> str:
        return f"{'wss' if self.secure else 'ws'}://{self.shown}{self.path}"

    @property
    def server(self) -> str:
        """What is expected there, as the subject of a sentence."""
        return "Foxglove's server" if self.is_foxglove else "rosbridge"

    @property
    def usual_port(self) -> int:
        return FOXGLOVE_PORT if self.is_foxglove else DEFAULT_PORT

    @property
    def kind(self) -> str:
        return "Foxglove server" if self.is_foxglove else "rosbridge"

    def scheme(self, *, secure: bool) -> str:
        plain = "wss" if secure else "ws"
        foxglove = next(name for name, dialled in FOXGLOVE_SCHEMES.items() if dialled == plain)
        return foxglove if self.is_foxglove else plain


def parse(text: str) -> Address:
    """The address in `text`: `ws://…`, `wss://…`, `host` or `host:port`; `foxglove://…` or `foxglove+tls://…`.

    Without a port a URL has that of its scheme, 80, 443 or 8765, and a host alone 9090.
    Raises BadAddress with a sentence of its own for each habit that leads nowhere.
    """
    typed = text.strip()
    if not typed:
        raise BadAddress("No address is given.", "Type the address of the car's rosbridge, such as 192.168.4.1:9090.")
    if len(typed) > LONGEST or any(not letter.isprintable() or letter.isspace() for letter in typed):
        raise BadAddress("This is not an address.", _EXAMPLE)
    scheme, separator, rest = typed.partition("://")
    if not separator:
        if _is_bare_ipv6(typed):
            return Address(host=_host_of(typed.lower()), port=DEFAULT_PORT)
        if slip := _FEW_SLASHES.match(typed):
            better = f"{slip[1].lower()}://{typed[slip.end() :]}"
            raise BadAddress(
                f"After {slip[1].lower()}: write two slashes.",
                f"Most likely {better}.",
                code="scheme",
                suggestion=better,
            )
        return _split(f"ws://{typed}", DEFAULT_PORT)
    if scheme.lower() in ("http", "https", "rosrpc"):
        raise _wrong_scheme(scheme.lower(), rest)
    if scheme.lower() in FOXGLOVE_SCHEMES:
        return replace(_split(f"{FOXGLOVE_SCHEMES[scheme.lower()]}://{rest}", FOXGLOVE_PORT), is_foxglove=True)
    if scheme.lower() not in SCHEME_PORTS:
        raise BadAddress(
            f"“{scheme[:20]}” is not a supported scheme.",
            "Use ws:// or wss://, or only host and port; foxglove:// for a Foxglove server.",
            code="scheme",
        )
    return _split(typed, SCHEME_PORTS[scheme.lower()])


def _split(typed: str, usual_port: int) -> Address:
    parts = _url_parts(typed)
    if parts.username is not None or parts.password is not None:
        raise BadAddress("An address with a user name is not supported.", "Remove the part before the @.")
    port = _port(parts)
    written = _written_host(parts)
    if not written.isascii() or (written.startswith("[") and not _is_bare_ipv6(parts.hostname or "")):
        raise _no_host(written)  # `hostname` is in small letters, and some letters have a small one in ASCII
    host = _host_of(parts.hostname or "")
    if port == 0:
        raise BadAddress("Port 0 cannot be dialled.", "rosbridge usually listens on 9090.")
    if port == MASTER_PORT:
        raise _master(host, f"Port {MASTER_PORT} is the ROS master; catgraph connects to rosbridge.")
    path = quote(parts.path, safe="/%:@!$&'()*+,;=~") if parts.path not in ("", "/") else ""
    if parts.query:
        path = f"{path or '/'}?{quote(parts.query, safe=_QUERY)}"
    return Address(host=host, port=port or usual_port, secure=parts.scheme.lower() == "wss", path=path)


def _url_parts(typed: str) -> SplitResult:
    rest = typed.partition("://")[2]
    if _RUN_ON.match(rest):  # checked here, because urlsplit accepts it in Python 3.11 and refuses it later
        raise _run_together()
    try:
        return urlsplit(typed)
    except ValueError:  # brackets that hold no IPv6 address, letters that turn into / or @ when made plain
        raise _no_host(rest) from None


def _written_host(parts: SplitResult) -> str:
    """With its brackets and capital letters."""
    found = _NETLOC.match(parts.netloc)
    return "" if found is None else found[1]


def _port(parts: SplitResult) -> int | None:
    if not _NETLOC.match(parts.netloc):
        raise _run_together()
    try:
        return parts.port
    except ValueError:
        raise BadAddress("The port is not a number from 1 to 65535.", "rosbridge usually listens on 9090.") from None


def _host_of(host: str) -> str:
    """The host as it is dialled. Raises BadAddress."""
    if not host:
        raise BadAddress("The address names no host.", _EXAMPLE)
    if "%" in host and is_ip(host):  # an interface's name: only link-local addresses have use for one
        raise BadAddress(
            f"{host[:60]} is never dialled.", "Use the car's address on its own network.", code="forbidden"
        )
    if not is_ip(host) and not _HOST.match(host):
        raise _no_host(host)
    return host


def _run_together() -> BadAddress:
    return BadAddress(
        "Host and port cannot be separated.", "Type host:port; an IPv6 address in brackets, [fd00::1]:9090."
    )


def _no_host(text: str) -> BadAddress:
    return BadAddress(f"“{text[:60]}” is not a host name.", "Type a name or an IP address, such as 192.168.4.1.")


def _master(host: str, sentence: str) -> BadAddress:
    better = f"ws://{_bracketed(host)}:{DEFAULT_PORT}"
    return BadAddress(sentence, f"Most likely {better}.", code="ros_master", suggestion=better)


def _wrong_scheme(scheme: str, rest: str) -> BadAddress:
    try:
        parts = _url_parts(f"ws://{rest}")
        host, port = _host_of(parts.hostname or ""), _port(parts)
    except BadAddress:
        host, port = "", None
    if port == MASTER_PORT and host:
        return _master(host, "This is a ROS master address; catgraph connects to rosbridge.")
    better = f"{'wss' if scheme == 'https' else 'ws'}://{_bracketed(host or 'host')}:{port or DEFAULT_PORT}"
    return BadAddress(
        f"{scheme}:// is for web pages; a rosbridge is reached with ws://."
        if scheme != "rosrpc"
        else "rosrpc:// is how ROS nodes call each other; a rosbridge is reached with ws://.",
        f"Most likely {better}.",
        code="scheme",
        suggestion=better if host else None,
    )


def url_of(typed: str | None) -> str | None:
    """The URL of what was typed; None: it is none."""
    try:
        return parse(typed).url if typed else None
    except BadAddress:
        return None


def demand_allowed(target: Address, hosts: Collection[str]) -> None:
    """Raises BadAddress where only `hosts` may be dialled; empty: any may."""
    if hosts and target.host not in hosts and target.shown not in hosts:
        raise BadAddress(
            f"{target.shown} is not among the vehicles that this server may connect to.",
            "Ask the person who started the server.",
            code="not_allowed",
        )


def without_login(typed: str) -> str:
    """What was typed, without the name and password that some addresses begin with: it is written down for good."""
    return _LOGIN.sub(r"\1…@", typed)


def refuse_forbidden(ip: str) -> None:
    """Raises BadAddress for an IP address that is never dialled: link-local, metadata services, multicast, broadcast,
    unspecified; and for an IPv6 address that a router or the system turns into one of these."""
    address = ipaddress.ip_address(ip.partition("%")[0])
    for one in (address, *_within(address)):
        if (
            one.is_link_local
            or one in _METADATA
            or one.is_multicast
            or one.is_unspecified
            or one == _EVERYONE
            or (one.version == 4 and one in _THIS_NETWORK)
        ):
            raise BadAddress(f"{ip} is never dialled.", "Use the car's address on its own network.", code="forbidden")


def _within(address: _IpAddress) -> list[ipaddress.IPv4Address]:
    """The IPv4 addresses that an IPv6 address carries."""
    if not isinstance(address, ipaddress.IPv6Address) or address.is_loopback:
        return []
    found = [address.ipv4_mapped, address.sixtofour, *(address.teredo or ())]
    bits = int(address)
    is_carrier = any(address in network for network in (*_COMPATIBLE, *_NAT64))
    if is_carrier or (bits >> 32 & 0xFFFFFFFF) in _ISATAP:
        found.append(ipaddress.IPv4Address(bits & 0xFFFFFFFF))
    return [one for one in found if one is not None]


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _is_bare_ipv6(text: str) -> bool:
    return is_ip(text) and ":" in text
