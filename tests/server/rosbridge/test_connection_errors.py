"""Each way of failing to reach the car has its own sentence and its own advice."""

from __future__ import annotations

import errno
import os
import socket
import ssl

import pytest

from server.rosbridge import connection_errors
from server.rosbridge.address import BadAddress, parse
from server.rosbridge.connection_errors import Problem, of_dial_error, of_handshake

CAR = parse("ws://car:9090")
SECURE = parse("wss://car:9090")


def system_error(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def untrusted() -> ssl.SSLCertVerificationError:
    error = ssl.SSLCertVerificationError(1, "certificate verify failed")
    error.verify_message = "self-signed certificate"
    return error


DIAL = {
    "bad address": (BadAddress("Never.", "Not at all.", code="forbidden"), "forbidden", "Never."),
    "no such host": (
        socket.gaierror(socket.EAI_NONAME, "Name or service not known"),
        "no_such_host",
        "no host named car",
    ),
    "no address of the family": (socket.gaierror(socket.EAI_FAMILY, "x"), "no_such_host", "no host named car"),
    "no name server": (socket.gaierror(socket.EAI_AGAIN, "Temporary failure"), "no_lookup", "cannot be looked up"),
    "refused": (system_error(errno.ECONNREFUSED), "refused", "nothing listens on port 9090"),
    "dial takes too long": (TimeoutError(), "timeout", "does not answer"),
    "system's own time-out": (system_error(errno.ETIMEDOUT), "timeout", "does not answer"),
    "no route": (system_error(errno.EHOSTUNREACH), "unreachable", "There is no route"),
    "no network": (system_error(errno.ENETUNREACH), "unreachable", "There is no route"),
    "host down": (system_error(errno.EHOSTDOWN), "unreachable", "There is no route"),
    "firewall here": (system_error(errno.EPERM), "forbidden_here", "not allowed to dial"),
    "something else": (system_error(errno.EMFILE), "failed", "cannot be reached"),
    "something without text": (OSError(), "failed", "cannot be reached"),
    "a fault of ours": (RuntimeError("x" * 1000), "failed", "cannot be reached"),
}
DIAL_SECURE = {
    "certificate": (untrusted(), "tls_untrusted", "not trusted"),
    "no TLS": (ssl.SSLError(1, "[SSL: WRONG_VERSION_NUMBER] wrong version number"), "tls", "does not speak TLS"),
    "hung up on": (system_error(errno.ECONNRESET), "tls", "does not speak TLS"),
    "ended": (ConnectionAbortedError("SSL handshake is taking longer"), "tls", "does not speak TLS"),
    "refused is refused": (system_error(errno.ECONNREFUSED), "refused", "nothing listens"),
    "silence is silence": (TimeoutError(), "timeout", "does not answer"),
}
HANDSHAKE = {
    "web server": (
        "WebSocket connection upgrade failed [404]: Not Found",
        b"HTTP/1.1 404",
        "not_rosbridge",
        "HTTP 404",
    ),
    "login": ("WebSocket connection upgrade failed [401]: ", b"HTTP/1.1 401", "not_rosbridge", "login"),
    "full": ("WebSocket connection upgrade failed [503]: ", b"HTTP/1.1 503", "busy", "automatically"),
    "TLS alert": ("peer dropped", b"\x15\x03\x01\x00\x02\x02\x46", "wants_tls", "wss://car:9090"),
    "TLS, nginx": (
        "WebSocket connection upgrade failed [400]: Bad Request",
        b"HTTP/1.1 400 Bad Request\r\n\r\n<h1>The plain HTTP request was sent to HTTPS port</h1>",
        "wants_tls",
        "wss://car:9090",
    ),
    "another language": (
        "opening handshake timeout",
        b"SSH-2.0-OpenSSH_9.6\r\n",
        "not_rosbridge",
        "not as a WebSocket",
    ),
    "bad answer": ("HTTP Upgrade header missing", b"HTTP/1.1 101\r\n\r\n", "not_rosbridge", "not as a WebSocket"),
    "silent": ("opening handshake timeout", b"", "not_rosbridge", "sends nothing"),
    "closes": ("peer dropped the TCP connection", b"", "not_rosbridge", "closes the connection"),
}


def is_well_worded(problem: Problem) -> None:
    assert problem.title.endswith(".")
    assert problem.title.count(". ") == 0, "one sentence"
    assert problem.hint.endswith((".", "?"))
    assert ".." not in problem.hint
    assert 0 < len(problem.mark) <= 14
    assert len(problem.title) <= 90
    assert len(problem.hint) <= 200
    assert set(problem.as_json()) == {"code", "title", "hint", "mark"}


@pytest.mark.parametrize(("error", "code", "text"), DIAL.values(), ids=DIAL)
def test_dialling_failed(error: BaseException, code: str, text: str) -> None:
    problem = of_dial_error(error, CAR)
    assert problem.code == code
    assert text in problem.title
    is_well_worded(problem)


@pytest.mark.parametrize(("error", "code", "text"), DIAL_SECURE.values(), ids=DIAL_SECURE)
def test_dialling_a_secure_address_failed(error: BaseException, code: str, text: str) -> None:
    problem = of_dial_error(error, SECURE)
    assert problem.code == code
    assert text in problem.title
    is_well_worded(problem)


def test_a_reset_without_tls_is_no_matter_of_tls() -> None:
    assert of_dial_error(system_error(errno.ECONNRESET), CAR).code == "failed"


@pytest.mark.parametrize(("reason", "answer", "code", "text"), HANDSHAKE.values(), ids=HANDSHAKE)
def test_no_websocket(reason: str, answer: bytes, code: str, text: str) -> None:
    problem = of_handshake(CAR, reason, answer)
    assert problem.code == code
    assert text in problem.hint
    is_well_worded(problem)


def test_a_secure_connection_gets_no_hint_to_be_secure() -> None:
    answer = b"HTTP/1.1 404 Not Found\r\n\r\nonly HTTPS here"
    assert of_handshake(SECURE, "upgrade failed [404]: ", answer).code == "not_rosbridge"


OTHERS = {
    "closed": connection_errors.closed_by_bridge(CAR, ""),
    "closed with a reason": connection_errors.closed_by_bridge(CAR, "r" * 500),
    "bridge silent": connection_errors.bridge_silent(CAR),
    "car silent": connection_errors.CAR_SILENT,
    "ROS gone": connection_errors.ROS_GONE,
    "no message": connection_errors.NO_MESSAGE,
    "no topics": connection_errors.NOTHING_KNOWN,
}


@pytest.mark.parametrize("problem", OTHERS.values(), ids=OTHERS)
def test_the_other_problems_have_sentences(problem: Problem) -> None:
    is_well_worded(problem)


@pytest.mark.parametrize(
    ("typed", "is_named"), [("ws://car", True), ("wss://car/x", True), ("car", False), ("ws://car:8080", False)]
)
def test_a_refused_port_that_was_not_typed_names_the_usual_one(typed: str, is_named: bool) -> None:
    problem = of_dial_error(system_error(errno.ECONNREFUSED), parse(typed))
    assert problem.code == "refused"
    assert problem.hint.endswith("rosbridge usually listens on 9090.") is is_named


FOXGLOVE = parse("foxglove://car")


@pytest.mark.parametrize(
    ("problem", "text"),
    [
        (of_dial_error(system_error(errno.ECONNREFUSED), FOXGLOVE), "Start Foxglove's server on the car"),
        (of_dial_error(system_error(errno.ECONNREFUSED), parse("foxglove://car:80")), "usually listens on 8765."),
        (connection_errors.not_proved(FOXGLOVE, "", 0), "it is not a Foxglove server. It speaks WebSocket, but not"),
        (connection_errors.not_proved(parse("ws://car:8765"), "", 0), "and is dialled with foxglove://"),
        (connection_errors.closed_by_bridge(FOXGLOVE, ""), "Foxglove's server on car:8765 stopped"),
        (connection_errors.bridge_silent(FOXGLOVE), "or Foxglove's server hangs"),
        (of_handshake(FOXGLOVE, "", b"\x15\x03"), "Try foxglove+tls://car:8765."),
        (of_dial_error(ssl.SSLError(1, "x"), parse("foxglove+tls://car")), "Try foxglove://car:8765 instead of"),
        (of_dial_error(untrusted(), parse("foxglove+tls://car")), "or try foxglove://car:8765."),
    ],
)
def test_a_foxglove_server_is_named_as_one(problem: Problem, text: str) -> None:
    assert text in f"{problem.title} {problem.hint}"
