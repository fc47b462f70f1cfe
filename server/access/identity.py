"""The identity of a request: one device or program, and its role, determined once, in the middleware; and the role that
each request needs, in one table.

A request that is not in the table needs the role of its method: reading a viewer, everything else an operator, new
routes included. Public routes are listed with their method, and a test checks all routes of the app.
"""

from __future__ import annotations

import re
from collections.abc import MutableMapping
from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import Any, Protocol

SCOPE_KEY = "catgraph.who"  # in the ASGI scope of an admitted request


class Connection(Protocol):
    """The part of a request or socket that is used here, because this package is below the web."""

    scope: MutableMapping[str, Any]


class Role(StrEnum):
    """The rights of a device: a viewer reads, an operator can also make changes."""

    VIEWER = "viewer"
    OPERATOR = "operator"


@dataclass(frozen=True, slots=True, kw_only=True)
class Principal:
    """An admitted device or program."""

    id: str  # stable over restarts, never shown as a secret: safe in logs
    name: str  # as the list of devices has it
    role: Role
    is_program: bool = False  # admitted by a key instead of a paired browser

    @property
    def is_operator(self) -> bool:
        return self.role is Role.OPERATOR


# Everybody, if the server listens on the loopback interface only.
LOCAL = Principal(id="local", name="this machine", role=Role.OPERATOR)


def principal_of(connection: Connection) -> Principal:
    """The principal of a request or socket. Raises KeyError if it was not authenticated: a programming error, which
    must not count as a permission."""
    found: Principal = connection.scope[SCOPE_KEY]
    return found


def is_known(connection: Connection) -> bool:
    """Whether the request was authenticated: always, except on the few public routes."""
    return SCOPE_KEY in connection.scope


class Needs(Enum):
    """Who may send a request: anybody, any admitted device or program, or only an operator."""

    NOBODY = "nobody"
    VIEWER = "viewer"
    OPERATOR = "operator"


_READS = "GET HEAD"
_ANY_METHOD = "*"
_SHELL = "manifest.webmanifest worker.js offline favicon.ico apple-touch-icon.png".split()

RULES: tuple[tuple[str, str, Needs], ...] = (  # methods, pattern of the whole path, who; the first that fits holds
    (_READS, r"/", Needs.NOBODY),  # the page's shell, which contains no data of the car
    (_READS, r"/fleet", Needs.NOBODY),  # as "/"
    (_READS, r"/static/.+", Needs.NOBODY),
    (_READS, "/(" + "|".join(map(re.escape, _SHELL)) + ")", Needs.NOBODY),
    (_READS, r"/api/health", Needs.NOBODY),  # status and version, for who is not known
    ("POST", r"/api/pair", Needs.NOBODY),
    ("POST", r"/api/ticket", Needs.VIEWER),  # the socket has further checks
    (_ANY_METHOD, r"/api/devices(/.*)?", Needs.OPERATOR),  # who else is paired
    (_ANY_METHOD, r"/api/(people|duty)(/.*)?", Needs.OPERATOR),  # names of people
    (_ANY_METHOD, r"/api/mail(/.*)?", Needs.OPERATOR),  # addresses of people, the login of the mail server
)
_AT_AGENT = re.compile(r"/agents/[^/]+(?=/api/)")  # before the path at a car's agent, at a web node
_COMPILED = tuple((methods.split(), re.compile(pattern), needs) for methods, pattern, needs in RULES)


def needs_of(method: str, path: str) -> Needs:
    """Who may send such a request; `path` as the router reads it, decoded."""
    path = _AT_AGENT.sub("", path, count=1) if path.startswith("/agents/") else path
    for methods, pattern, needs in _COMPILED:
        if (method in methods or methods == [_ANY_METHOD]) and pattern.fullmatch(path):
            return needs
    return Needs.VIEWER if method in _READS.split() else Needs.OPERATOR


def is_enough(role: Role, needs: Needs) -> bool:
    """Whether who has this role may."""
    return role is Role.OPERATOR or needs is not Needs.OPERATOR
