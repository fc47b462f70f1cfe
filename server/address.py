"""What an operator types as the vehicle's address, and what may be dialled."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from urllib.parse import urlsplit

DEFAULT_PORT = 9090  # rosbridge's own
MASTER_PORT = 11311  # a ROS master, which speaks XML-RPC and not rosbridge

_HOST = re.compile(r"^(?=.{1,253}$)[A-Za-z0-9_]([A-Za-z0-9_-]{0,62})?(\.[A-Za-z0-9_]([A-Za-z0-9_-]{0,62})?)*\.?$")
_METADATA = (ipaddress.ip_address("169.254.169.254"), ipaddress.ip_address("fd00:ec2::254"))


class BadAddress(ValueError):
    """The address cannot be dialled; `str()` is one sentence for the operator, `hint` what to do instead."""

    def __init__(self, sentence: str, hint: str = "", *, code: str = "address", suggestion: str | None = None) -> None:
        super().__init__(sentence)
        self.hint = hint
        self.code = code
        self.suggestion = suggestion


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Where a rosbridge listens."""

    host: str  # name or IP address, IPv6 without brackets
    port: int
    secure: bool = False
    path: str = ""

    @property
    def shown(self) -> str:
        """`host:port`, as the operator knows it."""
        return f"{self._bracketed}:{self.port}"

    @property
    def url(self) -> str:
        return f"{'wss' if self.secure else 'ws'}://{self._bracketed}:{self.port}{self.path}"

    @property
    def _bracketed(self) -> str:
        return f"[{self.host}]" if ":" in self.host else self.host


def parse(text: str) -> Address:
    """The address in `text`: `ws://…`, `wss://…`, `host` or `host:port`.

    Raises BadAddress with a sentence of its own for each habit that leads nowhere.
    """
    typed = text.strip()
    if not typed:
        raise BadAddress("No address is given.", "Type the address of the car's rosbridge, such as 192.168.4.1:9090.")
    if len(typed) > 300 or any(ord(letter) < 33 or ord(letter) == 127 for letter in typed):
        raise BadAddress("This is not an address.", "Type a host and a port, such as 192.168.4.1:9090.")
    scheme, separator, _ = typed.partition("://")
    if not separator:
        if _is_bare_ipv6(typed):
            return Address(host=typed, port=DEFAULT_PORT)
        typed = f"ws://{typed}"
    elif scheme.lower() in ("http", "https", "rosrpc"):
        raise _wrong_scheme(typed, scheme.lower())
    elif scheme.lower() not in ("ws", "wss"):
        raise BadAddress(
            f"“{scheme[:20]}” is not a way to reach a car.",
            "Use ws:// or wss://, or only host and port.",
            code="scheme",
        )
    return _split(typed)


def _split(typed: str) -> Address:
    try:
        parts = urlsplit(typed)
        port = parts.port
        host = parts.hostname or ""
    except ValueError:
        raise BadAddress("The port is not a number from 1 to 65535.", "rosbridge usually listens on 9090.") from None
    if parts.username is not None or parts.password is not None:
        raise BadAddress("An address with a user name is not dialled.", "Leave out what stands before the @.")
    if not host:
        raise BadAddress("The address names no host.", "Type a host and a port, such as 192.168.4.1:9090.")
    if not _is_ip(host) and not _HOST.match(host):
        raise BadAddress(f"“{host[:60]}” is not a host name.", "Type a name or an IP address, such as 192.168.4.1.")
    if port == 0:
        raise BadAddress("Port 0 cannot be dialled.", "rosbridge usually listens on 9090.")
    if port == MASTER_PORT:
        raise BadAddress(
            f"Port {MASTER_PORT} is the ROS master; catgraph speaks to rosbridge.",
            f"Most likely ws://{host}:{DEFAULT_PORT}.",
            code="ros_master",
            suggestion=f"ws://{host}:{DEFAULT_PORT}",
        )
    secure = parts.scheme.lower() == "wss"
    path = parts.path if parts.path not in ("", "/") else ""
    if parts.query:
        path = f"{path or '/'}?{parts.query}"
    return Address(host=host, port=port or DEFAULT_PORT, secure=secure, path=path)


def _wrong_scheme(typed: str, scheme: str) -> BadAddress:
    try:
        parts = urlsplit(typed)
        host, port = parts.hostname or "", parts.port
    except ValueError:
        host, port = "", None
    if port == MASTER_PORT and host:
        return BadAddress(
            "This is a ROS master address; catgraph speaks to rosbridge.",
            f"Most likely ws://{host}:{DEFAULT_PORT}.",
            code="ros_master",
            suggestion=f"ws://{host}:{DEFAULT_PORT}",
        )
    better = f"{'wss' if scheme == 'https' else 'ws'}://{host or 'host'}:{port or DEFAULT_PORT}"
    return BadAddress(
        f"{scheme}:// is for web pages; a rosbridge is reached with ws://.",
        f"Most likely {better}.",
        code="scheme",
        suggestion=better if host else None,
    )


def refuse_forbidden(ip: str) -> None:
    """Raises BadAddress for an IP address that is never dialled: link-local, metadata services, multicast,
    unspecified."""
    address = ipaddress.ip_address(ip.split("%")[0])
    mapped = getattr(address, "ipv4_mapped", None)
    if mapped is not None:
        address = mapped
    if address.is_link_local or address in _METADATA or address.is_multicast or address.is_unspecified:
        raise BadAddress(f"{ip} is never dialled.", "Use the car's address on its own network.", code="forbidden")


def _is_ip(host: str) -> bool:
    try:
        ipaddress.ip_address(host.split("%")[0])
    except ValueError:
        return False
    return True


def _is_bare_ipv6(text: str) -> bool:
    try:
        return ipaddress.ip_address(text).version == 6
    except ValueError:
        return False
