"""The identity of a request: one device or program, and its role. Determined once, in the middleware."""

from __future__ import annotations

from collections.abc import MutableMapping
from dataclasses import dataclass
from enum import StrEnum
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
