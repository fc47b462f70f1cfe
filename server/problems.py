"""Why the car cannot be reached, in the operator's words: one sentence, one hint, one mark for the picture of the
chain."""

from __future__ import annotations

import errno
import re
import socket
import ssl
from dataclasses import dataclass

from server.address import Address, BadAddress


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """What stands between the server and the bridge."""

    code: str  # stable name for tests and pages
    title: str  # one sentence
    hint: str  # what to do
    mark: str  # a word or two under the broken node of the chain

    def as_json(self) -> dict[str, str]:
        return {"code": self.code, "title": self.title, "hint": self.hint, "mark": self.mark}


def of_bad_address(error: BadAddress) -> Problem:
    return Problem(code=error.code, title=str(error), hint=error.hint, mark="not dialled")


def of_dial_error(error: BaseException, address: Address) -> Problem:
    """The problem behind an exception of dialling `address`."""
    host, port = address.host, address.port
    if isinstance(error, BadAddress):
        return of_bad_address(error)
    if isinstance(error, socket.gaierror) and error.errno == socket.EAI_AGAIN:
        return Problem(
            code="no_lookup",
            title=f"The name {host} cannot be looked up.",
            hint="No name server answers here: use the car's IP address, or join its network.",
            mark="no name server",
        )
    if isinstance(error, socket.gaierror):
        return Problem(
            code="no_such_host",
            title=f"There is no host named {host}.",
            hint="Check the spelling, or use the car's IP address. Is this server on the car's network?",
            mark="no such host",
        )
    if isinstance(error, ssl.SSLCertVerificationError):
        return Problem(
            code="tls_untrusted",
            title=f"The certificate of {host} is not trusted here.",
            hint=f"{_sentence(error.verify_message)} Install the bridge's certificate here, or try ws://{address.shown}.",
            mark="not trusted",
        )
    if isinstance(error, ConnectionRefusedError):
        return Problem(
            code="refused",
            title=f"{host} is there, but nothing listens on port {port}.",
            hint="Start rosbridge on the car, or check the port.",
            mark="refused",
        )
    if isinstance(error, ssl.SSLError) or (address.secure and isinstance(error, ConnectionError)):
        return Problem(
            code="tls",
            title=f"{address.shown} does not speak TLS.",
            hint=f"Try ws://{address.shown} instead of wss://.",
            mark="no TLS",
        )
    if isinstance(error, TimeoutError):
        return Problem(
            code="timeout",
            title=f"{host} does not answer.",
            hint="Is the car switched on, and this server on its network?",
            mark="no answer",
        )
    if isinstance(error, OSError) and error.errno in (errno.EACCES, errno.EPERM):
        return Problem(
            code="forbidden_here",
            title=f"This server is not allowed to dial {address.shown}.",
            hint="A firewall on this machine forbids it.",
            mark="forbidden",
        )
    if isinstance(error, OSError) and error.errno in (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTDOWN):
        return Problem(
            code="unreachable",
            title=f"No way leads from this server to {host}.",
            hint="Join the car's network and try again.",
            mark="no route",
        )
    return Problem(
        code="failed",
        title=f"{address.shown} cannot be reached.",
        hint=f"The system says: {_sentence(str(error)[:120] or type(error).__name__)}",
        mark="failed",
    )


def not_rosbridge(address: Address, what: str) -> Problem:
    """Something answers there, but not as a rosbridge does; `what` says how it answered."""
    return Problem(
        code="not_rosbridge",
        title=f"Something answers on {address.shown}, but it is not a rosbridge.",
        hint=f"{what} Check the port: rosbridge usually listens on 9090.",
        mark="not rosbridge",
    )


def of_handshake(address: Address, reason: str, answer: bytes) -> Problem:
    """The problem of something that took the connection and is no WebSocket: why its handshake failed, and how its
    answer began."""
    if answer.startswith(b"\x15\x03") or (not address.secure and b"HTTPS" in answer):  # a TLS alert; nginx in words
        return Problem(
            code="wants_tls",
            title=f"{address.shown} wants a secure connection.",
            hint=f"Try wss://{address.shown}.",
            mark="wants TLS",
        )
    status = re.search(r"upgrade failed \[(\d+)\]", reason)
    if status is not None and status[1] in ("401", "403", "407"):
        return not_rosbridge(address, f"It asks for a login (HTTP {status[1]}).")
    if status is not None and status[1] == "503":
        return Problem(
            code="busy",
            title=f"{address.shown} takes no more connections.",
            hint="Too many look at this car, or its bridge is still starting. It is tried again by itself.",
            mark="busy",
        )
    if status is not None:
        return not_rosbridge(address, f"It answers as a web server does (HTTP {status[1]}).")
    if answer:
        return not_rosbridge(address, "It answers, but not as a WebSocket does.")
    if "timeout" in reason:
        return not_rosbridge(address, "It accepts the connection and then says nothing.")
    return not_rosbridge(address, "It closes the connection at once; a secure one wants wss://.")


def closed_by_bridge(address: Address, why: str) -> Problem:
    """`why`: what the bridge gave as its reason, or what it did wrong; empty where it just went."""
    detail = f" ({why[:100]})" if why else ""
    return Problem(
        code="closed",
        title="The bridge closed the connection.",
        hint=f"rosbridge on {address.shown} stopped, or the network dropped{detail}. It is tried again by itself.",
        mark="closed",
    )


def bridge_silent(address: Address) -> Problem:
    return Problem(
        code="bridge_silent",
        title="The bridge does not answer.",
        hint=f"Nothing comes from {address.shown}: the car is out of radio range, switched off, or rosbridge hangs.",
        mark="silent",
    )


def _sentence(text: str) -> str:
    return text.strip().rstrip(".") + "."


CAR_SILENT = Problem(
    code="car_silent",
    title="The car fell silent.",
    hint="Server and bridge answer; no message comes from the car.",
    mark="silent",
)
ROS_GONE = Problem(
    code="ros_gone",
    title="The bridge answers, but ROS behind it does not.",
    hint="Seen after a restart of roscore: restart rosbridge too.",
    mark="silent",
)
NO_MESSAGE = Problem(
    code="no_message",
    title="The bridge answers, the car publishes nothing.",
    hint="Seen after a restart of roscore: restart rosbridge too.",
    mark="silent",
)
NOTHING_KNOWN = Problem(
    code="no_topics",
    title="The bridge answers, but it offers no topic that catgraph knows.",
    hint="Is the car's own software running? Its topics can be picked in Settings.",
    mark="no topics",
)
