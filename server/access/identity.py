"""Who asks: one device or program, and its role. Found once at the edge; everything inside is handed a Who."""

from __future__ import annotations

from collections.abc import MutableMapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Protocol

SCOPE_KEY = "catgraph.who"  # in the ASGI scope of a request that was let in


class Connection(Protocol):
    """A request or a socket, as far as it matters here: this file stands beneath the web."""

    scope: MutableMapping[str, Any]


class Role(StrEnum):
    """What a paired device may do: a viewer looks, an operator also acts."""

    VIEWER = "viewer"
    OPERATOR = "operator"


@dataclass(frozen=True, slots=True, kw_only=True)
class Principal:
    """A device or program that was let in."""

    id: str  # stable over restarts, never shown as a secret: safe in logs
    name: str  # as the list of devices has it
    role: Role
    is_program: bool = False  # let in by a key instead of a paired browser

    @property
    def is_operator(self) -> bool:
        return self.role is Role.OPERATOR


# Everybody, where the server listens on the loopback interface only.
LOCAL = Principal(id="local", name="this machine", role=Role.OPERATOR)


def principal_of(connection: Connection) -> Principal:
    """Who sent this request or opened this socket. Raises KeyError where nobody looked: that is a mistake of ours, and
    it must not be taken for a permission."""
    found: Principal = connection.scope[SCOPE_KEY]
    return found


def is_known(connection: Connection) -> bool:
    """Whether it is known who asks: everywhere, but for the few things that need nobody."""
    return SCOPE_KEY in connection.scope
