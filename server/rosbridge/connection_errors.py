"""Why the car cannot be reached, for the operator: one sentence, one hint, one mark for the picture of the
chain."""

from __future__ import annotations

import errno
import re
import socket
import ssl
from collections.abc import Sequence
from dataclasses import dataclass

from server.protocol.state import ConnectionProblem
from server.rosbridge.address import FOXGLOVE_PORT, SCHEME_PORTS, Address, BadAddress

LOGIN_WANTED = "login_wanted"
BRIDGE_SILENT = "bridge_silent"
NOT_EXPECTED = "not_rosbridge"
ROSBRIDGE_SERVERS = ("AutobahnPython", "TornadoServer")  # what rosbridge of ROS 1 and ROS 2 is built on
MAX_NAMES = 3  # of topics in a sentence


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A connection problem between server and bridge."""

    code: str  # stable name for tests and pages
    title: str  # one sentence
    hint: str  # what to do
    mark: str  # a short text under the broken node of the chain

    def as_json(self) -> ConnectionProblem:
        return {"code": self.code, "title": self.title, "hint": self.hint, "mark": self.mark}


def of_bad_address(error: BadAddress) -> Problem:
    return Problem(code=error.code, title=str(error), hint=error.hint, mark="not tried")


def of_dial_error(error: BaseException, address: Address) -> Problem:
    """The problem behind an exception of dialling `address`."""
    host, port = address.host, address.port
    if isinstance(error, BadAddress):
        return of_bad_address(error)
    if isinstance(error, socket.gaierror):
        return _of_name_error(error, host)
    if isinstance(error, ssl.SSLCertVerificationError):
        return _of_tls_error(error, address)
    if isinstance(error, ConnectionRefusedError):
        return Problem(
            code="refused",
            title=f"{host} is there, but nothing listens on port {port}.",
            hint=f"Start {address.server} on the car, or check the port."
            + (f" {address.server} usually listens on {address.usual_port}." if port in SCHEME_PORTS.values() else ""),
            mark="refused",
        )
    if isinstance(error, ssl.SSLError) or (address.secure and isinstance(error, ConnectionError)):
        return _of_tls_error(error, address)
    if isinstance(error, TimeoutError):
        return Problem(
            code="timeout",
            title=f"{host} does not answer.",
            hint="Is the car switched on, and this server on its network?",
            mark="no answer",
        )
    return _of_system_error(error, address)


def _of_name_error(error: socket.gaierror, host: str) -> Problem:
    if error.errno == socket.EAI_AGAIN:
        return Problem(
            code="no_lookup",
            title=f"The name {host} cannot be looked up.",
            hint="No name server answers here: use the car's IP address, or join its network.",
            mark="no name server",
        )
    return Problem(
        code="no_such_host",
        title=f"There is no host named {host}.",
        hint="Check the spelling, or use the car's IP address. Is this server on the car's network?",
        mark="no such host",
    )


def _of_tls_error(error: BaseException, address: Address) -> Problem:
    if isinstance(error, ssl.SSLCertVerificationError):
        return Problem(
            code="tls_untrusted",
            title=f"The certificate of {address.host} is not trusted here.",
            hint=f"{_sentence(error.verify_message)} Install the bridge's certificate here, or try "
            f"{address.scheme(secure=False)}://{address.shown}.",
            mark="not trusted",
        )
    return Problem(
        code="tls",
        title=f"{address.shown} does not speak TLS.",
        hint=f"Try {address.scheme(secure=False)}://{address.shown} instead of {address.scheme(secure=True)}://.",
        mark="no TLS",
    )


def _of_system_error(error: BaseException, address: Address) -> Problem:
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
            title=f"There is no route from this server to {address.host}.",
            hint="Join the car's network and try again.",
            mark="no route",
        )
    return Problem(
        code="failed",
        title=f"{address.shown} cannot be reached.",
        hint=f"System error: {_sentence(str(error)[:120] or type(error).__name__)}",
        mark="failed",
    )


def not_rosbridge(address: Address, what: str) -> Problem:
    """Another service answers at the address than is expected; `what` describes its answer."""
    port = "rosbridge usually listens on 9090."
    if address.is_foxglove or address.port == FOXGLOVE_PORT:
        port = f"a Foxglove server usually listens on {FOXGLOVE_PORT}, and is dialled with foxglove://."
    return Problem(
        code=NOT_EXPECTED,
        title=f"Something answers on {address.shown}, but it is not a {address.kind}.",
        hint=f"{what} Check the port: {port}",
        mark=f"not {address.kind.split()[0]}",
    )


def not_proved(address: Address, server_software: str, junk: int) -> Problem:
    """A WebSocket from which nothing came that only a rosbridge sends; `junk`: how much else came."""
    if server_software.startswith(ROSBRIDGE_SERVERS) and not junk:
        return BRIDGE_DEAF
    name = "Foxglove" if address.is_foxglove else "rosbridge"
    return not_rosbridge(address, f"It speaks WebSocket, but not {name}'s protocol.")


def of_handshake(address: Address, reason: str, answer: bytes) -> Problem:
    """The problem of something that took the connection and is no WebSocket: why its handshake failed, and how its
    answer began."""
    if answer.startswith(b"\x15\x03") or (not address.secure and b"HTTPS" in answer):  # a TLS alert; nginx's text
        return Problem(
            code="wants_tls",
            title=f"{address.shown} wants a secure connection.",
            hint=f"Try {address.scheme(secure=True)}://{address.shown}.",
            mark="wants TLS",
        )
    status = re.search(r"upgrade failed \[(\d+)\]", reason)
    if status is not None and status[1] in ("401", "403", "407"):
        return not_rosbridge(address, f"It requires a login (HTTP {status[1]}).")
    if status is not None and status[1] == "503":
        return Problem(
            code="busy",
            title=f"{address.shown} takes no more connections.",
            hint="Too many clients use this bridge, or it is still starting. The server tries again automatically.",
            mark="busy",
        )
    if status is not None:
        return not_rosbridge(address, f"It answers as a web server does (HTTP {status[1]}).")
    if answer:
        return not_rosbridge(address, "It answers, but not as a WebSocket does.")
    if "timeout" in reason:
        return not_rosbridge(address, "It accepts the connection and then sends nothing.")
    return not_rosbridge(
        address, f"It closes the connection at once; a secure one wants {address.scheme(secure=True)}://."
    )


def closed_by_bridge(address: Address, why: str) -> Problem:
    """`why`: what the bridge gave as its reason, or what it did wrong; empty where it just went."""
    detail = f" ({why[:100]})" if why else ""
    return Problem(
        code="closed",
        title="The bridge closed the connection.",
        hint=f"{address.server} on {address.shown} stopped, or the network dropped{detail}. "
        "The server tries again automatically.",
        mark="closed",
    )


def login_wanted(address: Address) -> Problem:
    """rosbridge of ROS 1 with authenticate:=true closes after the first operation, without a code or reason."""
    return Problem(
        code=LOGIN_WANTED,
        title=f"The bridge on {address.shown} wants a login.",
        hint="It closes the connection after the first request, as rosbridge with authenticate:=true does. "
        "catgraph has no login for it: start rosbridge without authenticate.",
        mark="wants login",
    )


def hidden_topics(topics: Sequence[str]) -> Problem:
    """Topics that have a publisher, and to which the bridge did not subscribe for us."""
    return Problem(
        code="topics_hidden",
        title=f"The bridge does not pass on {_names(topics)}.",
        hint="They have a publisher, but the bridge did not subscribe to them: its topics_glob hides them, or their "
        "message types are not installed where it runs. Start rosbridge with a topics_glob that includes them, or "
        "without one, and with their packages.",
        mark="hidden topics",
    )


def _others(clients: int) -> str:
    return f"{clients} other client{'s are' if clients != 1 else ' is'} connected to this bridge"


def single_messages(topics: Sequence[str], clients: int) -> Problem:
    """Topics that have a publisher, of which the bridge gives one message to each subscription."""
    return Problem(
        code="topics_once",
        title=f"The bridge delivers one message per subscription from {_names(topics)}.",
        hint=f"{_others(clients)}: while one stays subscribed, a ROS 2 bridge cannot receive a publisher that came "
        "back with another quality of service. Disconnect all other clients, other catgraph servers too, or restart "
        "rosbridge; the subscription is renewed by itself.",
        mark="blocked topics",
    )


def blocked_topics(topics: Sequence[str], clients: int) -> Problem:
    """Topics that have a publisher, to which the bridge subscribed for us, and of which nothing comes."""
    others = _others(clients)
    return Problem(
        code="topics_blocked",
        title=f"No message arrives through the bridge from {_names(topics)}.",
        hint=f"They have a publisher, and {others}: one that subscribed to them in raw form can block them. "
        "End that client; the subscription is renewed by itself. Or the publisher is idle.",
        mark="blocked topics",
    )


def _names(topics: Sequence[str]) -> str:
    more = len(topics) - MAX_NAMES
    return ", ".join(topics[:MAX_NAMES]) + (f" and {more} more" if more > 0 else "")


def rosapi_failing(text: str) -> Problem:
    """Every question to rosapi is answered with an error that is not known here."""
    return Problem(
        code="rosapi_failing",
        title="The bridge answers every question to rosapi with an error.",
        hint=f"It reports: {_sentence(text)} Check that rosapi is installed where rosbridge runs, and restart both. "
        "Until then topics and types are not known, and only the usual names are tried.",
        mark="rosapi fails",
    )


def bridge_silent(address: Address) -> Problem:
    return Problem(
        code=BRIDGE_SILENT,
        title="The bridge does not answer.",
        hint=f"Nothing comes from {address.shown}: the car is out of radio range, switched off, "
        f"or {address.server} hangs.",
        mark="silent",
    )


def _sentence(text: str) -> str:
    return text.strip().rstrip(".") + "."


CAR_SILENT = Problem(
    code="car_silent",
    title="The car fell silent.",
    hint="Server and bridge answer; no signal comes from the car.",
    mark="silent",
)
SIGNALS_SILENT = Problem(
    code="signals_silent",
    title="No signal of the car comes; its other topics do.",
    hint="Server and bridge answer. Check the nodes that publish the signals.",
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
ROSAPI_MISSING = Problem(
    code="no_rosapi",
    title="This is a rosbridge, but rosapi is not running.",
    hint="Start the node rosapi_node of the package rosapi on the car: without it topics and types are not known, "
    "and only the usual names are tried.",
    mark="no rosapi",
)
ROSAPI_ENDED = Problem(
    code="rosapi_ended",
    title="rosapi has ended.",
    hint="Start rosapi again on the car. If roscore was restarted, restart rosbridge too. "
    "Messages may still come; new topics are not found.",
    mark="rosapi ended",
)
ROSAPI_SILENT = Problem(
    code="rosapi_silent",
    title="The bridge answers, rosapi does not.",
    hint="rosapi hangs or was killed, or the bridge's services_glob hides it: restart rosapi. "
    "Messages may still come; new topics are not found.",
    mark="rosapi silent",
)
ROSCORE_GONE = Problem(
    code="roscore_gone",
    title="roscore is no longer running.",
    hint="Existing connections still work, but nothing new can connect. "
    "Start roscore, then restart rosbridge, rosapi and the car's nodes.",
    mark="no roscore",
)
ROSCORE_RESTARTED = Problem(
    code="roscore_restarted",
    title="roscore was restarted, and rosbridge is not connected to the new one.",
    hint="Restart rosbridge: until then new messages may not come, and commands may not reach the car. "
    "Nodes that are older than roscore have to be restarted too.",
    mark="restart rosbridge",
)
BRIDGE_NODE_DEAD = Problem(
    code="bridge_node_dead",
    title="The bridge's ROS node has died; its process still accepts connections.",
    hint="It no longer passes messages. End the rosbridge process (kill -9) and start it again.",
    mark="node died",
)
BRIDGE_DEAF = Problem(
    code="bridge_deaf",
    title="The connection is open, but nothing is answered.",
    hint="If this is rosbridge, its ROS node hangs or has died: restart rosbridge. "
    "Otherwise check the port: rosbridge usually listens on 9090.",
    mark="no answer",
)
